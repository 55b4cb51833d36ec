// Stage `narrow` of a step: which pairs certainly do not touch, by tests of intervals of time.
//
// In: pairs that `narrow_moving` has left. Out: all that may touch, by their places for the host, which settles them, or by global
// numbers for the caller's shaders; and for each a time before which it certainly does not touch. One thread per pair.
// Cost: 32 bytes of corners and 96 of positions read; up to N_INTERVALS intervals tested.
// Invariant: what is dropped is proven not to touch, and so is every pair before its time, whatever the device's rounding
// (`docs/exactness.md`).
//
//   [low, low + length] ── certainly free ──> go on behind it, with twice the length, to the end: dropped
//            └──────────── unclear ─────────> half the length, down to SHORTEST: left, free before `low`

// Times are multiples of it, so a time and its difference to 1 are exact.
const SHORTEST: f32 = 0x1p-10f;
// The most intervals of a pair.
const N_INTERVALS: u32 = 32u;

@group(0) @binding(0) var<storage, read> pairs: array<PairKey>;
@group(0) @binding(1) var<storage, read> corners: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> positions: array<u32>;
@group(0) @binding(3) var<storage, read> order: array<u32>;
@group(0) @binding(4) var<storage, read_write> unsure: array<UnsureKey>;
@group(0) @binding(5) var<storage, read_write> times: array<f32>;
@group(0) @binding(6) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(7) var<uniform> params: Params;

var<workgroup> n_unsure: atomic<u32>;
var<workgroup> first_unsure: u32;

// Not `mix`, which a device may compute in other ways.
fn at(d: Moving, time: f32) -> vec3<f32> {
    return d.start * (1.0 - time) + d.end * time;
}

fn over(d: Moving, low: f32, high: f32) -> Moving {
    return Moving(at(d, low), at(d, high));
}

// The time before which a pair certainly does not touch; 2 if it never does.
fn free_until(candidate: Candidate) -> f32 {
    var pair: Pair;
    load_pair(candidate, &pair);
    if !pair.sizes.are_in_range {
        return 0.0;
    }
    var sizes = pair.sizes;
    var low = 0.0;
    var length = 0.5;
    for (var n = 0u; n < N_INTERVALS; n++) {
        let high = min(low + length, 1.0);
        var part: Polygon;
        for (var k = 0u; k < 4u; k++) {
            part.corners[k] = over(pair.polygon.corners[k], low, high);
        }
        for (var k = 0u; k < 3u; k++) {
            part.edges[k] = over(pair.polygon.edges[k], low, high);
        }
        if never_touch(&part, &sizes, pair.are_edges) {
            if high == 1.0 {
                return 2.0;
            }
            low = high;
            length = 2.0 * length;
        } else if length > SHORTEST {
            length = 0.5 * length;
        } else {
            break;
        }
    }
    return low;
}

fn name_of(pair: PairKey) -> UnsureKey {
    let a = pair.low & ~FLAG;
    let b = pair.high & ~FLAG;
    if params.by_number == 0u {
        return UnsureKey(a, b);
    }
    return UnsureKey(min(order[a], order[b]), max(order[a], order[b]));
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) n_groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let ix = group_number(group, n_groups) * 64u + lane;
    let n = min(atomicLoad(&counters[N_PAIRS]), arrayLength(&pairs));
    if lane == 0u {
        atomicStore(&n_unsure, 0u);
    }
    workgroupBarrier();
    var time = 2.0;
    var pair = PairKey(0u, 0u);
    var place = 0u;
    if ix < n {
        pair = pairs[ix];
        time = free_until(Candidate(pair.low, pair.high));
    }
    let is_left = time <= 1.0;
    if is_left {
        place = atomicAdd(&n_unsure, 1u);
    }
    workgroupBarrier();
    if lane == 0u {
        first_unsure = reserve(N_UNSURE, atomicLoad(&n_unsure));
    }
    workgroupBarrier();
    if is_left {
        place += first_unsure;
        if place < arrayLength(&unsure) {
            unsure[place] = name_of(pair);
            times[place] = time;
        }
    }
}
