//! Probes: where points lie, and what is nearest to them.
//!
//! What it does: says of points whether they are inside a body, on its surface or outside.
//!
//! How: a probe is a box of its own. It goes down the tree of the body's clusters, which all questions share, past the boxes
//! of 64 elements at a time, to the elements that it may meet. These are decided one by one with exact signs.
//!
//! In: bodies, whose clusters are refitted when they have moved, and points in either precision. Out: one answer per point.
//!
//! Cost: the trees as for distances of bodies; 24 bytes per element of the clusters that probes come to; then per point a way down
//! the tree. Points are shared among the workers; each point's answer depends on nothing but the point and the bodies.

mod border;
mod boxes;
mod inside;

use std::collections::HashMap;
use std::sync::Arc;

use crate::contact::{Topologies, Work};
use crate::proximity::Distances;
use crate::scene::elements::BodyKind;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::positions::Real;
use crate::scene::{Body, Scene};
use crate::simd::Isa;

use border::Border;
use boxes::Boxes;

/// What is kept of the bodies that were probed, from call to call.
#[derive(Debug)]
pub(crate) struct Probes {
    isa: Isa,
    /// By the number of the body.
    boxes: HashMap<usize, Boxes>,
    borders: HashMap<usize, Border>,
}

/// A body that is probed.
#[derive(Clone, Copy)]
struct Target<'a> {
    body: &'a Body,
    boxes: &'a Boxes,
}

/// What a detector keeps for other questions too.
pub(crate) struct Shared<'a> {
    pub distances: &'a mut Distances,
    pub topologies: &'a mut Topologies,
}

/// Points per task.
const TASK: usize = 256;

impl Probes {
    /// Nothing is known yet.
    pub fn new(isa: Isa) -> Self {
        Probes {
            isa,
            boxes: HashMap::new(),
            borders: HashMap::new(),
        }
    }

    /// Bytes held beside the clusters and their trees.
    pub fn bytes(&self) -> u64 {
        let boxes: usize = self.boxes.values().map(Boxes::bytes).sum();
        let borders: usize = self.borders.values().map(Border::bytes).sum();
        (boxes + borders) as u64
    }

    /// Whether each point is inside a body (1), on its surface (0) or outside (-1).
    ///
    /// # Errors
    /// A stale id, a body of another kind than triangles and tetrahedra, a surface that is not closed, positions or points that are
    /// not finite, cancellation.
    pub fn contains<R: Real>(
        &mut self,
        scene: &Scene,
        id: BodyId,
        points: &[[R; 3]],
        shared: &mut Shared<'_>,
        work: Work<'_>,
    ) -> Result<Vec<i8>, Error> {
        check_points("points", points)?;
        let body = scene.body(id)?;
        match body.kind() {
            BodyKind::Triangles => shared.topologies.know(scene, id, work)?,
            BodyKind::Tetrahedra => self.know_border(id, body, work)?,
            kind => {
                return Err(Error::WrongKind {
                    body: id,
                    kind: kind.name(),
                    expected: "triangles or tetrahedra",
                });
            }
        }
        self.know(scene, &[id], shared, work)?;
        let target = Target {
            body,
            boxes: &self.boxes[&id.index()],
        };
        let border = self.borders.get(&id.index());
        let mut places = vec![0i8; points.len()];
        let size = work.workers.task(TASK);
        let mut tasks: Vec<_> = points.chunks(size).zip(places.chunks_mut(size)).collect();
        work.each(&mut tasks, |_, (points, places)| {
            inside::places(self.isa, target, border, points, places, work)
        })?;
        Ok(places)
    }

    /// Refits the boxes of some bodies, and forgets removed ones.
    fn know(
        &mut self,
        scene: &Scene,
        ids: &[BodyId],
        shared: &mut Shared<'_>,
        work: Work<'_>,
    ) -> Result<(), Error> {
        self.boxes.retain(|&slot, _| scene.holds(slot));
        self.borders.retain(|&slot, _| scene.holds(slot));
        shared.distances.begin(scene);
        for &id in ids {
            work.step()?;
            let tree = shared.distances.tree(scene, id, work.workers)?;
            let stamp = scene.body(id)?.positions_stamp();
            let known = self.boxes.get(&id.index());
            if !known.is_some_and(|boxes| boxes.fits(&tree.clustering, stamp)) {
                let boxes = Boxes::new(Arc::clone(&tree.clustering), stamp, tree.levels());
                self.boxes.insert(id.index(), boxes);
            }
        }
        Ok(())
    }

    /// Caches which faces of tetrahedra are the border of the body.
    fn know_border(&mut self, id: BodyId, body: &Body, work: Work<'_>) -> Result<(), Error> {
        let known = self.borders.get(&id.index());
        if !known.is_some_and(|border| border.fits(body)) {
            let border = Border::new(body, work)?;
            self.borders.insert(id.index(), border);
        }
        Ok(())
    }
}

/// Refuses the first row that is not finite.
fn check_points<R: Real>(what: &'static str, points: &[[R; 3]]) -> Result<(), Error> {
    if R::all_finite(points.as_flattened()) {
        return Ok(());
    }
    let mut rows = points.iter().map(|point| point.map(R::widen)).enumerate();
    match rows.find(|(_, value)| value.iter().any(|x| !x.is_finite())) {
        Some((row, value)) => Err(Error::NonFinitePoint { what, row, value }),
        None => Ok(()),
    }
}
