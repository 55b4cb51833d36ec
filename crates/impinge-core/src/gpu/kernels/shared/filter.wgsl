// The floating-point filter: the sign of a determinant where it is certain, else 0.
//
// Constants, bounds and their proof: `docs/exactness.md`, "The GPU filter". They hold under any
// rounding direction, contraction and reassociation, with subnormals flushed or kept. The one
// determinant is (d x e) . f, where d, e, f are differences of input points, never of differences.
// For positions that the host has rounded from f64, each size grows by `slack`.

const BOUND: f32 = 0x1p-16f;
const SMALLEST: f32 = 0x1p-32f;
const LARGEST_BITS: u32 = 0x53800000u; // 2^40
const NARROWING: f32 = 0x1p-22f;

fn size(d: vec3<f32>) -> f32 {
    let m = abs(d);
    return max(max(m.x, m.y), m.z);
}

// A vector d x e and the sizes of both.
struct Normal {
    vector: vec3<f32>,
    // |d| and |e|, slack included; both 0 when one is too small.
    d: f32,
    e: f32,
}

fn normal(d: vec3<f32>, e: vec3<f32>, slack: f32) -> Normal {
    let vector = vec3<f32>(
        d.y * e.z - d.z * e.y,
        d.z * e.x - d.x * e.z,
        d.x * e.y - d.y * e.x,
    );
    let size_d = size(d);
    let size_e = size(e);
    if size_d < SMALLEST || size_e < SMALLEST {
        return Normal(vector, 0.0, 0.0);
    }
    return Normal(vector, size_d + slack, size_e + slack);
}

// The sign of (d x e) . f: 1 or -1 when certain, 0 when not.
fn side(n: Normal, f: vec3<f32>, slack: f32) -> i32 {
    let size_f = size(f);
    if n.d == 0.0 || size_f < SMALLEST {
        return 0;
    }
    let value = n.vector.x * f.x + n.vector.y * f.y + n.vector.z * f.z;
    let wide = size_f + slack;
    let bound = BOUND * (n.d * n.e * wide)
        + 4.0 * slack * (n.d * n.e + n.e * wide + wide * n.d);
    return select(0, 1, value > bound) - select(0, 1, value < -bound);
}

fn determinant_sign(d: vec3<f32>, e: vec3<f32>, f: vec3<f32>, slack: f32) -> i32 {
    return side(normal(d, e, slack), f, slack);
}
