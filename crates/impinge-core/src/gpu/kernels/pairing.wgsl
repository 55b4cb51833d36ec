// Stage `pairing`: which elements of two clusters have boxes that meet. In a step, boxes at both
// ends.
//
// In: work items. Out: candidates. One workgroup of 64 per work item:
//
// 1. Each lane computes the box of one element of each cluster. Elements that do not meet the other
//    cluster's box drop out, for a partner's box lies in its cluster's box.
// 2. Lanes take the side with more survivors and walk over the survivors of the other side: one
//    64-bit mask per element, bit j for partner j, as two words:
//
//       mask.x  bits 0..31  partners  0..31
//       mask.y  bits 0..31  partners 32..63
//
// 3. Within one body, partners that share a vertex id are cleared, or marked as neighbours if they
//    are to be resolved. The ids are in workgroup memory; comparing them costs less than reading
//    adjacency masks would, and needs no special case for vertices with many elements.
// 4. One atomic per workgroup reserves room; candidates that do not fit are counted.
//
// Cost: 128 elements read, min(survivors) steps of one box test per lane.
// Invariant: a pair of elements lies in one work item only, so no candidate comes twice.

@group(0) @binding(0) var<storage, read> nodes: array<Node>;
@group(0) @binding(1) var<storage, read> clusters: array<Cluster>;
@group(0) @binding(2) var<storage, read> bodies: array<Body>;
@group(0) @binding(3) var<storage, read> corners: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read> positions: array<u32>;
@group(0) @binding(5) var<storage, read> items: array<WorkItem>;
@group(0) @binding(6) var<storage, read_write> candidates: array<Candidate>;
@group(0) @binding(7) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(8) var<uniform> params: Params;

// The elements of a in entries 0..63, those of b in 64..127.
var<workgroup> lows: array<vec3<u32>, 128u * ENDS>;
var<workgroup> highs: array<vec3<u32>, 128u * ENDS>;
var<workgroup> ids: array<vec4<u32>, 128>;
var<workgroup> survivors: array<atomic<u32>, 4>;
var<workgroup> n_found: atomic<u32>;
var<workgroup> first_found: u32;

// Stores an element's box in its entry; false if there is no element or its box misses the other
// cluster's.
fn load(cluster: Cluster, lane: u32, entry: u32, others: Extent) -> bool {
    if lane >= (cluster.sizes & 0xffffu) {
        return false;
    }
    let corner = corners[cluster.first_slot + lane];
    let own = element_extent(corner, bodies[cluster.body].slack);
    put_extent(entry, own);
    ids[entry] = corner;
    return extents_meet(own, others);
}

// Writes candidates: the lane's element with each partner in one word of its mask.
fn put(mask: u32, first_partner: u32, mine: u32, flags: vec2<u32>, swap: bool, pass_buffers: u32) -> u32 {
    var rest = mask;
    var at = pass_buffers;
    while rest != 0u {
        let partner = first_partner + firstTrailingBit(rest);
        rest &= rest - 1u;
        if at < arrayLength(&candidates) {
            let a = select(mine, partner, swap);
            let b = select(partner, mine, swap);
            candidates[at] = Candidate(a | flags.x, b | flags.y);
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
    if lane < 4u {
        atomicStore(&survivors[lane], 0u);
    }
    if lane == 0u {
        atomicStore(&n_found, 0u);
    }
    let item = items[min(ix, n_items - 1u)];
    let cluster_a = clusters[item.a];
    let cluster_b = clusters[item.b];
    workgroupBarrier();
    let bit = 1u << (lane & 31u);
    if load(cluster_a, lane, lane, node_extent(item.b)) {
        atomicOr(&survivors[lane >> 5u], bit);
    }
    if load(cluster_b, lane, lane + 64u, node_extent(item.a)) {
        atomicOr(&survivors[2u + (lane >> 5u)], bit);
    }
    workgroupBarrier();
    let alive_a = vec2<u32>(atomicLoad(&survivors[0]), atomicLoad(&survivors[1]));
    let alive_b = vec2<u32>(atomicLoad(&survivors[2]), atomicLoad(&survivors[3]));
    let count_a = countOneBits(alive_a.x) + countOneBits(alive_a.y);
    let count_b = countOneBits(alive_b.x) + countOneBits(alive_b.y);
    // Lanes hold the larger side and walk over the smaller one.
    let swap = count_a < count_b;
    let lanes = select(alive_a, alive_b, swap);
    var walked = select(alive_b, alive_a, swap);
    let mine = lane + select(0u, 64u, swap);
    let partners = select(64u, 0u, swap);
    let is_same_body = are_of_one_body(cluster_a, cluster_b);
    let alive = ix < n_items && (select(lanes.x, lanes.y, lane >= 32u) & bit) != 0u;
    var met = vec2<u32>(0u);
    var shared_ids = vec2<u32>(0u);
    if alive {
        if item.a == item.b {
            // A cluster with itself: only partners after the lane, so that each pair comes once.
            let after = select(vec2<u32>(~((bit << 1u) - 1u), 0xffffffffu),
                vec2<u32>(0u, ~((bit << 1u) - 1u)), lane >= 32u);
            walked &= after;
        }
        let own = extent_at(mine);
        let own_ids = ids[mine];
        for (var word = 0u; word < 2u; word++) {
            var rest = select(walked.x, walked.y, word == 1u);
            var found = 0u;
            var sharing = 0u;
            while rest != 0u {
                let partner_bit = rest & (0u - rest);
                let partner = partners + 32u * word + firstTrailingBit(rest);
                rest ^= partner_bit;
                if extents_meet(own, extent_at(partner)) {
                    if is_same_body && shares_vertex(own_ids, ids[partner]) {
                        sharing |= partner_bit * params.resolve;
                    } else {
                        found |= partner_bit;
                    }
                }
            }
            if word == 0u {
                met.x = found;
                shared_ids.x = sharing;
            } else {
                met.y = found;
                shared_ids.y = sharing;
            }
        }
    }
    let n_mine = countOneBits(met.x) + countOneBits(met.y)
        + countOneBits(shared_ids.x) + countOneBits(shared_ids.y);
    var slot = atomicAdd(&n_found, n_mine);
    workgroupBarrier();
    if lane == 0u {
        first_found = reserve(N_CANDIDATES, atomicLoad(&n_found));
    }
    workgroupBarrier();
    slot += first_found;
    let slack = bodies[cluster_a.body].slack + bodies[cluster_b.body].slack;
    let rounded = select(0u, FLAG, slack != 0u);
    let my_slot = lane + select(cluster_a.first_slot, cluster_b.first_slot, swap);
    let first_partner = select(cluster_b.first_slot, cluster_a.first_slot, swap);
    let plain = vec2<u32>(rounded, flag_of(cluster_a));
    let marked = vec2<u32>(rounded, FLAG);
    slot = put(met.x, first_partner, my_slot, plain, swap, slot);
    slot = put(met.y, first_partner + 32u, my_slot, plain, swap, slot);
    slot = put(shared_ids.x, first_partner, my_slot, marked, swap, slot);
    slot = put(shared_ids.y, first_partner + 32u, my_slot, marked, swap, slot);
}
