// Stage `pairing` of `Cells`: the paper's second level. One workgroup of 64 per work item.
//
// 1. Each lane writes the occupancy of one element of group b: bit x + 4 y + 16 z for sub-cell (x,
//    y, z):
//
//       mask.x   31 … 16 | 15 … 12   11 … 8   7 … 4   3 2 1 0
//                 z = 1     y = 3     y = 2   y = 1   x of y = 0, z = 0
//       mask.y    z = 3     z = 2
//
// 2. The 64 masks are transposed in workgroup memory: lane s gathers bit s of all of them, the
//    membership of sub-cell s.
//
//       masks of b       row j, bit s: element j touches sub-cell s
//       membership       row s, bit j: the same
//
// 3. The partners of an element of group a are the OR of the memberships of its own sub-cells.
// 4. Partners whose boxes do not meet, whose bodies do not meet, or which another cell owns are
//    cleared. The owner of a pair is the cell with max(low_a, low_b): exact, and without the
//    paper's hash table.
// 5. One atomic per workgroup reserves room for candidates; those that do not fit are counted.
//
// Source: "Real-time Collision Detection with Two-level Spatial Hashing on GPU", section 3.2.
// Reasons for each discard: elements without a common sub-cell have ranges, and so boxes, that do
// not overlap; a pair that another cell owns is found there.

@group(0) @binding(0) var<storage, read> bodies: array<Body>;
@group(0) @binding(1) var<storage, read> ignored: array<NodePair>;
@group(0) @binding(2) var<storage, read> corners: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> kept: array<Kept>;
@group(0) @binding(4) var<storage, read> entries: array<u32>;
@group(0) @binding(5) var<storage, read> items: array<CellItem>;
@group(0) @binding(6) var<storage, read_write> candidates: array<Candidate>;
@group(0) @binding(7) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(8) var<uniform> params: Params;

var<workgroup> group_b: array<Kept, 64>;
var<workgroup> masks: array<vec2<u32>, 64>;
var<workgroup> membership: array<vec2<u32>, 64>;
var<workgroup> n_found: atomic<u32>;
var<workgroup> first_found: u32;

// The sub-cells along one axis that a range touches, as four bits.
fn along(range: u32, cell: u32) -> u32 {
    let first = 4u * cell;
    let low = max(range & 0xffffu, first) - first;
    let high = min(range >> 16u, first + 3u) - first;
    return (15u >> (3u - high)) & (15u << low);
}

fn occupancy(range: vec3<u32>, cell: vec3<u32>) -> vec2<u32> {
    let x = along(range.x, cell.x);
    let y = along(range.y, cell.y);
    let z = along(range.z, cell.z);
    let plane = x * ((y & 1u) | ((y & 2u) << 3u) | ((y & 4u) << 6u) | ((y & 8u) << 9u));
    let low = (z & 1u) | ((z & 2u) << 15u);
    let high = ((z & 4u) >> 2u) | ((z & 8u) << 13u);
    return plane * vec2<u32>(low, high);
}

fn bit_of(mask: vec2<u32>, bit: u32) -> u32 {
    return (select(mask.x, mask.y, bit >= 32u) >> (bit & 31u)) & 1u;
}

fn bodies_meet(a: u32, b: u32) -> bool {
    if a == b {
        return bodies[a].within != 0u;
    }
    return meets(a, b);
}

fn is_owner(cell: vec3<u32>, a: vec3<u32>, b: vec3<u32>) -> bool {
    let low = max(a & vec3<u32>(0xffffu), b & vec3<u32>(0xffffu));
    return all(low >> vec3<u32>(2u) == cell);
}

