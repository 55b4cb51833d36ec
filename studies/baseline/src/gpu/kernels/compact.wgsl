// Stage `compact`: finds the cells with elements of both bodies, and the slots of their entries.
//
// In: sorted entries. Out: work items of at most 64 elements of each body: a large cell becomes all pairs of
// such groups. One thread per entry; the thread of the first entry of the first body in a cell does
// the work. Cost: a doubling search for the ends of its two runs.

@group(0) @binding(0) var<storage, read> entries: array<Entry>;
@group(0) @binding(1) var<storage, read_write> items: array<CellItem>;
@group(0) @binding(2) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(3) var<uniform> params: Params;

const GROUP: u32 = 64u;
// The most work items that one invocation writes; a cell with more is refused.
const MOST_ITEMS: u32 = 32768u;

var<workgroup> n_items: atomic<u32>;
var<workgroup> n_cells: atomic<u32>;
var<workgroup> first_item: u32;

// One past the last entry with the same key as the entry at `start`.
fn end_of_run(start: u32, n: u32) -> u32 {
    let key = entries[start].key;
    var step = 1u;
    var last = start;
    while step < n - last && entries[last + step].key == key {
        last += step;
        step *= 2u;
    }
    // The run ends within `step` entries after `last`, or with the list.
    var end = last + min(step, n - last);
    while last + 1u < end {
        let middle = last + (end - last) / 2u;
        if entries[middle].key == key {
            last = middle;
        } else {
            end = middle;
        }
    }
    return last + 1u;
}

fn n_groups_of(n: u32) -> u32 {
    return n / GROUP + select(0u, 1u, n % GROUP != 0u);
}

// `params.first`, `params.count`: the range of cells.
@compute @workgroup_size(256)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let ix = group_number(group) * 256u + lane;
    let n = min(atomicLoad(&counters[N_ENTRIES]), arrayLength(&entries));
    if lane == 0u {
        atomicStore(&n_items, 0u);
        atomicStore(&n_cells, 0u);
    }
    workgroupBarrier();
    var middle = ix;
    var end = ix;
    var cell = 0u;
    if ix < n {
        let key = entries[ix].key;
        cell = key >> 1u;
        var is_first = (key & 1u) == 0u && cell >= params.first && cell - params.first < params.count;
        if is_first && ix > 0u {
            is_first = entries[ix - 1u].key != key;
        }
        if is_first {
            middle = end_of_run(ix, n);
            end = middle;
            if middle < n {
                if entries[middle].key == (key | 1u) {
                    end = end_of_run(middle, n);
                }
            }
        }
    }
    let rows = n_groups_of(middle - ix);
    let columns = n_groups_of(end - middle);
    var mine = 0u;
    if columns > 0u {
        if rows > MOST_ITEMS / columns {
            atomicStore(&counters[TOO_MUCH], 1u);
        } else {
            mine = rows * columns;
        }
    }
    var slot = 0u;
    if mine > 0u {
        slot = atomicAdd(&n_items, mine);
        atomicAdd(&n_cells, 1u);
    }
    workgroupBarrier();
    if lane == 0u {
        first_item = reserve(N_ITEMS, atomicLoad(&n_items));
        atomicAdd(&counters[N_SUBDIVIDED], atomicLoad(&n_cells));
    }
    workgroupBarrier();
    slot += first_item;
    var first_a = ix;
    var first_b = middle;
    for (var at = slot; at < min(slot + mine, arrayLength(&items)); at++) {
        let n_a = min(GROUP, middle - first_a);
        let n_b = min(GROUP, end - first_b);
        items[at] = CellItem(cell, (n_a - 1u) | ((n_b - 1u) << 7u), first_a, first_b);
        first_b += GROUP;
        if first_b >= end {
            first_b = middle;
            first_a += GROUP;
        }
    }
}
