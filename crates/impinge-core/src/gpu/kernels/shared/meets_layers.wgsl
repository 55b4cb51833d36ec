// Whether elements of two different layers of a step meet: pairs of their bodies are asked for, and so is this kind of
// pair. The same as `Frame::test` on the host.
fn meets(a: u32, b: u32) -> bool {
    let of_a = bodies[a];
    let of_b = bodies[b];
    let body_a = of_a.layer >> BODY_SHIFT;
    let body_b = of_b.layer >> BODY_SHIFT;
    if body_a == body_b {
        if (of_a.layer & OWN_LAYERS) == 0u {
            return false;
        }
    } else if !filters_agree(of_a, of_b) || is_ignored(min(body_a, body_b), max(body_a, body_b)) {
        return false;
    }
    let part_a = of_a.layer & PART;
    let part_b = of_b.layer & PART;
    let both = of_a.layer & of_b.layer;
    if part_a == part_b {
        return part_a == EDGES || (part_a == VERTICES && (both & POINTS) != 0u);
    }
    if max(part_a, part_b) == FACES {
        return min(part_a, part_b) == VERTICES;
    }
    return (both & BARE) != 0u;
}
