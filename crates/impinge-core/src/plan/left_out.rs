//! Pairs that are left out because of their vertices, or by name: rings, groups, lists of vertices,
//! pinned vertices, pairs of an answer.

#[cfg(feature = "gpu")]
use std::collections::BTreeMap;
use std::collections::BTreeSet;
use std::sync::Arc;

use crate::query::goal::{Goal, Limits};
use crate::query::pair_kind::PairKind;
use crate::query::pair_set::{PairSet, PairsOfElements, SortedKeys};
use crate::query::{Exclusion, Query};
use crate::scene::Scene;
use crate::scene::body::are_all_pinned;
use crate::scene::elements::{Elements, Part, VertexRings};
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::index::PartIx;

use super::{Plan, Question};

/// What a plan leaves out.
#[derive(Debug, Clone, Default)]
pub(crate) struct LeftOut {
    /// By part.
    parts: Vec<OfPart>,
    /// Whether some vertices are marked: pinned, or in groups that do not meet.
    is_marked: bool,
    groups: BTreeSet<(u32, u32)>,
    vertices: Vec<VertexList>,
    pairs: Vec<SortedKeys>,
    /// Used in place of `pairs` when the question is which elements intersect.
    of_elements: Vec<Arc<PairsOfElements>>,
}

/// For each vertex of one body, vertices of another, or of the same.
#[derive(Debug, Clone)]
struct VertexList {
    bodies: [BodyId; 2],
    lists: Arc<VertexRings>,
}

impl VertexList {
    /// Whether some vertex of either element is listed with one of the other.
    #[inline]
    fn has(&self, bodies: [BodyId; 2], [a, b]: [&[u32]; 2]) -> bool {
        let reaches = |a: &[u32], b: &[u32]| a.iter().any(|&of| self.lists.reaches_any(of, b));
        // Lists of one body are both ways.
        (self.bodies == bodies && reaches(a, b))
            || (self.bodies == [bodies[1], bodies[0]] && reaches(b, a))
    }
}

/// Why an answer may lack pairs of two bodies that intersect.
#[derive(Debug, Clone, Default)]
pub(crate) struct Gaps {
    has_cell: bool,
    /// Bodies some of whose pairs the caller dropped, the lower first.
    dropped: BTreeSet<[BodyId; 2]>,
    /// Of elements, with the body of each part.
    left_out: Option<(Arc<LeftOut>, Vec<BodyId>)>,
}

impl Gaps {
    /// Those of the question which elements of bodies intersect.
    pub fn new(scene: &Scene, query: &Query) -> Result<Self, Error> {
        let plan = Plan::intersections(scene, query, Goal::All, Limits::default())?;
        Ok(plan.gaps())
    }

    /// Notes that the caller dropped a pair of two bodies.
    pub fn drop_pair(&mut self, [a, b]: [BodyId; 2]) {
        self.dropped.insert([a.min(b), a.max(b)]);
    }

    /// Why pairs of two bodies, whose elements have not changed since, are left out.
    pub fn between(&self, scene: &Scene, [a, b]: [BodyId; 2]) -> Option<&'static str> {
        if self.has_cell {
            return Some("a cell");
        }
        if self.dropped.contains(&[a.min(b), a.max(b)]) {
            return Some("`retain`");
        }
        let (left_out, bodies) = self.left_out.as_ref()?;
        let of = |id| {
            let part = bodies.binary_search(&id).ok()?;
            Some((&left_out.parts[part], scene.body(id).ok()?.elements()))
        };
        let of = [of(a)?, of(b)?];
        let is_listed =
            |of: &VertexList| (of.bodies == [a, b] || of.bodies == [b, a]) && !of.lists.is_empty();
        let [of_a, of_b] = of.map(|(of, _)| of.groups.as_deref().unwrap_or_default());
        let meet_not = |&(g, h): &(u32, u32)| {
            (of_a.contains(&g) && of_b.contains(&h)) || (of_a.contains(&h) && of_b.contains(&g))
        };
        let has_pinned = |(of, elements): &(&OfPart, &Elements)| {
            of.pinned.as_ref().is_some_and(|pinned| {
                (0..elements.len()).any(|ix| are_all_pinned(pinned, elements.corners(ix)))
            })
        };
        if left_out.groups.iter().any(meet_not) {
            Some("groups")
        } else if left_out.vertices.iter().any(is_listed) {
            Some("lists of vertices")
        } else if left_out.of_elements.iter().any(|of| of.are_of([a, b])) {
            Some("pairs of an answer")
        } else {
            of.iter().all(has_pinned).then_some("pinned faces of both")
        }
    }
}

