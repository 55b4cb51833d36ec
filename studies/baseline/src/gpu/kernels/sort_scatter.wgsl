// Stage `sort`, third kernel of a round: moves entries to the slots of their digits, in their original order.
//
// In: entries, sums of the counts, totals of the digits. Out: entries. One workgroup per block, 256 entries at a
// time. Each lane sets its bit in the row of its digit; the bits before its own give its rank among equal digits:
//
//   row of digit d    word 0: lanes 31 … 0 | word 1: lanes 63 … 32 | … | word 7: lanes 255 … 224
//
// Invariant: the order of equal digits is kept. A sort by digits, the lowest first, depends on it.

@group(0) @binding(0) var<storage, read> entries: array<Entry>;
@group(0) @binding(1) var<storage, read> counts: array<u32>;
@group(0) @binding(2) var<storage, read> totals: array<u32>;
@group(0) @binding(3) var<storage, read_write> sorted: array<Entry>;
@group(0) @binding(4) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(5) var<uniform> params: Params;

var<workgroup> rows: array<atomic<u32>, 2048>;
// Where the next entry of each digit goes.
var<workgroup> slots: array<u32, 256>;

// `params.first`: the lowest bit of the digit.
@compute @workgroup_size(256)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let block = group_number(group);
    let n = min(atomicLoad(&counters[N_ENTRIES]), arrayLength(&entries));
    let n_blocks = n_blocks_of(n);
    let own = totals[lane];
    var first = sum_up_to(lane, own, 256u) - own;
    if block < n_blocks {
        first += counts[lane * n_blocks + block];
    }
    slots[lane] = first;
    for (var word = 0u; word < 8u; word++) {
        atomicStore(&rows[256u * word + lane], 0u);
    }
    workgroupBarrier();
    let my_word = lane / 32u;
    let my_bit = 1u << (lane % 32u);
    for (var round = 0u; round < BLOCK / 256u; round++) {
        let ix = block * BLOCK + round * 256u + lane;
        let is_there = ix < n;
        var entry: Entry;
        var digit = 0u;
        if is_there {
            entry = entries[ix];
            digit = (entry.key >> params.first) % DIGITS;
            atomicOr(&rows[8u * digit + my_word], my_bit);
        }
        workgroupBarrier();
        var rank = 0u;
        var n_equal = 0u;
        if is_there {
            for (var word = 0u; word < 8u; word++) {
                let bits = atomicLoad(&rows[8u * digit + word]);
                n_equal += countOneBits(bits);
                if word < my_word {
                    rank += countOneBits(bits);
                } else if word == my_word {
                    rank += countOneBits(bits & (my_bit - 1u));
                }
            }
            sorted[slots[digit] + rank] = entry;
        }
        workgroupBarrier();
        // The last of the lanes with equal digits clears the row for the next round.
        if is_there && rank + 1u == n_equal {
            slots[digit] += n_equal;
            for (var word = 0u; word < 8u; word++) {
                atomicStore(&rows[8u * digit + word], 0u);
            }
        }
        workgroupBarrier();
    }
}
