// Stage `traversal`: pairs of clusters whose boxes meet, one level of the trees per launch.
//
// In: pairs of nodes. Out: pairs of their children that meet, to the next round's queue, and pairs
// of clusters that meet, to the work items. One workgroup per pair, one lane per pair of children:
//
//             children of b
//             0 1 2 3 4 5 6 7
//   of a  0   lane 0 … lane 7         A node with itself: only j > i, and i with i
//         1   lane 8 …                whatever its box. Unequal heights: the higher
//         …                           one's children against the other node.
//         7   …          lane 63
//
// Cost: proportional to the pairs of nodes that meet. Reason for each discard: boxes that do not
// overlap hold elements that cannot meet; a gate opens only where the bodies' filters agree.
// Invariant: every pair of clusters comes at most once. Pairs that do not fit are counted.

@group(0) @binding(0) var<storage, read> nodes: array<Node>;
@group(0) @binding(1) var<storage, read> bodies: array<Body>;
@group(0) @binding(2) var<storage, read> ignored: array<NodePair>;
@group(0) @binding(3) var<storage, read> queue: array<NodePair>;
@group(0) @binding(4) var<storage, read_write> next_queue: array<NodePair>;
@group(0) @binding(5) var<storage, read_write> items: array<WorkItem>;
@group(0) @binding(6) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(7) var<uniform> params: Params;

var<workgroup> n_next: atomic<u32>;
var<workgroup> n_found: atomic<u32>;
var<workgroup> first_next: u32;
var<workgroup> first_found: u32;

fn height(node: Node) -> u32 {
    return (node.shape >> 4u) & 0xffu;
}

fn child(node: Node, k: u32) -> u32 {
    if (node.shape & GATE) != 0u {
        return bodies[node.first_child].root;
    }
    return node.first_child + k;
}

// The pair of nodes that this lane examines; `alive` is false when it has none.
struct Task {
    a: u32,
    b: u32,
    alive: bool,
}

fn task(pair: NodePair, lane: u32) -> Task {
    let a = nodes[pair.a];
    let b = nodes[pair.b];
    let n_a = a.shape & CHILDREN;
    let n_b = b.shape & CHILDREN;
    let i = lane >> 3u;
    let j = lane & 7u;
    if pair.a == pair.b {
        if n_a == 0u {
            return Task(pair.a, pair.b, lane == 0u);
        }
        if (a.shape & GATE) != 0u && bodies[a.first_child].within == 0u {
            return Task(0u, 0u, false);
        }
        return Task(child(a, i), child(a, j), i <= j && j < n_a);
    }
    if !extents_meet(node_extent(pair.a), node_extent(pair.b)) {
        return Task(0u, 0u, false);
    }
    if (a.shape & b.shape & GATE) != 0u && !meets(a.first_child, b.first_child) {
        return Task(0u, 0u, false);
    }
    let height_a = height(a);
    let height_b = height(b);
    if height_a > height_b {
        return Task(child(a, lane), pair.b, lane < n_a);
    }
    if height_b > height_a {
        return Task(pair.a, child(b, lane), lane < n_b);
    }
    if height_a == 0u {
        return Task(pair.a, pair.b, lane == 0u);
    }
    return Task(child(a, i), child(b, j), i < n_a && j < n_b);
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let ix = group_number(group);
    let n_pairs = min(atomicLoad(&counters[params.first]), arrayLength(&queue));
    if lane == 0u {
        atomicStore(&n_next, 0u);
        atomicStore(&n_found, 0u);
    }
    workgroupBarrier();
    var found = Task(0u, 0u, false);
    var is_item = false;
    var slot = 0u;
    if ix < n_pairs {
        found = task(queue[ix], lane);
        if found.alive {
            let a = nodes[found.a];
            let b = nodes[found.b];
            found.alive = found.a == found.b || extents_meet(node_extent(found.a), node_extent(found.b));
            is_item = height(a) == 0u && height(b) == 0u;
        }
    }
    if found.alive {
        if is_item {
            slot = atomicAdd(&n_found, 1u);
        } else {
            slot = atomicAdd(&n_next, 1u);
        }
    }
    workgroupBarrier();
    if lane == 0u {
        first_next = reserve(params.first + 1u, atomicLoad(&n_next));
        first_found = reserve(N_ITEMS, atomicLoad(&n_found));
    }
    workgroupBarrier();
    if found.alive {
        if is_item {
            slot += first_found;
            if slot < arrayLength(&items) {
                // The lower cluster comes first.
                items[slot] = WorkItem(min(found.a, found.b), max(found.a, found.b));
            }
        } else {
            slot += first_next;
            if slot < arrayLength(&next_queue) {
                next_queue[slot] = NodePair(found.a, found.b);
            }
        }
    }
}
