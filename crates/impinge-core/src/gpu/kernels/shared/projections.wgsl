// Triangles whose images are apart after one coordinate is dropped, in the same steps as
// `impinge_exact::filter::projections` on the CPU: neighbours in a flat mesh lie in one plane, and
// every determinant of the other filters is zero.
//
// Every value is a determinant of two differences of input points. Bound and proof:
// `docs/exactness.md`, "The GPU filter", "Projections".

// The largest error of two determinants together, where no difference is larger than `widest`.
fn planar_bound(widest: f32, slack: f32) -> f32 {
    let wide = widest + slack;
    return wide * (BOUND * wide + 8.0 * slack);
}

fn cross2(d: vec2<f32>, e: vec2<f32>) -> f32 {
    return d.x * e.y - d.y * e.x;
}

// Whether all of b is more than `above` over the line of an edge, or less than `below`.
fn is_beyond(origin: vec2<f32>, edge: vec2<f32>, b0: vec2<f32>, b1: vec2<f32>, b2: vec2<f32>, above: f32,
    below: f32) -> bool {
    let x = cross2(edge, b0 - origin);
    let y = cross2(edge, b1 - origin);
    let z = cross2(edge, b2 - origin);
    return min(min(x, y), z) > above || max(max(x, y), z) < below;
}

// Whether the line of an edge of a has b strictly on one side, and a not.
fn parts(a0: vec2<f32>, a1: vec2<f32>, a2: vec2<f32>, b0: vec2<f32>, b1: vec2<f32>, b2: vec2<f32>,
    bound: f32) -> bool {
    // How far the vertex opposite an edge is from the edge's line: for all three edges, twice the
    // area.
    let own = cross2(a0 - a2, a1 - a0);
    let above = max(own, 0.0) + bound;
    let below = min(own, 0.0) - bound;
    return is_beyond(a0, a1 - a0, b0, b1, b2, above, below)
        || is_beyond(a1, a2 - a1, b0, b1, b2, above, below)
        || is_beyond(a2, a0 - a2, b0, b1, b2, above, below);
}

fn parted_in_plane(a0: vec2<f32>, a1: vec2<f32>, a2: vec2<f32>, b0: vec2<f32>, b1: vec2<f32>, b2: vec2<f32>,
    bound: f32) -> bool {
    return parts(a0, a1, a2, b0, b1, b2, bound) || parts(b0, b1, b2, a0, a1, a2, bound);
}

// Whether two triangles are certainly apart in some coordinate plane.
fn apart_in_a_plane(a0: vec3<f32>, a1: vec3<f32>, a2: vec3<f32>, b0: vec3<f32>, b1: vec3<f32>, b2: vec3<f32>,
    slack: f32) -> bool {
    let low = min(min(min(a0, a1), min(a2, b0)), min(b1, b2));
    let high = max(max(max(a0, a1), max(a2, b0)), max(b1, b2));
    let widest = size(high - low);
    if widest < SMALLEST {
        return false;
    }
    let bound = planar_bound(widest, slack);
    return parted_in_plane(a0.xy, a1.xy, a2.xy, b0.xy, b1.xy, b2.xy, bound)
        || parted_in_plane(a0.yz, a1.yz, a2.yz, b0.yz, b1.yz, b2.yz, bound)
        || parted_in_plane(a0.zx, a1.zx, a2.zx, b0.zx, b1.zx, b2.zx, bound);
}

// Whether the angles between a0 and a1 and between b0 and b1 certainly share no ray.
fn angles_part(a0: vec2<f32>, a1: vec2<f32>, b0: vec2<f32>, b1: vec2<f32>, bound: f32) -> bool {
    let turn_a = cross2(a0, a1);
    let turn_b = cross2(b0, b1);
    if abs(turn_a) <= bound || abs(turn_b) <= bound {
        return false;
    }
    // Both angles counterclockwise.
    let p0 = select(a1, a0, turn_a > 0.0);
    let p1 = select(a0, a1, turn_a > 0.0);
    let q0 = select(b1, b0, turn_b > 0.0);
    let q1 = select(b0, b1, turn_b > 0.0);
    let s = cross2(p0, q0);
    let t = cross2(p0, q1);
    let u = cross2(p1, q0);
    let w = cross2(p1, q1);
    // Neither edge of b in the angle of a, and neither edge of a in the angle of b.
    return (s < -bound || u > bound) && (t < -bound || w > bound)
        && (s > bound || t < -bound) && (u > bound || w < -bound);
}

// Whether the triangles v, a and v, b certainly meet in v alone, because seen along a coordinate
// axis they share no ray.
fn angles_apart(v: vec3<f32>, a0: vec3<f32>, a1: vec3<f32>, b0: vec3<f32>, b1: vec3<f32>, slack: f32) -> bool {
    let p0 = a0 - v;
    let p1 = a1 - v;
    let q0 = b0 - v;
    let q1 = b1 - v;
    let widest = max(max(size(p0), size(p1)), max(size(q0), size(q1)));
    if widest < SMALLEST {
        return false;
    }
    let bound = planar_bound(widest, slack);
    return angles_part(p0.xy, p1.xy, q0.xy, q1.xy, bound)
        || angles_part(p0.yz, p1.yz, q0.yz, q1.yz, bound)
        || angles_part(p0.zx, p1.zx, q0.zx, q1.zx, bound);
}

fn sides_part(edge: vec2<f32>, p: vec2<f32>, q: vec2<f32>, bound: f32) -> bool {
    let of_p = cross2(edge, p);
    let of_q = cross2(edge, q);
    return (of_p > bound && of_q < -bound) || (of_p < -bound && of_q > bound);
}

// Whether the triangles u, v, p and u, v, q certainly share the edge uv and nothing else, because
// seen along a coordinate axis p and q lie on different sides of it.
fn sides_apart(u: vec3<f32>, v: vec3<f32>, p: vec3<f32>, q: vec3<f32>, slack: f32) -> bool {
    let edge = v - u;
    let to_p = p - u;
    let to_q = q - u;
    let widest = max(size(edge), max(size(to_p), size(to_q)));
    if widest < SMALLEST {
        return false;
    }
    let bound = planar_bound(widest, slack);
    return sides_part(edge.xy, to_p.xy, to_q.xy, bound)
        || sides_part(edge.yz, to_p.yz, to_q.yz, bound)
        || sides_part(edge.zx, to_p.zx, to_q.zx, bound);
}
