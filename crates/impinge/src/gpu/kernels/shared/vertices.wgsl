// Vertices as keys. Positions are three words a vertex, the bits of x, y, z.

fn vertex_key(vertex: u32) -> vec3<u32> {
    let word = 3u * vertex;
    return vec3<u32>(key(positions[word]), key(positions[word + 1u]), key(positions[word + 2u]));
}
