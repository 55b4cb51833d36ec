// Stage `grid`, first kernel: the resolution, equation (1).
//
//   R_i = d_i (lambda N / V)^(1/3)
//
// In: the region, the number N of elements kept. Out: the grid, and arguments for dispatches over
// kept elements. Cost: one thread. Where the region is so thin along an axis that the equation
// gives less than one cell, the axis gets one cell and the others share the cells: a flat cloth,
// with V = 0, gets a grid of squares. The answer does not depend on the resolution, so plain floats
// are enough.

@group(0) @binding(0) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(1) var<storage, read_write> tallies: array<atomic<u32>>;
@group(0) @binding(2) var<storage, read_write> grid: array<Grid>;
@group(0) @binding(3) var<storage, read_write> arguments: array<Arguments>;
@group(0) @binding(4) var<uniform> params: Params;

// Thinner regions have one cell: their reciprocal would not be a number.
const THINNEST: f32 = 0x1p-100f;
const MOST_ALONG: f32 = 16384.0;

@compute @workgroup_size(1)
fn main() {
    let n = min(atomicLoad(&counters[N_KEPT]), params.capacity);
    arguments[params.slot] = arguments_for(n, 64u);
    var low: vec3<u32>;
    var high: vec3<u32>;
    for (var axis = 0u; axis < 3u; axis++) {
        low[axis] = ~atomicLoad(&tallies[axis]);
        high[axis] = atomicLoad(&tallies[3u + axis]);
    }
    let origin = values(low);
    let extent = values(high) - origin;
    // Logarithms keep products of extents within range.
    let wanted = log2(clamp(bitcast<f32>(params.lambda) * f32(n), 1.0, f32(params.most_cells)));
    var is_along = extent >= vec3<f32>(THINNEST);
    let sizes = log2(max(extent, vec3<f32>(THINNEST)));
    var cells = vec3<f32>(1.0);
    for (var attempt = 0u; attempt < 3u; attempt++) {
        let axes = u32(is_along.x) | (u32(is_along.y) << 1u) | (u32(is_along.z) << 2u);
        let n_along = f32(countOneBits(axes));
        let volume = select(0.0, sizes.x, is_along.x) + select(0.0, sizes.y, is_along.y)
            + select(0.0, sizes.z, is_along.z);
        let density = (wanted - volume) / max(n_along, 1.0);
        cells = select(vec3<f32>(1.0), exp2(min(sizes + density, vec3<f32>(20.0))), is_along);
        if all(cells >= vec3<f32>(1.0)) {
            break;
        }
        // One axis at a time: the first that is too thin.
        if cells.x < 1.0 {
            is_along.x = false;
        } else if cells.y < 1.0 {
            is_along.y = false;
        } else {
            is_along.z = false;
        }
        cells = max(cells, vec3<f32>(1.0));
    }
    var finest = vec3<u32>(clamp(cells, vec3<f32>(1.0), vec3<f32>(MOST_ALONG)));
    // Logarithms are not exact, but the number of cells must fit exactly.
    while finest.x * finest.y > params.most_cells
        || finest.x * finest.y > params.most_cells / finest.z {
        finest = max(finest / 2u, vec3<u32>(1u));
    }
    let scale = select(vec3<f32>(0.0), 4.0 * vec3<f32>(finest) / max(extent, vec3<f32>(THINNEST)),
        extent >= vec3<f32>(THINNEST));
    grid[0] = Grid(origin, 0u, scale, 0u, finest, 0u, finest, 0u);
}
