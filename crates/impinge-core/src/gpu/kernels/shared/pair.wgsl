// The difference polygon of a candidate of a step. Bindings: `corners` and `positions`.
//
// A vertex repeats itself, an edge its second end, a face its third corner. So an edge and a vertex
// are two edges of which one is a point, and two vertices a vertex and a face that is a point.

fn vertex_bits(vertex: u32) -> vec3<u32> {
    let word = 3u * vertex;
    return vec3<u32>(positions[word], positions[word + 1u], positions[word + 2u]);
}

// A vertex at both ends, as bits.
struct Path {
    start: vec3<u32>,
    end: vec3<u32>,
}

fn path(vertex: u32) -> Path {
    let at_end = vertex + arrayLength(&positions) / 6u;
    return Path(vertex_bits(vertex), vertex_bits(at_end));
}

fn reach(way: Path) -> u32 {
    return max(magnitude(way.start), magnitude(way.end));
}

fn moving(way: Path) -> Moving {
    return Moving(bitcast<vec3<f32>>(way.start), bitcast<vec3<f32>>(way.end));
}

// The elements of a candidate.
struct Pair {
    polygon: Polygon,
    sizes: Sizes,
    are_edges: bool,
}

// Loads a candidate. Its sizes say whether anything can be certain of it.
fn load_pair(candidate: Candidate, pair: ptr<function, Pair>) {
    let are_edges = (candidate.b & FLAG) != 0u;
    let a = corners[candidate.a & ~FLAG];
    let b = corners[candidate.b & ~FLAG];
    let p = path(a.x);
    let q = path(select(b.x, a.y, are_edges));
    let r = path(select(b.y, b.x, are_edges));
    let s = path(select(b.z, b.y, are_edges));
    (*pair).sizes.are_in_range = false;
    (*pair).are_edges = are_edges;
    // Compared as integers: infinities never reach the arithmetic.
    let largest = max(max(reach(p), reach(q)), max(reach(r), reach(s)));
    if largest > LARGEST_BITS {
        return;
    }
    let is_rounded = (candidate.a & FLAG) != 0u;
    let narrowing = select(0.0, NARROWING * bitcast<f32>(largest), is_rounded);
    var polygon = triangle(moving(p), moving(q), moving(r), moving(s));
    if are_edges {
        polygon = parallelogram(moving(p), moving(q), moving(r), moving(s));
    }
    (*pair).sizes = scale_all(&polygon, narrowing);
    (*pair).polygon = polygon;
}
