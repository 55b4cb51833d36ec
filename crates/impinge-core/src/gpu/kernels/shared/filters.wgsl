// Whether the filters of two bodies agree, and whether the query ignores the pair. The list of
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

fn filters_agree(a: Body, b: Body) -> bool {
    return any((a.category & b.mask) != vec2<u32>(0u)) && any((b.category & a.mask) != vec2<u32>(0u));
}
