// The number of a workgroup in a dispatch that may need more than 65,535 of them: rows of x, numbered row by row.
fn group_number(group: vec3<u32>, n_groups: vec3<u32>) -> u32 {
    return group.y * n_groups.x + group.x;
}
