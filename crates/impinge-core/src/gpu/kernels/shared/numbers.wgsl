// The global number of the primitive at a place. Bindings: `order` and `bodies`.

fn number_at(place: u32) -> u32 {
    // The last record whose first place is not beyond it: records without primitives come before those that have its place.
    var low = 0u;
    var high = arrayLength(&bodies);
    while low + 1u < high {
        let middle = low + (high - low) / 2u;
        if bodies[middle].first_place <= place {
            low = middle;
        } else {
            high = middle;
        }
    }
    return bodies[low].first_number + order[place];
}
