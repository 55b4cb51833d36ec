//! All kernels: their sources, their bindings, and the set of them per device.

use super::layout::{
    Arguments, Body, Candidate, Cell, CellItem, Cluster, ClusterVertex, Coordinate, Corners,
    Counter, Grid, Kept, Level, ListEntry, Node, NodePair, Order, PairKey, PairTimes, Params,
    Reach, Rule, Share, Start, Tally, UnsureKey, WorkItem,
};
use super::pipeline::{Kernel, Source, bindings, source};

bindings! {
    /// `bounds_clusters.wgsl`
    BoundsClusters {
        clusters: Read<Cluster>,
        cluster_vertices: Read<ClusterVertex>,
        positions: Read<Coordinate>,
        bodies: Read<Body>,
        nodes: Write<Node>,
        params: Uniform<Params>,
    }
}

bindings! {
    /// `bounds_level.wgsl`
    BoundsLevel {
        bodies: Read<Body>,
        nodes: Write<Node>,
        params: Uniform<Params>,
    }
}

bindings! {
    /// `bounds_top.wgsl`
    BoundsTop {
        bodies: Read<Body>,
        levels: Read<Level>,
        nodes: Write<Node>,
        params: Uniform<Params>,
    }
}

bindings! {
    /// `prepare.wgsl`
    Prepare {
        counters: Write<Counter>,
        arguments: Write<Arguments>,
        params: Uniform<Params>,
    }
}

bindings! {
    /// `traversal.wgsl`
    Traversal {
        nodes: Read<Node>,
        bodies: Read<Body>,
        ignored: Read<NodePair>,
        queue: Read<NodePair>,
        next_queue: Write<NodePair>,
        items: Write<WorkItem>,
        counters: Write<Counter>,
        params: Uniform<Params>,
    }
}

bindings! {
    /// `pairing.wgsl`
    Pairing {
        nodes: Read<Node>,
        clusters: Read<Cluster>,
        bodies: Read<Body>,
        corners: Read<Corners>,
        positions: Read<Coordinate>,
        items: Read<WorkItem>,
        candidates: Write<Candidate>,
        counters: Write<Counter>,
        params: Uniform<Params>,
    }
}

bindings! {
    /// `left_out.wgsl`
    LeaveOut {
        candidates: Write<Candidate>,
        corners: Read<Corners>,
        order: Read<Order>,
        rules: Read<Rule>,
        counters: Write<Counter>,
        bodies: Read<Body>,
    }
}

bindings! {
    /// `narrow.wgsl`
    Narrow {
        candidates: Read<Candidate>,
        corners: Read<Corners>,
        positions: Read<Coordinate>,
        order: Read<Order>,
        pairs: Write<PairKey>,
        unsure: Write<UnsureKey>,
        counters: Write<Counter>,
        bodies: Read<Body>,
    }
}

bindings! {
    /// `narrow_moving.wgsl`
    NarrowMoving {
        candidates: Read<Candidate>,
        corners: Read<Corners>,
        positions: Read<Coordinate>,
        pairs: Write<PairKey>,
        counters: Write<Counter>,
    }
}

bindings! {
    /// `narrow_search.wgsl`
    NarrowSearch {
        pairs: Read<PairKey>,
        corners: Read<Corners>,
        positions: Read<Coordinate>,
        order: Read<Order>,
        unsure: Write<UnsureKey>,
        times: Write<PairTimes>,
        counters: Write<Counter>,
        params: Uniform<Params>,
        bodies: Read<Body>,
    }
}

bindings! {
    /// `narrow_keep.wgsl`
    NarrowKeep {
        candidates: Read<Candidate>,
        corners: Read<Corners>,
        positions: Read<Coordinate>,
        thickness: Read<Share>,
        pairs: Write<PairKey>,
        times: Write<PairTimes>,
        counters: Write<Counter>,
    }
}

bindings! {
    /// `narrow_names.wgsl`
    NarrowNames {
        pairs: Read<PairKey>,
        order: Read<Order>,
        unsure: Write<UnsureKey>,
        counters: Write<Counter>,
        params: Uniform<Params>,
        bodies: Read<Body>,
    }
}

bindings! {
    /// `narrow_safe.wgsl`
    NarrowSafe {
        candidates: Read<Candidate>,
        corners: Read<Corners>,
        positions: Read<Coordinate>,
        limits: Read<Share>,
        thickness: Read<Share>,
        shares: Write<Share>,
        counters: Write<Counter>,
    }
}

bindings! {
    /// `safe_end.wgsl`
    SafeEnd {
        counters: Write<Counter>,
        shares: Write<Share>,
        params: Uniform<Params>,
    }
}

