// Stage `sort`, second kernel of a round: exclusive sums of each digit's counts over the blocks.
//
// In: counts. Out: sums in the same slots, and the total of each digit. One workgroup per digit; each lane takes
// a run of blocks.

@group(0) @binding(0) var<storage, read_write> counts: array<u32>;
@group(0) @binding(1) var<storage, read_write> totals: array<u32>;
@group(0) @binding(2) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(3) var<uniform> params: Params;

// `params.capacity`: the capacity for entries.
@compute @workgroup_size(256)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let n_blocks = n_blocks_of(min(atomicLoad(&counters[N_ENTRIES]), params.capacity));
    let each = n_blocks / 256u + select(0u, 1u, n_blocks % 256u != 0u);
    let first = min(lane * each, n_blocks);
    let end = min(first + each, n_blocks);
    let row = group.x * n_blocks;
    var own = 0u;
    for (var block = first; block < end; block++) {
        own += counts[row + block];
    }
    let sum = sum_up_to(lane, own, 256u);
    var slot = sum - own;
    for (var block = first; block < end; block++) {
        let n = counts[row + block];
        counts[row + block] = slot;
        slot += n;
    }
    if lane == 255u {
        totals[group.x] = sum;
    }
}
