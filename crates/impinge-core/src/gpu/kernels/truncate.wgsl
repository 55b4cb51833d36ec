// Stage `truncate`: moves each vertex of a body towards the position that is wished for it, at most
// as far as it may.
//
// In: how far each vertex may move; where it is, and the wished position. Out: the wished position
// where it is certainly near enough, else one on the way to it that is, else where the vertex is.
// One thread per vertex.
// Cost: 28 bytes read and 12 written per vertex.
// Invariant: no vertex moves farther than it may, whatever the device's rounding
// (`docs/exactness.md`, "Safe distances on the GPU").
//
// The position on the way is checked as it is stored. It is left in workgroup memory first: a
// compiler that computed it twice might round it in two ways.

// Vertices that may move less stay where they are: nothing that is flushed matters beside what
// others may.
const LEAST_ROOM: f32 = 0x1p-90f;

@group(0) @binding(0) var<storage, read> shares: array<f32>;
@group(0) @binding(1) var<storage, read> starts: array<u32>;
@group(0) @binding(2) var<storage, read_write> ends: array<u32>;
@group(0) @binding(3) var<uniform> params: Params;

var<workgroup> reached: array<vec3<u32>, 64>;

// Whether numbers are such that the arithmetic below says something about them.
fn are_in_range(start: vec3<u32>, end: vec3<u32>, room: f32) -> bool {
    // Compared as integers: infinities never reach the arithmetic.
    return max(magnitude(start), magnitude(end)) <= LARGEST_BITS && room >= LEAST_ROOM;
}

// Whether a position is certainly within the room of where a vertex is.
fn is_within(start: vec3<u32>, end: vec3<u32>, room: f32) -> bool {
    let way = bitcast<vec3<f32>>(end) - bitcast<vec3<f32>>(start);
    // Beyond that, squares might overflow.
    if size(way) > 2.0 * room {
        return false;
    }
    let d = way * scale_of(room);
    let r = room * scale_of(room);
    return dot3(d, d) * (1.0 + OF_PRODUCT) <= r * r * (1.0 - OF_PRODUCT);
}

// A position on the way that is about as far as the room allows, and by its own rounding not
// farther.
fn on_the_way(start: vec3<u32>, end: vec3<u32>, room: f32) -> vec3<u32> {
    let widest = bitcast<f32>(max(magnitude(start), magnitude(end)));
    let aim = room * (1.0 - 0x1p-16f) - 0x1p-21f * widest;
    let from_here = bitcast<vec3<f32>>(start);
    let way = bitcast<vec3<f32>>(end) - from_here;
    let length = size(way);
    if aim <= 0.0 || length < 0x1p-100f {
        return start;
    }
    let scaled = way * scale_of(length);
    let part = aim * scale_of(length) * inverseSqrt(dot3(scaled, scaled));
    return bitcast<vec3<u32>>(from_here + min(part, 1.0) * way);
}

fn three(first: u32, is_start: bool) -> vec3<u32> {
    if is_start {
        return vec3<u32>(starts[first], starts[first + 1u], starts[first + 2u]);
    }
    return vec3<u32>(ends[first], ends[first + 1u], ends[first + 2u]);
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let vertex = group_number(group) * 64u + lane;
    let is_one = vertex < params.count;
    var start = vec3<u32>(0u);
    var end = start;
    var room = 0.0;
    var says = false;
    if is_one {
        start = three(3u * vertex, true);
        end = three(3u * vertex, false);
        room = shares[params.first + vertex];
        says = are_in_range(start, end, room);
    }
    let is_near = says && is_within(start, end, room);
    reached[lane] = start;
    if says && !is_near {
        reached[lane] = on_the_way(start, end, room);
    }
    workgroupBarrier();
    if !is_one || is_near {
        return;
    }
    var to = reached[lane];
    if !says || !is_within(start, to, room) {
        to = start;
    }
    for (var k = 0u; k < 3u; k++) {
        ends[3u * vertex + k] = to[k];
    }
}
