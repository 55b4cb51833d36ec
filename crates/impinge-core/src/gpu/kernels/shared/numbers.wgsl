// The global number of the element at a slot. Bindings: `order` and `bodies`.

fn number_at(slot: u32) -> u32 {
    // The last record whose first slot is not beyond it: records without elements come before those
    // that have its place.
    var low = 0u;
    var high = arrayLength(&bodies);
    while low + 1u < high {
        let middle = low + (high - low) / 2u;
        if bodies[middle].first_slot <= slot {
            low = middle;
        } else {
            high = middle;
        }
    }
    return bodies[low].first_number + order[slot];
}
