// Stage `bounds` of `Cells`: each body's reach, the box in which it may meet others, and the region
// of all reaches.
//
// In: boxes of bodies (roots of the trees), the tree over bodies if there is one. Out: one reach
// per body; the region, by atomic maxima of keys and of their complements.
// One thread per body walks the tree over bodies. Cost: the nodes whose boxes meet the body's box.
// Beyond a limit the whole box becomes the reach: that discards less, which is always right.
// Reason for the discard in the next kernel: the boxes of a pair share a point. It lies in both
// bodies' boxes, so each element meets the intersection of the two.

@group(0) @binding(0) var<storage, read> nodes: array<Node>;
@group(0) @binding(1) var<storage, read> bodies: array<Body>;
@group(0) @binding(2) var<storage, read> ignored: array<NodePair>;
@group(0) @binding(3) var<storage, read_write> reaches: array<Reach>;
@group(0) @binding(4) var<storage, read_write> tallies: array<atomic<u32>>;
@group(0) @binding(5) var<uniform> params: Params;

// The most nodes that one invocation visits: some drivers stop loops after 65,536 steps.
const MOST_VISITS: u32 = 16384u;

// The reach of this invocation's body, as found so far.
var<private> found: Box;

fn visit(body: u32, other: u32) {
    if other == body || bodies[other].root == NO_ROOT || !meets(body, other) {
        return;
    }
    let mine = nodes[bodies[body].root];
    let theirs = nodes[bodies[other].root];
    if overlap(box_of(mine), box_of(theirs)) {
        found.low = min(found.low, max(mine.low, theirs.low));
        found.high = max(found.high, min(mine.high, theirs.high));
    }
}

// `params.first`: the top of the tree over bodies; `params.count`: bodies.
@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let body = group_number(group) * 64u + lane;
    if body >= params.count {
        return;
    }
    found = empty_box();
    let root = bodies[body].root;
    if root == NO_ROOT {
        reaches[body] = Reach(found.low, found.high);
        return;
    }
    let own = box_of(nodes[root]);
    if bodies[body].within != 0u {
        found = own;
    }
    if params.first == NO_ROOT {
        for (var other = 0u; other < params.count; other++) {
            visit(body, other);
        }
    } else {
        // Eight children per level: seven wait while one is walked, and no tree over bodies has
        // more than eleven levels.
        var stack: array<u32, 88>;
        stack[0] = params.first;
        var n_waiting = 1u;
        for (var visits = 0u; visits < MOST_VISITS && n_waiting > 0u; visits++) {
            n_waiting--;
            let node = nodes[stack[n_waiting]];
            if !overlap(own, box_of(node)) {
                continue;
            }
            if (node.shape & GATE) != 0u {
                visit(body, node.first_child);
                continue;
            }
            for (var k = 0u; k < (node.shape & CHILDREN); k++) {
                stack[n_waiting] = node.first_child + k;
                n_waiting++;
            }
        }
        if n_waiting > 0u {
            found = own;
        }
    }
    reaches[body] = Reach(found.low, found.high);
    if all(found.low <= found.high) {
        for (var axis = 0u; axis < 3u; axis++) {
            atomicMax(&tallies[axis], ~found.low[axis]);
            atomicMax(&tallies[3u + axis], found.high[axis]);
        }
    }
}
