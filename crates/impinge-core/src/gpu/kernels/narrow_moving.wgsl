// Stage `narrow` of a step: which candidates certainly do not touch while they move, by tests of
// the whole step.
//
// In: candidates. Out: all others, for `narrow_search`. One thread per candidate.
// Cost: 32 bytes of corners and 96 of positions read.
// Invariant: what is dropped is proven not to touch, whatever the device's rounding
// (`docs/exactness.md`).

@group(0) @binding(0) var<storage, read> candidates: array<Candidate>;
@group(0) @binding(1) var<storage, read> corners: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> positions: array<u32>;
@group(0) @binding(3) var<storage, read_write> pairs: array<PairKey>;
@group(0) @binding(4) var<storage, read_write> counters: array<atomic<u32>>;

// Whether the elements of a candidate may touch.
fn may_touch(candidate: Candidate) -> bool {
    var pair: Pair;
    load_pair(candidate, &pair);
    if !pair.sizes.are_in_range {
        return true;
    }
    return decide(pair.polygon, pair.sizes, pair.are_edges) != FREE;
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let ix = group_number(group) * 64u + lane;
    let n = min(atomicLoad(&counters[N_CANDIDATES]), arrayLength(&candidates));
    var is_left = false;
    var candidate = Candidate(0u, 0u);
    if ix < n {
        candidate = candidates[ix];
        if candidate.a != NOTHING {
            is_left = may_touch(candidate);
        }
    }
    let slot = slot_in(N_PAIRS, is_left, lane);
    if is_left && slot < arrayLength(&pairs) {
        pairs[slot] = PairKey(candidate.a, candidate.b);
    }
}
