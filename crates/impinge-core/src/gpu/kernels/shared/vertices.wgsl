// Vertices as keys. Positions are three words per vertex: the bits of x, y, z.

fn vertex_key(vertex: u32) -> vec3<u32> {
    let word = 3u * vertex;
    return vec3<u32>(key(positions[word]), key(positions[word + 1u]), key(positions[word + 2u]));
}

// The box of an element, widened by `slack` keys. A triangle repeats its last corner.
fn element_box(corner: vec4<u32>, slack: u32) -> Box {
    let p = vertex_key(corner.x);
    let q = vertex_key(corner.y);
    let r = vertex_key(corner.z);
    var low = min(min(p, q), r);
    var high = max(max(p, q), r);
    if corner.w != corner.z {
        let s = vertex_key(corner.w);
        low = min(low, s);
        high = max(high, s);
    }
    return Box(low - slack, high + slack);
}
