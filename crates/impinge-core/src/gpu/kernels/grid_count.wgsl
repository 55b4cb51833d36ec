// Stage `grid`, fourth kernel: the number of entries of each cell's list, and which bodies have
// any.
//
// In: kept elements, the grid. Out: ranges after the shift; for each cell the number of entries,
// the highest and the lowest body. One thread per kept element, one pass over the cells it touches.

@group(0) @binding(0) var<storage, read> grid: array<Grid>;
@group(0) @binding(1) var<storage, read_write> kept: array<Kept>;
@group(0) @binding(2) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(3) var<storage, read_write> cells: array<Cell>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let ix = group_number(group) * 64u + lane;
    if ix >= min(atomicLoad(&counters[N_KEPT]), arrayLength(&kept)) {
        return;
    }
    let fine = kept[ix].range;
    let shift = vec3<u32>(grid[0].shift);
    let low = (fine & vec3<u32>(0xffffu)) >> shift;
    let high = fine >> (shift + vec3<u32>(16u));
    let range = low | (high << vec3<u32>(16u));
    kept[ix].range = range;
    let body = kept[ix].body;
    let touched = coarse(range);
    var cell = touched.first;
    for (var left = n_touched(touched); left > 0u; left--) {
        let number = cell_number(cell, grid[0].resolution);
        atomicAdd(&cells[number].n_entries, 1u);
        atomicMax(&cells[number].highest, body);
        atomicMax(&cells[number].lowest, ~body);
        cell = next_cell(cell, touched);
    }
}
