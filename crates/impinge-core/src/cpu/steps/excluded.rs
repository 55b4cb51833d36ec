//! Which pairs of one body are never candidates, as bits of lanes: those that share a vertex, and
//! those that the query leaves out by lists of vertices or by name.
//!
//! ```text
//! cluster a -> [cluster b, rows, ..]     clusters with a pair that is excluded
//!                          |
//!                row -> lanes of b       bits that pairing takes away from those whose boxes meet
//! ```
//!
//! Most elements near an element are its neighbours in the surface, so most boxes that meet are of
//! pairs that are excluded. They depend on topology and query alone: found once, each costs a bit
//! in place of a comparison of all corners. Bodies with hubs have none: all pairs of a fan share
//! its middle, and pairing compares the corners of candidates.
//!
//! Cost: `O(n)` for each pair of parts, once per topology and query; some 50 bytes per element of a
//! surface without two rings.

use std::ops::Range;
use std::sync::Arc;

use crate::bvh::GROUP;
use crate::bvh::clusters::Clustering;
use crate::plan::{OwnRule, Plan};
use crate::query::pair_kind::PairKind;
use crate::query::pair_set::SortedKeys;
use crate::scene::error::Error;
use crate::scene::index::{ClusterIx, Number, PartIx, Slot, pair_numbers};
use crate::search::sink::{filled, grow, reserve};
use crate::search::sparse_rows::SparseRows;
use crate::search::work::Work;
use crate::simd::{Lanes, Masks};

/// Clusters per task.
const CLUSTERS: usize = 64;
const WHAT: &str = "excluded pairs";

/// The excluded pairs of two parts of a body, or of one part.
#[derive(Debug)]
pub(super) struct ExcludedLanes {
    /// Where the entries of each cluster of the first part start, and one past the last.
    starts: Vec<u32>,
    entries: Vec<ExcludedClusters>,
    lanes: Vec<u64>,
}

/// Two clusters with a pair that is excluded.
#[derive(Debug, Clone, Copy)]
struct ExcludedClusters {
    /// Of the second part; of one part, the first cluster or a later one.
    other: ClusterIx,
    /// Rows with excluded pairs: lanes of the first part.
    rows: u64,
    /// Where the lanes of the first such row are; the others follow.
    first: usize,
}

/// The excluded pairs of two clusters.
#[derive(Debug, Clone, Copy)]
pub(super) struct ExcludedRows<'a> {
    rows: u64,
    lanes: &'a [u64],
}

impl ExcludedRows<'_> {
    /// Takes the excluded pairs away.
    #[inline(always)]
    pub fn take_from(self, masks: &mut Masks) {
        for (row, lanes) in Lanes(self.rows).zip(self.lanes) {
            masks.0[row] &= !lanes;
        }
    }
}

impl ExcludedLanes {
    /// Finds the excluded pairs of two parts of a body, the second of which may be the first.
    /// `None` if hubs make them too many.
    ///
    /// # Errors
    /// There is no memory; cancellation.
    pub fn new(
        plan: &Plan,
        parts: [PartIx; 2],
        clusterings: [&Clustering; 2],
        rule: &OwnRule,
        work: Work<'_>,
    ) -> Result<Option<Arc<Self>>, Error> {
        if clusterings.iter().any(|of| of.hubs().is_some()) {
            return Ok(None);
        }
        let is_own = parts[0] == parts[1];
        let finder = ExclusionFinder {
            clusterings,
            is_own,
            slots: slots_of_vertices(clusterings[1])?,
            rule,
            named: named(plan, parts, clusterings, rule)?,
        };
        let n = clusterings[0].n_clusters();
        let n_each = work.workers.task(CLUSTERS);
        let tasks = (0..n).step_by(n_each).map(|first| ExcludedRun {
            clusters: first..n.min(first + n_each),
            ..ExcludedRun::default()
        });
        let mut runs: Vec<ExcludedRun> = tasks.collect();
        work.each(&mut runs, |_, run| {
            let mut scratch = Scratch::default();
            for cluster in ClusterIx::each(run.clusters.clone()) {
                finder.put(cluster, &mut scratch, run)?;
            }
            Ok(())
        })?;
        let mut all = ExcludedLanes {
            starts: vec![0],
            entries: Vec::new(),
            lanes: Vec::new(),
        };
        let [entries, lanes] = runs.iter().fold([0, 0], |[entries, lanes], run| {
            [entries + run.entries.len(), lanes + run.lanes.len()]
        });
        reserve(&mut all.starts, n, WHAT)?;
        reserve(&mut all.entries, entries, WHAT)?;
        reserve(&mut all.lanes, lanes, WHAT)?;
        for run in runs {
            let [n_entries, n_lanes] = [all.entries.len(), all.lanes.len()];
            all.starts
                .extend(run.ends.iter().map(|end| n_entries as u32 + end));
            let moved = run.entries.iter().map(|entry| ExcludedClusters {
                first: n_lanes + entry.first,
                ..*entry
            });
            all.entries.extend(moved);
            all.lanes.extend_from_slice(&run.lanes);
        }
        Ok(Some(Arc::new(all)))
    }

