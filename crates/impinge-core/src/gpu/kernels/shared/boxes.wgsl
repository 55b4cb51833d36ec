// Boxes in ordered keys: the bits of an f32, mapped so that integers order as the floats do.
//
//   sign 0   1 b30 … b0       (set the sign bit)
//   sign 1   ~b31 … ~b0       (flip everything)        -0 is taken as +0
//
// Integers are exact on every device: no flushing of subnormals, no rounding, no NaN. Moving by two keys moves
// by at least one f32 (the key of -0 is never used, hence two).

fn key(bits: u32) -> u32 {
    let canonical = select(bits, 0u, bits == FLAG);
    return select(canonical | FLAG, ~canonical, canonical >= FLAG);
}

struct Box {
    low: vec3<u32>,
    high: vec3<u32>,
}

fn empty_box() -> Box {
    return Box(vec3<u32>(0xffffffffu), vec3<u32>(0u));
}

fn overlap(a: Box, b: Box) -> bool {
    return all(a.low <= b.high) && all(b.low <= a.high);
}

fn box_of(node: Node) -> Box {
    return Box(node.low, node.high);
}
