// Computes the boxes of an inner node or gate from those of its children.
fn refit(node_ix: u32) {
    let node = nodes[node_ix];
    var first_child = node.first_child;
    if (node.shape & GATE) != 0u {
        first_child = bodies[first_child].root;
    }
    for (var end = 0u; end < ENDS; end++) {
        let offset = end * (arrayLength(&nodes) / ENDS);
        let first = offset + first_child;
        var low = vec3<u32>(0xffffffffu);
        var high = vec3<u32>(0u);
        for (var child = first; child < first + (node.shape & CHILDREN); child++) {
            low = min(low, nodes[child].low);
            high = max(high, nodes[child].high);
        }
        nodes[offset + node_ix].low = low;
        nodes[offset + node_ix].high = high;
    }
}
