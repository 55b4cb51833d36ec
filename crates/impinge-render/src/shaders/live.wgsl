// Uniform data of the live shaders: `ViewUniform` of live/pipelines.rs.
struct View {
    // Axes of the viewer; `w` moves the eye to 0.
    right: vec4<f32>,
    up: vec4<f32>,
    back: vec4<f32>,
    // Factors of x and y; a and b of depth a z + b. Depth is 1 at the eye and 0 far away.
    projection: vec4<f32>,
    // The scene's up axis as the viewer sees it; 1 in perspective, else 0.
    sky: vec4<f32>,
    // Width and height of the target in pixels; width of lines in pixels; opacity of what other faces hide.
    screen: vec4<f32>,
    // Colour and opacity of lines.
    line: vec4<f32>,
    // 1 to draw only marked faces; 0 for all faces.
    only_marked: vec4<u32>,
}

@group(0) @binding(0) var<uniform> view: View;

fn seen_from_eye(point: vec3<f32>) -> vec3<f32> {
    let p = vec4<f32>(point, 1.0);
    return vec3<f32>(dot(view.right, p), dot(view.up, p), dot(view.back, p));
}

fn clip(seen: vec3<f32>) -> vec4<f32> {
    let scaled = vec3<f32>(view.projection.xy * seen.xy, view.projection.z * seen.z + view.projection.w);
    return vec4<f32>(scaled, select(1.0, -seen.z, view.sky.w > 0.5));
}

// Behind the viewer: a triangle with these corners is not drawn.
fn nowhere() -> vec4<f32> {
    return vec4<f32>(0.0, 0.0, 2.0, 1.0);
}

// The same point drawn as if it were nearer to the viewer, by this share of its distance.
fn nearer(at: vec4<f32>, share: f32) -> vec4<f32> {
    let raised = select(at.z + 0.1 * share, at.z * (1.0 + share), view.sky.w > 0.5);
    return vec4<f32>(at.xy, raised, at.w);
}
