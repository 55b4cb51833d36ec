//! Which elements share vertices, as 64-bit masks fixed by topology.
//!
//! In self-collision nearly all box overlaps are between neighbours on one surface, which the
//! adjacency rule excludes. Since a clustering never changes, the rule is one mask per element,
//! made once: bit `j` of the mask of element `i` says that `i` and lane `j` of the other cluster
//! name a common vertex. A frame then clears neighbours from its candidate masks with one `and`.
//!
//! ```text
//! cluster A, lane 5             own cluster      0b…0101_0000   lanes that share a vertex
//!                 neighbour B > A, entry (5, mask)  0b…0000_0011   lanes of B that share a vertex
//! ```
//!
//! A vertex with very many elements (the hub of a fan) would make these masks quadratic. Hubs are
//! left out: [`hubs`](super::hubs) has separate masks for them.
//!
//! Cost: `O(n · valence)` once per topology; about 8 bytes per element for the own masks and
//! about as much for those of neighbours, at most `HUB` entries per corner.

use crate::scene::index::{ClusterIx, Slot};

use super::hubs::{self, HUB};
use super::{GROUP, parallel};

/// The masks of one body's clusters.
#[derive(Debug)]
pub(crate) struct Adjacency {
    /// One mask per slot of the order: lanes of the same cluster that share a vertex, itself
    /// included.
    own: Vec<u64>,
    /// Neighbour clusters of each cluster, higher numbers only.
    neighbors: Vec<Neighbor>,
    neighbor_starts: Vec<u32>,
    lanes: Vec<u8>,
    masks: Vec<u64>,
}

#[derive(Debug, Clone, Copy)]
struct Neighbor {
    cluster: ClusterIx,
    /// First entry in `lanes` and `masks`; the entries end where the next neighbour's begin.
    first: u32,
}

/// The masks of one cluster.
struct ClusterMasks {
    own: Vec<u64>,
    /// `(neighbour cluster, lane, mask)`, sorted.
    entries: Vec<(ClusterIx, u8, u64)>,
}

impl Adjacency {
    /// From the corners in cluster order.
    pub fn new<const N: usize>(corners: &[[u32; N]]) -> Self {
        let incidence = ElementsAtVertices::new(corners);
        let n_clusters = corners.len().div_ceil(GROUP);
        let of_cluster = |(): &mut (), cluster: usize| -> ClusterMasks {
            part(ClusterIx::from_usize(cluster), corners, &incidence)
        };
        let parts = parallel::made(n_clusters, 32, || (), of_cluster);
        let mut adjacency = Adjacency {
            own: Vec::with_capacity(corners.len()),
            neighbors: Vec::new(),
            neighbor_starts: vec![0],
            lanes: Vec::new(),
            masks: Vec::new(),
        };
        for part in parts {
            adjacency.own.extend_from_slice(&part.own);
            let mut last = None;
            for (cluster, lane, mask) in part.entries {
                if last != Some(cluster) {
                    last = Some(cluster);
                    adjacency.neighbors.push(Neighbor {
                        cluster,
                        first: adjacency.lanes.len() as u32,
                    });
                }
                adjacency.lanes.push(lane);
                adjacency.masks.push(mask);
            }
            adjacency
                .neighbor_starts
                .push(adjacency.neighbors.len() as u32);
        }
        let end = adjacency.lanes.len() as u32;
        adjacency.neighbors.push(Neighbor {
            cluster: ClusterIx::new(u32::MAX),
            first: end,
        });
        adjacency
    }

    /// The own masks of a cluster's elements, one per lane.
    #[inline(always)]
    pub fn own(&self, cluster: ClusterIx) -> &[u64] {
        &self.own[cluster.slots(self.own.len())]
    }

    /// Lanes of cluster `a` that share vertices with lanes of cluster `b > a`, and those lanes'
    /// masks.
    #[inline]
    pub fn between(&self, a: ClusterIx, b: ClusterIx) -> impl Iterator<Item = (usize, u64)> + '_ {
        let (starts, a) = (&self.neighbor_starts, a.index());
        let neighbors = starts[a] as usize..starts[a + 1] as usize;
        let entries = neighbors
            .clone()
            .find(|&ix| self.neighbors[ix].cluster == b)
            .map_or(0..0, |ix| {
                self.neighbors[ix].first as usize..self.neighbors[ix + 1].first as usize
            });
        self.lanes[entries.clone()]
            .iter()
            .zip(&self.masks[entries])
            .map(|(&lane, &mask)| (lane as usize, mask))
    }

    pub fn bytes(&self) -> usize {
        size_of_val(&self.own[..])
            + size_of_val(&self.neighbors[..])
            + size_of_val(&self.neighbor_starts[..])
            + size_of_val(&self.lanes[..])
            + size_of_val(&self.masks[..])
    }
}

/// For each vertex, the slots of the elements that name it.
struct ElementsAtVertices {
    starts: Vec<u32>,
    slots: Vec<Slot>,
}

impl ElementsAtVertices {
    fn new<const N: usize>(corners: &[[u32; N]]) -> Self {
        let flat = corners.as_flattened();
        let counts = hubs::counts(corners);
        let is_hub = |vertex: usize| counts[vertex] > HUB;
        let mut starts = Vec::with_capacity(counts.len() + 1);
        let mut start = 0;
        starts.push(start);
        for (vertex, &count) in counts.iter().enumerate() {
            // Hubs keep no slots.
            start += if is_hub(vertex) { 0 } else { count };
            starts.push(start);
        }
        let mut next = starts.clone();
        let mut slots = vec![Slot::default(); *starts.last().expect("never empty") as usize];
        for (slot, &vertex) in flat.iter().enumerate() {
            let vertex = vertex as usize;
            if !is_hub(vertex) {
                slots[next[vertex] as usize] = Slot::from_usize(slot / N);
                next[vertex] += 1;
            }
        }
        ElementsAtVertices { starts, slots }
    }

    /// The slots that name the vertex; empty for a hub.
    fn of(&self, vertex: u32) -> &[Slot] {
        let vertex = vertex as usize;
        &self.slots[self.starts[vertex] as usize..self.starts[vertex + 1] as usize]
    }
}

fn part<const N: usize>(
    cluster: ClusterIx,
    corners: &[[u32; N]],
    incidence: &ElementsAtVertices,
) -> ClusterMasks {
    let group = &corners[cluster.slots(corners.len())];
    let mut own = vec![0u64; group.len()];
    let mut entries: Vec<(ClusterIx, u8, u64)> = Vec::new();
    for (lane, element) in group.iter().enumerate() {
        own[lane] |= 1 << lane;
        for &vertex in element {
            for &slot in incidence.of(vertex) {
                let (other, bit) = (slot.cluster(), 1u64 << slot.lane());
                if other == cluster {
                    own[lane] |= bit;
                } else if other > cluster {
                    entries.push((other, lane as u8, bit));
                }
            }
        }
    }
    entries.sort_unstable_by_key(|&(other, lane, _)| (other, lane));
    entries.dedup_by(|next, kept| {
        let same = (next.0, next.1) == (kept.0, kept.1);
        if same {
            kept.2 |= next.2;
        }
        same
    });
    ClusterMasks { own, entries }
}
