// Stage `fill`, third kernel: one entry for every cell that an element's box touches.
//
// In: kept elements with their ranges, and the slots of their first entries. Out: entries; those that do not
// fit have already been counted. One thread per kept element.

@group(0) @binding(0) var<storage, read> grid: array<Grid>;
@group(0) @binding(1) var<storage, read> kept: array<Kept>;
@group(0) @binding(2) var<storage, read> firsts: array<u32>;
@group(0) @binding(3) var<storage, read> sums: array<u32>;
@group(0) @binding(4) var<storage, read_write> entries: array<Entry>;
@group(0) @binding(5) var<storage, read_write> counters: array<atomic<u32>>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let block = group_number(group);
    let ix = block * 64u + lane;
    if ix >= min(atomicLoad(&counters[N_KEPT]), arrayLength(&kept)) {
        return;
    }
    let body = kept[ix].body;
    let touched = coarse(kept[ix].range);
    var at = firsts[ix] + sums[block];
    var cell = touched.first;
    for (var left = n_touched(touched); left > 0u; left--) {
        if at < arrayLength(&entries) {
            entries[at] = Entry((cell_number(cell, grid[0].resolution) << 1u) | body, ix);
        }
        at++;
        cell = next_cell(cell, touched);
    }
}
