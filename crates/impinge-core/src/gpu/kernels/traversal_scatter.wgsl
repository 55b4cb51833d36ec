// Stage `traversal` of `Cells`, second kernel: fills the lists of the cells that have one.
//
// In: kept elements, where lists start. Out: entries, which are numbers of kept elements, in any
// order.
// One thread per kept element. Counts run down to hand out slots.

@group(0) @binding(0) var<storage, read> grid: array<Grid>;
@group(0) @binding(1) var<storage, read> kept: array<Kept>;
@group(0) @binding(2) var<storage, read> starts: array<u32>;
@group(0) @binding(3) var<storage, read_write> cells: array<Cell>;
@group(0) @binding(4) var<storage, read_write> entries: array<u32>;
@group(0) @binding(5) var<storage, read_write> counters: array<atomic<u32>>;

const NOWHERE: u32 = 0xffffffffu;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let ix = group_number(group) * 64u + lane;
    if ix >= min(atomicLoad(&counters[N_KEPT]), arrayLength(&kept)) {
        return;
    }
    let touched = coarse(kept[ix].range);
    var cell = touched.first;
    for (var left = n_touched(touched); left > 0u; left--) {
        let number = cell_number(cell, grid[0].resolution);
        let start = starts[number];
        if start != NOWHERE {
            let at = start + atomicSub(&cells[number].n_entries, 1u) - 1u;
            if at < arrayLength(&entries) {
                entries[at] = ix;
            }
        }
        cell = next_cell(cell, touched);
    }
}
