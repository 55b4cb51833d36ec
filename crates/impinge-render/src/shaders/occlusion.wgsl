
// How much of the sky nearby faces hide from each pixel: samples on a spiral in the depth buffer, weighted by
// how steeply they rise over the pixel's own plane and how near they are. After McGuire, Osman, Bukowski and
// Hennessy, "The Alchemy Screen-Space Ambient Obscurance Algorithm" (2011), with another falloff. The spiral is
// rotated differently for each pixel of a 4 x 4 block, over which `composite` takes the mean.

@group(0) @binding(1) var depths: texture_depth_multisampled_2d;

const N_SAMPLES: i32 = 20;

@vertex
fn vertex(@builtin(vertex_index) ix: u32) -> @builtin(position) vec4<f32> {
    return over_all(ix);
}

// The position of the face in this pixel, relative to the eye; `w` is 0 if there is no face.
fn seen_at(pixel: vec2<i32>) -> vec4<f32> {
    let size = vec2<i32>(textureDimensions(depths));
    if any(pixel < vec2<i32>(0)) || any(pixel >= size) {
        return vec4<f32>(0.0);
    }
    let depth = textureLoad(depths, pixel, 0);
    if depth >= 1.0 {
        return vec4<f32>(0.0);
    }
    let at = (vec2<f32>(pixel) + 0.5 + frame.picture.zw) / frame.picture.xy;
    let across = vec2<f32>(2.0 * at.x - 1.0, 1.0 - 2.0 * at.y) / frame.projection.xy;
    if frame.sky.w > 0.5 {
        let z = -frame.projection.w / (depth + frame.projection.z);
        return vec4<f32>(across * -z, z, 1.0);
    }
    return vec4<f32>(across, (depth - frame.projection.w) / frame.projection.z, 1.0);
}

// The direction along the surface, taken from the neighbour whose position is closer in depth.
fn slope(here: vec3<f32>, one: vec4<f32>, other: vec4<f32>) -> vec3<f32> {
    let forward = one.xyz - here;
    let backward = here - other.xyz;
    let take_other = one.w == 0.0 || (other.w > 0.0 && abs(backward.z) < abs(forward.z));
    return select(forward, backward, take_other);
}

@fragment
fn fragment(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<i32>(at.xy);
    let here = seen_at(pixel);
    if here.w == 0.0 {
        return vec4<f32>(1.0, 0.0, 0.0, 0.0);
    }
    let x = slope(here.xyz, seen_at(pixel + vec2<i32>(1, 0)), seen_at(pixel - vec2<i32>(1, 0)));
    let y = slope(here.xyz, seen_at(pixel - vec2<i32>(0, 1)), seen_at(pixel + vec2<i32>(0, 1)));
    let across = cross(x, y);
    let n = select(vec3<f32>(0.0, 0.0, 1.0), normalize(across), dot(across, across) > 0.0);

    let reach = frame.amounts.x;
    let distance = select(1.0, -here.z, frame.sky.w > 0.5);
    let reach_pixels = min(0.5 * frame.picture.y * frame.projection.y * reach / distance, frame.amounts.y);
    let turned = vec2<i32>(pixel + vec2<i32>(frame.picture.zw)) & vec2<i32>(3);
    // Rotations 0 to 15; neighbouring pixels get very different ones.
    let turn = f32((turned.x * 5 + turned.y * 11) & 15) * (6.2831853 / 16.0);
    var sum = 0.0;
    for (var k = 0; k < N_SAMPLES; k++) {
        let part = (f32(k) + 0.5) / f32(N_SAMPLES);
        let angle = turn + 2.3999632 * f32(k);
        let away = max(reach_pixels * part, 1.0) * vec2<f32>(cos(angle), sin(angle));
        let there = seen_at(pixel + vec2<i32>(round(away)));
        let v = there.xyz - here.xyz;
        let squared = dot(v, v);
        let near = max(1.0 - squared / (reach * reach), 0.0);
        let rise = max(dot(v, n) * inverseSqrt(max(squared, 1e-12)) - 0.08, 0.0);
        sum += select(0.0, near * rise, there.w > 0.0);
    }
    let lost = min(2.2 * frame.amounts.z * sum / f32(N_SAMPLES), 1.0);
    return vec4<f32>(1.0 - lost, 1.0 + abs(here.z), 0.0, 0.0);
}
