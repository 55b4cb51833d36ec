// Stage `sort`, first kernel of a round: counts how often each digit occurs in each block of entries.
//
// In: entries. Out: the counts, digit by digit, and within a digit block by block. One workgroup per block.

@group(0) @binding(0) var<storage, read> entries: array<Entry>;
@group(0) @binding(1) var<storage, read_write> counts: array<u32>;
@group(0) @binding(2) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(3) var<uniform> params: Params;

var<workgroup> found: array<atomic<u32>, 256>;

// `params.first`: the lowest bit of the digit.
@compute @workgroup_size(256)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let block = group_number(group);
    let n = min(atomicLoad(&counters[N_ENTRIES]), arrayLength(&entries));
    let n_blocks = n_blocks_of(n);
    atomicStore(&found[lane], 0u);
    workgroupBarrier();
    if block < n_blocks {
        let end = min(n, (block + 1u) * BLOCK);
        for (var ix = block * BLOCK + lane; ix < end; ix += 256u) {
            atomicAdd(&found[(entries[ix].key >> params.first) % DIGITS], 1u);
        }
    }
    workgroupBarrier();
    if block < n_blocks {
        counts[lane * n_blocks + block] = atomicLoad(&found[lane]);
    }
}
