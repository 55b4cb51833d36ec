//! What has changed from one answer to the next: which pairs are kept, new and gone.

use std::cmp::Ordering;
use std::collections::BTreeSet;
use std::convert::Infallible;

use crate::scene::bodies::NumberedPart;
use crate::scene::elements::Part;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;

/// The pairs of an answer beside those of an older one: [`Pairs::changes`](crate::Pairs::changes),
/// [`Impacts::changes`](crate::Impacts::changes),
/// [`NearPairs::changes`](crate::NearPairs::changes).
///
/// What a solver keeps per pair (multipliers, anchors of friction, a warm start) moves with it:
///
/// ```
/// use impinge::{Backend, Detector, Query, Scene};
/// # fn main() -> Result<(), impinge::Error> {
/// let mut scene = Scene::new();
/// scene.add_triangles(&[[0, 1, 2]], &[[0.0f32, 0.0, 0.0], [8.0, 0.0, 0.0], [0.0, 8.0, 0.0]])?;
/// let points = scene.add_points(&[[1.0f32, 1.0, 0.5], [3.0, 1.0, 0.5], [1.0, 2.0, 9.0]])?;
/// let mut detector = Detector::new(Backend::Cpu)?;
/// let mut near = detector.near(&scene, 1.0, &Query::all())?;
/// let mut multipliers = vec![0.25, 0.5];
///
/// scene.set_positions(points, &[[1.0f32, 1.0, 9.0], [3.0, 1.0, 0.5], [1.0, 2.0, 0.5]])?;
/// let next = detector.near(&scene, 1.0, &Query::all())?;
/// let changes = next.changes(&near)?;
/// let mut moved = vec![0.0; next.len()];
/// for &[old, new] in &changes.kept {
///     moved[new] = multipliers[old];
/// }
/// (near, multipliers) = (next, moved);
/// assert_eq!((changes.new, changes.gone), (vec![1], vec![0]));
/// assert_eq!(multipliers, [0.5, 0.0]);
/// # assert_eq!(near.len(), 2);
/// # Ok(()) }
/// ```
#[derive(Debug, Clone, Default, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Changes {
    /// Of each pair that is in both answers its index in the old one and in the new one; both
    /// ascend.
    pub kept: Vec<[usize; 2]>,
    /// The indices, in the new answer, of pairs that the old one does not have; ascending.
    pub new: Vec<usize>,
    /// The indices, in the old answer, of pairs that the new one does not have; ascending.
    pub gone: Vec<usize>,
}

impl Changes {
    /// Whether both answers have the same pairs.
    pub fn is_empty(&self) -> bool {
        self.new.is_empty() && self.gone.is_empty()
    }

    /// Compares parts of answers, or anything else that ascends strictly: what makes a pair the
    /// same, of all old ones and of all new ones. Takes time in their number.
    ///
    /// ```
    /// use impinge::Changes;
    /// let changes = Changes::between([2, 3, 5, 8], [1, 3, 5]);
    /// assert_eq!(changes.kept, [[1, 1], [2, 2]]);
    /// assert_eq!((changes.new, changes.gone), (vec![0], vec![0, 3]));
    /// ```
    pub fn between<K: Ord>(
        old: impl IntoIterator<Item = K>,
        new: impl IntoIterator<Item = K>,
    ) -> Self {
        let mut changes = Changes::default();
        Self::each(old, new, |order, [before, after]| {
            match order {
                Ordering::Less => changes.gone.push(before),
                Ordering::Greater => changes.new.push(after),
                Ordering::Equal => changes.kept.push([before, after]),
            }
            Ok::<_, Infallible>(())
        })
        .unwrap_or_else(|never| match never {});
        changes
    }

    /// [`between`](Changes::between) without memory of its own: calls `each` with the indices of
    /// every pair in the old answer and in the new one, and `Less` if it is gone, `Greater` if it
    /// is new, where the other index says nothing. Ends with the first error of `each`.
    #[doc(hidden)]
    pub fn each<K: Ord, E>(
        old: impl IntoIterator<Item = K>,
        new: impl IntoIterator<Item = K>,
        mut each: impl FnMut(Ordering, [usize; 2]) -> Result<(), E>,
    ) -> Result<(), E> {
        let (mut old, mut new) = (old.into_iter().enumerate(), new.into_iter().enumerate());
        let (mut before, mut after) = (old.next(), new.next());
        loop {
            let order = match (&before, &after) {
                (None, None) => return Ok(()),
                (Some(_), None) => Ordering::Less,
                (None, Some(_)) => Ordering::Greater,
                (Some((_, before)), Some((_, after))) => before.cmp(after),
            };
            // At most one of them is absent.
            each(
                order,
                [&before, &after].map(|at| at.as_ref().map_or(0, |(ix, _)| *ix)),
            )?;
            if order.is_le() {
                before = old.next();
            }
            if order.is_ge() {
                after = new.next();
            }
        }
    }
}

/// Refuses to compare two answers, the old one and the new one, each with the
/// [family](crate::Scene::family) of its scene and with its parts: if their scenes differ, or if
/// both have pairs with elements of a part that has other numbers in the new one. `named` are the
/// parts of each pair, of the old one and of the new one.
pub(crate) fn check_comparable<P: Iterator<Item = NumberedPart> + Clone>(
    [(old_family, old), (new_family, new)]: [(u64, P); 2],
    named: [impl Iterator<Item = [(BodyId, Part); 2]>; 2],
) -> Result<(), Error> {
    // Answers about no body are of any scene.
    if old_family != new_family && old_family.min(new_family) > 0 {
        return Err(Error::Setting {
            setting: "old",
            given: "an answer about another scene".to_owned(),
            allowed: "those about the same scene or its clones",
        });
    }
    // As nearly always.
    if old.clone().eq(new.clone()) {
        return Ok(());
    }
    let new: BTreeSet<NumberedPart> = new.collect();
    let is_renumbered = |&(id, part, stamp): &NumberedPart| {
        let mut of_part = new.range((id, part, 0)..=(id, part, u64::MAX));
        of_part.next().is_some_and(|now| now.2 != stamp)
    };
    let renumbered = old.filter(is_renumbered).map(|(id, part, _)| (id, part));
    let mut renumbered: BTreeSet<(BodyId, Part)> = renumbered.collect();
    for named in named {
        if renumbered.is_empty() {
            return Ok(());
        }
        let parts = named.flatten().filter(|part| renumbered.contains(part));
        renumbered = parts.collect();
    }
    match renumbered.first() {
        Some(&(body, _)) => Err(Error::Remeshed { body }),
        None => Ok(()),
    }
}
