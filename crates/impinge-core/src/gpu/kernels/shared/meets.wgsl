// Whether two bodies meet: their filters agree and the query does not ignore the pair. The list of
// ignored pairs is sorted, lower body first.

fn is_ignored(a: u32, b: u32) -> bool {
    var low = 0u;
    var high = params.n_ignored;
    while low < high {
        let middle = low + (high - low) / 2u;
        let entry = ignored[middle];
        if entry.a < a || (entry.a == a && entry.b < b) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low < params.n_ignored && ignored[low].a == a && ignored[low].b == b;
}

fn meets(a: u32, b: u32) -> bool {
    let of_a = bodies[a];
    let of_b = bodies[b];
    return any((of_a.category & of_b.mask) != vec2<u32>(0u))
        && any((of_b.category & of_a.mask) != vec2<u32>(0u))
        && !is_ignored(min(a, b), max(a, b));
}
