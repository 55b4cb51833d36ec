// Stage `traversal` of `Cells` for a crowded cell, whose list an earlier pass has filled: the work
// items of one tile of the product of its groups, equation (4).
//
// In: the number of entries of the list, which begins at entry 0. Out: work items. One thread per
// pair of groups.
// Invariant: nothing writes the list between the passes over its tiles, so every pair of entries
// comes up once.
//
//   groups   0   1   2   3      tiles of side 2: (0, 0), (0, 2), (2, 2); each without its part
//      0     x   x | x   x      below the diagonal
//      1         x | x   x
//           -------+-------
//      2           | x   x
//      3           |     x

@group(0) @binding(0) var<storage, read> grid: array<Grid>;
@group(0) @binding(1) var<storage, read_write> items: array<CellItem>;
@group(0) @binding(2) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(3) var<uniform> params: Params;

// `params.first`: the cell.
@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let ix = group_number(group) * 64u + lane;
    let side = params.tile_side;
    let size = params.group_size;
    let row = params.tile_row + ix / side;
    let column = params.tile_column + ix % side;
    let groups = params.n_entries / size + select(0u, 1u, params.n_entries % size != 0u);
    let is_item = ix < side * side && row <= column && column < groups;
    let at = slot_in(N_ITEMS, is_item, lane);
    if is_item && at < arrayLength(&items) {
        let cell = params.first;
        let x = cell % grid[0].resolution.x;
        let y = cell / grid[0].resolution.x % grid[0].resolution.y;
        let z = cell / grid[0].resolution.x / grid[0].resolution.y;
        let n_a = min(size, params.n_entries - row * size);
        let n_b = min(size, params.n_entries - column * size);
        let sizes = (n_a - 1u) | ((n_b - 1u) << 7u) | (z << 14u);
        items[at] = CellItem(x | (y << 14u), sizes, row * size, column * size);
    }
}
