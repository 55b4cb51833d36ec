// Workgroups of the next dispatch, an indirect one: rows of at most WIDEST.
fn arguments_for(n: u32, per_group: u32) -> Arguments {
    let groups = n / per_group + select(0u, 1u, n % per_group != 0u);
    let rows = groups / WIDEST + select(0u, 1u, groups % WIDEST != 0u);
    return Arguments(min(groups, WIDEST), rows, 1u);
}
