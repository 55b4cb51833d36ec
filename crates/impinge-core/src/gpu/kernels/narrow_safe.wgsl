// Stage `narrow` of safe distances: how far the vertices of two elements may move, so that the
// elements do not touch.
//
// In: candidates; the most that each vertex may move, 0 if it is fixed; how thick each is, or one
// number where none is thick. Out: per vertex, the bits of the least number that its pairs leave
// it. One thread per candidate.
// Cost: 32 bytes of corners and 48 of positions read; 20 products of a direction and a corner; up
// to six atomics. Of thick bodies 24 bytes more.
// Invariant: a number is at most what a lower bound of the distance gives, whatever the device's
// rounding (`docs/exactness.md`, "Safe distances on the GPU").
//
// The difference polygon of two elements is as far from the origin as the elements are apart. So
// for any direction n, the least of n . V over its corners, by the length of n, is a lower bound:
//
//   find      five directions: of the nearest point of each edge, and across the polygon. However wrong they are, bounds hold
//   measure   the least n . V, minus what rounding may add
//   divide    by a length that is checked by products
//
// Each step leaves its numbers in workgroup memory: a compiler that computed a direction twice
// might round it in two ways.

const N_DIRECTIONS: u32 = 5u;

@group(0) @binding(0) var<storage, read> candidates: array<Candidate>;
@group(0) @binding(1) var<storage, read> corners: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> positions: array<u32>;
@group(0) @binding(3) var<storage, read> limits: array<u32>;
@group(0) @binding(4) var<storage, read> thickness: array<f32>;
@group(0) @binding(5) var<storage, read_write> shares: array<atomic<u32>>;
@group(0) @binding(6) var<storage, read_write> counters: array<atomic<u32>>;

var<workgroup> directions: array<vec3<f32>, 64u * N_DIRECTIONS>;
var<workgroup> heights: array<f32, 64u * N_DIRECTIONS>;

fn vertex_bits(vertex: u32) -> vec3<u32> {
    let word = 3u * vertex;
    return vec3<u32>(positions[word], positions[word + 1u], positions[word + 2u]);
}

// The corners of a difference polygon, and the edge after each; all brought into [1, 2).
struct Polygon {
    corners: array<vec3<f32>, 4>,
    edges: array<vec3<f32>, 4>,
    scale: f32,
    // By how much the distance may be less, because positions were rounded.
    off: f32,
    // Whether anything is certain of it.
    is_in_range: bool,
}

fn load(candidate: Candidate) -> Polygon {
    var polygon = Polygon();
    let are_edges = (candidate.b & FLAG) != 0u;
    let a = corners[candidate.a & ~FLAG];
    let b = corners[candidate.b & ~FLAG];
    let bits_p = vertex_bits(a.x);
    let bits_q = vertex_bits(select(b.x, a.y, are_edges));
    let bits_r = vertex_bits(select(b.y, b.x, are_edges));
    let bits_s = vertex_bits(select(b.z, b.y, are_edges));
    // Compared as integers: infinities never reach the arithmetic.
    let widest = max(max(magnitude(bits_p), magnitude(bits_q)), max(magnitude(bits_r), magnitude(bits_s)));
    if widest > LARGEST_BITS {
        return polygon;
    }
    let p = bitcast<vec3<f32>>(bits_p);
    let q = bitcast<vec3<f32>>(bits_q);
    let r = bitcast<vec3<f32>>(bits_r);
    let s = bitcast<vec3<f32>>(bits_s);
    if are_edges {
        polygon.corners = array<vec3<f32>, 4>(p - r, q - r, q - s, p - s);
        polygon.edges = array<vec3<f32>, 4>(q - p, r - s, p - q, s - r);
    } else {
        polygon.corners = array<vec3<f32>, 4>(q - p, r - p, s - p, s - p);
        polygon.edges = array<vec3<f32>, 4>(r - q, s - r, vec3<f32>(0.0), q - s);
    }
    var largest = 0.0;
    for (var k = 0u; k < 4u; k++) {
        largest = max(largest, size(polygon.corners[k]));
    }
    if largest < SMALLEST {
        return polygon;
    }
    polygon.scale = scale_of(largest);
    for (var k = 0u; k < 4u; k++) {
        polygon.corners[k] *= polygon.scale;
        polygon.edges[k] *= polygon.scale;
    }
    let is_rounded = (candidate.a & FLAG) != 0u;
    polygon.off = select(0.0, NARROWING * bitcast<f32>(widest) * polygon.scale, is_rounded);
    polygon.is_in_range = true;
    return polygon;
}

// A number below the least of n . V, or of -n . V, over all corners: by how much they are certainly
// on one side.
fn height(n: vec3<f32>, polygon: ptr<function, Polygon>) -> f32 {
    var low = 0x1p100f;
    var opposite = 0x1p100f;
    for (var k = 0u; k < 4u; k++) {
        let v = (*polygon).corners[k];
        let product = dot3(n, v);
        let error = OF_PRODUCT * dot3(abs(n), abs(v)) + FLUSHED;
        low = min(low, product - error);
        opposite = min(opposite, -product - error);
    }
    return max(low, opposite);
}

fn lower(vertex: u32, share: f32) {
    let bits = bitcast<u32>(share);
    // Most are not lowered, and reading is cheaper.
    if bits < atomicLoad(&shares[vertex]) {
        atomicMin(&shares[vertex], bits);
    }
}

// A vertex repeats itself, an edge its second end, a face its third corner.
fn lower_all(corner: vec4<u32>, share: f32) {
    lower(corner.x, share);
    if corner.y != corner.x {
        lower(corner.y, share);
    }
    if corner.z != corner.y {
        lower(corner.z, share);
    }
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let ix = group_number(group) * 64u + lane;
    let n = min(atomicLoad(&counters[N_CANDIDATES]), arrayLength(&candidates));
    var candidate = Candidate(0u, 0u);
    var polygon = Polygon();
    var is_asked = false;
    if ix < n {
        candidate = candidates[ix];
        is_asked = candidate.a != NOTHING;
    }
    if is_asked {
        polygon = load(candidate);
    }
    for (var k = 0u; k < 4u; k++) {
        directions[lane * N_DIRECTIONS + k] = scaled(towards(polygon.corners[k], polygon.edges[k]));
    }
    directions[lane * N_DIRECTIONS + 4u] = scaled(cross3(polygon.edges[0], polygon.edges[1]));
    workgroupBarrier();
    for (var k = 0u; k < N_DIRECTIONS; k++) {
        heights[lane * N_DIRECTIONS + k] = height(directions[lane * N_DIRECTIONS + k], &polygon);
    }
    workgroupBarrier();
    if !is_asked {
        return;
    }
    var distance = 0.0;
    if polygon.is_in_range {
        for (var k = 0u; k < N_DIRECTIONS; k++) {
            let own = lane * N_DIRECTIONS + k;
            distance = max(distance, quotient(heights[own], directions[own]));
        }
        distance = max(0.0, distance - polygon.off) * BELOW * scale_of(polygon.scale);
    }
    let a = corners[candidate.a & ~FLAG];
    let b = corners[candidate.b & ~FLAG];
    distance = besides_thickness(distance, thickness_of_both(a, b));
    let a_moves = limits[a.x] != 0u;
    let b_moves = limits[b.x] != 0u;
    let share = select(distance, 0.5 * distance, a_moves && b_moves);
    if a_moves {
        lower_all(a, share);
    }
    if b_moves {
        lower_all(b, share);
    }
}
