fn is_kind_asked(kind: u32, covers: bool) -> bool {
    return select((params.kinds & kind) != 0u, covers, params.kinds == 0u);
}

// Whether elements of two different parts of a step meet: pairs of their bodies are asked for, and
// so is this kind of pair. The same as `Plan::test` on the host.
fn meets(a: u32, b: u32) -> bool {
    let of_a = bodies[a];
    let of_b = bodies[b];
    let body_a = of_a.part >> BODY_SHIFT;
    let body_b = of_b.part >> BODY_SHIFT;
    if body_a == body_b {
        if (of_a.part & OWN_PARTS) == 0u {
            return false;
        }
    } else if !filters_agree(of_a, of_b) || is_ignored(min(body_a, body_b), max(body_a, body_b)) {
        return false;
    }
    let part_a = of_a.part & PART;
    let part_b = of_b.part & PART;
    let both = of_a.part & of_b.part;
    if part_a == part_b {
        return (part_a == EDGES && is_kind_asked(KIND_EDGE_EDGE, true))
            || (part_a == VERTICES && is_kind_asked(KIND_VERTEX_VERTEX, (both & POINTS) != 0u));
    }
    if max(part_a, part_b) == FACES {
        return min(part_a, part_b) == VERTICES && is_kind_asked(KIND_VERTEX_FACE, true);
    }
    return is_kind_asked(KIND_EDGE_VERTEX, (both & BARE) != 0u);
}
