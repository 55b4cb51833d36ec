//! Pairs of vertices, edges and faces that a query leaves out by name.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};

use crate::query::pair_kind::PairKind;
use crate::scene::Scene;
use crate::scene::bodies::NumberedPart;
use crate::scene::body::Body;
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
    /// Their lookup by elements, for the scene that was asked about last.
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
        let mut last = None;
        for (kind, pair) in pairs {
            of_kinds[kind as usize].push(pair);
            let [a, b] = pair.map(|(body, _)| body);
            if last.replace((kind, a, b)) == Some((kind, a, b)) {
                continue;
            }
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

/// Looks up whether two elements that bodies were given as contain a pair: each is one of its
/// elements, or has it as a corner, an edge or a face.
#[derive(Debug)]
pub(crate) struct PairsOfElements {
    /// Sorted by body.
    of_bodies: Vec<(BodyId, PartsOfElements)>,
    bodies: BTreeSet<[BodyId; 2]>,
    keys: [Vec<u64>; PairKind::ALL.len()],
}

/// What elements consist of, by dimension.
const PARTS: [Part; 3] = [Part::Vertices, Part::Edges, Part::Faces];

/// The numbers of the corners, edges and faces of a body's elements, by dimension; none where no
/// pair names such parts.
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

fn dimension_of(part: Part) -> Option<usize> {
    PARTS.iter().position(|&of| of == part)
}

/// The body that a part is of, if its elements still have the numbers that pairs name. One that
/// does not take part in a question may be gone, or have others.
fn fitting<'a>(scene: &'a Scene, &(id, part, stamp): &NumberedPart) -> Option<&'a Body> {
    let body = scene.body(id).ok()?;
    (body.numbers_stamp(part) == stamp).then_some(body)
}

/// Where a body is in a sorted list, or where it would be.
fn place<T>(list: &[(BodyId, T)], body: BodyId) -> Result<usize, usize> {
    list.binary_search_by_key(&body, |&(id, _)| id)
}

impl PairsOfElements {
    fn new(pairs: &HeldPairs, scene: &Scene) -> Self {
        let mut of_bodies: Vec<(BodyId, PartsOfElements)> = Vec::new();
        let mut n = 0;
        for named in &pairs.parts {
            let &(id, part, _) = named;
            let (Some(body), Some(dimension)) = (fitting(scene, named), dimension_of(part)) else {
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
            let ix = place(&of_bodies, id).unwrap_or_else(|ix| {
                of_bodies.insert(ix, (id, PartsOfElements::default()));
                ix
            });
            of_bodies[ix].1.0[dimension] = Some(NumberedElements {
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
            let dimension = dimension_of(part)?;
            let (_, of) = &of_bodies[place(&of_bodies, body).ok()?];
            Some(of.0[dimension].as_ref()?.first)
        });
        PairsOfElements {
            of_bodies,
            bodies: pairs.bodies.clone(),
            keys,
        }
    }

    /// Whether these are of all parts that pairs name and that are in the scene as they were. Those
    /// of other parts play no part: none of their elements is asked about.
    fn is_of(&self, scene: &Scene, pairs: &HeldPairs) -> bool {
        pairs.parts.iter().all(|named| {
            let &(id, part, _) = named;
            let of = self.of(id).zip(dimension_of(part));
            let is_held = of.is_some_and(|(of, dimension)| of.0[dimension].is_some());
            is_held || fitting(scene, named).is_none()
        })
    }

    fn of(&self, body: BodyId) -> Option<&PartsOfElements> {
        let ix = place(&self.of_bodies, body).ok()?;
        Some(&self.of_bodies[ix].1)
    }

    /// Whether there are pairs of two bodies.
    pub fn are_of(&self, [a, b]: [BodyId; 2]) -> bool {
        self.bodies.contains(&[a.min(b), a.max(b)])
    }

    /// Whether two elements, each with its corners, have a pair.
    pub fn has(&self, bodies: [BodyId; 2], [a, b]: [(ElementIx, &[u32]); 2]) -> bool {
        let [Some(of_a), Some(of_b)] = bodies.map(|body| self.of(body)) else {
            return false;
        };
        let has = |(part_a, a), (part_b, b)| {
            PairKind::of(part_a, part_b).is_some_and(|kind| {
                let keys = &self.keys[kind as usize];
                keys.binary_search(&pair_key(a, b)).is_ok()
            })
        };
        if !self.are_of(bodies) {
            return false;
        }
        // A tetrahedron has the most parts.
        let mut held = [None; 14];
        for (held, part) in held.iter_mut().zip(of_b.of(b)) {
            *held = Some(part);
        }
        (of_a.of(a)).any(|a| held.iter().map_while(|&b| b).any(|b| has(a, b)))
    }
}
