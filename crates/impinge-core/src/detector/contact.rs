//! A detector's answers about contact: where pairs meet, and how deep bodies are in each other.

use super::Detector;
use crate::answers::pairs::Pairs;
use crate::contact::{Contacts, Penetration};
use crate::plan::Gaps;
use crate::query::Query;
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::search::work::Work;

impl Detector {
    /// Where the triangles of each pair meet: points, segments and polygons. The scene must not
    /// have changed since the pairs were found.
    ///
    /// ```
    /// use impinge::{Backend, Detector, Query, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// let floor = [[0.0f32, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
    /// let blade = [[1.0f32, 1.0, -1.0], [2.0, 1.0, -1.0], [1.0, 1.0, 1.0]];
    /// scene.add_triangles(&[[0, 1, 2]], &floor)?;
    /// scene.add_triangles(&[[0, 1, 2]], &blade)?;
    /// let mut detector = Detector::new(Backend::Cpu)?;
    /// let pairs = detector.detect(&scene, &Query::between_all())?.clone();
    /// let contacts = detector.contacts(&scene, &pairs)?;
    /// assert_eq!(contacts.points(), [[1.0, 1.0, 0.0], [1.5, 1.0, 0.0]]);
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// A body of the pairs is no longer in the scene, or was re-meshed since; positions written in
    /// place since then that are refused.
    pub fn contacts(&mut self, scene: &Scene, pairs: &Pairs) -> Result<Contacts, Error> {
        let control = &self.control.clone();
        let limits = self.settings.limits();
        let Detector {
            runner,
            stats: measured,
            ..
        } = self;
        runner.measure(measured, limits, |workers, stats| {
            let _shift = workers.shift(pairs.len() as u64);
            let contacts = Contacts::new(scene, pairs, Work { workers, control })?;
            stats.bytes_held = contacts.bytes();
            Ok(contacts)
        })
    }

    /// How deep two closed bodies of triangles are in each other, from contacts among which are all
    /// of these two. The bodies' topologies are kept, so that later calls cost less.
    ///
    /// A vertex is inside where the other surface's winding number around it is not 0; a vertex on
    /// the surface is not inside. The body with the lower number is the first, whichever argument
    /// it is.
    ///
    /// ```
    /// use impinge::{Backend, Detector, Query, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let tetrahedron = [[0u32, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    /// let corners = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    /// let mut scene = Scene::new();
    /// let a = scene.add_triangles(&tetrahedron, &corners)?;
    /// let moved = corners.map(|[x, y, z]| [x + 0.1, y + 0.125, z - 0.875]);
    /// let b = scene.add_triangles(&tetrahedron, &moved)?;
    /// let mut detector = Detector::new(Backend::Cpu)?;
    /// let pairs = detector.detect(&scene, &Query::between(a, b))?.clone();
    /// let contacts = detector.contacts(&scene, &pairs)?;
    /// let penetration = detector.penetration(&scene, &contacts, a, b)?;
    /// assert_eq!(penetration.inside[1], [3]); // The tip of b is in a.
    /// let region = &penetration.regions[0];
    /// assert!(region.depth.is_some_and(|depth| depth <= 0.125));
    /// assert!(region.normal.is_some_and(|normal| normal[2] > 0.9)); // Push a up.
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// A body that is not in the scene, the same body twice, a body not made of triangles, a
    /// surface that is not closed, contacts without these two though they intersect; contacts of a
    /// query that left out pairs of the two: in a cell, by groups, by lists of vertices, by pairs
    /// of an answer, or because faces of both were [pinned](Scene::set_pinned); contacts of pairs
    /// some of which [`retain`](Pairs::retain) dropped; a body that was moved or re-meshed since
    /// the pairs were found ([`Error::Moved`]).
    pub fn penetration(
        &mut self,
        scene: &Scene,
        contacts: &Contacts,
        a: BodyId,
        b: BodyId,
    ) -> Result<Penetration, Error> {
        self.refuse_others(scene, contacts, [a, b])?;
        let control = &self.control.clone();
        let limits = self.settings.limits();
        let Detector {
            runner,
            stats: measured,
            topologies,
            ..
        } = self;
        runner.measure(measured, limits, |workers, stats| {
            let _shift = workers.shift(0);
            let work = Work { workers, control };
            let found = topologies.penetration(scene, contacts, [a, b], work)?;
            stats.bytes_held = topologies.bytes();
            Ok(found)
        })
    }

    /// Refuses contacts of other bodies or other positions: two bodies that intersect would seem to
    /// be apart.
    fn refuse_others(
        &mut self,
        scene: &Scene,
        contacts: &Contacts,
        [a, b]: [BodyId; 2],
    ) -> Result<(), Error> {
        if a == b {
            return Ok(());
        }
        let are_there = contacts.are_any_of([a.min(b), a.max(b)]);
        if are_there {
            contacts.refuse_moved(scene, a)?;
            contacts.refuse_moved(scene, b)?;
        }
        let refuse = |given: String| {
            Err(Error::Setting {
                setting: "contacts",
                given,
                allowed: "those of all pairs of the two",
            })
        };
        let question = Query::between(a, b);
        let gap = match are_there {
            true => contacts.gaps().between(scene, [a, b]),
            false => Gaps::new(scene, &question)?.between(scene, [a, b]),
        };
        if let Some(what) = gap {
            return refuse(format!("without some of the two, because of {what},"));
        }
        if !are_there && self.any(scene, &question)? {
            return refuse(format!("none of bodies {a} and {b}, which intersect,"));
        }
        Ok(())
    }
}
