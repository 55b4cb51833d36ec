//! Clusters: groups fixed by topology, found once in the current pose.
//!
//! In: the primitives' corners and one pose. Out: an order of the primitives in which cluster `c`
//! is the run `64 c .. 64 c + 64` (the last one may be shorter), the tree over clusters, the corners in
//! that order, and each cluster's unique vertices. A frame computes a cluster's box from these, each
//! read once (64 triangles of a closed mesh have about 45 unique vertices, not 192).
//!
//! Cost: `O(n log n)` time once per topology; 8 to 12 bytes per primitive for order and vertices, and a
//! copy of the corners. Inside a cluster, runs of eight primitives lie close together, so that a
//! vector of lanes tends to be needed whole or not at all.

use std::sync::OnceLock;

use rayon::prelude::*;

use super::GROUP;
use super::adjacency::Adjacency;
use super::bounds::Bounds;
use super::hierarchy::{Entry, Shape};
use super::hubs::{self, Hubs};
use super::rings::Rings;
use crate::elements::{Elements, with_corners};

/// Runs this short are not split further inside a cluster.
const FINEST_RUN: usize = 8;
/// A cluster's vertices are padded to whole chunks of this many: a loop over them needs no remainder, and its end
/// is easy to predict.
pub(crate) const CHUNK: usize = 8;

/// The clusters of one body.
#[derive(Debug)]
pub(crate) struct Clustering {
    /// The primitive at each place of the order.
    pub order: Vec<u32>,
    /// The corners at each place of the order.
    pub corners: Elements,
    /// Unique vertices of all clusters, cluster after cluster. Each run ascends and repeats its last vertex up
    /// to a multiple of [`CHUNK`].
    pub vertices: Vec<u32>,
    /// Where each cluster's run starts, and one past the last.
    pub vertex_starts: Vec<u32>,
    /// The number of vertices, if every vertex up to the highest index belongs to some primitive; else `None`.
    pub n_vertices_covered: Option<usize>,
    /// The tree over the clusters.
    pub shape: Shape,
    hubs: Option<Hubs>,
    adjacency: OnceLock<Adjacency>,
    local_faces: OnceLock<Vec<LocalFaces>>,
    rings: OnceLock<Rings>,
}

/// The corners of a cluster's triangles as numbers of its vertices: `[corner][place]`. Places past its size hold 0.
pub(crate) type LocalFaces = [[u8; GROUP]; 3];

/// With three vertices per triangle, the numbers fit a byte.
const _: () = assert!(3 * GROUP <= 256);

impl Clustering {
    /// Clusters primitives whose boxes in the current pose are given by `bounds`.
    pub fn new(elements: &Elements, bounds: impl Fn(usize) -> Bounds + Sync) -> Self {
        let n = elements.len();
        let shape = Shape::new(n.div_ceil(GROUP));
        let mut entries: Vec<Entry> = (0..n)
            .into_par_iter()
            .with_min_len(4096)
            .map(|primitive| Entry {
                center: bounds(primitive).center(),
                number: primitive as u32,
            })
            .collect();
        let classes = with_corners!(elements, |corners| hubs::classes(corners));
        let classes = classes.as_deref();
        super::hierarchy::order(&shape, GROUP, FINEST_RUN, classes, &mut entries);
        let order: Vec<u32> = entries.iter().map(|entry| entry.number).collect();
        drop(entries);
        let corners = with_corners!(elements, |corners| gather(corners, &order).into());
        let (vertices, vertex_starts) = with_corners!(&corners, |corners| unique_vertices(corners));
        let hubs = classes
            .is_some()
            .then(|| with_corners!(&corners, |corners| Hubs::new(corners, &shape)));
        Clustering {
            n_vertices_covered: covered(&vertices),
            order,
            corners,
            vertices,
            vertex_starts,
            shape,
            hubs,
            adjacency: OnceLock::new(),
            local_faces: OnceLock::new(),
            rings: OnceLock::new(),
        }
    }

    pub fn n_clusters(&self) -> usize {
        self.vertex_starts.len() - 1
    }

    /// How many primitives a cluster holds.
    #[inline(always)]
    pub fn size(&self, cluster: usize) -> usize {
        (self.order.len() - cluster * GROUP).min(GROUP)
    }

    /// The unique vertices of a cluster, ascending, the last one repeated up to a multiple of [`CHUNK`].
    #[inline(always)]
    pub fn vertices(&self, cluster: usize) -> &[u32] {
        let starts = &self.vertex_starts;
        &self.vertices[starts[cluster] as usize..starts[cluster + 1] as usize]
    }

    /// Vertices that very many primitives name, if there are any.
    #[inline(always)]
    pub fn hubs(&self) -> Option<&Hubs> {
        self.hubs.as_ref()
    }

    /// Which primitives share vertices that are not hubs; found at the first self-collision query.
    pub fn adjacency(&self) -> &Adjacency {
        self.adjacency
            .get_or_init(|| with_corners!(&self.corners, |corners| Adjacency::new(corners)))
    }

    /// Finds the corners of each cluster's triangles as numbers of its own vertices, for kernels that look them up.
    pub fn find_local_faces(&self) {
        self.local_faces.get_or_init(|| match &self.corners {
            Elements::Triangles(faces) => (0..self.n_clusters())
                .into_par_iter()
                .with_min_len(64)
                .map(|cluster| {
                    let places = cluster * GROUP..cluster * GROUP + self.size(cluster);
                    local_faces(&faces[places], self.vertices(cluster))
                })
                .collect(),
            _ => Vec::new(),
        });
    }

