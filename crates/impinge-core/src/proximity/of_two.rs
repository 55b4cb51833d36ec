//! The smallest distance of two bodies, and what is kept of it from call to call: the bodies'
//! trees, and what was found. The pair that was nearest in the last call is compared first: bodies
//! that move little have a good bound from the start.

use std::collections::HashMap;
use std::sync::Arc;

use super::best_first::{DistanceSearch, FoundNearest, where_they_touch};
use super::nearest::Nearest;
use super::tree::Tree;
use crate::boxes::scale::Scale;
use crate::clusterings::{BodyPart, Clusterings};
use crate::query::progress::Control;
use crate::scene::elements::Part;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::index::ElementIx;
use crate::scene::{Body, Scene};
use crate::search::stats::Stats;
use crate::search::work::Work;

/// Of how many pairs of bodies the answers are kept, for each body.
const MOST_KNOWN: usize = 64;
/// With more pairs of clusters whose boxes overlap, it pays to ask first whether the bodies touch.
const MOST_OVERLAPPING: u64 = 8;

/// The trees of bodies, and what was found about pairs of them.
pub(super) struct OfTwo {
    clusterings: Clusterings,
    /// What was clustered.
    stats: Stats,
    /// By the number of the body and the part of it.
    trees: HashMap<(usize, Part), Tree>,
    /// Those of the trees.
    bytes: usize,
    /// The arrangement of the scene whose removed bodies were forgotten last.
    seen: u64,
    /// By the numbers of the bodies.
    known: HashMap<[usize; 2], Known>,
}

/// What was found about two bodies when they were asked about last.
#[derive(Clone, Copy)]
struct Known {
    /// The stamps of their positions.
    stamps: [u64; 2],
    answer: KnownDistance,
    /// The elements that were nearest last.
    likely: Option<[ElementIx; 2]>,
}

#[derive(Clone, Copy)]
enum KnownDistance {
    /// The square of the distance as computed, and who has it.
    Is(f64, Nearest),
    /// The square of the distance is above this.
    Above(f64),
}

impl OfTwo {
    pub(super) fn new(clusterings: Clusterings) -> Self {
        OfTwo {
            clusterings,
            stats: Stats::default(),
            trees: HashMap::new(),
            bytes: 0,
            seen: 0,
            known: HashMap::new(),
        }
    }

    /// Forgets removed bodies: to be called first in each question.
    pub(super) fn begin(&mut self, scene: &Scene) {
        if self.trees.len() > scene.n_bodies() && self.seen != scene.arrangement() {
            self.seen = scene.arrangement();
            self.trees.retain(|&(slot, _), _| scene.holds(slot));
            self.bytes = self.trees.values().map(Tree::bytes).sum();
        }
        if self.known.len() > MOST_KNOWN * scene.n_bodies().max(MOST_KNOWN) {
            self.known.clear();
        }
        drop(self.clusterings.open(scene));
        self.stats.clear();
    }

    /// As `search`, but where very many boxes overlap `touching` is asked first for the lowest pair
    /// that touches.
    pub(super) fn search_or_ask(
        &mut self,
        scene: &Scene,
        ids: [BodyId; 2],
        most: (Scale, f64),
        control: &Control,
        touching: impl FnOnce() -> Result<Option<[u32; 2]>, Error>,
    ) -> Result<FoundNearest, Error> {
        if let Some(found) = self.search(scene, ids, most, MOST_OVERLAPPING, control)? {
            return Ok(found);
        }
        let Some(elements) = touching()? else {
            let found = self.search(scene, ids, most, u64::MAX, control)?;
            return Ok(found.flatten());
        };
        let bodies = [scene.body(ids[0])?, scene.body(ids[1])?];
        let elements = elements.map(ElementIx::new);
        let points = [where_they_touch(bodies, elements); 2];
        let found = Some((0.0, Nearest::new(0.0, ids, elements, points)));
        note(&mut self.known, bodies, f64::INFINITY, (ids, found));
        Ok(found)
    }

