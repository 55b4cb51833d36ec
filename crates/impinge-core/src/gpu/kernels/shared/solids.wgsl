// A tetrahedron against a tetrahedron or a triangle, in the same steps as `impinge_exact::filter`
// on the CPU.
//
// A solid is four points. A triangle repeats its last point and has one face and three edges.
//
// Yes: a vertex certainly inside, or an edge that certainly crosses a face. No: a face with all of
// the other certainly on its outer side; or all edges certainly miss all faces, so that the
// surfaces share no point, and neither is inside the other.

struct Solid {
    points: array<vec3<f32>, 4>,
    is_triangle: bool,
}

// Where the points of one solid lie relative to each face of the other: 1 inside, -1 outside, 0
// unsure. If the other is a triangle: 1 above, -1 below, 0 unsure.
struct Sides {
    faces: array<vec4<i32>, 4>,
}

// The vertices of face k of a tetrahedron, counterclockwise as seen from vertex k if the
// tetrahedron is positively oriented.
fn face(k: u32) -> vec3<u32> {
    switch k {
        case 0u: { return vec3<u32>(1u, 3u, 2u); }
        case 1u: { return vec3<u32>(0u, 2u, 3u); }
        case 2u: { return vec3<u32>(0u, 3u, 1u); }
        default: { return vec3<u32>(0u, 1u, 2u); }
    }
}

// Edges; the first three are those of a triangle.
fn edge(k: u32) -> vec2<u32> {
    switch k {
        case 0u: { return vec2<u32>(0u, 1u); }
        case 1u: { return vec2<u32>(1u, 2u); }
        case 2u: { return vec2<u32>(0u, 2u); }
        case 3u: { return vec2<u32>(0u, 3u); }
        case 4u: { return vec2<u32>(1u, 3u); }
        default: { return vec2<u32>(2u, 3u); }
    }
}

// The first face to examine: a triangle has only the last, which has vertices 0, 1, 2.
fn first_face(solid: ptr<function, Solid>) -> u32 {
    return select(0u, 3u, (*solid).is_triangle);
}

fn sides(solid: ptr<function, Solid>, points: ptr<function, Solid>, slack: f32) -> Sides {
    var found: Sides;
    var upright = 1;
    if !(*solid).is_triangle {
        let o = (*solid).points[0];
        upright = determinant_sign((*solid).points[1] - o, (*solid).points[2] - o,
            (*solid).points[3] - o, slack);
    }
    for (var k = first_face(solid); k < 4u; k++) {
        let v = face(k);
        let o = (*solid).points[v.x];
        let plane = normal((*solid).points[v.y] - o, (*solid).points[v.z] - o, slack);
        found.faces[k] = upright * vec4<i32>(
            side(plane, (*points).points[0] - o, slack),
            side(plane, (*points).points[1] - o, slack),
            side(plane, (*points).points[2] - o, slack),
            side(plane, (*points).points[3] - o, slack),
        );
    }
    return found;
}

// Whether some face certainly has all points on its outer side; for a triangle, on one side.
fn are_parted(solid: ptr<function, Solid>, by: ptr<function, Sides>) -> bool {
    var parted = false;
    for (var k = first_face(solid); k < 4u; k++) {
        parted |= all((*by).faces[k] == vec4<i32>(-1));
    }
    return parted || ((*solid).is_triangle && all((*by).faces[3] == vec4<i32>(1)));
}

// Whether some point is certainly inside the tetrahedron.
fn any_inside(solid: ptr<function, Solid>, by: ptr<function, Sides>) -> bool {
    if (*solid).is_triangle {
        return false;
    }
    let least = min(min((*by).faces[0], (*by).faces[1]), min((*by).faces[2], (*by).faces[3]));
    return any(least == vec4<i32>(1));
}

// Whether the first point is certainly not inside: always so for a triangle, which has no inside.
fn is_outside(solid: ptr<function, Solid>, by: ptr<function, Sides>) -> bool {
    return (*solid).is_triangle || (*by).faces[0].x < 0 || (*by).faces[1].x < 0
        || (*by).faces[2].x < 0 || (*by).faces[3].x < 0;
}

// The edges of `points` against the faces of `solid`: yes when one certainly crosses, no when all
// certainly miss.
fn crossing(solid: ptr<function, Solid>, points: ptr<function, Solid>, by: ptr<function, Sides>,
    slack: f32) -> i32 {
    var answer = NO;
    let n_edges = select(6u, 3u, (*points).is_triangle);
    for (var n = 0u; n < n_edges; n++) {
        let ends = edge(n);
        let p = (*points).points[ends.x];
        let along = (*points).points[ends.y] - p;
        for (var k = first_face(solid); k < 4u; k++) {
            let from_side = (*by).faces[k][ends.x];
            let to_side = (*by).faces[k][ends.y];
            if from_side * to_side > 0 {
                continue;
            }
            // The line passes the three edges of the face on the same side, or misses it.
            let v = face(k);
            let x = (*solid).points[v.x] - p;
            let y = (*solid).points[v.y] - p;
            let z = (*solid).points[v.z] - p;
            let xy = determinant_sign(along, x, y, slack);
            let yz = determinant_sign(along, y, z, slack);
            let zx = determinant_sign(along, z, x, slack);
            if xy * yz < 0 || yz * zx < 0 || zx * xy < 0 {
                continue;
            }
            if from_side * to_side < 0 && xy * yz > 0 && yz * zx > 0 {
                return YES;
            }
            answer = UNSURE;
        }
    }
    return answer;
}

fn solids(a: ptr<function, Solid>, b: ptr<function, Solid>, slack: f32) -> i32 {
    var by_b = sides(b, a, slack);
    if are_parted(b, &by_b) {
        return NO;
    }
    var by_a = sides(a, b, slack);
    if are_parted(a, &by_a) {
        return NO;
    }
    if any_inside(b, &by_b) || any_inside(a, &by_a) {
        return YES;
    }
    let of_a = crossing(b, a, &by_b, slack);
    if of_a == YES {
        return YES;
    }
    let of_b = crossing(a, b, &by_a, slack);
    if of_b == YES {
        return YES;
    }
    if of_a == NO && of_b == NO && is_outside(b, &by_b) && is_outside(a, &by_a) {
        return NO;
    }
    return UNSURE;
}
