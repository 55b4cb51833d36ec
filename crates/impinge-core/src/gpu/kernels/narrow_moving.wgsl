// Stage `narrow` of a step: which candidates certainly do not touch while they move.
//
// In: candidates. Out: all others, by their places for the host, which settles them, or by global numbers for the caller's
// shaders. One thread per candidate. Cost: 32 bytes of corners and 96 of positions read.
// Invariant: what is dropped is proven not to touch, whatever the device's rounding (`docs/exactness.md`).
//
// A vertex repeats itself, an edge its second end, a face its third corner. So an edge and a vertex are two edges of
// which one is a point, and two vertices a vertex and a face that is a point.

@group(0) @binding(0) var<storage, read> candidates: array<Candidate>;
@group(0) @binding(1) var<storage, read> corners: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> positions: array<u32>;
@group(0) @binding(3) var<storage, read> order: array<u32>;
@group(0) @binding(4) var<storage, read_write> unsure: array<UnsureKey>;
@group(0) @binding(5) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(6) var<uniform> params: Params;

var<workgroup> n_unsure: atomic<u32>;
var<workgroup> first_unsure: u32;

fn vertex_bits(vertex: u32) -> vec3<u32> {
    let word = 3u * vertex;
    return vec3<u32>(positions[word], positions[word + 1u], positions[word + 2u]);
}

fn magnitude(bits: vec3<u32>) -> u32 {
    let each = bits & vec3<u32>(0x7fffffffu);
    return max(max(each.x, each.y), each.z);
}

// A vertex at both ends, as bits.
struct Path {
    start: vec3<u32>,
    end: vec3<u32>,
}

fn path(vertex: u32) -> Path {
    let at_end = vertex + arrayLength(&positions) / 6u;
    return Path(vertex_bits(vertex), vertex_bits(at_end));
}

fn reach(way: Path) -> u32 {
    return max(magnitude(way.start), magnitude(way.end));
}

fn moving(way: Path) -> Moving {
    return Moving(bitcast<vec3<f32>>(way.start), bitcast<vec3<f32>>(way.end));
}

// Whether the elements of a candidate may touch.
fn may_touch(candidate: Candidate) -> bool {
    let are_edges = (candidate.b & FLAG) != 0u;
    let a = corners[candidate.a & ~FLAG];
    let b = corners[candidate.b & ~FLAG];
    let p = path(a.x);
    let q = path(select(b.x, a.y, are_edges));
    let r = path(select(b.y, b.x, are_edges));
    let s = path(select(b.z, b.y, are_edges));
    // Compared as integers: infinities never reach the arithmetic.
    let largest = max(max(reach(p), reach(q)), max(reach(r), reach(s)));
    if largest > LARGEST_BITS {
        return true;
    }
    let is_rounded = (candidate.a & FLAG) != 0u;
    let narrowing = select(0.0, NARROWING * bitcast<f32>(largest), is_rounded);
    var polygon = triangle(moving(p), moving(q), moving(r), moving(s));
    if are_edges {
        polygon = parallelogram(moving(p), moving(q), moving(r), moving(s));
    }
    return !never_touch(&polygon, are_edges, narrowing);
}

fn name_of(candidate: Candidate) -> UnsureKey {
    let a = candidate.a & ~FLAG;
    let b = candidate.b & ~FLAG;
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
    let n = min(atomicLoad(&counters[N_CANDIDATES]), arrayLength(&candidates));
    if lane == 0u {
        atomicStore(&n_unsure, 0u);
    }
    workgroupBarrier();
    var is_left = false;
    var candidate = Candidate(0u, 0u);
    var place = 0u;
    if ix < n {
        candidate = candidates[ix];
        is_left = may_touch(candidate);
    }
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
            unsure[place] = name_of(candidate);
        }
    }
}
