// Lengths that products certify, whatever the device's rounding: `docs/exactness.md`, "Safe
// distances on the GPU".

// Bounds of the relative error of n . V, of n . n, and of what is divided; see the proof.
const OF_PRODUCT: f32 = 0x1p-19f;

fn magnitude(bits: vec3<u32>) -> u32 {
    let each = bits & vec3<u32>(0x7fffffffu);
    return max(max(each.x, each.y), each.z);
}

fn dot3(d: vec3<f32>, e: vec3<f32>) -> f32 {
    return d.x * e.x + d.y * e.y + d.z * e.z;
}

fn cross3(d: vec3<f32>, e: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(d.y * e.z - d.z * e.y, d.z * e.x - d.x * e.z, d.x * e.y - d.y * e.x);
}

// The power of two that brings a size into [1, 2), for sizes from 2^-126 to 2^126.
fn scale_of(size: f32) -> f32 {
    return bitcast<f32>((254u - (bitcast<u32>(size) >> 23u)) << 23u);
}