    /// The excluded pairs of two clusters, if there are any.
    #[inline(always)]
    pub fn of(&self, a: ClusterIx, b: ClusterIx) -> Option<ExcludedRows<'_>> {
        let [start, end] = [0, 1].map(|next| self.starts[a.index() + next] as usize);
        let own = &self.entries[start..end];
        let found = own.binary_search_by_key(&b, |entry| entry.other).ok()?;
        let ExcludedClusters { rows, first, .. } = own[found];
        Some(ExcludedRows {
            rows,
            lanes: &self.lanes[first..][..rows.count_ones() as usize],
        })
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.starts[..])
            + size_of_val(&self.entries[..])
            + size_of_val(&self.lanes[..])
    }
}

/// What was found of some clusters.
#[derive(Debug, Default)]
struct ExcludedRun {
    clusters: Range<usize>,
    /// Of each cluster, the entries up to its last one.
    ends: Vec<u32>,
    entries: Vec<ExcludedClusters>,
    lanes: Vec<u64>,
}

struct ExclusionFinder<'a> {
    clusterings: [&'a Clustering; 2],
    is_own: bool,
    /// The elements of the second part at each vertex.
    slots: SparseRows<Slot>,
    rule: &'a OwnRule,
    /// Pairs that are left out by name, sorted: the first slot in the upper half.
    named: Vec<u64>,
}

/// Of some clusters, lanes by row.
#[derive(Debug, Default)]
struct LanesByRow {
    clusters: Vec<ClusterIx>,
    /// `n_rows` for each cluster.
    lanes: Vec<u64>,
    n_rows: usize,
    last: usize,
}

impl LanesByRow {
    fn begin(&mut self, n_rows: usize) {
        self.clusters.clear();
        self.lanes.clear();
        self.n_rows = n_rows;
        self.last = 0;
    }

    /// Marks an element in a row.
    #[inline]
    fn put(&mut self, row: usize, slot: Slot) {
        let cluster = slot.cluster();
        // Slots of a vertex are near each other.
        if self.clusters.get(self.last) != Some(&cluster) {
            self.last = match self.clusters.iter().position(|&own| own == cluster) {
                Some(ix) => ix,
                None => {
                    self.clusters.push(cluster);
                    self.lanes.resize(self.lanes.len() + self.n_rows, 0);
                    self.clusters.len() - 1
                }
            };
        }
        self.lanes[self.last * self.n_rows + row] |= 1 << slot.lane();
    }

    /// The rows of each cluster.
    fn iter(&self) -> impl Iterator<Item = (ClusterIx, &[u64])> {
        let rows = self.lanes.chunks_exact(self.n_rows.max(1));
        self.clusters.iter().copied().zip(rows)
    }
}

#[derive(Debug, Default)]
struct Scratch {
    vertices: Vec<u32>,
    by_vertex: LanesByRow,
    by_lane: LanesByRow,
    /// Clusters in the upper half, and where they are.
    order: Vec<u64>,
}

