//! Pairs of vertices, edges and faces that a query leaves out by name.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, PoisonError};

use crate::query::pair_kind::PairKind;
use crate::scene::Scene;
use crate::scene::bodies::NumberedPart;
use crate::scene::elements::Part;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::index::{ElementIx, Number, pair_key};

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
    /// Bodies that have a pair, the lower first.
    bodies: BTreeSet<[BodyId; 2]>,
    /// Their keys in the numbers of the last plan.
    keys: Mutex<Option<(Vec<Numbered>, SortedKeys)>>,
    /// Those of the bodies that the last scene had.
    of_elements: Mutex<Option<Arc<PairsOfElements>>>,
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
        let (mut named, mut bodies) = (BTreeSet::new(), BTreeSet::new());
        for (kind, pair) in pairs {
            of_kinds[kind as usize].push(pair);
            let [a, b] = pair.map(|(body, _)| body);
            bodies.insert([a.min(b), a.max(b)]);
            named.extend(pair.map(|(body, _)| body).into_iter().zip(kind.parts()));
        }
        let mut parts = parts.peekable();
        let body = parts.peek().map(|&(body, ..)| body);
        let parts = parts.filter(|&(body, part, _)| named.contains(&(body, part)));
        PairSet(Arc::new(HeldPairs {
            pairs: of_kinds,
            body,
            parts: parts.collect(),
            bodies,
            keys: Mutex::default(),
            of_elements: Mutex::default(),
        }))
    }

    /// A body of the scene of the answer, if it had any.
    pub fn body(&self) -> Option<BodyId> {
        self.0.body
    }

    /// Refuses a body whose elements have other numbers now, if they take part. Pairs of a body
    /// that is no longer there are none.
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
        let keys = Arc::new(self.0.keys_in(|body, part| {
            let own = |&&(id, of, _): &&Numbered| id == body && of == part;
            parts.iter().find(own).map(|&(_, _, first)| first)
        }));
        *held = Some((parts, Arc::clone(&keys)));
        keys
    }

    /// The same pairs, to be looked up by the elements that have them.
    pub fn of_elements(&self, scene: &Scene) -> Arc<PairsOfElements> {
        let held = &self.0.of_elements;
        let mut held = held.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(of) = &*held
            && of.is_of(scene, &self.0)
        {
            return Arc::clone(of);
        }
        let of = Arc::new(PairsOfElements::new(&self.0, scene));
        *held = Some(Arc::clone(&of));
        of
    }
}

impl HeldPairs {
    /// The keys of all pairs whose parts are numbered, given the first number of each part.
    fn keys_in(
        &self,
        first: impl Fn(BodyId, Part) -> Option<Number>,
    ) -> [Vec<u64>; PairKind::ALL.len()] {
        PairKind::ALL.map(|kind| {
            let number = |(body, element): (BodyId, u32), part: Part| {
                Some(Number::new(first(body, part)?.raw() + element))
            };
            let key = |&[a, b]: &Named| {
                let [part_a, part_b] = kind.parts();
                Some(pair_key(number(a, part_a)?, number(b, part_b)?))
            };
            let pairs = self.pairs[kind as usize].iter();
            let mut keys: Vec<u64> = pairs.filter_map(key).collect();
            keys.sort_unstable();
            keys
        })
    }
}

/// Pairs, to be looked up by two elements that bodies were given as: each of them is one of a pair,
/// or has it as a corner, an edge or a face.
#[derive(Debug)]
pub(crate) struct PairsOfElements {
    of_bodies: BTreeMap<BodyId, PartsOfElements>,
    bodies: BTreeSet<[BodyId; 2]>,
    keys: [Vec<u64>; PairKind::ALL.len()],
}

/// What elements consist of, by dimension.
const PARTS: [Part; 3] = [Part::Vertices, Part::Edges, Part::Faces];

/// How the elements of a body tell what they consist of: by dimension, where pairs name such parts.
#[derive(Debug, Default)]
struct PartsOfElements([Option<NumberedElements>; PARTS.len()]);

#[derive(Debug)]
struct NumberedElements {
    first: Number,
    /// The sorted corners of each, and which it is; sorted. `None` if they are numbered as
    /// positions are, or as the elements that the body was given as.
    by_corners: Option<Vec<(Corners, u32)>>,
}

