// Whether two moving elements certainly do not touch, or certainly touch, over an interval: tests of their difference polygon, as
// `Motion` of `impinge_exact::filter::motion` has on the CPU.
//
// Constants, bounds and their proof: `docs/exactness.md`, "The GPU filter for moving elements". They hold under any
// rounding direction, contraction and reassociation, with subnormals flushed or kept. All differences are scaled by one
// power of two, so that the largest of them is in [1, 2). For positions that the host has rounded from f64, each size grows
// by `slack`.

// Errors that do not depend on sizes: of flushed numbers.
const TINY: f32 = 0x1p-76f;
// Bounds of f's outer coefficients, of the quartics' and of a product with the sum of all corners, by the sizes in them.
const OF_CUBIC: f32 = 0x1p-16f;
const OF_QUARTIC: f32 = 0x1p-14f;
const OF_SUM: f32 = 0x1p-13f;
// How much larger those of other coefficients are: 3 f_1; 4 w_1; 6 w_2.
const INNER: f32 = 5.0;
const NEXT: f32 = 8.0;
const MIDDLE: f32 = 16.0;

// A vector at the start and at the end.
struct Moving {
    start: vec3<f32>,
    end: vec3<f32>,
}

fn size_of(d: Moving) -> f32 {
    return max(size(d.start), size(d.end));
}

fn between(p: Moving, q: Moving) -> Moving {
    return Moving(p.start - q.start, p.end - q.end);
}

fn scaled(d: Moving, scale: f32) -> Moving {
    return Moving(d.start * scale, d.end * scale);
}

fn opposite(d: Moving) -> Moving {
    return Moving(-d.start, -d.end);
}

fn cross3(d: vec3<f32>, e: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(d.y * e.z - d.z * e.y, d.z * e.x - d.x * e.z, d.x * e.y - d.y * e.x);
}

// Bernstein coefficients of a cross product: the first, twice the middle one, the last.
struct Crossed {
    first: vec3<f32>,
    twice: vec3<f32>,
    last: vec3<f32>,
}

fn crossed(d: Moving, e: Moving) -> Crossed {
    return Crossed(
        cross3(d.start, e.start),
        cross3(d.start, e.end) + cross3(d.end, e.start),
        cross3(d.end, e.end),
    );
}

// The corners V_0 to V_3 of the difference polygon, and its edges from V_0, V_1 and V_2; a triangle repeats V_2.
struct Polygon {
    corners: array<Moving, 4>,
    edges: array<Moving, 3>,
}

// Points p and a, b, c of a vertex and a face.
fn triangle(p: Moving, a: Moving, b: Moving, c: Moving) -> Polygon {
    let last = between(c, p);
    return Polygon(
        array<Moving, 4>(between(a, p), between(b, p), last, last),
        array<Moving, 3>(between(b, a), between(c, b), between(a, c)),
    );
}

// Points p, q and r, s of two edges.
fn parallelogram(p: Moving, q: Moving, r: Moving, s: Moving) -> Polygon {
    return Polygon(
        array<Moving, 4>(between(p, r), between(q, r), between(q, s), between(p, s)),
        array<Moving, 3>(between(q, p), between(r, s), between(p, q)),
    );
}

// Whether all corners at both ends are on one side of the plane through the origin across `direction`.
fn are_aside(polygon: ptr<function, Polygon>, direction: vec3<f32>, bound: f32) -> bool {
    var least = dot3(direction, (*polygon).corners[0].start);
    var most = least;
    for (var k = 0u; k < 4u; k++) {
        let at_start = dot3(direction, (*polygon).corners[k].start);
        let at_end = dot3(direction, (*polygon).corners[k].end);
        least = min(least, min(at_start, at_end));
        most = max(most, max(at_start, at_end));
    }
    return least > bound || most < -bound;
}

// What is certain of w = N . (V x E): that all its coefficients are negative, or that all are positive.
struct Side {
    is_outside: bool,
    is_inside: bool,
}

fn side_of(n: Crossed, corner: Moving, edge: Moving, bound: f32) -> Side {
    let m = crossed(corner, edge);
    let w_0 = dot3(n.first, m.first);
    let w_1 = dot3(n.first, m.twice) + dot3(n.twice, m.first);
    let w_2 = dot3(n.first, m.last) + dot3(n.twice, m.twice) + dot3(n.last, m.first);
    let w_3 = dot3(n.twice, m.last) + dot3(n.last, m.twice);
    let w_4 = dot3(n.last, m.last);
    let next = NEXT * bound;
    let middle = MIDDLE * bound;
    let is_outside = max(w_0, w_4) < -bound && max(w_1, w_3) < -next && w_2 < -middle;
    let is_inside = min(w_0, w_4) > bound && min(w_1, w_3) > next && w_2 > middle;
    return Side(is_outside, is_inside);
}

