// Stage `narrow` of a frame or a step whose lists stay on the device, last kernel: says whether the
// lists are complete.
//
// In: counters; the room that all buffers had. Out: for each list the number of pairs that it has,
// or a number above its room if pairs may be missing. Then also 0 for all times until which pairs
// of a step are free. One thread per unsure pair that there is room for.
// Invariant: a number that is not above the room of its list counts every pair.
//
// The counters of the lists stay as they are, for the host: room grows with what was needed.

@group(0) @binding(0) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(1) var<storage, read_write> times: array<PairTimes>;
@group(0) @binding(2) var<uniform> params: Params;

fn listed(counter: u32, room: u32, are_missing: bool) -> u32 {
    let n = atomicLoad(&counters[counter]);
    return select(n, max(n, room + 1u), are_missing);
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let ix = group_number(group) * 64u + lane;
    // There is one time per unsure pair.
    let room = arrayLength(&times);
    if ix >= room {
        return;
    }
    let are_missing = are_lost();
    // A step searches its pairs, and those that are left are unsure.
    let are_searched = params.searched_room != 0u;
    let are_unsearched = are_searched && atomicLoad(&counters[N_PAIRS]) > params.searched_room;
    let n_unsure = listed(N_UNSURE, room, are_missing || are_unsearched);
    if ix == 0u {
        atomicStore(&counters[N_UNSURE_LISTED], n_unsure);
        atomicStore(&counters[N_PAIRS_LISTED], listed(N_PAIRS, params.pairs_room, are_missing));
    }
    if n_unsure > room {
        times[ix].free_until = 0.0;
    }
}
