// Stage `fill`, second kernel: exclusive sum over the workgroups of the first.
//
// In: the number of entries of each workgroup. Out: the number of entries of all workgroups before it; in the
// counters, the total. One workgroup; each lane takes a run of sums. Cost: the sums, one per 64 elements, are
// read twice and written once.

@group(0) @binding(0) var<storage, read_write> sums: array<u32>;
@group(0) @binding(1) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(2) var<uniform> params: Params;

@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) lane: u32) {
    let n_kept = min(atomicLoad(&counters[N_KEPT]), params.capacity);
    let n_sums = n_kept / 64u + select(0u, 1u, n_kept % 64u != 0u);
    let each = n_sums / 256u + select(0u, 1u, n_sums % 256u != 0u);
    let first = min(lane * each, n_sums);
    let end = min(first + each, n_sums);
    var own = 0u;
    for (var ix = first; ix < end; ix++) {
        own += sums[ix];
    }
    let sum = sum_up_to(lane, own, 256u);
    var slot = sum - own;
    for (var ix = first; ix < end; ix++) {
        let n = sums[ix];
        sums[ix] = slot;
        slot += n;
    }
    if lane == 255u {
        atomicStore(&counters[N_ENTRIES], sum);
    }
}