    /// The local faces of a cluster, if they have been found.
    #[inline(always)]
    pub fn local_faces(&self, cluster: usize) -> Option<&LocalFaces> {
        self.local_faces.get()?.get(cluster)
    }

    /// Finds the rings of the vertices, if the primitives are triangles.
    pub fn find_rings(&self) {
        if let Elements::Triangles(faces) = &self.corners {
            self.rings.get_or_init(|| Rings::new(faces));
        }
    }

    /// The rings of the vertices, if they have been found.
    #[inline(always)]
    pub fn rings(&self) -> Option<&Rings> {
        self.rings.get()
    }

    /// Whether [`adjacency`](Self::adjacency) has been found.
    pub fn knows_adjacency(&self) -> bool {
        self.adjacency.get().is_some()
    }

    pub fn bytes(&self) -> usize {
        self.corners.bytes()
            + size_of_val(&self.order[..])
            + size_of_val(&self.vertices[..])
            + size_of_val(&self.vertex_starts[..])
            + self.shape.bytes()
            + self.hubs.as_ref().map_or(0, Hubs::bytes)
            + self.adjacency.get().map_or(0, Adjacency::bytes)
            + self.rings.get().map_or(0, Rings::bytes)
            + self
                .local_faces
                .get()
                .map_or(0, |faces| size_of_val(&faces[..]))
    }
}

fn local_faces(faces: &[[u32; 3]], vertices: &[u32]) -> LocalFaces {
    let mut local = [[0; GROUP]; 3];
    for (place, face) in faces.iter().enumerate() {
        for corner in 0..3 {
            // The first occurrence: the last vertex is repeated.
            let number = vertices.partition_point(|&vertex| vertex < face[corner]);
            local[corner][place] = number as u8;
        }
    }
    local
}

/// `n` if vertices `0..n` all occur.
fn covered(vertices: &[u32]) -> Option<usize> {
    let n = vertices.iter().max().map_or(0, |&last| last as usize + 1);
    let mut seen = vec![false; n];
    for &vertex in vertices {
        seen[vertex as usize] = true;
    }
    seen.iter().all(|&seen| seen).then_some(n)
}

fn gather<const N: usize>(elements: &[[u32; N]], order: &[u32]) -> Vec<[u32; N]> {
    order
        .par_iter()
        .with_min_len(16 * 1024)
        .map(|&primitive| elements[primitive as usize])
        .collect()
}

/// The unique vertices of all clusters, and where each cluster's run starts, and one past the last.
fn unique_vertices<const N: usize>(corners: &[[u32; N]]) -> (Vec<u32>, Vec<u32>) {
    /// Clusters that a thread takes at a time.
    const BLOCK: usize = 64;
    let blocks: Vec<(Vec<u32>, Vec<u32>)> = corners
        .par_chunks(BLOCK * GROUP)
        .map(|block| {
            let mut seen = Seen::default();
            let (mut vertices, mut lengths) = (Vec::new(), Vec::with_capacity(BLOCK));
            for group in block.chunks(GROUP) {
                let start = vertices.len();
                seen.forget();
                let corners = group.as_flattened().iter().copied();
                vertices.extend(corners.filter(|&vertex| seen.is_new(vertex)));
                vertices[start..].sort_unstable();
                let last = vertices[vertices.len() - 1];
                let length = (vertices.len() - start).next_multiple_of(CHUNK);
                vertices.resize(start + length, last);
                lengths.push(length as u32);
            }
            (vertices, lengths)
        })
        .collect();
    let mut starts = Vec::with_capacity(corners.len().div_ceil(GROUP) + 1);
    let mut end = 0;
    starts.push(end);
    let mut vertices = Vec::with_capacity(blocks.iter().map(|block| block.0.len()).sum());
    for (of_block, lengths) in blocks {
        vertices.extend_from_slice(&of_block);
        for length in lengths {
            end += length;
            starts.push(end);
        }
    }
    (vertices, starts)
}

/// The vertices of a cluster seen so far, as a hash table. Sorting only what is new takes less than half the time of
/// sorting all corners, of which each vertex has about four.
struct Seen {
    slots: [(u32, u32); Seen::SLOTS],
    /// Slots of another turn are empty.
    turn: u32,
}

impl Default for Seen {
    fn default() -> Self {
        Seen {
            slots: [(0, 0); Seen::SLOTS],
            turn: 0,
        }
    }
}

impl Seen {
    /// At most half of them are taken: a cluster has up to four corners per primitive.
    const SLOTS: usize = 2 * 4 * GROUP;

    fn forget(&mut self) {
        self.turn += 1;
    }

    #[inline(always)]
    fn is_new(&mut self, vertex: u32) -> bool {
        // Fibonacci hashing (Knuth, TAOCP 3, 6.4): the highest bits of the product with 2^32 over the golden ratio.
        let hash = vertex.wrapping_mul(0x9E37_79B1) >> (u32::BITS - Seen::SLOTS.ilog2());
        let mut slot = hash as usize;
        while self.slots[slot].0 == self.turn {
            if self.slots[slot].1 == vertex {
                return false;
            }
            slot = (slot + 1) % Seen::SLOTS;
        }
        self.slots[slot] = (self.turn, vertex);
        true
    }
}
