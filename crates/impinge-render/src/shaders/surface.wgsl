
// Faces, lit from both sides: light from the sky and from the ground, a key light from the upper left of the
// viewer, a fill light from the right. A face turned to the viewer is drawn about as bright as its colour.

struct Corner {
    @location(0) position: vec3<f32>,
    @location(1) normal: vec4<f32>,
    @location(2) color: vec4<f32>,
}

struct Shaded {
    @builtin(position) clip: vec4<f32>,
    @location(0) seen_from: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) @interpolate(flat) color: vec3<f32>,
}

@vertex
fn vertex(corner: Corner) -> Shaded {
    let p = vec4<f32>(corner.position, 1.0);
    let seen = vec3<f32>(dot(frame.right, p), dot(frame.up, p), dot(frame.back, p));
    let n = corner.normal.xyz;
    var out: Shaded;
    let scaled = vec3<f32>(frame.projection.xy * seen.xy, frame.projection.z * seen.z + frame.projection.w);
    out.clip = vec4<f32>(scaled, select(1.0, -seen.z, frame.sky.w > 0.5));
    out.seen_from = select(vec3<f32>(0.0, 0.0, 1.0), -seen, frame.sky.w > 0.5);
    out.normal = vec3<f32>(dot(frame.right.xyz, n), dot(frame.up.xyz, n), dot(frame.back.xyz, n));
    out.color = linear(corner.color.rgb);
    return out;
}

@fragment
fn fragment(in: Shaded, @builtin(front_facing) is_front: bool) -> @location(0) vec4<f32> {
    // Opposite normals of corners may cancel when interpolated.
    let long_enough = dot(in.normal, in.normal) > 1e-8;
    let outward = select(vec3<f32>(0.0, 0.0, 1.0), normalize(in.normal), long_enough);
    let n = select(-outward, outward, is_front);
    let to_eye = normalize(in.seen_from);
    let key = normalize(vec3<f32>(-0.5, 0.65, 0.8));
    let fill = normalize(vec3<f32>(0.8, 0.1, 0.5));

    let from_sky = mix(0.2, 0.46, 0.5 + 0.5 * dot(n, frame.sky.xyz));
    // A wide light: its shade begins a little beyond the horizon.
    let from_key = 0.78 * max((dot(n, key) + 0.15) / 1.15, 0.0);
    let from_fill = 0.16 * max(dot(n, fill), 0.0);
    let half_way = normalize(key + to_eye);
    let gloss = 0.05 * pow(max(dot(n, half_way), 0.0), 40.0);
    let light = in.color * (from_sky + from_key + from_fill) + vec3<f32>(gloss);
    return vec4<f32>(light, 1.0);
}
