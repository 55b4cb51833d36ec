// Whether two bodies meet: their filters agree and the query does not ignore the pair.
fn meets(a: u32, b: u32) -> bool {
    return filters_agree(bodies[a], bodies[b])
        && !is_ignored(min(a, b), max(a, b));
}
