//! The clusters as they are sent to the device once per topology: elements, corners and vertices.

use std::ops::Range;

use super::layout::{Body, Cluster, ClusterVertex, Coordinate, Corners, Node, Order};
use crate::bvh::clusters::Clustering;
use crate::scene::elements::BodyKind;
use crate::scene::index::{ClusterIx, Number};

/// Clusters as kernels read them.
#[derive(Debug, Default)]
pub struct DeviceClusters {
    pub clusters: Vec<Cluster>,
    pub cluster_vertices: Vec<ClusterVertex>,
    pub corners: Vec<Corners>,
    /// The global number of each element.
    pub numbers: Vec<Order>,
    pub has_solids: bool,
}

impl DeviceClusters {
    /// Appends a run of clusters of a body whose first element has the global number `first`.
    /// `body`: its number on the device; `on_device`: where each of its vertices is there.
    pub fn push(
        &mut self,
        clustering: &Clustering,
        clusters: Range<usize>,
        first: Number,
        body: u32,
        on_device: impl Fn(u32) -> u32,
    ) {
        let slots = clustering.slots_of_run(&clusters);
        for cluster in ClusterIx::each(clusters) {
            let vertices = clustering.vertices(cluster);
            let first_slot = self.corners.len() + cluster.slot(0).index() - slots.start;
            self.clusters.push(Cluster {
                // Slots and vertices fit 32 bits: the caller has checked the sizes.
                first_slot: first_slot as u32,
                first_vertex: self.cluster_vertices.len() as u32,
                sizes: clustering.size(cluster) as u32 | (vertices.len() as u32) << 16,
                body,
            });
            let vertices = vertices.iter().map(|&vertex| ClusterVertex {
                vertex: on_device(vertex),
            });
            self.cluster_vertices.extend(vertices);
        }
        let is_solid = clustering.corners.kind() == BodyKind::Tetrahedra;
        self.has_solids |= is_solid && !slots.is_empty();
        // Edges and points become degenerate triangles.
        let corners = slots.clone().map(|ix| Corners {
            vertices: clustering.corners.four_corners(ix).map(&on_device),
        });
        self.corners.extend(corners);
        let order = clustering.order[slots].iter();
        self.numbers.extend(order.map(|&element| Order {
            number: first.plus(element).raw(),
        }));
    }
}

/// The size of the data to send.
#[derive(Debug, Clone, Copy, Default)]
pub struct Weight {
    pub n_elements: u64,
    pub n_vertices: u64,
    pub n_cluster_vertices: u64,
    pub n_clusters: u64,
    pub n_nodes: u64,
    pub n_bodies: u64,
}

const fn bytes<T>(n: u64) -> u64 {
    n * size_of::<T>() as u64
}

impl Weight {
    /// Adds a cluster of a piece, with nodes and a body of its own, as if no other cluster shared
    /// them.
    pub fn add_cluster(&mut self, n_elements: u64, n_vertices: u64) {
        self.n_elements += n_elements;
        self.n_vertices += n_vertices;
        self.n_cluster_vertices += n_vertices;
        self.n_clusters += 1;
        self.n_nodes += 2;
        self.n_bodies += 1;
    }

    /// Bytes of the largest buffer.
    pub fn binding(&self) -> u64 {
        let sizes = [
            bytes::<Corners>(self.n_elements),
            bytes::<[Coordinate; 3]>(self.n_vertices),
            bytes::<ClusterVertex>(self.n_cluster_vertices),
            bytes::<Node>(self.n_nodes),
            bytes::<Body>(self.n_bodies),
        ];
        sizes.into_iter().max().unwrap_or(0)
    }

    /// Bytes of all buffers.
    pub fn bytes(&self) -> u64 {
        bytes::<Corners>(self.n_elements)
            + bytes::<Order>(self.n_elements)
            + bytes::<[Coordinate; 3]>(self.n_vertices)
            + bytes::<ClusterVertex>(self.n_cluster_vertices)
            + bytes::<Cluster>(self.n_clusters)
            + bytes::<Node>(self.n_nodes)
            + bytes::<Body>(self.n_bodies)
    }

    /// Whether no buffer has more than `most.binding` bytes and all together have at most
    /// `most.bytes`.
    pub fn fits(&self, most: Most) -> bool {
        self.binding() <= most.binding && self.bytes() <= most.bytes
    }
}

/// The most of a frame, or of a piece of it, that may be on the device at once.
#[derive(Debug, Clone, Copy)]
pub struct Most {
    /// Bytes of one buffer.
    pub binding: u64,
    /// Bytes of all buffers that hold topology and positions.
    pub bytes: u64,
}

/// The bits of a coordinate rounded to nearest; boxes and filter allow for it, see `Body::slack`.
pub fn narrowed(x: &f64) -> u32 {
    (*x as f32).to_bits()
}
