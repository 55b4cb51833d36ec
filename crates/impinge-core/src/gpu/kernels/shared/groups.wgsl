// The number of a workgroup in a dispatch that may need more than 65,535 of them: rows of WIDEST,
// numbered row by row. Not asked of `num_workgroups`, which is 0 in indirect dispatches of Direct3D
// 12.
fn group_number(group: vec3<u32>) -> u32 {
    return group.y * WIDEST + group.x;
}
