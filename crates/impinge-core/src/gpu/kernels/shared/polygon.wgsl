// Whether two moving elements certainly do not touch, or certainly touch, over an interval: tests
// of their difference polygon, as `Motion` of `impinge_exact::filter::motion` has on the CPU.
//
// Constants, bounds and their proof: `docs/exactness.md`, "The GPU filter for moving elements".
// They hold under any rounding direction, contraction and reassociation, with subnormals flushed or
// kept. All differences are scaled by one power of two, so that the largest of them is in [1, 2).
// For positions that the host has rounded from f64, each size grows by `slack`.

// Errors that do not depend on sizes: of flushed numbers.
const TINY: f32 = 0x1p-76f;
// Bounds of f's outer coefficients, of the quartics' and of a product with the sum of all corners,
// by the sizes in them.
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

fn between(p: Moving, q: Moving) -> Moving {
    return Moving(p.start - q.start, p.end - q.end);
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

// Four vectors, by coordinate. Corners and edges are no arrays: those in a loop, which wgpu keeps
// compilers from unrolling, may be kept outside of registers.
struct Four {
    x: vec4<f32>,
    y: vec4<f32>,
    z: vec4<f32>,
}

// Four vectors at the start and at the end.
struct MovingFour {
    start: Four,
    end: Four,
}

fn four(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, d: vec3<f32>) -> Four {
    return Four(vec4<f32>(a.x, b.x, c.x, d.x), vec4<f32>(a.y, b.y, c.y, d.y), vec4<f32>(a.z, b.z, c.z, d.z));
}

fn moving_four(a: Moving, b: Moving, c: Moving, d: Moving) -> MovingFour {
    return MovingFour(four(a.start, b.start, c.start, d.start), four(a.end, b.end, c.end, d.end));
}

fn first_of(d: MovingFour) -> Moving {
    return Moving(vec3<f32>(d.start.x.x, d.start.y.x, d.start.z.x), vec3<f32>(d.end.x.x, d.end.y.x, d.end.z.x));
}

fn second_of(d: MovingFour) -> Moving {
    return Moving(vec3<f32>(d.start.x.y, d.start.y.y, d.start.z.y), vec3<f32>(d.end.x.y, d.end.y.y, d.end.z.y));
}

fn sum_four(d: Four, e: Four) -> Four {
    return Four(d.x + e.x, d.y + e.y, d.z + e.z);
}

fn scaled_four(d: Four, scale: f32) -> Four {
    return Four(d.x * scale, d.y * scale, d.z * scale);
}

fn scaled_moving(d: MovingFour, scale: f32) -> MovingFour {
    return MovingFour(scaled_four(d.start, scale), scaled_four(d.end, scale));
}

// The product of a vector with each of four.
fn dot_four(n: vec3<f32>, d: Four) -> vec4<f32> {
    return n.x * d.x + n.y * d.y + n.z * d.z;
}

fn cross_four(d: Four, e: Four) -> Four {
    return Four(d.y * e.z - d.z * e.y, d.z * e.x - d.x * e.z, d.x * e.y - d.y * e.x);
}

fn size_four(d: Four) -> vec4<f32> {
    return max(max(abs(d.x), abs(d.y)), abs(d.z));
}

fn total(d: vec4<f32>, weight: f32) -> f32 {
    return d.x + d.y + d.z + weight * d.w;
}

fn least(d: vec4<f32>) -> f32 {
    return min(min(d.x, d.y), min(d.z, d.w));
}

fn most(d: vec4<f32>) -> f32 {
    return max(max(d.x, d.y), max(d.z, d.w));
}

// The corners V_0 to V_3 of the difference polygon, and the edges from them; a triangle repeats the
// last of both.
struct Polygon {
    corners: MovingFour,
    edges: MovingFour,
}

// Points p and a, b, c of a vertex and a face.
fn triangle(p: Moving, a: Moving, b: Moving, c: Moving) -> Polygon {
    let corner = between(c, p);
    let edge = between(a, c);
    return Polygon(
        moving_four(between(a, p), between(b, p), corner, corner),
        moving_four(between(b, a), between(c, b), edge, edge),
    );
}

// Points p, q and r, s of two edges.
fn parallelogram(p: Moving, q: Moving, r: Moving, s: Moving) -> Polygon {
    return Polygon(
        moving_four(between(p, r), between(q, r), between(q, s), between(p, s)),
        moving_four(between(q, p), between(r, s), between(p, q), between(s, r)),
    );
}

// Whether all corners at both ends are on one side of the plane through the origin across
// `direction`.
fn are_aside(corners: MovingFour, direction: vec3<f32>, bound: f32) -> bool {
    let at_start = dot_four(direction, corners.start);
    let at_end = dot_four(direction, corners.end);
    return least(min(at_start, at_end)) > bound || most(max(at_start, at_end)) < -bound;
}

// What is certain of w = N . (V x E) for each edge: that all its coefficients are negative, or that
// all are positive.
struct Sides {
    are_outside: vec4<bool>,
    are_inside: vec4<bool>,
}

fn sides_of(n: Crossed, corners: MovingFour, edges: MovingFour, bound: vec4<f32>) -> Sides {
    let first = cross_four(corners.start, edges.start);
    let twice = sum_four(cross_four(corners.start, edges.end), cross_four(corners.end, edges.start));
    let last = cross_four(corners.end, edges.end);
    let w_0 = dot_four(n.first, first);
    let w_1 = dot_four(n.first, twice) + dot_four(n.twice, first);
    let w_2 = dot_four(n.first, last) + dot_four(n.twice, twice) + dot_four(n.last, first);
    let w_3 = dot_four(n.twice, last) + dot_four(n.last, twice);
    let w_4 = dot_four(n.last, last);
    let next = NEXT * bound;
    let middle = MIDDLE * bound;
    let are_outside = (max(w_0, w_4) < -bound) & (max(w_1, w_3) < -next) & (w_2 < -middle);
    let are_inside = (min(w_0, w_4) > bound) & (min(w_1, w_3) > next) & (w_2 > middle);
    return Sides(are_outside, are_inside);
}

// Sizes of corners and edges over the whole step, after scaling, with what rounded positions add.
struct Sizes {
    corners: vec4<f32>,
    edges: vec4<f32>,
    // The largest of a corner.
    wide: f32,
    slack: f32,
    // What they were multiplied by.
    scale: f32,
    // Whether bounds hold for differences of these sizes.
    are_in_range: bool,
}

// Scales all differences. `narrowing`: by how much a difference may be wrong because positions were
// rounded.
fn scale_all(polygon: ptr<function, Polygon>, narrowing: f32) -> Sizes {
    let corners = max(size_four((*polygon).corners.start), size_four((*polygon).corners.end));
    let edges = max(size_four((*polygon).edges.start), size_four((*polygon).edges.end));
    let widest = most(corners);
    let largest = max(widest, most(edges));
    if largest < SMALLEST || largest < narrowing {
        return Sizes();
    }
    let scale = scale_of(largest);
    let slack = narrowing * scale;
    (*polygon).corners = scaled_moving((*polygon).corners, scale);
    (*polygon).edges = scaled_moving((*polygon).edges, scale);
    return Sizes(corners * scale + slack, edges * scale + slack, widest * scale + slack, slack, scale, true);
}

// What is certain of two elements between the two ends of their polygon: nothing, that they do not
// touch, or that they do, at one time strictly between.
const UNCLEAR: u32 = 0u;
const FREE: u32 = 1u;
const TOUCHES: u32 = 2u;

fn decide(polygon: Polygon, sizes: Sizes, are_edges: bool) -> u32 {
    let slack = sizes.slack;
    let wide = sizes.wide;
    let corners = polygon.corners;
    let edges = polygon.edges;

    // Free along the sum of all corners. A triangle's last corner comes twice, and counts once.
    let weight = select(0.0, 1.0, are_edges);
    let sum = vec3<f32>(
        total(corners.start.x + corners.end.x, weight),
        total(corners.start.y + corners.end.y, weight),
        total(corners.start.z + corners.end.z, weight),
    );
    if are_aside(corners, sum, wide * (OF_SUM * wide + 32.0 * slack) + TINY) {
        return FREE;
    }

    // Free along the normal at either end, or by the sign of f = N . V_0.
    let n = crossed(first_of(edges), second_of(edges));
    let d = sizes.edges.x;
    let e = sizes.edges.y;
    let bound = OF_CUBIC * (d * e * wide) + 4.0 * slack * (d * e + (d + e) * wide) + TINY;
    if are_aside(corners, n.first, bound) || are_aside(corners, n.last, bound) {
        return FREE;
    }
    let v = first_of(corners);
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

    // Free beyond one edge all the time. Contact where the sign of f changes, and only once, and
    // all edges are passed on the inner side all the time.
    let falls = f_0 > bound && f_3 < -bound && (f_1 > inner || f_2 < -inner);
    let rises = f_0 < -bound && f_3 > bound && (f_1 < -inner || f_2 > inner);
    let c = sizes.corners;
    let g = sizes.edges;
    let w_bound = OF_QUARTIC * (d * e * c * g) + 8.0 * slack * (d * e * (c + g) + c * g * (d + e)) + TINY;
    let sides = sides_of(n, corners, edges, w_bound);
    if any(sides.are_outside) {
        return FREE;
    }
    let touches = (falls || rises) && all(sides.are_inside);
    return select(UNCLEAR, TOUCHES, touches);
}
