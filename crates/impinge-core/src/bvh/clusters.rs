//! Clusters: groups fixed by topology, found once in the current pose.
//!
//! In: the elements' corners and one pose. Out: an order of the elements in which cluster `c`
//! is the run `64 c .. 64 c + 64` (the last one may be shorter), the tree over clusters, the
//! corners in that order, and each cluster's unique vertices. A frame computes a cluster's box from
//! these, each read once (64 triangles of a closed mesh have about 45 unique vertices, not 192).
//!
//! Cost: `O(n log n)` time once per topology; 8 to 12 bytes per element for order and vertices,
//! and a copy of the corners. Inside a cluster, the order of the elements does not matter: frames
//! were not faster when runs of eight lay close together, and half of this work went into that.

use std::ops::Range;
use std::sync::OnceLock;

use super::adjacency::Adjacency;
use super::hubs::{self, Hubs};
use super::rings::Rings;
use super::tree::{GoOn, TreeEntry, TreeShape, order_while};
use super::unique::{LocalCorners, Unique};
use super::{GROUP, made_from};
use crate::scene::elements::{Elements, with_corners};
use crate::scene::index::{ClusterIx, ElementIx, Slot};

/// The clusters of one body.
#[derive(Debug)]
pub(crate) struct Clustering {
    /// The element at each slot of the order.
    pub order: Vec<ElementIx>,
    /// The corners at each slot of the order.
    pub corners: Elements,
    /// Unique vertices of all clusters, cluster after cluster. Each run ascends and repeats its
    /// last vertex up to a multiple of [`CHUNK`](super::CHUNK).
    pub vertices: Vec<u32>,
    /// Where each cluster's run starts, and one past the last.
    pub vertex_starts: Vec<u32>,
    /// The number of vertices, if every vertex up to the highest index belongs to some element;
    /// else `None`.
    pub n_vertices_covered: Option<usize>,
    /// The tree over the clusters.
    pub shape: TreeShape,
    hubs: Option<Hubs>,
    adjacency: OnceLock<Adjacency>,
    local_faces: OnceLock<Vec<LocalFaces>>,
    rings: OnceLock<Rings>,
}

/// What the order of the clusters follows: by element.
#[derive(Debug)]
pub(crate) struct ToOrder {
    /// The centres of the elements' boxes.
    pub centers: Vec<TreeEntry>,
    /// Classes of sizes, if these differ much.
    pub sizes: Option<Vec<u8>>,
}

/// The corners of a cluster's triangles as numbers of its vertices.
pub(crate) type LocalFaces = LocalCorners<3>;

impl Clustering {
    /// Clusters elements by the centres of their boxes in the current pose, which are given in
    /// the order of the elements. Those of one class of sizes follow each other. Their [local
    /// faces](Self::local_faces) are found at the same time if they are needed. `None` if `go_on`
    /// says no: it is asked between pieces of work that take a few milliseconds.
    pub fn new(
        elements: &Elements,
        to_order: ToOrder,
        with_local_faces: bool,
        go_on: &GoOn<'_>,
    ) -> Option<Self> {
        let ToOrder {
            centers: mut entries,
            sizes,
        } = to_order;
        let n = elements.len();
        let shape = TreeShape::new(n.div_ceil(GROUP));
        let counts = with_corners!(elements, |corners| hubs::counts(corners));
        let of_hubs = with_corners!(elements, |corners| hubs::classes(corners, &counts));
        let has_hubs = of_hubs.is_some();
        let classes = with_sizes(of_hubs, sizes);
        order_while(go_on, &shape, GROUP, classes.as_deref(), &mut entries);
        if !go_on() {
            return None;
        }
        let order = made_from(&entries, |_, entry| ElementIx::new(entry.number));
        let corners = with_corners!(elements, |corners| gather(corners, entries).into());
        let (vertices, vertex_starts, local_faces) = match &corners {
            Elements::Triangles(faces) if with_local_faces => {
                let unique = Unique::new(faces, counts.len(), true);
                (unique.vertices, unique.starts, unique.corners.into())
            }
            corners => with_corners!(corners, |corners| {
                let unique = Unique::new(corners, counts.len(), false);
                (unique.vertices, unique.starts, OnceLock::new())
            }),
        };
        if !go_on() {
            return None;
        }
        let hubs = has_hubs
            .then(|| with_corners!(&corners, |corners| Hubs::new(corners, &counts, &shape)));
        Some(Clustering {
            n_vertices_covered: counts
                .iter()
                .all(|&count| count > 0)
                .then_some(counts.len()),
            order,
            corners,
            vertices,
            vertex_starts,
            shape,
            hubs,
            adjacency: OnceLock::new(),
            local_faces,
            rings: OnceLock::new(),
        })
    }

