
// Faces of one body. No vertex buffer: a vertex reads the three corners of its face from storage buffers, so that per
// frame only positions and one bit per face go to the device. The light of `surface.wgsl` without gloss: it is the same
// on all pixels of a flat face, so the vertex shader computes it.

struct Body {
    // sRGB of faces that are not marked, and of those that are.
    other: vec4<f32>,
    marked: vec4<f32>,
    // 1 if faces may have colours of their own.
    has_colors: vec4<u32>,
    // What is subtracted from positions; with what the difference is multiplied.
    place: vec4<f32>,
}

@group(1) @binding(0) var<uniform> body: Body;
// x, y, z of each vertex.
@group(1) @binding(1) var<storage, read> positions: array<f32>;
// The corners of each face; `w` is 1 if it is drawn only where it is marked.
@group(1) @binding(2) var<storage, read> faces: array<vec4<u32>>;
// One bit per face, the lowest bit first.
@group(1) @binding(3) var<storage, read> marks: array<u32>;
// sRGB per face, 8 bits each, red in the lowest; the highest 8 bits are 0 for a face without a colour of its own.
@group(1) @binding(4) var<storage, read> colors: array<u32>;

struct Shaded {
    @builtin(position) @invariant clip: vec4<f32>,
    @location(0) @interpolate(flat) color: vec3<f32>,
}

fn corner(vertex: u32) -> vec3<f32> {
    let at = 3u * vertex;
    let point = vec3<f32>(positions[at], positions[at + 1u], positions[at + 2u]);
    return (point - body.place.xyz) * body.place.w;
}

fn linear(srgb: vec3<f32>) -> vec3<f32> {
    let low = srgb / 12.92;
    let high = pow((srgb + 0.055) / 1.055, vec3<f32>(2.4));
    return select(high, low, srgb <= vec3<f32>(0.04045));
}

fn encoded(light: vec3<f32>) -> vec3<f32> {
    let low = light * 12.92;
    let high = 1.055 * pow(max(light, vec3<f32>(0.0)), vec3<f32>(1.0 / 2.4)) - 0.055;
    return clamp(select(high, low, light <= vec3<f32>(0.0031308)), vec3<f32>(0.0), vec3<f32>(1.0));
}

fn own_color(face: u32, is_marked: bool) -> vec3<f32> {
    if body.has_colors.x == 1u {
        let own = unpack4x8unorm(colors[face]);
        if own.a > 0.0 {
            return own.rgb;
        }
    }
    return select(body.other.rgb, body.marked.rgb, is_marked);
}

fn shade(ix: u32, leave_unmarked: bool) -> Shaded {
    let face = ix / 3u;
    let named = faces[face];
    let is_marked = ((marks[face >> 5u] >> (face & 31u)) & 1u) == 1u;
    var out: Shaded;
    out.clip = nowhere();
    out.color = vec3<f32>(0.0);
    if !is_marked && (leave_unmarked || named.w == 1u) {
        return out;
    }
    let a = seen_from_eye(corner(named.x));
    let b = seen_from_eye(corner(named.y));
    let c = seen_from_eye(corner(named.z));
    var here = a;
    let which = ix % 3u;
    if which == 1u {
        here = b;
    }
    if which == 2u {
        here = c;
    }
    out.clip = clip(here);
    if is_marked {
        // Slightly nearer, so that a marked face wins against another one in the same place.
        out.clip = nearer(out.clip, 1e-5);
    }
    let across = cross(b - a, c - a);
    let squared = dot(across, across);
    var n = select(vec3<f32>(0.0, 0.0, 1.0), across * inverseSqrt(max(squared, 1e-37)), squared > 1e-37);
    let to_eye = select(vec3<f32>(0.0, 0.0, 1.0), -a, view.sky.w > 0.5);
    n = select(-n, n, dot(n, to_eye) >= 0.0);
    let key = normalize(vec3<f32>(-0.5, 0.65, 0.8));
    let fill = normalize(vec3<f32>(0.8, 0.1, 0.5));
    let from_sky = mix(0.2, 0.46, 0.5 + 0.5 * dot(n, view.sky.xyz));
    let from_key = 0.78 * max((dot(n, key) + 0.15) / 1.15, 0.0);
    let from_fill = 0.16 * max(dot(n, fill), 0.0);
    let light = linear(own_color(face, is_marked)) * (from_sky + from_key + from_fill);
    out.color = encoded(light);
    return out;
}

@vertex
fn vertex(@builtin(vertex_index) ix: u32) -> Shaded {
    return shade(ix, view.only_marked.x == 1u);
}

@vertex
fn vertex_marked(@builtin(vertex_index) ix: u32) -> Shaded {
    return shade(ix, true);
}

@fragment
fn fragment(in: Shaded) -> @location(0) vec4<f32> {
    return vec4<f32>(in.color, 1.0);
}

@fragment
fn fragment_hidden(in: Shaded) -> @location(0) vec4<f32> {
    return vec4<f32>(in.color, view.screen.w);
}