    /// The nearest elements of two bodies that are known, and the square of their distance in a
    /// scale; nothing, or what is farther away, if that is not at most `most`. `None` if more pairs
    /// of clusters would have to be compared whose boxes overlap than `most_overlapping`.
    fn search(
        &mut self,
        scene: &Scene,
        ids: [BodyId; 2],
        (scale, most): (Scale, f64),
        most_overlapping: u64,
        control: &Control,
    ) -> Result<Option<FoundNearest>, Error> {
        let [a, b] = ids;
        let search = DistanceSearch {
            control,
            ids,
            bodies: [scene.body(a)?, scene.body(b)?],
            trees: ids.map(|id| &self.trees[&(id.index(), Part::Given)]),
            scale,
        };
        let known = self.known.get(&ids.map(BodyId::index));
        if let Some(known) = known
            && scale.is_one()
            && known.stamps == search.bodies.map(Body::positions_stamp)
        {
            match known.answer {
                KnownDistance::Is(squared, nearest) => return Ok(Some(Some((squared, nearest)))),
                KnownDistance::Above(squared) if most <= squared => return Ok(Some(None)),
                KnownDistance::Above(_) => {}
            }
        }
        let likely = known.and_then(|known| known.likely);
        let bodies = search.bodies;
        let found = search.nearest(likely, most, most_overlapping)?;
        if let Some(found) = found
            && scale.is_one()
        {
            note(&mut self.known, bodies, most, (ids, found));
        }
        Ok(found)
    }

    /// The tree of a part of a body that is [known](OfTwo::know).
    pub(super) fn tree(&self, id: BodyId, part: Part) -> &Tree {
        &self.trees[&(id.index(), part)]
    }

    /// Says what the last question clustered, and the bytes of the trees.
    pub(super) fn report(&self, stats: &mut Stats) {
        (stats.n_clustered, stats.n_reclustered) =
            (self.stats.n_clustered, self.stats.n_reclustered);
        stats.bytes_held = (self.clusterings.bytes() + self.bytes) as u64;
    }

    /// Brings the tree of a part of a body to its current pose.
    ///
    /// # Errors
    /// A stale id, bad positions that were written in place; cancellation.
    pub(super) fn know(
        &mut self,
        scene: &Scene,
        id: BodyId,
        part: Part,
        work: Work<'_>,
    ) -> Result<(), Error> {
        let body = scene.body(id)?;
        body.check_once(id)?;
        let body_part = BodyPart::new(id, body, part);
        let (slot, stats) = (id.index(), &mut self.stats);
        let known = self.trees.remove(&(slot, part));
        self.bytes -= known.as_ref().map_or(0, Tree::bytes);
        let known = known.filter(|tree| tree.fits(body));
        if known.is_none() && part == Part::Given {
            self.known.retain(|numbers, _| !numbers.contains(&slot));
        }
        let own = known.as_ref().map(|tree| &tree.clustering);
        let clustering = self.clusterings.of(body_part, own, work, stats)?;
        let known = known.filter(|tree| Arc::ptr_eq(&tree.clustering, &clustering));
        let mut tree = known.unwrap_or_else(|| Tree::new(body, clustering));
        if tree.refit(body) {
            let (spread, mut all) = (tree.spread(), self.clusterings.lock());
            let renewed = all.renew_if_stale(body_part, (&mut tree.fit, spread), work, stats)?;
            if let Some(clustering) = renewed {
                tree = Tree::new(body, clustering);
                tree.refit(body);
                tree.fit.note(tree.spread());
            }
        }
        self.bytes += tree.bytes();
        self.trees.insert((slot, part), tree);
        Ok(())
    }
}

/// Keeps what was found about two bodies, of all that is at most `most`.
fn note(
    known: &mut HashMap<[usize; 2], Known>,
    bodies: [&Body; 2],
    most: f64,
    (ids, found): ([BodyId; 2], FoundNearest),
) {
    let known = known.entry(ids.map(BodyId::index)).or_insert(Known {
        stamps: [0; 2],
        answer: KnownDistance::Above(0.0),
        likely: None,
    });
    known.stamps = bodies.map(Body::positions_stamp);
    known.answer = match found {
        Some((squared, nearest)) => {
            known.likely = Some(nearest.elements());
            KnownDistance::Is(squared, nearest)
        }
        None => KnownDistance::Above(most),
    };
}
