// Stage `pairing`: box tests of all pairs of a cell.
//
// In: work items. Out: candidates; those that do not fit are counted. One workgroup of 64 lanes per work item:
// boxes go to workgroup memory, then the lanes test 64 pairs at a time.
//
//   test p       element p / n_b of the first body, p % n_b of the second
//   hits         bit k: the lane's k-th test, p = 64 k + lane, found a candidate
//
// Cost: n_a n_b box tests. With the owner rule (`params.owner_rule`) a pair is a candidate only in the cell
// that holds the lower corner of its common range; without it, in every common cell.

@group(0) @binding(0) var<storage, read> grid: array<Grid>;
@group(0) @binding(1) var<storage, read> kept: array<Kept>;
@group(0) @binding(2) var<storage, read> entries: array<Entry>;
@group(0) @binding(3) var<storage, read> items: array<CellItem>;
@group(0) @binding(4) var<storage, read_write> candidates: array<Candidate>;
@group(0) @binding(5) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(6) var<uniform> params: Params;

// The elements of the first body in places 0..63, those of the second in 64..127.
var<workgroup> lows: array<vec3<u32>, 128>;
var<workgroup> highs: array<vec3<u32>, 128>;
// The first coarse cells that they touch.
var<workgroup> cells: array<vec3<u32>, 128>;
var<workgroup> slots: array<u32, 128>;
var<workgroup> n_found: atomic<u32>;
var<workgroup> first_found: u32;

fn load(to: u32, entry: u32) {
    let own = kept[entries[entry].kept];
    lows[to] = own.low;
    highs[to] = own.high;
    cells[to] = coarse(own.range).first;
    slots[to] = own.slot;
}

fn is_candidate(a: u32, b: u32, cell: u32) -> bool {
    if !overlap(Box(lows[a], highs[a]), Box(lows[b], highs[b])) {
        return false;
    }
    return params.owner_rule == 0u
        || cell_number(max(cells[a], cells[b]), grid[0].resolution) == cell;
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let ix = group_number(group);
    let n_items = min(atomicLoad(&counters[N_ITEMS]), arrayLength(&items));
    let is_item = ix < n_items;
    if lane == 0u {
        atomicStore(&n_found, 0u);
    }
    let item = items[min(ix, max(n_items, 1u) - 1u)];
    let n_a = (item.sizes & 0x7fu) + 1u;
    let n_b = ((item.sizes >> 7u) & 0x7fu) + 1u;
    if is_item {
        if lane < n_a {
            load(lane, item.first_a + lane);
        }
        if lane < n_b {
            load(64u + lane, item.first_b + lane);
        }
    }
    workgroupBarrier();
    let n_tests = select(0u, n_a * n_b, is_item);
    var hits = vec2<u32>(0u);
    var k = 0u;
    for (var test = lane; test < n_tests; test += 64u) {
        if is_candidate(test / n_b, 64u + test % n_b, item.cell) {
            let bit = 1u << (k & 31u);
            hits |= select(vec2<u32>(bit, 0u), vec2<u32>(0u, bit), k >= 32u);
        }
        k++;
    }
    var slot = atomicAdd(&n_found, countOneBits(hits.x) + countOneBits(hits.y));
    workgroupBarrier();
    if lane == 0u {
        first_found = reserve(N_CANDIDATES, atomicLoad(&n_found));
        let before = atomicAdd(&counters[N_BOX_TESTS], n_tests);
        if before + n_tests < before {
            atomicAdd(&counters[N_BOX_TESTS_HIGH], 1u);
        }
    }
    workgroupBarrier();
    slot += first_found;
    for (var word = 0u; word < 2u; word++) {
        for (var rest = select(hits.x, hits.y, word == 1u); rest != 0u; rest &= rest - 1u) {
            let test = 64u * (32u * word + firstTrailingBit(rest)) + lane;
            let a = slots[test / n_b];
            let b = slots[64u + test % n_b];
            if slot < arrayLength(&candidates) {
                // Bit 31 of either number says that positions were rounded; it is stored with the first.
                candidates[slot] = Candidate(a | (b & FLAG), b & ~FLAG);
            }
            slot++;
        }
    }
}