/// Up to three corners, from the lowest to the highest, and then `u32::MAX`.
type Corners = [u32; PARTS.len()];

fn sorted(corners: impl Iterator<Item = u32>) -> Corners {
    let mut sorted = [u32::MAX; PARTS.len()];
    for (to, corner) in sorted.iter_mut().zip(corners) {
        *to = corner;
    }
    sorted.sort_unstable();
    sorted
}

impl PartsOfElements {
    /// The parts of an element, by dimension, and their numbers.
    fn of<'a>(
        &'a self,
        (element, corners): (ElementIx, &'a [u32]),
    ) -> impl Iterator<Item = (Part, Number)> {
        // Any of its corners span one.
        (1..1_u32 << corners.len()).filter_map(move |which| {
            let dimension = which.count_ones() as usize - 1;
            let numbered = self.0.get(dimension)?.as_ref()?;
            let own = || (corners.iter().enumerate()).filter(|(ix, _)| which >> ix & 1 == 1);
            let own = || own().map(|(_, &corner)| corner);
            let number = match &numbered.by_corners {
                Some(of) => {
                    let found = of.binary_search_by_key(&sorted(own()), |&(corners, _)| corners);
                    of[found.ok()?].1
                }
                None if dimension == 0 => own().next()?,
                // Of the elements themselves.
                None if corners.len() == dimension + 1 => element.raw(),
                None => return None,
            };
            Some((PARTS[dimension], Number::new(numbered.first.raw() + number)))
        })
    }
}

impl PairsOfElements {
    fn new(pairs: &HeldPairs, scene: &Scene) -> Self {
        let mut of_bodies: BTreeMap<BodyId, PartsOfElements> = BTreeMap::new();
        let mut n = 0;
        for &(id, part, _) in &pairs.parts {
            let (Ok(body), Some(dimension)) =
                (scene.body(id), PARTS.iter().position(|&of| of == part))
            else {
                continue;
            };
            let elements = body.part(part);
            let is_given = body.canonical(part) == Part::Given;
            let by_corners = (dimension > 0 && !is_given).then(|| {
                let corners = |ix| sorted(elements.corners(ix).iter().copied());
                let all = 0..elements.len();
                let mut all: Vec<_> = all.map(|ix| (corners(ix), ix as u32)).collect();
                all.sort_unstable();
                all
            });
            of_bodies.entry(id).or_default().0[dimension] = Some(NumberedElements {
                first: Number::new(n),
                by_corners,
            });
            // Fewer than a plan, which has all of them, can number.
            n += match part {
                Part::Vertices => body.n_vertices() as u32,
                _ => elements.len() as u32,
            };
        }
        let keys = pairs.keys_in(|body, part| {
            let dimension = PARTS.iter().position(|&of| of == part)?;
            let numbered = of_bodies.get(&body)?.0[dimension].as_ref()?;
            Some(numbered.first)
        });
        PairsOfElements {
            of_bodies,
            bodies: pairs.bodies.clone(),
            keys,
        }
    }

    /// Whether the scene has the bodies of which these are, and no others that pairs name. Their
    /// elements have not changed, see [`check`](PairSet::check).
    fn is_of(&self, scene: &Scene, pairs: &HeldPairs) -> bool {
        let mut named = pairs.parts.iter();
        named.all(|&(id, ..)| scene.body(id).is_ok() == self.of_bodies.contains_key(&id))
    }

    /// Whether there are pairs of two bodies.
    pub fn are_of(&self, [a, b]: [BodyId; 2]) -> bool {
        self.bodies.contains(&[a.min(b), a.max(b)])
    }

    /// Whether two elements, each with its corners, have a pair.
    pub fn has(&self, bodies: [BodyId; 2], [a, b]: [(ElementIx, &[u32]); 2]) -> bool {
        let [Some(of_a), Some(of_b)] = bodies.map(|body| self.of_bodies.get(&body)) else {
            return false;
        };
        let has = |(part_a, a), (part_b, b)| {
            PairKind::of(part_a, part_b).is_some_and(|kind| {
                let keys = &self.keys[kind as usize];
                keys.binary_search(&pair_key(a, b)).is_ok()
            })
        };
        self.are_of(bodies) && of_a.of(a).any(|a| of_b.of(b).any(|b| has(a, b)))
    }
}
