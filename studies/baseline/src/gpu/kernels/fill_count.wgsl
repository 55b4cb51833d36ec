// Stage `fill`, first kernel: how many cells each element touches, summed up within workgroups.
//
// In: kept elements, the grid. Out: ranges after the shift; for each element the number of entries of the
// elements before it in its workgroup; for each workgroup its total. One thread per kept element.

@group(0) @binding(0) var<storage, read> grid: array<Grid>;
@group(0) @binding(1) var<storage, read_write> kept: array<Kept>;
@group(0) @binding(2) var<storage, read_write> firsts: array<u32>;
@group(0) @binding(3) var<storage, read_write> sums: array<u32>;
@group(0) @binding(4) var<storage, read_write> counters: array<atomic<u32>>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let block = group_number(group);
    let ix = block * 64u + lane;
    let n_kept = min(atomicLoad(&counters[N_KEPT]), arrayLength(&kept));
    var n = 0u;
    if ix < n_kept {
        let fine = kept[ix].range;
        let shift = vec3<u32>(grid[0].shift);
        let low = (fine & vec3<u32>(0xffffu)) >> shift;
        let high = fine >> (shift + vec3<u32>(16u));
        let range = low | (high << vec3<u32>(16u));
        kept[ix].range = range;
        n = n_touched(coarse(range));
    }
    let sum = sum_up_to(lane, n, 64u);
    if ix < n_kept {
        firsts[ix] = sum - n;
    }
    if lane == 63u && block < arrayLength(&sums) {
        sums[block] = sum;
    }
}