    pub fn n_clusters(&self) -> usize {
        self.vertex_starts.len() - 1
    }

    /// All clusters.
    pub fn clusters(&self) -> impl ExactSizeIterator<Item = ClusterIx> + Clone + use<> {
        ClusterIx::up_to(self.n_clusters())
    }

    /// How many elements a cluster holds.
    #[inline(always)]
    pub fn size(&self, cluster: ClusterIx) -> usize {
        self.slots(cluster).len()
    }

    /// The slots of a cluster's elements.
    #[inline(always)]
    pub fn slots(&self, cluster: ClusterIx) -> Range<usize> {
        cluster.slots(self.order.len())
    }

    /// The slots of the elements of a run of clusters.
    #[cfg(feature = "gpu")]
    pub fn slots_of_run(&self, run: &Range<usize>) -> Range<usize> {
        let n = self.order.len();
        n.min(run.start * GROUP)..n.min(run.end * GROUP)
    }

    /// The elements of a cluster.
    #[inline(always)]
    pub fn elements(&self, cluster: ClusterIx) -> &[ElementIx] {
        &self.order[self.slots(cluster)]
    }

    /// The element at a slot.
    #[inline(always)]
    pub fn element(&self, slot: Slot) -> ElementIx {
        self.order[slot.index()]
    }

    /// The unique vertices of a cluster, ascending, the last one repeated up to a multiple of
    /// [`CHUNK`](super::CHUNK).
    #[inline(always)]
    pub fn vertices(&self, cluster: ClusterIx) -> &[u32] {
        let (starts, ix) = (&self.vertex_starts, cluster.index());
        &self.vertices[starts[ix] as usize..starts[ix + 1] as usize]
    }

    /// Vertices that very many elements name, if there are any.
    #[inline(always)]
    pub fn hubs(&self) -> Option<&Hubs> {
        self.hubs.as_ref()
    }

    /// Which elements share vertices that are not hubs; found at the first self-collision query.
    pub fn adjacency(&self) -> &Adjacency {
        self.adjacency
            .get_or_init(|| with_corners!(&self.corners, |corners| Adjacency::new(corners)))
    }

    /// Finds the local faces of all clusters, if the elements are triangles: for kernels that
    /// look corners up in a table of a cluster's vertices.
    pub fn find_local_faces(&self) {
        if let Elements::Triangles(faces) = &self.corners {
            let n_vertices = self
                .vertices
                .iter()
                .max()
                .map_or(0, |&last| last as usize + 1);
            let find = || Unique::new(faces, n_vertices, true).corners;
            self.local_faces.get_or_init(find);
        }
    }

    /// Whether there are no local faces to be found any more.
    pub fn knows_local_faces(&self) -> bool {
        self.local_faces.get().is_some() || !matches!(self.corners, Elements::Triangles(_))
    }

    /// The local faces of a cluster, if they have been found.
    #[inline(always)]
    pub fn local_faces(&self, cluster: ClusterIx) -> Option<&LocalFaces> {
        self.local_faces.get()?.get(cluster.index())
    }

    /// Finds the rings of the vertices, if the elements are triangles.
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

/// The classes of elements: by their hubs, if they have any, and else by their sizes. Vertices
/// have lower numbers than sizes.
fn with_sizes(
    of_hubs: Option<Vec<Option<u32>>>,
    sizes: Option<Vec<u8>>,
) -> Option<Vec<Option<u32>>> {
    let Some(sizes) = sizes else {
        return of_hubs;
    };
    let of_size = |size: u8| (size > 0).then(|| u32::MAX - u32::from(u8::MAX - size));
    let mut classes = of_hubs.unwrap_or_else(|| vec![None; sizes.len()]);
    for (class, size) in classes.iter_mut().zip(sizes) {
        *class = class.or(of_size(size));
    }
    Some(classes)
}

/// The corners in the order of the entries, in their memory: the first use of new memory would take
/// four times as long as this loop does.
fn gather<const N: usize>(elements: &[[u32; N]], entries: Vec<TreeEntry>) -> Vec<[u32; N]> {
    let corners = entries
        .into_iter()
        .map(|entry| elements[entry.number as usize]);
    let mut corners: Vec<[u32; N]> = corners.collect();
    corners.shrink_to_fit();
    corners
}
