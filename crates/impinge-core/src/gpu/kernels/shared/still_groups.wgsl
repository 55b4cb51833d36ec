// The elements of two clusters in workgroup memory, where they stand still.

fn element_extent(corner: vec4<u32>, slack: u32) -> Extent {
    return element_box(corner, slack);
}

fn put_extent(entry: u32, extent: Extent) {
    lows[entry] = extent.low;
    highs[entry] = extent.high;
}

fn extent_at(entry: u32) -> Extent {
    return Box(lows[entry], highs[entry]);
}

fn are_of_one_body(a: Cluster, b: Cluster) -> bool {
    return a.body == b.body;
}

// Bit 31 of the second slot of a candidate that shares no vertex.
fn flag_of(a: Cluster) -> u32 {
    return 0u;
}
