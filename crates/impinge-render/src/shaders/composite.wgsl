
// Composes the picture: the visible faces, darkened by occlusion; faintly over them the faces that show through; behind
// them the background. Colours are premultiplied by alpha.

@group(0) @binding(1) var scene: texture_2d<f32>;
@group(0) @binding(2) var through: texture_2d<f32>;
@group(0) @binding(3) var occlusion: texture_2d<f32>;

@vertex
fn vertex(@builtin(vertex_index) ix: u32) -> @builtin(position) vec4<f32> {
    return over_all(ix);
}

// The mean over those pixels of a 4 x 4 block that have about the same depth.
fn brightness(pixel: vec2<i32>) -> f32 {
    let size = vec2<i32>(textureDimensions(occlusion));
    let here = textureLoad(occlusion, pixel, 0).xy;
    if here.y == 0.0 {
        return 1.0;
    }
    var sum = vec2<f32>(0.0);
    for (var y = -2; y < 2; y++) {
        for (var x = -2; x < 2; x++) {
            let at = pixel + vec2<i32>(x, y);
            if any(at < vec2<i32>(0)) || any(at >= size) {
                continue;
            }
            let there = textureLoad(occlusion, at, 0).xy;
            let alike = max(1.0 - 8.0 * abs(there.y - here.y), 0.0);
            let weight = select(0.0, alike, there.y > 0.0);
            sum += weight * vec2<f32>(there.x, 1.0);
        }
    }
    return sum.x / sum.y;
}

@fragment
fn fragment(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<i32>(at.xy);
    var seen = textureLoad(scene, pixel, 0);
    seen = vec4<f32>(seen.rgb * brightness(pixel), seen.a);
    let hidden = textureLoad(through, pixel, 0);
    let part = frame.amounts.w;
    let mixed = seen.rgb * (1.0 - part * hidden.a) + part * hidden.rgb;
    let alpha = seen.a * (1.0 - part * hidden.a) + part * hidden.a;
    let down = (at.y + frame.picture.w) / frame.picture.y;
    let background = linear(mix(frame.background_top.rgb, frame.background_bottom.rgb, down));
    return vec4<f32>(mixed + (1.0 - alpha) * background, 1.0);
}
