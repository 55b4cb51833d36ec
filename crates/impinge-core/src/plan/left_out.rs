//! Pairs that are left out because of their vertices, or by name: rings, groups, lists of vertices,
//! pinned vertices, pairs of an answer.

use std::collections::BTreeSet;
use std::sync::Arc;

use crate::query::pair_kind::PairKind;
use crate::query::pair_set::{PairSet, SortedKeys};
use crate::query::{Exclusion, Query};
use crate::scene::Scene;
use crate::scene::elements::VertexRings;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::index::PartIx;

use super::{Plan, Question};

/// What a plan leaves out.
#[derive(Debug, Clone, Default)]
pub(crate) struct LeftOut {
    /// By part.
    parts: Vec<OfPart>,
    groups: BTreeSet<(u32, u32)>,
    vertices: Vec<Listed>,
    pairs: Vec<SortedKeys>,
}

/// For each vertex of one body, vertices of another, or of the same.
#[derive(Debug, Clone)]
struct Listed {
    bodies: [BodyId; 2],
    lists: Arc<VertexRings>,
}

impl Listed {
    /// Whether some vertex of either element is listed with one of the other.
    #[inline]
    fn has(&self, bodies: [BodyId; 2], [a, b]: [&[u32]; 2]) -> bool {
        let reaches = |a: &[u32], b: &[u32]| a.iter().any(|&of| self.lists.reaches_any(of, b));
        // Lists of one body are both ways.
        (self.bodies == bodies && reaches(a, b))
            || (self.bodies == [bodies[1], bodies[0]] && reaches(b, a))
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

impl LeftOut {
    /// Whether a pair is left out.
    #[inline]
    fn has(
        &self,
        (kind, key): (Option<PairKind>, u64),
        [a, b]: [Cornered<'_>; 2],
        bodies: [BodyId; 2],
    ) -> bool {
        let of = [&self.parts[a.0.index()], &self.parts[b.0.index()]];
        if let [Some(of_a), Some(of_b)] = of.map(|of| of.pinned.as_ref()) {
            let is_pinned = |pinned: &[bool], corners: &[u32]| {
                corners.iter().all(|&corner| pinned[corner as usize])
            };
            if is_pinned(of_a, a.1) && is_pinned(of_b, b.1) {
                return true;
            }
        }
        if let (true, Some(rings)) = (bodies[0] == bodies[1], &of[0].rings)
            && a.1.iter().any(|&from| rings.reaches_any(from, b.1))
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
        if (self.vertices.iter()).any(|listed| listed.has(bodies, [a.1, b.1])) {
            return true;
        }
        kind.is_some_and(|kind| {
            let has = |keys: &SortedKeys| keys[kind as usize].binary_search(&key).is_ok();
            self.pairs.iter().any(has)
        })
    }
}

impl Plan {
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
        let has_pinned = scene.bodies().any(|(_, body)| body.pinned().is_some());
        if !has_pinned && query.leaves_out_elements().is_none() {
            return Ok(());
        }
        let mut vertices = Vec::new();
        for lists in &query.vertices {
            let bodies = lists.bodies();
            // Pairs of a body that is no longer there are none.
            if let [Ok(a), Ok(b)] = bodies.map(|body| scene.body(body)) {
                let lists = lists.sorted([a.n_vertices(), b.n_vertices()])?;
                vertices.push(Listed { bodies, lists });
            }
        }
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
        self.left_out = Some(Arc::new(LeftOut {
            parts: self.part_ixs().map(of_part).collect(),
            groups: query.groups.clone(),
            vertices,
            pairs: query.pairs.iter().map(keys).collect(),
        }));
        Ok(())
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
        let kind = match self.question {
            Question::Intersection => None,
            _ => PairKind::of(parts[0].part, parts[1].part),
        };
        left_out.has((kind, key), [a, b], parts.map(|part| part.id))
    }

    /// Whether a pair is left out, by its key alone.
    #[inline(never)]
    pub(super) fn is_key_left_out(&self, scene: &Scene, key: u64) -> bool {
        let [a, b] = self.located(key);
        let [a, b] = [&a, &b].map(|(part, element)| {
            let corners = self
                .body(scene, *part)
                .corners(self.part(*part).part, element);
            (*part, corners)
        });
        self.is_left_out(key, [a, b])
    }
}
