// Uniform data of all shaders: `FrameUniform` of pipelines.rs.
struct Frame {
    // Axes of the viewer; `w` moves the eye to 0.
    right: vec4<f32>,
    up: vec4<f32>,
    back: vec4<f32>,
    // Factors of x and y; a and b of depth a z + b.
    projection: vec4<f32>,
    // The scene's up axis as the viewer sees it; 1 in perspective, else 0.
    sky: vec4<f32>,
    // sRGB.
    background_top: vec4<f32>,
    background_bottom: vec4<f32>,
    // Width and height of the picture; first column and row of the tile.
    picture: vec4<f32>,
    // Reach of occlusion in the scene and in pixels; its strength; the visibility of hidden faces.
    amounts: vec4<f32>,
}

@group(0) @binding(0) var<uniform> frame: Frame;

fn linear(srgb: vec3<f32>) -> vec3<f32> {
    let low = srgb / 12.92;
    let high = pow((srgb + 0.055) / 1.055, vec3<f32>(2.4));
    return select(high, low, srgb <= vec3<f32>(0.04045));
}

// One triangle over all pixels.
fn over_all(ix: u32) -> vec4<f32> {
    return vec4<f32>(f32(ix & 1u) * 4.0 - 1.0, f32(ix >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}
