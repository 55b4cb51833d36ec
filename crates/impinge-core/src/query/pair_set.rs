//! Pairs of vertices, edges and faces that a query leaves out by name.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};

use crate::query::pair_kind::PairKind;
use crate::scene::Scene;
use crate::scene::bodies::NumberedPart;
use crate::scene::elements::Part;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::index::{Number, pair_key};

/// Elements of bodies, by the body and the number of the element.
type Named = [(BodyId, u32); 2];

/// Sorted keys, by kind of pair.
pub(crate) type SortedKeys = Arc<[Vec<u64>; PairKind::ALL.len()]>;

/// A part of a body, and the number of its first element in a plan.
pub(crate) type Numbered = (BodyId, Part, Number);

/// Pairs by kind. Equal to itself and its clones only.
#[derive(Debug, Clone)]
pub(crate) struct PairSet(Arc<HeldPairs>);

#[derive(Debug)]
struct HeldPairs {
    pairs: [Vec<Named>; PairKind::ALL.len()],
    /// A body that the answer was about, whether pairs name it or not: it tells the scene.
    body: Option<BodyId>,
    /// The parts that they name.
    parts: Vec<NumberedPart>,
    /// Their keys in the numbers of the last plan.
    keys: Mutex<Option<(Vec<Numbered>, SortedKeys)>>,
}

impl PartialEq for PairSet {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl PairSet {
    pub fn new(
        pairs: impl Iterator<Item = (PairKind, Named)>,
        parts: impl Iterator<Item = NumberedPart>,
    ) -> Self {
        let mut of_kinds: [Vec<Named>; PairKind::ALL.len()] = Default::default();
        let mut named = BTreeSet::new();
        for (kind, pair) in pairs {
            of_kinds[kind as usize].push(pair);
            named.extend(pair.map(|(body, _)| body).into_iter().zip(kind.parts()));
        }
        let mut parts = parts.peekable();
        let body = parts.peek().map(|&(body, ..)| body);
        let parts = parts.filter(|&(body, part, _)| named.contains(&(body, part)));
        PairSet(Arc::new(HeldPairs {
            pairs: of_kinds,
            body,
            parts: parts.collect(),
            keys: Mutex::default(),
        }))
    }

    /// A body of the scene of the answer, if it had any.
    pub fn body(&self) -> Option<BodyId> {
        self.0.body
    }

    /// Refuses a body whose elements have other numbers now, if they take part. Pairs of a body that
    /// is no longer there are none.
    ///
    /// # Errors
    /// Names the body.
    pub fn check(
        &self,
        scene: &Scene,
        takes_part: impl Fn(BodyId, Part) -> bool,
    ) -> Result<(), Error> {
        let mut renumbered = scene.renumbered(self.0.parts.iter().copied());
        match renumbered.find(|&(body, part)| takes_part(body, part)) {
            Some((body, _)) => Err(Error::Remeshed { body }),
            None => Ok(()),
        }
    }

    /// The keys of the pairs in the numbers of a plan; those of bodies that do not take part have
    /// none. They are made again only when numbers have changed.
    pub fn keys(&self, parts: Vec<Numbered>) -> SortedKeys {
        let mut held = self.0.keys.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((of, keys)) = &*held
            && *of == parts
        {
            return Arc::clone(keys);
        }
        let keys = PairKind::ALL.map(|kind| {
            let pairs = self.0.pairs[kind as usize].iter();
            let number = |(body, element): (BodyId, u32), part: Part| {
                let own = |&&(id, of, _): &&Numbered| id == body && of == part;
                let (_, _, first) = parts.iter().find(own)?;
                Some(Number::new(first.raw() + element))
            };
            let key = |&[a, b]: &Named| {
                let [part_a, part_b] = kind.parts();
                Some(pair_key(number(a, part_a)?, number(b, part_b)?))
            };
            let mut keys: Vec<u64> = pairs.filter_map(key).collect();
            keys.sort_unstable();
            keys
        });
        let keys = Arc::new(keys);
        *held = Some((parts, Arc::clone(&keys)));
        keys
    }
}
