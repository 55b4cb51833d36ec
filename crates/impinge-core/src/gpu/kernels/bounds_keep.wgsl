// Stage `bounds` of `Cells`: the elements within their body's reach, with their boxes.
//
// In: clusters, corners, positions, reaches. Out: kept elements, in any order; those that do not
// fit are counted. One workgroup per cluster, one lane per element. Cost: every element once,
// unless its cluster is out of reach.

@group(0) @binding(0) var<storage, read> nodes: array<Node>;
@group(0) @binding(1) var<storage, read> clusters: array<Cluster>;
@group(0) @binding(2) var<storage, read> bodies: array<Body>;
@group(0) @binding(3) var<storage, read> corners: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read> positions: array<u32>;
@group(0) @binding(5) var<storage, read> reaches: array<Reach>;
@group(0) @binding(6) var<storage, read_write> kept: array<Kept>;
@group(0) @binding(7) var<storage, read_write> counters: array<atomic<u32>>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let cluster_ix = group_number(group);
    if cluster_ix >= arrayLength(&clusters) {
        return;
    }
    let cluster = clusters[cluster_ix];
    let reach = Box(reaches[cluster.body].low, reaches[cluster.body].high);
    let is_near = overlap(box_of(nodes[cluster_ix]), reach);
    var own = empty_box();
    var is_kept = false;
    let slack = bodies[cluster.body].slack;
    if is_near && lane < (cluster.sizes & 0xffffu) {
        own = element_box(corners[cluster.first_slot + lane], slack);
        is_kept = overlap(own, reach);
    }
    let slot = slot_in(N_KEPT, is_kept, lane);
    if is_kept && slot < arrayLength(&kept) {
        let rounded = select(0u, FLAG, slack != 0u);
        kept[slot] = Kept(own.low, (cluster.first_slot + lane) | rounded, own.high, cluster.body,
            vec3<u32>(0u), 0u);
    }
}
