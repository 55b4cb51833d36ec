//! The answer about the elements nearest to points.

use crate::answers::home::{Home, gives_back};
use crate::answers::pairs::{Element, hash_row};
use crate::search::stats::Stats;
use impinge_exact::Feature;

/// The element that is nearest to a point.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ClosestElement {
    /// The element. Decided exactly; of several at the same distance, the lowest by body and then
    /// by number.
    pub element: Element,
    /// The feature of the element that has the nearest point in its inside. Exact.
    pub feature: Feature,
    /// The largest float that is at most the distance, in the unit of the scene: 0 if they touch,
    /// or are nearer than the smallest `f64`.
    pub distance: f64,
    /// The point of the element that is nearest, rounded.
    pub point: [f64; 3],
}

/// The elements nearest to points: [`Detector::closest`](crate::Detector::closest). One entry per
/// point, or as many as [`Query::n_nearest`](crate::Query::n_nearest) says.
#[derive(Clone, Default)]
pub struct Closest {
    /// Of each point as many as were asked for; `None` after the last that is near.
    pub(crate) found: Vec<Option<ClosestElement>>,
    /// How many entries each point has; 0 in an answer about nothing.
    pub(crate) n_nearest: usize,
    pub(crate) stats: Stats,
    /// Where its buffers go when it is dropped.
    home: Home<Closest>,
}

gives_back!(Closest);

impl std::fmt::Debug for Closest {
    /// Their number and the first of them, however many there are.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut short = f.debug_struct("Closest");
        short.field("len", &self.len());
        short.field("first", &self.found.first());
        short.finish_non_exhaustive()
    }
}

impl Closest {
    /// The number of points.
    pub fn len(&self) -> usize {
        self.found.len() / self.n_nearest()
    }

    /// How many entries there are per point: what the query said.
    pub fn n_nearest(&self) -> usize {
        self.n_nearest.max(1)
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.found.is_empty()
    }

    /// What is nearest to a point; `None` if nothing is as near as was asked for, or there is no
    /// such point.
    pub fn get(&self, point: usize) -> Option<ClosestElement> {
        let first = point.checked_mul(self.n_nearest())?;
        self.found.get(first).copied().flatten()
    }

    /// What is nearest to a point, nearest first: as many elements as were asked for, or fewer if
    /// there are no more, or no more are as near as was asked for. Of several at the same distance
    /// the lowest by body and then by number comes first.
    pub fn of(&self, point: usize) -> impl Iterator<Item = ClosestElement> + '_ {
        let rows = self.found.chunks_exact(self.n_nearest()).nth(point);
        rows.unwrap_or_default().iter().map_while(|found| *found)
    }

    /// What is nearest to each point, in their order: [`n_nearest`](Closest::n_nearest) entries per
    /// point, those after its last element `None`.
    pub fn iter(&self) -> std::iter::Copied<std::slice::Iter<'_, Option<ClosestElement>>> {
        self.found.iter().copied()
    }

    /// Rows `[body, element]`, with bodies by their [`index`](crate::BodyId::index);
    /// `[u32::MAX, u32::MAX]` where nothing is near. As many as [`iter`](Closest::iter) has.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = [u32; 2]> + '_ {
        self.iter().map(|found| match found {
            Some(found) => [found.element.body.slot(), found.element.element],
            None => [u32::MAX; 2],
        })
    }

    /// A hash of the rows and their order.
    pub fn hash(&self) -> u64 {
        let rows = (0u64..).zip(self.rows());
        let hashes = rows
            .map(|(ix, [body, element])| hash_row([(ix >> 32) as u32, ix as u32, body, element]));
        hashes.fold(0, u64::wrapping_add)
    }

    /// How the answer was found.
    pub fn stats(&self) -> &Stats {
        &self.stats
    }

    pub(crate) fn bytes(&self) -> u64 {
        size_of_val(&self.found[..]) as u64
    }
}

impl<'a> IntoIterator for &'a Closest {
    type Item = Option<ClosestElement>;
    type IntoIter = std::iter::Copied<std::slice::Iter<'a, Option<ClosestElement>>>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}
