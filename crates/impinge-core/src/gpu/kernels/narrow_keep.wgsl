// Stage `narrow` of a step whose elements keep a distance: which candidates certainly keep it, and
// until when each other one does.
//
// In: candidates; how thick each vertex is, half of the separation included. Out: all that may come
// nearer, and at the same places the time until which each certainly does not. One thread per
// candidate.
// Cost: 32 bytes of corners, 96 of positions and 24 of thickness read; up to N_ROUNDS rounds, each
// of about 20 products of a direction and four corners.
// Invariant: what is dropped is proven to keep its distance, and so are the times, whatever the
// device's rounding (`docs/exactness.md`, "Distances that are kept on the GPU").
//
// Along a direction every corner of the difference polygon goes on evenly. So what is beyond the
// distance at two times, along the same direction, is so at any time between:
//
//   find   directions across which the elements are apart now, as for safe distances
//   guess  for each along which a bound holds now: about the time when the first corner comes too near
//   check  whether a bound holds then, too, or at a time between
//   again  from the latest of these times; until nothing is gained, or to the end: dropped

const N_DIRECTIONS: u32 = 5u;
const N_ROUNDS: u32 = 8u;
// Attempts to go on along a direction, each half as far.
const N_TRIES: u32 = 3u;
// Shorter gains end the search: a 1024th of the step.
const SHORTEST_GAIN: u32 = 0x4000u;
// The part of what is left of the distance now that may be gone then.
const GOES: f32 = 0.998;

@group(0) @binding(0) var<storage, read> candidates: array<Candidate>;
@group(0) @binding(1) var<storage, read> corners: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> positions: array<u32>;
@group(0) @binding(3) var<storage, read> thickness: array<f32>;
@group(0) @binding(4) var<storage, read_write> pairs: array<PairKey>;
@group(0) @binding(5) var<storage, read_write> times: array<PairTimes>;
@group(0) @binding(6) var<storage, read_write> counters: array<atomic<u32>>;

// Left in memory: a compiler that computed a direction or a guess twice might round it in two ways.
var<workgroup> directions: array<vec3<f32>, 64u * N_DIRECTIONS>;
var<workgroup> guesses: array<u32, 64u * N_DIRECTIONS>;

// Directions across which the elements may be apart at a time, towards the polygon. However wrong
// they are, bounds hold.
fn find(pair: ptr<function, Pair>, time: u32, lane: u32) {
    let points = at((*pair).polygon.corners, time);
    let edges = at((*pair).polygon.edges, time);
    let first = lane * N_DIRECTIONS;
    let p = vec3<f32>(points.x.x, points.y.x, points.z.x);
    let d = vec3<f32>(edges.x.x, edges.y.x, edges.z.x);
    let e = vec3<f32>(edges.x.y, edges.y.y, edges.z.y);
    directions[first] = scaled(towards(p, d));
    directions[first + 1u] = scaled(towards(vec3<f32>(points.x.y, points.y.y, points.z.y), e));
    directions[first + 2u] = scaled(towards(
        vec3<f32>(points.x.z, points.y.z, points.z.z),
        vec3<f32>(edges.x.z, edges.y.z, edges.z.z),
    ));
    directions[first + 3u] = scaled(towards(
        vec3<f32>(points.x.w, points.y.w, points.z.w),
        vec3<f32>(edges.x.w, edges.y.w, edges.z.w),
    ));
    let across = scaled(cross3(d, e));
    directions[first + 4u] = select(across, -across, dot3(across, p) < 0.0);
}

// A number below the least of n . V over all corners at a time.
fn height(n: vec3<f32>, pair: ptr<function, Pair>, time: u32) -> f32 {
    let start = (*pair).polygon.corners.start;
    let end = (*pair).polygon.corners.end;
    let widest = Four(max(abs(start.x), abs(end.x)), max(abs(start.y), abs(end.y)), max(abs(start.z), abs(end.z)));
    let error = OF_PRODUCT * dot_four(abs(n), widest) + FLUSHED;
    return least(dot_four(n, at((*pair).polygon.corners, time)) - error);
}

