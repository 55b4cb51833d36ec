//! Between `pairing` and `narrow`: where very many boxes of two clusters overlap, a direction of
//! each element tells most pairs apart.
//!
//! In: the masks of a work item. Out: the same masks without pairs that are certainly apart
//! (`impinge_exact::filter::directions`). Boxes say little about long elements that lie aslant: on
//! two parts of a machine whose triangles are mostly slivers, those of a fifth of all pairs
//! overlap, of which planes leave one in 150.
//!
//! Cost: nothing where few boxes overlap, as between clusters of short elements. Else 1 ns per
//! pair, and 2 µs per cluster when it is first needed, with 3.8 KB. Short elements that are nearer
//! than the distance that is asked for overlap in many pairs too, and no direction tells those
//! apart: after a work item in which it told few, a worker passes by one, then three, up to 31,
//! until it told many again. Answers do not depend on it.

use crate::bvh::GROUP;
use crate::bvh::clusters::Clustering;
use crate::query::settings::Settings;
use crate::scene::elements::with_corners;
use crate::scene::index::{ClusterIx, PartIx};
use crate::scene::positions::Positions;
use impinge_exact::internal::filter::Directions64;

use super::group_cache::{GroupCache, PerCluster};
use super::lane_pairs::{RowSide, WorkItem};
use super::world::World;
use crate::simd::{Isa, Lanes, Masks, Simd, with_isa};

/// Which work items are asked about: all, as long as directions tell many of their pairs apart.
#[derive(Debug, Default)]
struct Pause {
    /// How many pass by after one of which they told few.
    length: u32,
    /// How many of these are still to come.
    left: u32,
}

impl Pause {
    /// Directions pay if they tell one pair in so many apart.
    const PAYS: usize = 4;
    /// Each work item of which they told few doubles the pause, up to this.
    const LONGEST: u32 = 31;

    /// Whether the next work item passes by.
    #[inline(always)]
    fn pass(&mut self) -> bool {
        let passes = self.left > 0;
        self.left = self.left.saturating_sub(1);
        passes
    }

    /// Records how many pairs of a work item directions have separated.
    #[inline(always)]
    fn record(&mut self, n_parted: usize, n_pairs: usize) {
        self.length = match n_parted * Self::PAYS >= n_pairs {
            true => 0,
            false => (2 * self.length + 1).min(Self::LONGEST),
        };
        self.left = self.length;
    }

    /// A work item turned out to have too few pairs: the next one is as likely to be in vain.
    #[inline(always)]
    fn again(&mut self) {
        self.left = self.length;
    }
}

/// Where the elements of a part are.
pub(super) trait Placed: Copy {
    /// The clusters of a part, and the positions of its body's vertices.
    fn placed(&self, part: PartIx) -> (&Clustering, &Positions);
}

impl Placed for World<'_> {
    #[inline(always)]
    fn placed(&self, part: PartIx) -> (&Clustering, &Positions) {
        (&self.cache(part).clustering, self.body(part).positions)
    }
}

/// The directions of the clusters that a worker saw last, if it needed them.
#[derive(Debug, Default)]
pub(super) struct Directions {
    groups: GroupCache<Directions64>,
    /// How many clusters are kept once there is one.
    n: usize,
    /// From this many pairs on, they are worth it.
    from: usize,
    pause: Pause,
    /// Pairs that they told apart.
    pub n_parted: u64,
}

impl<W: Placed> PerCluster<W> for Directions64 {
    const EMPTY: Self = Directions64::EMPTY;

    #[inline(always)]
    fn fill<S: Simd>(&mut self, _: S, world: W, part: PartIx, cluster: ClusterIx) {
        let (clustering, positions) = world.placed(part);
        let slots = clustering.slots(cluster);
        with_corners!(&clustering.corners, |corners| put(
            self,
            &corners[slots],
            positions
        ));
    }
}

fn put<const N: usize>(group: &mut Directions64, corners: &[[u32; N]], positions: &Positions) {
    group.begin(N);
    for (lane, corners) in corners.iter().enumerate() {
        let points = corners.map(|vertex| positions.point(vertex as usize));
        group.put(lane, &points);
    }
}

impl Directions {
    /// Prepares for a frame of `n_clusters` clusters.
    pub fn begin<W: Placed>(&mut self, n_clusters: u64, settings: &Settings) {
        self.n = GroupCache::<Directions64>::capacity(n_clusters, settings);
        self.from = settings.tuning.directions_from;
        self.pause = Pause::default();
        self.n_parted = 0;
        self.groups.clear();
        // A budget must know now what may be needed.
        if settings.memory_budget.is_some() {
            self.groups.reset::<W>(self.n);
        }
    }

