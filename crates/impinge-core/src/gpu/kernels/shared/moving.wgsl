// Boxes of what moves during a step: one at the start and one at the end.
//
//   positions   all vertices at the start | all vertices at the end
//   nodes       boxes at the start        | boxes at the end; children are named in the first half only

const ENDS: u32 = 2u;

struct Extent {
    start: Box,
    end: Box,
}

// Whether two moving boxes are not beside each other, on the same side of an axis, at both ends. If
// they are, they are so at any time between, for what moves linearly is within the interpolation of
// its boxes.
fn extents_meet(a: Extent, b: Extent) -> bool {
    let a_first = (a.start.high < b.start.low) & (a.end.high < b.end.low);
    let b_first = (b.start.high < a.start.low) & (b.end.high < a.end.low);
    return !any(a_first | b_first);
}

fn node_extent(node: u32) -> Extent {
    let at_end = node + arrayLength(&nodes) / ENDS;
    return Extent(box_of(nodes[node]), box_of(nodes[at_end]));
}
