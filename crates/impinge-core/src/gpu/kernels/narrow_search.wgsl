// Stage `narrow` of a step: which pairs certainly do not touch, and which certainly do, by tests of
// intervals of time.
//
// In: pairs that `narrow_moving` has left. Out: all that may touch, by their places for the host,
// which decides them, or by global numbers for the caller's shaders. For each a time until which it
// certainly does not touch, and one by which it certainly does, if there is one. For the whole step
// the least of the latter. One thread per pair.
// Cost: 32 bytes of corners and 96 of positions read; up to N_INTERVALS intervals tested.
// Invariant: what is dropped is proven not to touch, or to touch later than another pair; and so
// are the times, whatever the device's rounding (`docs/exactness.md`).
//
//   [low, high] ── certainly free ────> go on behind it, with twice the length, to the end: dropped
//        ├──────── certain contact ──> touches by `high`; half the length, to know it better
//        └──────── unclear ──────────> half the length, down to SHORTEST: left, free until `low`
//
// Where the earliest contact is sought, the end is the least time by which any pair touches. So
// most pairs are dropped after one interval. Where any contact is sought, all threads end once
// there is one.

// The shortest interval: a 1024th of the step.
const SHORTEST: u32 = 0x4000u;
// The most intervals of a pair.
const N_INTERVALS: u32 = 32u;

@group(0) @binding(0) var<storage, read> pairs: array<PairKey>;
@group(0) @binding(1) var<storage, read> corners: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> positions: array<u32>;
@group(0) @binding(3) var<storage, read> order: array<u32>;
@group(0) @binding(4) var<storage, read_write> unsure: array<UnsureKey>;
@group(0) @binding(5) var<storage, read_write> times: array<PairTimes>;
@group(0) @binding(6) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(7) var<uniform> params: Params;
@group(0) @binding(8) var<storage, read> bodies: array<Body>;

// The ticks of a time.
fn ticks_of(bits: u32) -> u32 {
    return u32(bitcast<f32>(bits) * f32(TICKS));
}

fn over(d: MovingFour, low: u32, high: u32) -> MovingFour {
    return MovingFour(at(d, low), at(d, high));
}

// The times of a pair, in ticks.
struct Bracket {
    free_until: u32,
    touches_by: u32,
    is_left: bool,
}

fn bracket_of(candidate: Candidate) -> Bracket {
    var found = Bracket(0u, NONE, true);
    var pair: Pair;
    load_pair(candidate, &pair);
    if !pair.sizes.are_in_range {
        return found;
    }
    var length = TICKS / 2u;
    for (var n = 0u; n < N_INTERVALS; n++) {
        // The first time by which any pair touches.
        let first = ticks_of(atomicLoad(&counters[TOUCHES_BY]));
        if params.sought == SEEK_ANY && first != NONE {
            found.is_left = false;
            break;
        }
        let end = min(TICKS, select(found.touches_by, first, params.sought == SEEK_EARLIEST));
        let low = found.free_until;
        if low >= end {
            found.is_left = false;
            break;
        }
        let high = min(low + length, end);
        let part = Polygon(over(pair.polygon.corners, low, high), over(pair.polygon.edges, low, high));
        let decided = decide(part, pair.sizes, pair.are_edges);
        if decided == FREE {
            found.free_until = high;
            length = 2u * length;
            if high == end {
                found.is_left = false;
                break;
            }
            continue;
        }
        if decided == TOUCHES {
            found.touches_by = high;
            if high < first {
                atomicMin(&counters[TOUCHES_BY], bitcast<u32>(time_of(high)));
            }
            if params.sought == SEEK_ALL && params.by_number == 0u {
                break;
            }
        }
        if high - low <= SHORTEST {
            break;
        }
        length = (high - low) / 2u;
    }
    return found;
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let ix = group_number(group) * 64u + lane;
    let n = min(atomicLoad(&counters[N_PAIRS]), arrayLength(&pairs));
    var bracket = Bracket(0u, NONE, false);
    var pair = PairKey(0u, 0u);
    if ix < n {
        pair = pairs[ix];
        bracket = bracket_of(Candidate(pair.low, pair.high));
    }
    let slot = slot_in(N_UNSURE, bracket.is_left, lane);
    if bracket.is_left && slot < arrayLength(&unsure) {
        unsure[slot] = name_of(pair);
        times[slot] = PairTimes(time_of(bracket.free_until), time_of(bracket.touches_by));
    }
}