/// What is known of the vertices of a part.
#[derive(Debug, Clone, Default)]
struct OfPart {
    rings: Option<Arc<VertexRings>>,
    groups: Option<Arc<[u32]>>,
    pinned: Option<Arc<[bool]>>,
}

/// An element: its part, its corners.
pub(crate) type Cornered<'a> = (PartIx, &'a [u32]);

/// What is left out of the pairs of one body by lists and by names. It is the same as long as the
/// topology and the query are.
#[derive(Debug, Clone, Default)]
pub(crate) struct OwnRule {
    /// Of each vertex: its elements are left out with those of these.
    pub lists: Vec<Arc<VertexRings>>,
    pub pairs: Vec<SortedKeys>,
}

/// Whether both hold the same, not only equals.
fn are_same<T: ?Sized>(a: &[Arc<T>], b: &[Arc<T>]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| Arc::ptr_eq(a, b))
}

impl OwnRule {
    /// Whether nothing is left out.
    pub fn is_empty(&self) -> bool {
        self.lists.is_empty() && self.pairs.is_empty()
    }

    /// Whether two rules are of the same lists.
    pub fn is(&self, other: &OwnRule) -> bool {
        are_same(&self.lists, &other.lists) && are_same(&self.pairs, &other.pairs)
    }
}

impl LeftOut {
    /// Whether a pair is left out because of how its vertices are marked.
    #[inline]
    fn has_marked(&self, [a, b]: [Cornered<'_>; 2]) -> bool {
        let of = [&self.parts[a.0.index()], &self.parts[b.0.index()]];
        if let [Some(of_a), Some(of_b)] = of.map(|of| of.pinned.as_ref())
            && are_all_pinned(of_a, a.1)
            && are_all_pinned(of_b, b.1)
        {
            return true;
        }
        if let (false, [Some(of_a), Some(of_b)]) =
            (self.groups.is_empty(), of.map(|of| of.groups.as_ref()))
        {
            let are_apart = |&from: &u32| {
                let g = of_a[from as usize];
                b.1.iter().all(|&to| {
                    let h = of_b[to as usize];
                    self.groups.contains(&(g.min(h), g.max(h)))
                })
            };
            if a.1.iter().all(are_apart) {
                return true;
            }
        }
        false
    }

    /// Whether a pair is left out by lists or by its name.
    #[inline]
    fn has_listed(
        &self,
        (kind, key): (Option<PairKind>, u64),
        [a, b]: [Cornered<'_>; 2],
        bodies: [BodyId; 2],
    ) -> bool {
        if let (true, Some(rings)) = (bodies[0] == bodies[1], &self.parts[a.0.index()].rings)
            && a.1.iter().any(|&from| rings.reaches_any(from, b.1))
        {
            return true;
        }
        if (self.vertices.iter()).any(|listed| listed.has(bodies, [a.1, b.1])) {
            return true;
        }
        kind.is_some_and(|kind| {
            let has = |keys: &SortedKeys| keys[kind as usize].binary_search(&key).is_ok();
            self.pairs.iter().any(has)
        })
    }
}

/// What of it a device is told.
#[cfg(feature = "gpu")]
impl LeftOut {
    /// Whether it is the same, of the same parts.
    pub fn is(&self, other: &LeftOut) -> bool {
        let is_part = |(a, b): (&OfPart, &OfPart)| {
            are_same(a.rings.as_slice(), b.rings.as_slice())
                && are_same(a.groups.as_slice(), b.groups.as_slice())
                && are_same(a.pinned.as_slice(), b.pinned.as_slice())
        };
        let is_list = |(a, b): (&VertexList, &VertexList)| {
            a.bodies == b.bodies && Arc::ptr_eq(&a.lists, &b.lists)
        };
        self.groups == other.groups
            && self.parts.len() == other.parts.len()
            && self.parts.iter().zip(&other.parts).all(is_part)
            && self.vertices.len() == other.vertices.len()
            && self.vertices.iter().zip(&other.vertices).all(is_list)
            && are_same(&self.pairs, &other.pairs)
    }

    /// Pairs of groups that do not meet.
    pub fn groups(&self) -> &BTreeSet<(u32, u32)> {
        &self.groups
    }

    /// The groups of the vertices of a part's body, and which are pinned.
    pub fn marks(&self, part: PartIx) -> (Option<&[u32]>, Option<&[bool]>) {
        let of = &self.parts[part.index()];
        (of.groups.as_deref(), of.pinned.as_deref())
    }

    /// The lists of vertices, of the vertices of the first body: rings are lists of a body with
    /// itself.
    pub fn lists<'a>(
        &'a self,
        plan: &'a Plan,
    ) -> impl Iterator<Item = ([BodyId; 2], &'a VertexRings)> {
        let bodies = plan.first_parts().into_iter();
        let rings = bodies.filter_map(|(body, part)| {
            let rings = self.parts[part.index()].rings.as_deref()?;
            Some(([body; 2], rings))
        });
        rings.chain(self.vertices.iter().map(|of| (of.bodies, &*of.lists)))
    }

    /// The keys of pairs, of each kind and set.
    pub fn keys(&self) -> impl Iterator<Item = &[u64]> {
        self.pairs
            .iter()
            .flat_map(|set| set.iter().map(Vec::as_slice))
    }
}

impl Plan {
    /// What is left out because of its elements.
    #[cfg(feature = "gpu")]
    pub(crate) fn left_out(&self) -> Option<&Arc<LeftOut>> {
        self.left_out.as_ref()
    }

