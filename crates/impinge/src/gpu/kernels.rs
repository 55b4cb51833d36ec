//! All kernels: their sources, their bindings, and the compiled set.

use super::layout::{
    Arguments, Body, Candidate, Cluster, ClusterVertex, Coordinate, Corners, Counter, Level, Node,
    NodePair, Order, PairKey, Params, UnsureKey, WorkItem,
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
    /// `dispatch.wgsl`
    Dispatch {
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
    /// `narrow.wgsl`
    Narrow {
        candidates: Read<Candidate>,
        corners: Read<Corners>,
        positions: Read<Coordinate>,
        order: Read<Order>,
        pairs: Write<PairKey>,
        unsure: Write<UnsureKey>,
        counters: Write<Counter>,
    }
}

pub(crate) const BOUNDS_CLUSTERS: Source =
    source!("bounds_clusters", "boxes", "vertices", "groups");
pub(crate) const BOUNDS_LEVEL: Source = source!("bounds_level", "refit", "groups");
pub(crate) const BOUNDS_TOP: Source = source!("bounds_top", "refit");
pub(crate) const PREPARE: Source = source!("prepare");
pub(crate) const DISPATCH: Source = source!("dispatch", "boxes", "reserve", "groups");
pub(crate) const PAIRING: Source = source!("pairing", "boxes", "vertices", "reserve", "groups");
pub(crate) const NARROW: Source = source!(
    "narrow",
    "filter",
    "triangles",
    "solids",
    "reserve",
    "groups"
);

/// Every kernel, compiled.
pub(crate) struct Kernels {
    pub bounds_clusters: Kernel<BoundsClusters>,
    pub bounds_level: Kernel<BoundsLevel>,
    pub bounds_top: Kernel<BoundsTop>,
    pub prepare: Kernel<Prepare>,
    pub dispatch: Kernel<Dispatch>,
    pub pairing: Kernel<Pairing>,
    /// For scenes of triangles alone.
    pub narrow: Kernel<Narrow>,
    /// For scenes with tetrahedra.
    pub narrow_solids: Kernel<Narrow>,
}

impl Kernels {
    /// Compiles all of them; errors go to the error scopes that are open.
    pub fn new(device: &wgpu::Device) -> Self {
        Kernels {
            bounds_clusters: Kernel::new(device, &BOUNDS_CLUSTERS, &[]),
            bounds_level: Kernel::new(device, &BOUNDS_LEVEL, &[]),
            bounds_top: Kernel::new(device, &BOUNDS_TOP, &[]),
            prepare: Kernel::new(device, &PREPARE, &[]),
            dispatch: Kernel::new(device, &DISPATCH, &[]),
            pairing: Kernel::new(device, &PAIRING, &[]),
            narrow: Kernel::new(device, &NARROW, &[("WITH_SOLIDS", 0.0)]),
            narrow_solids: Kernel::new(device, &NARROW, &[("WITH_SOLIDS", 1.0)]),
        }
    }
}
