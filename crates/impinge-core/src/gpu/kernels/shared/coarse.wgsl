// The coarse cells of a range.
struct Coarse {
    first: vec3<u32>,
    last: vec3<u32>,
}

fn coarse(range: vec3<u32>) -> Coarse {
    return Coarse((range & vec3<u32>(0xffffu)) >> vec3<u32>(2u), range >> vec3<u32>(18u));
}

fn n_touched(touched: Coarse) -> u32 {
    let along = touched.last - touched.first + vec3<u32>(1u);
    return along.x * along.y * along.z;
}

// The cell after this one. One loop steps through all three axes: some drivers stop an invocation
// after 65,536 loop steps, and nested loops of lanes with different counts add up.
fn next_cell(cell: vec3<u32>, touched: Coarse) -> vec3<u32> {
    var next = cell + vec3<u32>(1u, 0u, 0u);
    if next.x > touched.last.x {
        next = vec3<u32>(touched.first.x, next.y + 1u, next.z);
    }
    if next.y > touched.last.y {
        next = vec3<u32>(next.x, touched.first.y, next.z + 1u);
    }
    return next;
}

// Equation (2): the cell's slot in the linear array.
fn cell_number(cell: vec3<u32>, resolution: vec3<u32>) -> u32 {
    return (cell.z * resolution.y + cell.y) * resolution.x + cell.x;
}
