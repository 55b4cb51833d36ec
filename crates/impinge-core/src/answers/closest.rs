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
    /// The largest float that is at most the distance, in the unit of the scene: 0 if they touch.
    pub distance: f64,
    /// The point of the element that is nearest, rounded.
    pub point: [f64; 3],
}

/// The elements nearest to points, one entry per point:
/// [`Detector::closest`](crate::Detector::closest).
#[derive(Clone, Default)]
pub struct Closest {
    pub(crate) found: Vec<Option<ClosestElement>>,
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
        self.found.len()
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.found.is_empty()
    }

    /// What is nearest to a point; `None` if nothing is as near as was asked for, or there is no
    /// such point.
    pub fn get(&self, point: usize) -> Option<ClosestElement> {
        self.found.get(point).copied().flatten()
    }

    /// What is nearest to each point, in their order.
    pub fn iter(&self) -> std::iter::Copied<std::slice::Iter<'_, Option<ClosestElement>>> {
        self.found.iter().copied()
    }

    /// Rows `[body, element]`, with bodies by their [`index`](crate::BodyId::index);
    /// `[u32::MAX, u32::MAX]` for points to which nothing is near.
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
