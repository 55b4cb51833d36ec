// Stage `grid`, second kernel: fine cell ranges, equation (3) at four times the resolution.
//
// In: kept elements, the grid. Out: their ranges; entries of the cell lists for every shift.
// One thread per kept element.
// Invariant: boxes that overlap have ranges that overlap. A coordinate in units of cells is
// wrong by less than 2^-4 cells (65,536 cells, four roundings), however the compiler
// arranges the operations; low ends move down and high ends up by a quarter of a cell before they
// are floored.

@group(0) @binding(0) var<storage, read> grid: array<Grid>;
@group(0) @binding(1) var<storage, read_write> kept: array<Kept>;
@group(0) @binding(2) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(3) var<storage, read_write> tallies: array<atomic<u32>>;

const MARGIN: f32 = 0.25;
// The most cells that one invocation may walk over: see `next_cell`.
const MOST_TOUCHED: u32 = 32768u;

var<workgroup> n_entries: array<atomic<u32>, 15>;

fn cells(at: vec3<f32>, margin: f32) -> vec3<u32> {
    let last = vec3<f32>(4u * grid[0].finest - vec3<u32>(1u));
    let cell = floor((at - grid[0].origin) * grid[0].scale + vec3<f32>(margin));
    return vec3<u32>(clamp(cell, vec3<f32>(0.0), last));
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    if lane < SHIFTS {
        atomicStore(&n_entries[lane], 0u);
    }
    workgroupBarrier();
    let ix = group_number(group) * 64u + lane;
    if ix < min(atomicLoad(&counters[N_KEPT]), arrayLength(&kept)) {
        let low = cells(values(kept[ix].low), -MARGIN);
        let high = max(cells(values(kept[ix].high), MARGIN), low);
        kept[ix].range = low | (high << vec3<u32>(16u));
        for (var shift = 0u; shift < SHIFTS; shift++) {
            let coarse = vec3<u32>(shift + 2u);
            let touched = (high >> coarse) - (low >> coarse) + vec3<u32>(1u);
            // At most 2^14 along each axis: neither product overflows.
            let n = min(touched.x * touched.y, 1u << 16u) * touched.z;
            if n > MOST_TOUCHED {
                atomicOr(&tallies[SHIFTS_TOO_FINE], 1u << shift);
            }
            atomicAdd(&n_entries[shift], min(n, MOST_TOUCHED));
        }
    }
    workgroupBarrier();
    if lane < SHIFTS {
        let n = atomicLoad(&n_entries[lane]);
        let low_word = ENTRIES_BY_SHIFT + 2u * lane;
        let before = atomicAdd(&tallies[low_word], n);
        if before + n < before {
            atomicAdd(&tallies[low_word + 1u], 1u);
        }
    }
}
