//! The answer about rays: what each of them hits.

use crate::answers::home::{Home, gives_back};
use crate::answers::pairs::{Element, hash_row};
use crate::search::stats::Stats;
use impinge_exact::Feature;

/// Where a ray meets an element. Which elements it meets, their order and the features are exact.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RayHit {
    /// The element.
    pub element: Element,
    /// The feature of the element that has the point of entry in its inside.
    pub feature: Feature,
    /// The largest float that is at most the parameter of entry, in units of the direction.
    pub t: f64,
    /// The same of the parameter at which the ray leaves the element: more than at the entry where
    /// it lies in its plane.
    pub t_end: f64,
    /// The barycentrics of the point of entry, each rounded to nearest.
    pub barycentrics: [f64; 3],
}

/// What rays hit: [`Detector::cast`](crate::Detector::cast).
#[derive(Clone, Default)]
pub struct Hits {
    /// Of all rays, one after the other; empty if only yes or no was asked for.
    pub(crate) found: Vec<RayHit>,
    /// Where those of each ray start, and the end of the last.
    pub(crate) offsets: Vec<usize>,
    pub(crate) is_hit: Vec<bool>,
    pub(crate) stats: Stats,
    /// Where its buffers go when it is dropped.
    home: Home<Hits>,
}

gives_back!(Hits);

impl std::fmt::Debug for Hits {
    /// Their number and the first of them, however many there are.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut short = f.debug_struct("Hits");
        short.field("len", &self.len());
        short.field("first", &self.found.first());
        short.finish_non_exhaustive()
    }
}

impl Hits {
    /// The number of rays.
    pub fn len(&self) -> usize {
        self.is_hit.len()
    }

    /// Whether there are no rays.
    pub fn is_empty(&self) -> bool {
        self.is_hit.is_empty()
    }

    /// Whether each ray hits anything.
    pub fn is_hit(&self) -> &[bool] {
        &self.is_hit
    }

    /// What a ray hits, by t, then by body and number: all, or the first. Nothing if only yes or no
    /// was asked for, or there is no such ray.
    pub fn of(&self, ray: usize) -> &[RayHit] {
        match self.offsets.get(ray..).and_then(<[usize]>::first_chunk) {
            Some(&[from, to]) => &self.found[from..to],
            None => &[],
        }
    }

    /// The hits of all rays, one ray after the other.
    pub fn iter(&self) -> std::slice::Iter<'_, RayHit> {
        self.found.iter()
    }

    /// Rows `[body, element]` of the hits of all rays, with bodies by their
    /// [`index`](crate::BodyId::index).
    pub fn rows(&self) -> impl ExactSizeIterator<Item = [u32; 2]> + '_ {
        self.iter()
            .map(|hit| [hit.element.body.slot(), hit.element.element])
    }

    /// Where the hits of each ray start among all, and the end of the last.
    pub fn offsets(&self) -> &[usize] {
        &self.offsets
    }

    /// A hash of the rays, the elements that they hit and their order.
    pub fn hash(&self) -> u64 {
        let of_ray = |ray: usize| {
            let [high, low] = [(ray as u64 >> 32) as u32, ray as u32];
            let hits = (1u32..).zip(self.of(ray)).map(move |(ix, hit)| {
                let Element { body, element } = hit.element;
                hash_row([high, low, body.slot() ^ ix.rotate_left(16), element])
            });
            let yes = hash_row([high, low, u32::from(self.is_hit[ray]), u32::MAX]);
            hits.fold(yes, u64::wrapping_add)
        };
        (0..self.len()).map(of_ray).fold(0, u64::wrapping_add)
    }

    /// How the answer was found.
    pub fn stats(&self) -> &Stats {
        &self.stats
    }

    pub(crate) fn bytes(&self) -> u64 {
        (size_of_val(&self.found[..]) + size_of_val(&self.offsets[..]) + self.is_hit.len()) as u64
    }
}

impl<'a> IntoIterator for &'a Hits {
    type Item = &'a RayHit;
    type IntoIter = std::slice::Iter<'a, RayHit>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}