// Sizes of corners and edges over the whole step, after scaling, with what rounded positions add.
struct Sizes {
    corners: array<f32, 4>,
    edges: array<f32, 3>,
    // The largest of a corner.
    wide: f32,
    slack: f32,
    // Whether bounds hold for differences of these sizes.
    are_in_range: bool,
}

// Scales all differences. `narrowing`: by how much a difference may be wrong because positions were rounded.
fn scale_all(polygon: ptr<function, Polygon>, narrowing: f32) -> Sizes {
    var sizes = Sizes();
    var widest = 0.0;
    for (var k = 0u; k < 4u; k++) {
        sizes.corners[k] = size_of((*polygon).corners[k]);
        widest = max(widest, sizes.corners[k]);
    }
    var largest = widest;
    for (var k = 0u; k < 3u; k++) {
        sizes.edges[k] = size_of((*polygon).edges[k]);
        largest = max(largest, sizes.edges[k]);
    }
    if largest < SMALLEST || largest < narrowing {
        return sizes;
    }
    let scale = bitcast<f32>((254u - (bitcast<u32>(largest) >> 23u)) << 23u);
    let slack = narrowing * scale;
    for (var k = 0u; k < 4u; k++) {
        (*polygon).corners[k] = scaled((*polygon).corners[k], scale);
        sizes.corners[k] = sizes.corners[k] * scale + slack;
    }
    for (var k = 0u; k < 3u; k++) {
        (*polygon).edges[k] = scaled((*polygon).edges[k], scale);
        sizes.edges[k] = sizes.edges[k] * scale + slack;
    }
    sizes.wide = widest * scale + slack;
    sizes.slack = slack;
    sizes.are_in_range = true;
    return sizes;
}

// What is certain of two elements between the two ends of their polygon: nothing, that they do not touch, or that they do, at one time
// strictly between.
const UNCLEAR: u32 = 0u;
const FREE: u32 = 1u;
const TOUCHES: u32 = 2u;

fn decide(polygon: ptr<function, Polygon>, sizes: ptr<function, Sizes>, are_edges: bool) -> u32 {
    let slack = (*sizes).slack;
    let wide = (*sizes).wide;

    // Free along the sum of all corners.
    var sum = vec3<f32>(0.0);
    for (var k = 0u; k < 3u; k++) {
        sum += (*polygon).corners[k].start + (*polygon).corners[k].end;
    }
    if are_edges {
        sum += (*polygon).corners[3].start + (*polygon).corners[3].end;
    }
    if are_aside(polygon, sum, wide * (OF_SUM * wide + 32.0 * slack) + TINY) {
        return FREE;
    }

    // Free along the normal at either end, or by the sign of f = N . V_0.
    let first = (*polygon).edges[0];
    let second = (*polygon).edges[1];
    let n = crossed(first, second);
    let d = (*sizes).edges[0];
    let e = (*sizes).edges[1];
    let bound = OF_CUBIC * (d * e * wide) + 4.0 * slack * (d * e + (d + e) * wide) + TINY;
    if are_aside(polygon, n.first, bound) || are_aside(polygon, n.last, bound) {
        return FREE;
    }
    let v = (*polygon).corners[0];
    let f_0 = dot3(n.first, v.start);
    let f_1 = dot3(n.first, v.end) + dot3(n.twice, v.start);
    let f_2 = dot3(n.twice, v.end) + dot3(n.last, v.start);
    let f_3 = dot3(n.last, v.end);
    let inner = INNER * bound;
    if min(f_0, f_3) > bound && min(f_1, f_2) > inner {
        return FREE;
    }
    if max(f_0, f_3) < -bound && max(f_1, f_2) < -inner {
        return FREE;
    }

    // Free beyond one edge all the time. Contact where the sign of f changes, and only once, and all edges are passed on the inner side
    // all the time.
    let falls = f_0 > bound && f_3 < -bound && (f_1 > inner || f_2 < -inner);
    let rises = f_0 < -bound && f_3 > bound && (f_1 < -inner || f_2 > inner);
    var touches = falls || rises;
    for (var k = 0u; k < 3u; k++) {
        let c = (*sizes).corners[k];
        let g = (*sizes).edges[k];
        let w_bound = OF_QUARTIC * (d * e * c * g)
            + 8.0 * slack * (d * e * (c + g) + c * g * (d + e)) + TINY;
        let side = side_of(n, (*polygon).corners[k], (*polygon).edges[k], w_bound);
        if side.is_outside {
            return FREE;
        }
        touches = touches && side.is_inside;
    }
    if are_edges {
        // The last edge is the opposite of the second one.
        let c = (*sizes).corners[3];
        let w_bound = OF_QUARTIC * (d * e * c * e) + 8.0 * slack * (d * e * (c + e) + c * e * (d + e)) + TINY;
        let side = side_of(n, (*polygon).corners[3], opposite(second), w_bound);
        if side.is_outside {
            return FREE;
        }
        touches = touches && side.is_inside;
    }
    return select(UNCLEAR, TOUCHES, touches);
}
