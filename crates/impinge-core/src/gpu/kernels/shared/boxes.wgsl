// Boxes in ordered keys: the bits of an f32, mapped so that integers order as the floats do.
//
//   sign 0   1 b30 … b0       (set the sign bit)
//   sign 1   ~b31 … ~b0       (flip everything)        -0 is taken as +0
//
// Integers are exact on every device: no flushing of subnormals, no rounding, no NaN. Moving by two
// keys moves by at least one f32 (the key of -0 is never used, hence two).

fn key(bits: u32) -> u32 {
    let canonical = select(bits, 0u, bits == FLAG);
    return select(canonical | FLAG, ~canonical, canonical >= FLAG);
}

struct Box {
    low: vec3<u32>,
    high: vec3<u32>,
}

fn float_of(key: u32) -> f32 {
    return bitcast<f32>(select(~key, key & ~FLAG, key >= FLAG));
}

// A key that is lower by a length and more, and one that is higher: the sum is off by at most one
// f32, or by a subnormal number, which the length allows for. Numbers that have no room for it stay
// as they are but for two keys.
fn lowered(low: u32, reach: f32) -> u32 {
    let inside = clamp(low, 0x017fffffu, 0xfe800000u); // up to 2^126
    return min(low, key(bitcast<u32>(float_of(inside) - reach))) - 2u;
}

fn raised(high: u32, reach: f32) -> u32 {
    let inside = clamp(high, 0x017fffffu, 0xfe800000u);
    return max(high, key(bitcast<u32>(float_of(inside) + reach))) + 2u;
}

// A box widened on all sides by a length, given by its bits.
fn widened(box: Box, reach: u32) -> Box {
    if reach == 0u {
        return box;
    }
    let by = bitcast<f32>(reach);
    return Box(
        vec3<u32>(lowered(box.low.x, by), lowered(box.low.y, by), lowered(box.low.z, by)),
        vec3<u32>(raised(box.high.x, by), raised(box.high.y, by), raised(box.high.z, by)),
    );
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