// A number below what is left of the distance of two elements at a time, besides the one that they
// keep: 0 if nothing is certain.
fn left_at(n: vec3<f32>, pair: ptr<function, Pair>, time: u32, both: f32) -> f32 {
    let apart = max(0.0, quotient(height(n, pair, time), n) - (*pair).sizes.slack) * BELOW;
    return besides_thickness(apart * scale_of((*pair).sizes.scale), both);
}

// About how long it takes from a time on until so much is gone along a direction, in ticks.
fn ticks_until(n: vec3<f32>, pair: ptr<function, Pair>, time: u32, gone: f32) -> u32 {
    let now = dot_four(n, at((*pair).polygon.corners, time));
    let end = dot_four(n, (*pair).polygon.corners.end);
    let low = least(now) - gone;
    let shares = select(vec4<f32>(1.0), (now - low) / max(now - end, vec4<f32>(FLUSHED)), end < vec4<f32>(low));
    let rest = TICKS - time;
    let share = least(shares);
    return select(min(u32(f32(rest) * clamp(share, 0.0, 1.0)), rest), rest, share >= 1.0);
}

// A guess until when two elements keep their distance along a direction: later than a time only if
// they certainly do at that time.
fn guess(n: vec3<f32>, pair: ptr<function, Pair>, time: u32, both: f32) -> u32 {
    let left = left_at(n, pair, time, both);
    if left == 0.0 {
        return time;
    }
    return time + ticks_until(n, pair, time, GOES * left * (*pair).sizes.scale * sqrt(dot3(n, n)));
}

// Until when two elements certainly keep their distance along a direction, from a time on, by a
// guess.
fn free_until(n: vec3<f32>, pair: ptr<function, Pair>, time: u32, guessed: u32, both: f32) -> u32 {
    var length = guessed - time;
    for (var n_tries = 0u; n_tries < N_TRIES && length > 0u; n_tries++) {
        if left_at(n, pair, time + length, both) > 0.0 {
            return time + length;
        }
        length /= 2u;
    }
    return time;
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let ix = group_number(group) * 64u + lane;
    let n = min(atomicLoad(&counters[N_CANDIDATES]), arrayLength(&candidates));
    var candidate = Candidate(0u, 0u);
    var pair = Pair();
    var is_left = false;
    if ix < n {
        candidate = candidates[ix];
        is_left = candidate.a != NOTHING;
    }
    if is_left {
        load_pair(candidate, &pair);
    }
    let both = thickness_of_both(corners[candidate.a & ~FLAG], corners[candidate.b & ~FLAG]);
    var goes_on = is_left && pair.sizes.are_in_range;
    var time = 0u;
    let first = lane * N_DIRECTIONS;
    for (var round = 0u; round < N_ROUNDS; round++) {
        if goes_on {
            find(&pair, time, lane);
        }
        workgroupBarrier();
        if goes_on {
            for (var k = first; k < first + N_DIRECTIONS; k++) {
                guesses[k] = guess(directions[k], &pair, time, both);
            }
        }
        workgroupBarrier();
        if goes_on {
            var latest = time;
            for (var k = first; k < first + N_DIRECTIONS; k++) {
                latest = max(latest, free_until(directions[k], &pair, time, guesses[k], both));
            }
            is_left = latest < TICKS;
            goes_on = is_left && latest - time > SHORTEST_GAIN;
            time = latest;
        }
        workgroupBarrier();
    }
    let slot = slot_in(N_PAIRS, is_left, lane);
    if is_left && slot < arrayLength(&pairs) {
        pairs[slot] = PairKey(candidate.a, candidate.b);
    }
    if is_left && slot < arrayLength(&times) {
        times[slot] = PairTimes(time_of(time), time_of(NONE));
    }
}
