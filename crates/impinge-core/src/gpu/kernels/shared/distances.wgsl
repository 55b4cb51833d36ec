// Lower bounds of the distance of two elements, from directions that are found anyhow:
// `docs/exactness.md`, "Safe distances on the GPU".
// Binding: `thickness`.

// Of numbers that are flushed.
const FLUSHED: f32 = 0x1p-76f;
// The least height that is divided: its square is a normal number.
const LOWEST: f32 = 0x1p-40f;
// What is left of a quotient, so that it passes the check.
const BELOW: f32 = 0x0.ffffcp0f; // 1 - 2^-18
// Shorter distances, in the caller's unit, count as 0: nothing that is flushed is called a
// distance.
const SHORTEST: f32 = 0x1p-100f;

// A direction whose largest coordinate is in [1, 2), or none: 0.
fn scaled(d: vec3<f32>) -> vec3<f32> {
    let s = size(d);
    if s < 0x1p-100f {
        return vec3<f32>(0.0);
    }
    return d * scale_of(s);
}

// About the direction of the nearest point of the edge after a corner.
fn towards(corner: vec3<f32>, edge: vec3<f32>) -> vec3<f32> {
    let square = dot3(edge, edge);
    // Nothing overflows below.
    if square < 0x1p-60f {
        return corner;
    }
    let along = -dot3(corner, edge) / square;
    if along <= 0.0 {
        return corner;
    }
    if along >= 1.0 {
        return corner + edge;
    }
    let nearest = corner + along * edge;
    // Once more, so that it is across the edge to the last bits.
    return nearest - (dot3(nearest, edge) / square) * edge;
}

// A number below a height divided by the length of a direction: checked by products. If the height
// is computed once more, it may be another one: also a number below, but perhaps negative.
fn quotient(low: f32, n: vec3<f32>) -> f32 {
    let height = max(low, 0.0);
    if height < LOWEST {
        return 0.0;
    }
    let square = dot3(n, n);
    let found = height * inverseSqrt(square) * BELOW;
    let is_below = found * found * (square * (1.0 + OF_PRODUCT)) <= height * height * (1.0 - OF_PRODUCT);
    return select(0.0, found * BELOW, is_below);
}

// How thick an element is: as its thickest vertex.
fn thickness_of(corner: vec4<u32>) -> f32 {
    return max(max(thickness[corner.x], thickness[corner.y]), thickness[corner.z]);
}

// A number that is at least how thick two elements are together; 0 where nothing is.
fn thickness_of_both(a: vec4<u32>, b: vec4<u32>) -> f32 {
    if arrayLength(&thickness) > 1u {
        return (thickness_of(a) + thickness_of(b)) * (1.0 + OF_PRODUCT);
    }
    return 0.0;
}

// What is left of a distance besides the thickness of both elements, if there is any.
fn besides_thickness(distance: f32, both: f32) -> f32 {
    var besides = distance;
    if arrayLength(&thickness) > 1u {
        besides = max(0.0, distance - both) * BELOW;
    }
    return select(besides, 0.0, besides < SHORTEST);
}
