// Stage `bounds`, first kernel: the box of each cluster.
//
// In: unique vertices of clusters `first .. first + count`, positions. Out: the boxes of the nodes
// with these numbers; in a step, then those at the end.
// One workgroup per cluster and end. Each lane takes every 64th vertex; then two steps reduce eight
// boxes to one.
// Cost: 12 bytes per vertex and 4 per index, for each unique vertex of a cluster once.
// Invariant: a box holds all its vertices exactly, or widened by `slack` when they were rounded;
// for safe distances by `reach` too.

@group(0) @binding(0) var<storage, read> clusters: array<Cluster>;
@group(0) @binding(1) var<storage, read> cluster_vertices: array<u32>;
@group(0) @binding(2) var<storage, read> positions: array<u32>;
@group(0) @binding(3) var<storage, read> bodies: array<Body>;
@group(0) @binding(4) var<storage, read_write> nodes: array<Node>;
@group(0) @binding(5) var<uniform> params: Params;

var<workgroup> lows: array<vec3<u32>, 64>;
var<workgroup> highs: array<vec3<u32>, 64>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let n_clusters = params.count;
    let ix = group_number(group);
    if ix >= ENDS * n_clusters {
        return;
    }
    let end = ix / n_clusters;
    let cluster_ix = params.first + ix % n_clusters;
    let node_ix = end * (arrayLength(&nodes) / ENDS) + cluster_ix;
    let first_of_end = end * (arrayLength(&positions) / (3u * ENDS));
    let cluster = clusters[cluster_ix];
    let n_vertices = cluster.sizes >> 16u;
    var low = vec3<u32>(0xffffffffu);
    var high = vec3<u32>(0u);
    for (var ix = lane; ix < n_vertices; ix += 64u) {
        let at = vertex_key(first_of_end + cluster_vertices[cluster.first_vertex + ix]);
        low = min(low, at);
        high = max(high, at);
    }
    lows[lane] = low;
    highs[lane] = high;
    workgroupBarrier();
    if lane < 8u {
        for (var ix = lane + 8u; ix < 64u; ix += 8u) {
            low = min(low, lows[ix]);
            high = max(high, highs[ix]);
        }
        lows[lane] = low;
        highs[lane] = high;
    }
    workgroupBarrier();
    if lane == 0u {
        for (var ix = 1u; ix < 8u; ix++) {
            low = min(low, lows[ix]);
            high = max(high, highs[ix]);
        }
        let slack = bodies[cluster.body].slack;
        let box = widened(Box(low - slack, high + slack), params.reach);
        nodes[node_ix].low = box.low;
        nodes[node_ix].high = box.high;
    }
}
