// Whether two elements name a common vertex.
fn shares_vertex(a: vec4<u32>, b: vec4<u32>) -> bool {
    return any(a == b) || any(a == b.yzwx) || any(a == b.zwxy) || any(a == b.wxyz);
}
