// Stage `narrow` of safe distances, last kernel: takes everything back if pairs were lost.
//
// In: counters; the room that queues, work items and candidates had. Out: 0 for all vertices if any
// of it was too small.
// Invariant: no number is left that pairs which did not fit might have lowered.

@group(0) @binding(0) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(1) var<storage, read_write> shares: array<u32>;
@group(0) @binding(2) var<uniform> params: Params;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let vertex = group_number(group) * 64u + lane;
    if vertex < arrayLength(&shares) && are_lost() {
        shares[vertex] = 0u;
    }
}