bindings! {
    /// `lists_end.wgsl`
    ListsEnd {
        counters: Write<Counter>,
        times: Write<PairTimes>,
        params: Uniform<Params>,
    }
}

bindings! {
    /// `truncate.wgsl`
    Truncate {
        shares: Read<Share>,
        starts: Read<Coordinate>,
        ends: Write<Coordinate>,
        params: Uniform<Params>,
    }
}

bindings! {
    /// `bounds_reach.wgsl`
    BoundsReach {
        nodes: Read<Node>,
        bodies: Read<Body>,
        ignored: Read<NodePair>,
        reaches: Write<Reach>,
        tallies: Write<Tally>,
        params: Uniform<Params>,
    }
}

bindings! {
    /// `bounds_keep.wgsl`
    BoundsKeep {
        nodes: Read<Node>,
        clusters: Read<Cluster>,
        bodies: Read<Body>,
        corners: Read<Corners>,
        positions: Read<Coordinate>,
        reaches: Read<Reach>,
        kept: Write<Kept>,
        counters: Write<Counter>,
    }
}

bindings! {
    /// `grid_resolution.wgsl`
    GridResolution {
        counters: Write<Counter>,
        tallies: Write<Tally>,
        grid: Write<Grid>,
        arguments: Write<Arguments>,
        params: Uniform<Params>,
    }
}

bindings! {
    /// `grid_ranges.wgsl`
    GridRanges {
        grid: Read<Grid>,
        kept: Write<Kept>,
        counters: Write<Counter>,
        tallies: Write<Tally>,
    }
}

bindings! {
    /// `grid_shift.wgsl`
    GridShift {
        counters: Write<Counter>,
        tallies: Write<Tally>,
        grid: Write<Grid>,
        arguments: Write<Arguments>,
        params: Uniform<Params>,
    }
}

bindings! {
    /// `grid_count.wgsl`
    GridCount {
        grid: Read<Grid>,
        kept: Write<Kept>,
        counters: Write<Counter>,
        cells: Write<Cell>,
    }
}

bindings! {
    /// `traversal_cells.wgsl`
    TraversalCells {
        grid: Read<Grid>,
        bodies: Read<Body>,
        cells: Write<Cell>,
        starts: Write<Start>,
        items: Write<CellItem>,
        counters: Write<Counter>,
        params: Uniform<Params>,
    }
}

bindings! {
    /// `traversal_tile.wgsl`
    TraversalTile {
        grid: Read<Grid>,
        items: Write<CellItem>,
        counters: Write<Counter>,
        params: Uniform<Params>,
    }
}

bindings! {
    /// `traversal_scatter.wgsl`
    TraversalScatter {
        grid: Read<Grid>,
        kept: Read<Kept>,
        starts: Read<Start>,
        cells: Write<Cell>,
        entries: Write<ListEntry>,
        counters: Write<Counter>,
    }
}

bindings! {
    /// `pairing_cells.wgsl`
    PairingCells {
        bodies: Read<Body>,
        ignored: Read<NodePair>,
        corners: Read<Corners>,
        kept: Read<Kept>,
        entries: Read<ListEntry>,
        items: Read<CellItem>,
        candidates: Write<Candidate>,
        counters: Write<Counter>,
        params: Uniform<Params>,
    }
}

/// Declares the set: for each kernel its source, constants and bindings. A second kernel of one
/// file has a name of its own.
macro_rules! kernels {
    ($($name:ident: $bindings:ident = $source:ident [$($constant:expr),*]
        from $file:literal $(as $label:literal)? ($($shared:literal),*);)*) => {
        /// Every kernel, compiled when it is first bound.
        pub(crate) struct Kernels {
            $(pub $name: Kernel<$bindings>,)*
        }

        $(pub(crate) const $source: Source = source!($file $(as $label)?, [$($shared),*]);)*

        impl Kernels {
            /// All kernels. `damage` may replace a kernel's text.
            pub fn new(damage: impl Fn(&Source) -> Option<String>) -> Self {
                Kernels {
                    $($name: Kernel::with_text($source, &[$($constant),*], damage(&$source)),)*
                }
            }
        }

        /// Every kernel's source and its bindings.
        pub(crate) const ALL: &[(Source, &[super::pipeline::BindingEntry])] = &[
            $(($source, <$bindings as super::pipeline::Bindings>::ENTRIES),)*
        ];
    };
}

