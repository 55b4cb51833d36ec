// Computes the box of an inner node or gate from the boxes of its children.
fn refit(node_ix: u32) {
    let node = nodes[node_ix];
    var first = node.first_child;
    if (node.shape & GATE) != 0u {
        first = bodies[first].root;
    }
    var low = vec3<u32>(0xffffffffu);
    var high = vec3<u32>(0u);
    for (var child = first; child < first + (node.shape & CHILDREN); child++) {
        low = min(low, nodes[child].low);
        high = max(high, nodes[child].high);
    }
    nodes[node_ix].low = low;
    nodes[node_ix].high = high;
}
