// Stage `narrow` of a step whose elements keep a distance, second kernel: names the pairs that
// `narrow_keep` has left.
//
// In: pairs. Out: the same pairs at the same places, by their slots for the host, or by global
// numbers for the caller's shaders; their number. One thread per pair.

@group(0) @binding(0) var<storage, read> pairs: array<PairKey>;
@group(0) @binding(1) var<storage, read> order: array<u32>;
@group(0) @binding(2) var<storage, read_write> unsure: array<UnsureKey>;
@group(0) @binding(3) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(4) var<uniform> params: Params;
@group(0) @binding(5) var<storage, read> bodies: array<Body>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let ix = group_number(group) * 64u + lane;
    let n = atomicLoad(&counters[N_PAIRS]);
    if ix == 0u {
        atomicStore(&counters[N_UNSURE], n);
    }
    if ix < min(n, min(arrayLength(&pairs), arrayLength(&unsure))) {
        unsure[ix] = name_of(pairs[ix]);
    }
}
