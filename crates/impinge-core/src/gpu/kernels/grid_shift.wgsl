// Stage `grid`, third kernel: how often the grid is halved.
//
// In: entries of the cell lists for every shift. Out: the least shift with at most 16 entries per
// kept element on average and at most 32,768 for any one, and arguments for a dispatch over cells.
// Cost: one thread. A huge element would touch every cell of a fine grid; this bounds the lists'
// memory and the work of one thread.

@group(0) @binding(0) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(1) var<storage, read_write> tallies: array<atomic<u32>>;
@group(0) @binding(2) var<storage, read_write> grid: array<Grid>;
@group(0) @binding(3) var<storage, read_write> arguments: array<Arguments>;
@group(0) @binding(4) var<uniform> params: Params;

const MOST_ENTRIES_EACH: u32 = 16u;

@compute @workgroup_size(1)
fn main() {
    let n = min(atomicLoad(&counters[N_KEPT]), params.capacity);
    let most = min(n, 0xfffffffu) * MOST_ENTRIES_EACH;
    let too_fine = atomicLoad(&tallies[SHIFTS_TOO_FINE]);
    var shift = 0u;
    while shift < SHIFTS - 1u {
        let low_word = ENTRIES_BY_SHIFT + 2u * shift;
        let is_too_fine = ((too_fine >> shift) & 1u) != 0u;
        if !is_too_fine && atomicLoad(&tallies[low_word + 1u]) == 0u
            && atomicLoad(&tallies[low_word]) <= most {
            break;
        }
        shift++;
    }
    let last = (grid[0].finest - vec3<u32>(1u)) >> vec3<u32>(shift);
    let resolution = last + vec3<u32>(1u);
    let n_cells = resolution.x * resolution.y * resolution.z;
    grid[0].shift = shift;
    grid[0].resolution = resolution;
    grid[0].n_cells = n_cells;
    arguments[params.slot] = arguments_for(n_cells, 64u);
}
