// Boxes of what stands still: one per node.

const ENDS: u32 = 1u;

alias Extent = Box;

fn extents_meet(a: Extent, b: Extent) -> bool {
    return overlap(a, b);
}

fn node_extent(node: u32) -> Extent {
    return box_of(nodes[node]);
}
