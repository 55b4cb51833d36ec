//! A detector's answers about points: where they lie.

use super::Detector;
use crate::contact::Work;
use crate::probe::Shared;
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::positions::Real;

impl Detector {
    /// Where each point lies: inside a body (1), on its surface (0) or outside (-1). Decided exactly, also for points on faces,
    /// edges and vertices and in their planes.
    ///
    /// Triangles must be a closed surface: every edge has as many faces along it as against it. A point is inside where the
    /// surface winds around it a number of times that is not 0, whichever way. So an outer shell and an inner one of the opposite
    /// orientation have a hollow between them, and where two shells of one orientation overlap is inside. A point on any face is on
    /// the surface.
    ///
    /// Of tetrahedra, a point is inside if it is strictly inside one of them, or on faces of theirs that are not the border of
    /// the body: faces that belong to one tetrahedron alone are the border, and the surface.
    ///
    /// ```
    /// use impinge::{Backend, Detector, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let faces = [[0u32, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    /// let corners = [[0.0f32, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 4.0]];
    /// let mut scene = Scene::new();
    /// let body = scene.add_triangles(&faces, &corners)?;
    /// let mut detector = Detector::new(Backend::Cpu)?;
    /// let points = [[1.0f32, 1.0, 1.0], [0.0, 0.0, 2.0], [-1.0, 0.0, 0.0]];
    /// assert_eq!(detector.contains(&scene, body, &points)?, [1, 0, -1]);
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// A stale id, a body of points or edges, a surface that is not closed (the error names an edge), positions or points that
    /// are not finite, a memory budget too small for the trees of the body.
    pub fn contains<R: Real>(
        &mut self,
        scene: &Scene,
        body: BodyId,
        points: &[[R; 3]],
    ) -> Result<Vec<i8>, Error> {
        let control = &self.control.clone();
        let limits = self.settings.limits();
        let Detector {
            runner,
            stats: measured,
            distances,
            topologies,
            probes,
            ..
        } = self;
        runner.measure(measured, limits, |workers, stats| {
            let _shift = workers.shift(points.len() as u64);
            let work = Work { workers, control };
            let mut shared = Shared {
                distances,
                topologies,
            };
            let places = probes.contains(scene, body, points, &mut shared, work)?;
            distances.report(stats);
            stats.bytes_held += probes.bytes() + topologies.bytes();
            Ok(places)
        })
    }
}
