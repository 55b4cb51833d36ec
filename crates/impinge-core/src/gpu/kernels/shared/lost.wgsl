// Whether pairs may be missing from what a stage has read: a counter is above the room that there
// was, or has wrapped around. Counters of later stages do not show it: these count only what
// reached them. `counters` and `params` are bindings of the kernel.
fn are_lost() -> bool {
    var most = 0u;
    for (var round = 0u; round < ROUNDS; round++) {
        most = max(most, atomicLoad(&counters[round]));
    }
    return most > params.queue_room
        || atomicLoad(&counters[N_ITEMS]) > params.items_room
        || atomicLoad(&counters[N_KEPT]) > params.kept_room
        || atomicLoad(&counters[N_ENTRIES]) > params.entries_room
        || atomicLoad(&counters[N_CANDIDATES]) > params.capacity
        || atomicLoad(&counters[TOO_MUCH]) != 0u;
}