    pub fn bytes(&self) -> usize {
        self.groups.bytes()
    }

    /// Whether so many boxes may overlap that counting them pays, of the next work item.
    #[inline(always)]
    pub fn may_pay(&mut self, lanes: [u64; 2]) -> bool {
        let [a, b] = lanes.map(|lanes| lanes.count_ones() as usize);
        a * b >= self.from && !self.pause.pass()
    }

    /// Clears pairs that are certainly farther apart than a distance, if there are many pairs, and
    /// returns how many. Bits of masks are the lanes of the side that does not have the rows. Pairs
    /// in `aside`, which others decide, are neither counted nor cleared.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "a stage between two others")]
    pub fn thin<S: Simd, W: Placed>(
        &mut self,
        simd: S,
        isa: Isa,
        world: W,
        item: &WorkItem,
        (side, rows): (RowSide, u64),
        distance: f32,
        aside: &[u64; GROUP],
        masks: &mut Masks,
    ) -> u64 {
        let (mut n_pairs, mut lanes) = (0, 0);
        for (mask, aside) in masks.0.iter().zip(aside) {
            n_pairs += (mask & !aside).count_ones() as usize;
            lanes |= mask;
        }
        if n_pairs < self.from {
            self.pause.again();
            return 0;
        }
        if self.groups.is_empty() {
            self.groups.reset::<W>(self.n);
        }
        let slot_a = self
            .groups
            .slot(simd, world, (item.a, item.cluster_a), usize::MAX);
        let slot_b = self
            .groups
            .slot(simd, world, (item.b, item.cluster_b), slot_a);
        let [a, b] = [slot_a, slot_b].map(|slot| self.groups.at(slot));
        let (of_rows, of_lanes) = match side {
            RowSide::A => (a, b),
            RowSide::B => (b, a),
        };
        if !of_rows.can_part(of_lanes) {
            return 0;
        }
        // Compiled once per instruction set, not once more per caller.
        let n_parted = with_isa!(isa, part, (
            groups: [&Directions64; 2] = [of_rows, of_lanes],
            lanes: [u64; 2] = [rows, lanes],
            distance: f32 = distance,
            aside: &[u64; GROUP] = aside,
            masks: &mut Masks = masks,
        ) -> u64);
        self.n_parted += n_parted;
        self.pause.record(n_parted as usize, n_pairs);
        n_parted
    }
}

/// Clears pairs of rows and lanes that are certainly farther apart than a distance.
#[inline(always)]
fn part<S: Simd>(
    _: S,
    [of_rows, of_lanes]: [&Directions64; 2],
    [rows, lanes]: [u64; 2],
    distance: f32,
    aside: &[u64; GROUP],
    masks: &mut Masks,
) -> u64 {
    let mut n_parted = 0;
    let near = match std::ptr::eq(of_rows, of_lanes) {
        true => [rows, lanes],
        false => of_rows.near::<S::F32>(of_lanes, [rows, lanes], distance),
    };
    for row in Lanes(rows) {
        let open = masks.0[row] & !aside[row];
        let lane_pairs = match near[0] >> row & 1 {
            1 => open & near[1],
            _ => 0,
        };
        let beyond =
            of_lanes.beyond::<S::F32>(lane_pairs, (of_rows, row), distance) | open & !lane_pairs;
        masks.0[row] &= !beyond;
        n_parted += u64::from(beyond.count_ones());
    }
    n_parted
}

#[cfg(test)]
mod tests {
    use super::Pause;

    fn n_asked(pause: &mut Pause, n_items: usize, n_parted: usize) -> usize {
        (0..n_items)
            .filter(|_| {
                let is_asked = !pause.pass();
                if is_asked {
                    pause.record(n_parted, 100);
                }
                is_asked
            })
            .count()
    }

    #[test]
    fn items_pass_by_while_directions_tell_few_apart() {
        let mut pause = Pause::default();
        assert_eq!(n_asked(&mut pause, 1000, 25), 1000);
        assert_eq!(n_asked(&mut pause, 62, 24), 5); // and pauses of 1, 3, 7, 15, 31
        assert_eq!(n_asked(&mut pause, 3201, 0), 101); // one in 32
        // They pay again: seen when the pause is over, and then everywhere.
        assert_eq!(n_asked(&mut pause, 132, 90), 101);
    }
}