kernels! {
    bounds_clusters: BoundsClusters = BOUNDS_CLUSTERS []
        from "bounds_clusters" ("boxes", "still", "vertices", "groups");
    bounds_level: BoundsLevel = BOUNDS_LEVEL []
        from "bounds_level" ("boxes", "still", "refit", "groups");
    bounds_top: BoundsTop = BOUNDS_TOP [] from "bounds_top" ("boxes", "still", "refit");
    prepare: Prepare = PREPARE [] from "prepare" ("arguments");
    traversal: Traversal = TRAVERSAL []
        from "traversal" ("boxes", "still", "filters", "meets", "reserve", "groups");
    pairing: Pairing = PAIRING []
        from "pairing" ("boxes", "still", "still_groups", "vertices", "ids", "reserve", "groups");
    bounds_clusters_moving: BoundsClusters = BOUNDS_CLUSTERS_MOVING []
        from "bounds_clusters" as "bounds_clusters_moving" ("boxes", "moving", "vertices", "groups");
    bounds_level_moving: BoundsLevel = BOUNDS_LEVEL_MOVING []
        from "bounds_level" as "bounds_level_moving" ("boxes", "moving", "refit", "groups");
    bounds_top_moving: BoundsTop = BOUNDS_TOP_MOVING []
        from "bounds_top" as "bounds_top_moving" ("boxes", "moving", "refit");
    traversal_moving: Traversal = TRAVERSAL_MOVING []
        from "traversal" as "traversal_moving"
        ("boxes", "moving", "filters", "meets_parts", "reserve", "groups");
    pairing_moving: Pairing = PAIRING_MOVING []
        from "pairing" as "pairing_moving"
        ("boxes", "moving", "moving_groups", "vertices", "ids", "reserve", "groups");
    leave_out: LeaveOut = LEAVE_OUT [] from "left_out" ("numbers", "groups");
    narrow_moving: NarrowMoving = NARROW_MOVING []
        from "narrow_moving" ("filter", "lengths", "polygon", "pair", "reserve", "slots", "groups");
    narrow_search: NarrowSearch = NARROW_SEARCH []
        from "narrow_search"
        ("filter", "lengths", "polygon", "times", "pair", "numbers", "names", "reserve", "slots", "groups");
    narrow_keep: NarrowKeep = NARROW_KEEP []
        from "narrow_keep"
        ("filter", "lengths", "distances", "polygon", "times", "pair", "reserve", "slots", "groups");
    narrow_names: NarrowNames = NARROW_NAMES []
        from "narrow_names" ("numbers", "names", "groups");
    narrow_safe: NarrowSafe = NARROW_SAFE [] from "narrow_safe" ("filter", "lengths", "distances", "groups");
    safe_end: SafeEnd = SAFE_END [] from "safe_end" ("lost", "groups");
    lists_end: ListsEnd = LISTS_END [] from "lists_end" ("lost", "groups");
    truncate: Truncate = TRUNCATE [] from "truncate" ("filter", "lengths", "groups");
    narrow: Narrow = NARROW [("WITH_SOLIDS", 0.0)]
        from "narrow" ("filter", "projections", "triangles", "neighbours", "solids", "numbers", "reserve", "groups");
    narrow_solids: Narrow = NARROW_SOLIDS [("WITH_SOLIDS", 1.0)]
        from "narrow" ("filter", "projections", "triangles", "neighbours", "solids", "numbers", "reserve", "groups");
    bounds_reach: BoundsReach = BOUNDS_REACH [] from "bounds_reach" ("boxes", "filters", "meets", "groups");
    bounds_keep: BoundsKeep = BOUNDS_KEEP []
        from "bounds_keep" ("boxes", "vertices", "reserve", "slots", "groups");
    grid_resolution: GridResolution = GRID_RESOLUTION []
        from "grid_resolution" ("region", "arguments");
    grid_ranges: GridRanges = GRID_RANGES [] from "grid_ranges" ("region", "groups");
    grid_shift: GridShift = GRID_SHIFT [] from "grid_shift" ("arguments");
    grid_count: GridCount = GRID_COUNT [] from "grid_count" ("coarse", "groups");
    traversal_cells: TraversalCells = TRAVERSAL_CELLS [] from "traversal_cells" ("reserve", "groups");
    traversal_scatter: TraversalScatter = TRAVERSAL_SCATTER []
        from "traversal_scatter" ("coarse", "groups");
    traversal_tile: TraversalTile = TRAVERSAL_TILE []
        from "traversal_tile" ("reserve", "slots", "groups");
    pairing_cells: PairingCells = PAIRING_CELLS []
        from "pairing_cells" ("boxes", "filters", "meets", "ids", "reserve", "groups");
}

/// The name and the text of every shader that this crate compiles, for compilers other than naga to
/// check.
pub fn shaders() -> impl Iterator<Item = (&'static str, String)> {
    ALL.iter().map(|(source, _)| (source.name, source.text()))
}
