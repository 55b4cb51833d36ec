// Triangles of one body that share vertices by id, in the same steps as
// `impinge_exact::filter::neighbours` on the CPU: whether they meet beyond the part that they
// share.
//
// One vertex v: if one plane has the other triangle's two vertices on one side, no. If each plane
// has the other's vertices on different sides, each triangle contains the start of one ray from v
// along the line where the planes meet. Both rays are the same, and the answer is yes, if and only
// if exactly one of the two first vertices is above the other's plane (`docs/exactness.md`, "Shared
// vertex").
//
//        a1       b0
//          \     /            the second and third vertex
//      -----v---/----> line   follow v in each triangle's turn
//          / \ /
//        b1   a0
//
// Two: no, unless coplanar; then no if the third vertices certainly lie on different sides. Three:
// yes, always.

// One bit per vertex of `a`, set when `b` names it too.
fn shared_by(a: vec3<u32>, b: vec3<u32>) -> u32 {
    return u32(any(vec3<u32>(a.x) == b))
        | (u32(any(vec3<u32>(a.y) == b)) << 1u)
        | (u32(any(vec3<u32>(a.z) == b)) << 2u);
}

fn is_repeating(ids: vec3<u32>) -> bool {
    return any(ids == ids.yzx);
}

fn neighbours(ids_a: vec3<u32>, ids_b: vec3<u32>, a0: vec3<f32>, a1: vec3<f32>, a2: vec3<f32>,
    b0: vec3<f32>, b1: vec3<f32>, b2: vec3<f32>, slack: f32) -> i32 {
    if is_repeating(ids_a) || is_repeating(ids_b) {
        return UNSURE;
    }
    let of_a = shared_by(ids_a, ids_b);
    let of_b = shared_by(ids_b, ids_a);
    switch countOneBits(of_a) {
        case 1u: {
            let a = turned(a0, a1, a2, firstTrailingBit(of_a), false);
            let b = turned(b0, b1, b2, firstTrailingBit(of_b), false);
            let plane_a = normal(a.q - a.p, a.r - a.p, slack);
            let plane_b = normal(b.q - b.p, b.r - b.p, slack);
            let b_q = side(plane_a, b.q - a.p, slack);
            let b_r = side(plane_a, b.r - a.p, slack);
            let a_q = side(plane_b, a.q - b.p, slack);
            let a_r = side(plane_b, a.r - b.p, slack);
            if b_q * b_r > 0 || a_q * a_r > 0 {
                return NO;
            }
            if b_q * b_r < 0 && a_q * a_r < 0 {
                return select(NO, YES, a_q != b_q);
            }
            return select(UNSURE, NO, angles_apart(a.p, a.q, a.r, b.q, b.r, slack));
        }
        case 2u: {
            let a = turned(a0, a1, a2, firstTrailingBit(of_a ^ 7u), false);
            let b = turned(b0, b1, b2, firstTrailingBit(of_b ^ 7u), false);
            let sign = determinant_sign(a.r - a.q, a.p - a.q, b.p - a.q, slack);
            if sign != 0 {
                return NO;
            }
            return select(UNSURE, NO, sides_apart(a.q, a.r, a.p, b.p, slack));
        }
        case 3u: {
            return YES;
        }
        default: {
            return UNSURE;
        }
    }
}