    /// The first part of each body that takes part.
    #[cfg(feature = "gpu")]
    pub(crate) fn first_parts(&self) -> BTreeMap<BodyId, PartIx> {
        let mut first = BTreeMap::new();
        for (ix, part) in self.numbered_parts() {
            first.entry(part.id).or_insert(ix);
        }
        first
    }

    /// Resolves what the query and the scene leave out.
    pub(super) fn leave_out(&mut self, scene: &Scene, query: &Query) -> Result<(), Error> {
        if let Some(n) = query.rings
            && n > Exclusion::MOST_RINGS
        {
            return Err(Error::Setting {
                setting: "rings",
                given: n.to_string(),
                allowed: "at most 16",
            });
        }
        let mut parts = self.part_ixs();
        let has_pinned = parts.any(|part| self.body(scene, part).pinned().is_some());
        if !has_pinned && query.leaves_out_elements().is_none() {
            return Ok(());
        }
        let mut vertices = Vec::new();
        for lists in &query.vertices {
            let bodies = lists.bodies();
            // Pairs of a body that is no longer there are none.
            if let [Ok(a), Ok(b)] = bodies.map(|body| scene.body(body)) {
                let lists = lists.sorted([a.n_vertices(), b.n_vertices()])?;
                vertices.push(VertexList { bodies, lists });
            }
        }
        let is_of_elements = self.question == Question::Intersection;
        let asked = self.kinds_asked();
        let takes_part = |body: BodyId, of: Part| {
            let mut parts = self.parts.iter();
            if is_of_elements {
                return parts.any(|part| part.id == body);
            }
            let mut kinds = PairKind::ALL.into_iter();
            kinds.any(|kind| asked.contains(kind) && kind.parts().contains(&of))
                && parts.any(|part| part.id == body && part.part == of)
        };
        query
            .pairs
            .iter()
            .try_for_each(|pairs| pairs.check(scene, takes_part))?;
        let of_part = |part: PartIx| {
            let body = self.body(scene, part);
            OfPart {
                rings: query.rings.map(|n| body.vertex_rings(n)),
                groups: body.shared_groups(),
                pinned: body.shared_pinned(),
            }
        };
        let numbered = || {
            self.parts
                .iter()
                .map(|part| (part.id, part.part, part.first))
        };
        let keys = |pairs: &PairSet| pairs.keys(numbered().collect());
        let sets = query.pairs.iter();
        let (pairs, of_elements) = match is_of_elements {
            true => (vec![], sets.map(|set| set.of_elements(scene)).collect()),
            false => (sets.map(keys).collect(), vec![]),
        };
        self.left_out = Some(Arc::new(LeftOut {
            is_marked: has_pinned || !query.groups.is_empty(),
            parts: self.part_ixs().map(of_part).collect(),
            groups: query.groups.clone(),
            vertices,
            pairs,
            of_elements,
        }));
        Ok(())
    }

