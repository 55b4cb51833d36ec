// The elements of two clusters in workgroup memory, where they move: the boxes at the end follow
// all those at the start.

fn element_extent(corner: vec4<u32>, slack: u32) -> Extent {
    let n_vertices = arrayLength(&positions) / (3u * ENDS);
    return Extent(
        widened(element_box(corner, slack), params.reach),
        widened(element_box(corner + n_vertices, slack), params.reach),
    );
}

fn put_extent(entry: u32, extent: Extent) {
    lows[entry] = extent.start.low;
    highs[entry] = extent.start.high;
    lows[entry + 128u] = extent.end.low;
    highs[entry + 128u] = extent.end.high;
}

fn extent_at(entry: u32) -> Extent {
    return Extent(
        Box(lows[entry], highs[entry]),
        Box(lows[entry + 128u], highs[entry + 128u]),
    );
}

fn are_of_one_body(a: Cluster, b: Cluster) -> bool {
    return bodies[a.body].part >> BODY_SHIFT == bodies[b.body].part >> BODY_SHIFT;
}

// Bit 31 of the second slot of a candidate: the first slot is that of an edge.
fn flag_of(a: Cluster) -> u32 {
    return select(0u, FLAG, (bodies[a.body].part & PART) == EDGES);
}