impl ExclusionFinder<'_> {
    /// Finds what is excluded of the elements of a cluster.
    fn put(
        &self,
        cluster: ClusterIx,
        scratch: &mut Scratch,
        run: &mut ExcludedRun,
    ) -> Result<(), Error> {
        let Scratch {
            vertices,
            by_vertex,
            by_lane,
            order,
        } = scratch;
        let [of_a, _] = self.clusterings;
        vertices.clear();
        vertices.extend_from_slice(of_a.vertices(cluster));
        vertices.dedup();
        by_vertex.begin(vertices.len());
        for (row, &vertex) in vertices.iter().enumerate() {
            let mut put = |vertex| {
                for &slot in self.slots.of(vertex as usize) {
                    if !self.is_own || slot.cluster() >= cluster {
                        by_vertex.put(row, slot);
                    }
                }
            };
            put(vertex);
            let listed = self.rule.lists.iter().flat_map(|lists| lists.of(vertex));
            listed.for_each(|&other| put(other));
        }
        by_lane.begin(GROUP);
        for (other, of_vertices) in by_vertex.iter() {
            by_lane.clusters.push(other);
            let first = by_lane.lanes.len();
            by_lane.lanes.resize(first + GROUP, 0);
            let rows = &mut by_lane.lanes[first..];
            for (row, slot) in rows.iter_mut().zip(of_a.slots(cluster)) {
                for corner in of_a.corners.corners(slot) {
                    let local = vertices.partition_point(|vertex| vertex < corner);
                    *row |= of_vertices[local];
                }
            }
        }
        let first = u64::from(cluster.slot(0).raw()) << 32;
        let named = self.named.partition_point(|&pair| pair < first);
        for &pair in &self.named[named..] {
            let [a, b] = [(pair >> 32) as u32, pair as u32].map(Slot::new);
            if a.cluster() != cluster {
                break;
            }
            by_lane.put(a.lane() as usize, b);
        }
        order.clear();
        let clusters = (0u64..).zip(&by_lane.clusters);
        order.extend(clusters.map(|(ix, other)| u64::from(other.raw()) << 32 | ix));
        order.sort_unstable();
        for ix in order.iter().map(|&ix| ix as u32 as usize) {
            let rows = &by_lane.lanes[ix * GROUP..][..GROUP];
            let marked = (0..GROUP).filter(|&row| rows[row] != 0);
            let first = run.lanes.len();
            let marked = marked.fold(0u64, |marked, row| marked | 1 << row);
            grow(&mut run.lanes, marked.count_ones() as usize, WHAT)?;
            run.lanes.extend(Lanes(marked).map(|row| rows[row]));
            grow(&mut run.entries, 1, WHAT)?;
            run.entries.push(ExcludedClusters {
                other: by_lane.clusters[ix],
                rows: marked,
                first,
            });
        }
        run.ends.push(run.entries.len() as u32);
        Ok(())
    }
}

/// The elements at each vertex.
fn slots_of_vertices(clustering: &Clustering) -> Result<SparseRows<Slot>, Error> {
    let last = clustering.vertices.iter().max();
    let n = last.map_or(0, |&last| last as usize + 1);
    let corners = || {
        let slots = 0..clustering.order.len();
        slots.flat_map(|slot| {
            let corners = clustering.corners.corners(slot).iter();
            corners.map(move |&corner| (corner, Slot::from_usize(slot)))
        })
    };
    SparseRows::new(n, corners, WHAT)
}

/// The pairs of two parts that are left out by name, sorted: the first slot in the upper half.
/// Those of one cluster are there both ways.
fn named(
    plan: &Plan,
    [a, b]: [PartIx; 2],
    clusterings: [&Clustering; 2],
    rule: &OwnRule,
) -> Result<Vec<u64>, Error> {
    let [of_a, of_b] = [a, b].map(|part| plan.part(part));
    let Some(kind) = PairKind::of(of_a.part, of_b.part) else {
        return Ok(Vec::new());
    };
    // The lower number is of the first part.
    let with_first = |keys: &SortedKeys| {
        let keys = &keys[kind as usize];
        let before = |number: Number| keys.partition_point(|&key| key < number.first_key());
        let numbers = of_a.numbers();
        before(numbers.start)..before(numbers.end)
    };
    let lists = rule.pairs.iter();
    let lists: Vec<&[u64]> = lists
        .map(|keys| &keys[kind as usize][with_first(keys)])
        .collect();
    if lists.iter().all(|keys| keys.is_empty()) {
        return Ok(Vec::new());
    }
    let mut slots = [Vec::new(), Vec::new()];
    let of = clusterings.iter().zip([of_a, of_b]);
    for ((clustering, part), slots) in of.zip(&mut slots) {
        // Vertices of no element have numbers, too.
        *slots = filled(Slot::default(), part.n_elements as usize, WHAT)?;
        for (slot, element) in clustering.order.iter().enumerate() {
            slots[element.index()] = Slot::from_usize(slot);
        }
    }
    let pair = |a: Slot, b: Slot| u64::from(a.raw()) << 32 | u64::from(b.raw());
    let mut named = Vec::new();
    for keys in lists {
        reserve(&mut named, 2 * keys.len(), WHAT)?;
        for [low, high] in keys.iter().map(|&key| pair_numbers(key)) {
            if !of_b.numbers().contains(&high) {
                continue;
            }
            let low = slots[0][of_a.element(low).index()];
            let high = slots[1][of_b.element(high).index()];
            let clusters = [low.cluster(), high.cluster()];
            if a != b || clusters[0] <= clusters[1] {
                named.push(pair(low, high));
            }
            if a == b && clusters[1] <= clusters[0] {
                named.push(pair(high, low));
            }
        }
    }
    named.sort_unstable();
    Ok(named)
}
