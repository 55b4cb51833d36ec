// Triangle against triangle, in the same steps as `impinge_exact::filter` on the CPU: planes first,
// then the two edge-edge determinants of Guigue and Devillers (2003), then projections.

const YES: i32 = 1;
const NO: i32 = -1;
const UNSURE: i32 = 0;

fn all_are(signs: vec3<i32>, sign: i32) -> bool {
    return all(signs == vec3<i32>(sign));
}

// The triangle with its vertices rotated so that the one alone on its side comes first; the other
// two may be exchanged.
struct Turned {
    p: vec3<f32>,
    q: vec3<f32>,
    r: vec3<f32>,
}

// Which vertex is alone on its side.
fn lone(signs: vec3<i32>) -> u32 {
    if signs.x == signs.y {
        return 2u;
    }
    return select(0u, 1u, signs.x == signs.z);
}

fn turned(p: vec3<f32>, q: vec3<f32>, r: vec3<f32>, first: u32, exchange: bool) -> Turned {
    var t = Turned(p, q, r);
    if first == 1u {
        t = Turned(q, r, p);
    } else if first == 2u {
        t = Turned(r, p, q);
    }
    if exchange {
        return Turned(t.p, t.r, t.q);
    }
    return t;
}

// Along the line where the planes meet, a covers the interval from edge 02 to edge 01, and b from
// 01 to 02 (exchanged as needed). They meet unless one interval begins after the other has ended:
//
//        a0
//       /  \
//  ----2----1------------------> line
//  -------1'-------2'----------> line
fn triangles(a0: vec3<f32>, a1: vec3<f32>, a2: vec3<f32>, b0: vec3<f32>, b1: vec3<f32>,
    b2: vec3<f32>, slack: f32) -> i32 {
    let plane_b = normal(b1 - b0, b2 - b0, slack);
    let of_a = vec3<i32>(
        side(plane_b, a0 - b0, slack),
        side(plane_b, a1 - b0, slack),
        side(plane_b, a2 - b0, slack),
    );
    if all_are(of_a, 1) || all_are(of_a, -1) {
        return NO;
    }
    let plane_a = normal(a1 - a0, a2 - a0, slack);
    let of_b = vec3<i32>(
        side(plane_a, b0 - a0, slack),
        side(plane_a, b1 - a0, slack),
        side(plane_a, b2 - a0, slack),
    );
    if all_are(of_b, 1) || all_are(of_b, -1) {
        return NO;
    }
    if any(of_a == vec3<i32>(0)) || any(of_b == vec3<i32>(0)) {
        return select(UNSURE, NO, apart_in_a_plane(a0, a1, a2, b0, b1, b2, slack));
    }
    let lone_a = lone(of_a);
    let lone_b = lone(of_b);
    let sign_a = select(select(of_a.x, of_a.y, lone_a == 1u), of_a.z, lone_a == 2u);
    let sign_b = select(select(of_b.x, of_b.y, lone_b == 1u), of_b.z, lone_b == 2u);
    let a = turned(a0, a1, a2, lone_a, sign_b < 0);
    let b = turned(b0, b1, b2, lone_b, sign_a < 0);
    let between = b.p - a.p;
    let low = determinant_sign(a.r - a.p, b.r - b.p, between, slack);
    let high = determinant_sign(a.q - a.p, b.q - b.p, between, slack);
    if low > 0 || high < 0 {
        return NO;
    }
    if low < 0 && high > 0 {
        return YES;
    }
    return select(UNSURE, NO, apart_in_a_plane(a0, a1, a2, b0, b1, b2, slack));
}