    /// Why the answer may lack pairs of two bodies.
    pub(crate) fn gaps(&self) -> Gaps {
        Gaps {
            has_cell: self.cell.is_some(),
            dropped: BTreeSet::new(),
            left_out: self.left_out.as_ref().map(|left_out| {
                let bodies = self.parts.iter().map(|part| part.id);
                (Arc::clone(left_out), bodies.collect())
            }),
        }
    }

    /// Whether some pairs are left out because of their elements.
    pub(crate) fn leaves_out(&self) -> bool {
        self.left_out.is_some()
    }

    /// Whether a pair of two parts is left out, by its key and its corners.
    #[inline]
    pub(crate) fn is_left_out(&self, key: u64, [a, b]: [Cornered<'_>; 2]) -> bool {
        let Some(left_out) = &self.left_out else {
            return false;
        };
        let parts = [self.part(a.0), self.part(b.0)];
        // Elements that bodies were given as are of no kind.
        let kind = PairKind::of(parts[0].part, parts[1].part);
        left_out.has_marked([a, b])
            || left_out.has_listed((kind, key), [a, b], parts.map(|part| part.id))
    }

    /// What is left out of the pairs of the body of a part, except for how vertices are marked.
    pub(crate) fn own_rule(&self, part: PartIx) -> OwnRule {
        let Some(left_out) = &self.left_out else {
            return OwnRule::default();
        };
        let bodies = [self.part(part).id; 2];
        let listed = left_out.vertices.iter().filter(|of| of.bodies == bodies);
        let rings = left_out.parts[part.index()].rings.iter();
        OwnRule {
            lists: rings.chain(listed.map(|of| &of.lists)).cloned().collect(),
            pairs: left_out.pairs.clone(),
        }
    }

    /// Whether pairs are left out because of how their vertices are marked: pinned, or in groups.
    #[inline]
    pub(crate) fn leaves_out_marked(&self) -> bool {
        self.left_out
            .as_ref()
            .is_some_and(|left_out| left_out.is_marked)
    }

    /// Whether a pair is left out because of how its vertices are marked.
    #[inline]
    pub(crate) fn is_left_out_marked(&self, pair: [Cornered<'_>; 2]) -> bool {
        let left_out = self.left_out.as_deref();
        left_out.is_some_and(|left_out| left_out.has_marked(pair))
    }

    /// Whether some pairs of two parts may be left out.
    #[inline]
    pub(crate) fn leaves_out_between(&self, a: PartIx, b: PartIx) -> bool {
        let Some(left_out) = &self.left_out else {
            return false;
        };
        let [of_a, of_b] = [a, b].map(|part| &left_out.parts[part.index()]);
        let bodies = [a, b].map(|part| self.part(part).id);
        (of_a.rings.is_some() && bodies[0] == bodies[1])
            || (of_a.pinned.is_some() && of_b.pinned.is_some())
            || !left_out.groups.is_empty()
            || !left_out.pairs.is_empty()
            || (left_out.vertices.iter())
                .any(|of| of.bodies == bodies || of.bodies == [bodies[1], bodies[0]])
    }

    /// Whether a pair is left out, by its key alone.
    #[inline(never)]
    pub(super) fn is_key_left_out(&self, scene: &Scene, key: u64) -> bool {
        let located = self.located(key);
        let pair = [&located[0], &located[1]].map(|(part, element)| {
            let corners = self
                .body(scene, *part)
                .corners(self.part(*part).part, element);
            (*part, corners)
        });
        if self.is_left_out(key, pair) {
            return true;
        }
        let left_out = self.left_out.as_deref();
        let mut of_elements = left_out.map_or(&[][..], |of| &of.of_elements).iter();
        of_elements.any(|set| {
            let bodies = pair.map(|(part, _)| self.part(part).id);
            set.has(bodies, [0, 1].map(|ix| (located[ix].1, pair[ix].1)))
        })
    }
}
