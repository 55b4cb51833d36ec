// Stage `traversal` of `Cells`: room for the lists of cells that matter, and their work items.
//
// In: cells. Out: where each list starts; a work item for every pair of groups of the list,
// equation (4).
// One thread per cell. Cells with elements of only one body are culled, unless its self-collision
// is queried. Instead of a prefix sum over all cells, a workgroup reserves the room that its cells
// need: lists then lie in any order, which does no harm.
//
// Where we deviate from the paper: groups are cut from the whole list, bodies mixed, and level 2
// clears partners of bodies that do not meet. A cell of five elements of one body and five of
// another is one work item of ten, and no list has to be sorted.
//
//   groups   0   1   2          items: the upper triangle, diagonal included
//      0     x   x   x
//      1         x   x
//      2             x

@group(0) @binding(0) var<storage, read> grid: array<Grid>;
@group(0) @binding(1) var<storage, read> bodies: array<Body>;
@group(0) @binding(2) var<storage, read_write> cells: array<Cell>;
@group(0) @binding(3) var<storage, read_write> starts: array<u32>;
@group(0) @binding(4) var<storage, read_write> items: array<CellItem>;
@group(0) @binding(5) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(6) var<uniform> params: Params;

const NOWHERE: u32 = 0xffffffffu;
// The most work items that one invocation writes; a cell with more is processed in tiles.
const MOST_ITEMS: u32 = 32768u;

var<workgroup> n_wanted: atomic<u32>;
var<workgroup> n_items: atomic<u32>;
var<workgroup> n_cells: atomic<u32>;
var<workgroup> first_wanted: u32;
var<workgroup> first_item: u32;

// The number of entries in the upper triangle; numbers above MOST_ITEMS may not be exact.
fn count_items(groups: u32) -> u32 {
    if groups > MOST_ITEMS {
        return MOST_ITEMS + 1u;
    }
    return groups * (groups + 1u) / 2u;
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let ix = group_number(group) * 64u + lane;
    if lane == 0u {
        atomicStore(&n_wanted, 0u);
        atomicStore(&n_items, 0u);
        atomicStore(&n_cells, 0u);
    }
    workgroupBarrier();
    let is_cell = ix < grid[0].n_cells;
    var n = 0u;
    if is_cell && ix >= params.first && ix - params.first < params.count {
        n = atomicLoad(&cells[ix].n_entries);
        let highest = atomicLoad(&cells[ix].highest);
        let is_one_body = highest == ~atomicLoad(&cells[ix].lowest);
        if n < 2u || (is_one_body && bodies[highest].within == 0u) {
            n = 0u;
        }
    }
    let size = params.group_size;
    let groups = n / size + select(0u, 1u, n % size != 0u);
    let mine = select(count_items(groups), 0u, params.lists_only != 0u);
    if mine > MOST_ITEMS {
        atomicStore(&counters[TOO_MUCH], 1u);
        n = 0u;
    }
    var wanted_at = 0u;
    var item_at = 0u;
    if n > 0u {
        wanted_at = atomicAdd(&n_wanted, n);
        item_at = atomicAdd(&n_items, mine);
        atomicAdd(&n_cells, 1u);
    }
    workgroupBarrier();
    if lane == 0u {
        first_wanted = reserve(N_ENTRIES, atomicLoad(&n_wanted));
        first_item = reserve(N_ITEMS, atomicLoad(&n_items));
        atomicAdd(&counters[N_SUBDIVIDED], atomicLoad(&n_cells));
    }
    workgroupBarrier();
    if !is_cell {
        return;
    }
    if n == 0u {
        starts[ix] = NOWHERE;
        return;
    }
    let start = first_wanted + wanted_at;
    starts[ix] = start;
    let x = ix % grid[0].resolution.x;
    let y = ix / grid[0].resolution.x % grid[0].resolution.y;
    let z = ix / grid[0].resolution.x / grid[0].resolution.y;
    // One loop through rows and columns: see `next_cell` in coarse.wgsl.
    var row = 0u;
    var column = 0u;
    let first = first_item + item_at;
    for (var at = first; at < min(first + mine, arrayLength(&items)); at++) {
        let n_a = min(size, n - row * size);
        let n_b = min(size, n - column * size);
        let sizes = (n_a - 1u) | ((n_b - 1u) << 7u) | (z << 14u);
        items[at] = CellItem(x | (y << 14u), sizes, start + row * size, start + column * size);
        column++;
        if column >= groups {
            row++;
            column = row;
        }
    }
}
