
// Segments as rectangles of a constant width in pixels, two triangles each. No vertex buffer: the ends come from a
// storage buffer.

// The two ends of each segment; `w` is not used.
@group(1) @binding(0) var<storage, read> ends: array<vec4<f32>>;

// The nearest distance from the eye at which lines are drawn.
const NEAR: f32 = 1e-4;

fn in_front(seen: vec3<f32>, other: vec3<f32>) -> vec3<f32> {
    if view.sky.w < 0.5 || seen.z <= -NEAR || other.z > -NEAR {
        return seen;
    }
    return mix(seen, other, (seen.z + NEAR) / (seen.z - other.z));
}

@vertex
fn vertex(@builtin(vertex_index) ix: u32) -> @builtin(position) vec4<f32> {
    let segment = ix / 6u;
    // Corners 0 1 2 and 2 1 3: the lowest bit chooses the end, the next one the side.
    let turn = ix % 6u;
    var which = turn;
    if turn >= 3u {
        // 2, 1, 3.
        which = select(select(3u, 1u, turn == 4u), 2u, turn == 3u);
    }
    let from_eye = seen_from_eye(ends[2u * segment].xyz);
    let to_eye = seen_from_eye(ends[2u * segment + 1u].xyz);
    if view.sky.w > 0.5 && from_eye.z > -NEAR && to_eye.z > -NEAR {
        return nowhere();
    }
    let a = clip(in_front(from_eye, to_eye));
    let b = clip(in_front(to_eye, from_eye));
    let half_size = 0.5 * view.screen.xy;
    let along = b.xy / b.w * half_size - a.xy / a.w * half_size;
    let length_squared = dot(along, along);
    let unit = select(vec2<f32>(1.0, 0.0), along * inverseSqrt(max(length_squared, 1e-12)), length_squared > 1e-12);
    let side = select(-1.0, 1.0, (which & 2u) == 2u);
    let end = select(-1.0, 1.0, (which & 1u) == 1u);
    // Half a width beyond both ends, so that the joints of a curve have no gaps.
    let offset = 0.5 * view.screen.z * (side * vec2<f32>(-unit.y, unit.x) + end * unit);
    var at = a;
    if (which & 1u) == 1u {
        at = b;
    }
    // Slightly nearer than the faces in which the segment lies.
    return nearer(vec4<f32>(at.xy + offset / half_size * at.w, at.z, at.w), 3e-5);
}

@fragment
fn fragment() -> @location(0) vec4<f32> {
    return view.line;
}

@fragment
fn fragment_hidden() -> @location(0) vec4<f32> {
    return vec4<f32>(view.line.rgb, view.line.a * view.screen.w);
}
