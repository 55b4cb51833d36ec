//! How far a step can be taken, and where the vertices are afterwards.

use crate::answers::impacts::Impact;
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::positions::Positions;

/// How far a step can be taken.
#[derive(Clone, PartialEq)]
#[non_exhaustive]
pub struct Advance {
    /// The part of the step that can be taken: 1 for all of it, 0 for none. With a
    /// [clearance](crate::Query::clearance) it holds for positions that solvers compute, and for
    /// all smaller parts: see [`Detector::advance`](crate::Detector::advance).
    pub fraction: f64,
    /// The first contact of the whole step, its time rounded down to `f64`. `None` if nothing
    /// touches. With a clearance: the first time at which a pair is as near as it may come,
    /// rounding included, as an `f32`.
    pub first: Option<Impact>,
    /// Whether elements intersect at the start; the fraction is then 0, whether or not there is a
    /// first contact. `None` if nobody asked: only [`Start::Verify`](crate::Start::Verify) does.
    pub start_intersects: Option<bool>,
    /// The vertex positions of all moving bodies at that fraction, rounded to the precision in
    /// which they are stored. The straight path from the start to these rounded positions is free,
    /// if the start was free of intersections, and except for pairs that touch at the start.
    pub positions: Vec<(BodyId, Positions)>,
    /// How many fractions were tried.
    pub n_tried: u32,
}

impl std::fmt::Debug for Advance {
    /// Without the positions: these may be millions.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut short = f.debug_struct("Advance");
        short.field("fraction", &self.fraction);
        short.field("first", &self.first);
        short.field("start_intersects", &self.start_intersects);
        short.field("n_tried", &self.n_tried);
        short.field("n_bodies", &self.positions.len());
        short.finish_non_exhaustive()
    }
}

impl Advance {
    /// Takes the step: sets these positions in the scene.
    ///
    /// # Errors
    /// A body that was removed, or that now has another number of vertices.
    pub fn apply(&self, scene: &mut Scene) -> Result<(), Error> {
        set_positions(scene, &self.positions)
    }
}

/// Sets the positions of bodies in a scene.
///
/// # Errors
/// A body that was removed, or that now has another number of vertices.
pub(crate) fn set_positions(
    scene: &mut Scene,
    positions: &[(BodyId, Positions)],
) -> Result<(), Error> {
    let mut all = positions.iter();
    all.try_for_each(|(body, positions)| match positions {
        Positions::F32(positions) => scene.set_positions(*body, positions),
        Positions::F64(positions) => scene.set_positions(*body, positions),
    })
}