// Of the partners in one word of a mask: those that stay, and those that share a vertex and are to
// be resolved.
fn decide_partners(partners: u32, first: u32, own: Kept, cell: vec3<u32>) -> vec2<u32> {
    var rest = partners;
    var stay = vec2<u32>(0u);
    while rest != 0u {
        let bit = rest & (0u - rest);
        let other = group_b[first + firstTrailingBit(rest)];
        rest ^= bit;
        if !overlap(Box(own.low, own.high), Box(other.low, other.high))
            || !is_owner(cell, own.range, other.range) || !bodies_meet(own.body, other.body) {
            continue;
        }
        if own.body == other.body
            && shares_vertex(corners[own.slot & ~FLAG], corners[other.slot & ~FLAG]) {
            stay.y |= bit * params.resolve;
        } else {
            stay.x |= bit;
        }
    }
    return stay;
}

fn put(mask: u32, first: u32, own: Kept, flag: u32, pass_buffers: u32) -> u32 {
    var rest = mask;
    var at = pass_buffers;
    while rest != 0u {
        let other = group_b[first + firstTrailingBit(rest)].slot;
        rest &= rest - 1u;
        if at < arrayLength(&candidates) {
            candidates[at] = Candidate(own.slot | (other & FLAG), (other & ~FLAG) | flag);
        }
        at++;
    }
    return at;
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let ix = group_number(group);
    let n_items = min(atomicLoad(&counters[N_ITEMS]), arrayLength(&items));
    if lane == 0u {
        atomicStore(&n_found, 0u);
    }
    let item = items[min(ix, n_items - 1u)];
    let cell = vec3<u32>(item.cell & 0x3fffu, item.cell >> 14u, item.sizes >> 14u);
    let n_a = select(0u, (item.sizes & 0x7fu) + 1u, ix < n_items);
    let n_b = ((item.sizes >> 7u) & 0x7fu) + 1u;
    masks[lane] = vec2<u32>(0u);
    if lane < n_b {
        let other = kept[entries[item.first_b + lane]];
        group_b[lane] = other;
        masks[lane] = occupancy(other.range, cell);
    }
    workgroupBarrier();
    var members = vec2<u32>(0u);
    for (var j = 0u; j < n_b; j++) {
        let touches = bit_of(masks[j], lane) << (j & 31u);
        if j < 32u {
            members.x |= touches;
        } else {
            members.y |= touches;
        }
    }
    membership[lane] = members;
    workgroupBarrier();
    var own: Kept;
    var low_stay = vec2<u32>(0u);
    var high_stay = vec2<u32>(0u);
    if lane < n_a {
        own = kept[entries[item.first_a + lane]];
        let mask = occupancy(own.range, cell);
        var partners = vec2<u32>(0u);
        for (var rest = mask.x; rest != 0u; rest &= rest - 1u) {
            partners |= membership[firstTrailingBit(rest)];
        }
        for (var rest = mask.y; rest != 0u; rest &= rest - 1u) {
            partners |= membership[32u + firstTrailingBit(rest)];
        }
        if item.first_a == item.first_b {
            // A group with itself: only partners after the lane, so that each pair comes once.
            let after = ~(((1u << (lane & 31u)) << 1u) - 1u);
            partners &= select(vec2<u32>(after, 0xffffffffu), vec2<u32>(0u, after), lane >= 32u);
        }
        low_stay = decide_partners(partners.x, 0u, own, cell);
        high_stay = decide_partners(partners.y, 32u, own, cell);
    }
    let n_mine = countOneBits(low_stay.x) + countOneBits(low_stay.y)
        + countOneBits(high_stay.x) + countOneBits(high_stay.y);
    var slot = atomicAdd(&n_found, n_mine);
    workgroupBarrier();
    if lane == 0u {
        first_found = reserve(N_CANDIDATES, atomicLoad(&n_found));
    }
    workgroupBarrier();
    slot += first_found;
    slot = put(low_stay.x, 0u, own, 0u, slot);
    slot = put(high_stay.x, 32u, own, 0u, slot);
    slot = put(low_stay.y, 0u, own, FLAG, slot);
    slot = put(high_stay.y, 32u, own, FLAG, slot);
}
