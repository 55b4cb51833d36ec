//! A detector's answers about points: where they lie and how far inside, in which tetrahedra, and
//! what is nearest.

use super::Detector;
use crate::answers::closest::Closest;
use crate::answers::hits::Hits;
use crate::proximity::probe::{Probes, Shared};
use crate::query::Query;
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::positions::Real;
use crate::search::sink;
use crate::search::work::Work;

/// A point or a ray takes at least as long as so many elements of a frame.
const ELEMENTS_PER_PROBE: u64 = 32;

impl Detector {
    /// Where each point lies: inside a body (1), on its surface (0) or outside (-1). Decided
    /// exactly, also for points on faces, edges and vertices and in their planes.
    ///
    /// Triangles must be a closed surface: every edge has as many faces along it as against it. A
    /// point is inside where the surface winds around it a number of times that is not 0, whichever
    /// way. So an outer shell and an inner one of the opposite orientation have a hollow between
    /// them, and where two shells of one orientation overlap is inside. A point on any face is on
    /// the surface.
    ///
    /// Of tetrahedra, a point is inside if it is strictly inside one of them, or on faces of theirs
    /// that are not the border of the body. The border, which is the surface, are all faces but
    /// those between two tetrahedra that have another vertex on either side. So where tetrahedra
    /// overlap, a point strictly inside one of them is inside, also on the border of another.
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
    /// A stale id, a body of points or edges, a surface that is not closed (the error names an
    /// edge), positions or points that are not finite, a memory budget too small for the trees of
    /// the body.
    pub fn contains<R: Real>(
        &mut self,
        scene: &Scene,
        body: BodyId,
        points: &[[R; 3]],
    ) -> Result<Vec<i8>, Error> {
        self.probe(points.len(), |probes, shared, work| {
            let places = probes.contains(scene, body, points, shared, work)?;
            Ok((places, shared.topologies.bytes()))
        })
    }

    /// How far each point is from the surface of a body: positive inside, negative outside, 0 on
    /// the surface. The sign is that of [`contains`](Detector::contains) and exact; the magnitude
    /// is the distance of [`closest`](Detector::closest), rounded down: never above the true one,
    /// and 0 or -0 below the smallest `f64`. So it is 0 on every face of the surface, also on one
    /// that is strictly inside another tetrahedron, where `contains` says inside.
    ///
    /// ```
    /// use impinge::{Backend, Detector, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let faces = [[0u32, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    /// let corners = [[0.0f32, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 4.0]];
    /// let mut scene = Scene::new();
    /// let body = scene.add_triangles(&faces, &corners)?;
    /// let mut detector = Detector::new(Backend::Cpu)?;
    /// let points = [[1.0f32, 1.0, 0.5], [0.0, 0.0, 2.0], [-1.0, 0.0, 0.0]];
    /// assert_eq!(detector.signed_distance(&scene, body, &points)?, [0.5, 0.0, -1.0]);
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// As [`contains`](Detector::contains).
    pub fn signed_distance<R: Real>(
        &mut self,
        scene: &Scene,
        body: BodyId,
        points: &[[R; 3]],
    ) -> Result<Vec<f64>, Error> {
        let mut closest = self.homes.closest.take();
        self.probe(points.len(), |probes, shared, work| {
            let places = probes.contains(scene, body, points, shared, work)?;
            let asked = (&Query::of(body), f64::INFINITY);
            probes.closest(scene, asked, points, &mut closest.found, shared, work)?;
            let mut signed = sink::with_capacity(points.len(), "distances")?;
            // A body without elements is infinitely far.
            signed.extend(places.iter().zip(&closest.found).map(|(&place, found)| {
                let distance = found.map_or(f64::INFINITY, |found| found.distance);
                match place {
                    0 => 0.0,
                    _ => f64::from(place) * distance,
                }
            }));
            Ok((signed, closest.bytes() + shared.topologies.bytes()))
        })
    }

    /// How often a closed surface winds around each point: 0 outside, 1 inside where faces are
    /// counterclockwise seen from outside and -1 where they are clockwise, and sums of these where
    /// the surface overlaps itself; `None` on the surface. Decided exactly.
    /// [`contains`](Detector::contains) says whether it is 0.
    ///
    /// ```
    /// use impinge::{Backend, Detector, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// // Twice the same surface, of which one is four times as large.
    /// let faces = [[0u32, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    /// let both = [faces, faces.map(|face| face.map(|vertex| vertex + 4))].concat();
    /// let corners = [[0.0f32, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 4.0]];
    /// let corners = [corners, corners.map(|corner| corner.map(|x| 4.0 * x - 1.0))].concat();
    /// let mut scene = Scene::new();
    /// let body = scene.add_triangles(&both, &corners)?;
    /// let mut detector = Detector::new(Backend::Cpu)?;
    /// let points = [[1.0f32, 1.0, 1.0], [3.0, 3.0, 3.0], [0.0, 1.0, 1.0], [-2.0, 0.0, 0.0]];
    /// let windings = detector.winding_numbers(&scene, body, &points)?;
    /// assert_eq!(windings, [Some(2), Some(1), None, Some(0)]);
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// A stale id, a body of another kind than triangles, a surface that is not closed (the error
    /// names an edge), positions or points that are not finite, a memory budget too small for the
    /// trees of the body.
    pub fn winding_numbers<R: Real>(
        &mut self,
        scene: &Scene,
        body: BodyId,
        points: &[[R; 3]],
    ) -> Result<Vec<Option<i32>>, Error> {
        self.probe(points.len(), |probes, shared, work| {
            let windings = probes.winding_numbers(scene, body, points, shared, work)?;
            Ok((windings, shared.topologies.bytes()))
        })
    }

    /// Which tetrahedron of a body contains each point: the lowest by number, where several share
    /// the face, edge or vertex on which a point is; `None` outside. Tetrahedra are closed, so
    /// points on the surface of the body are in one. Decided exactly. A flat tetrahedron contains
    /// the points of its faces.
    ///
    /// ```
    /// use impinge::{Backend, Detector, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let corners = [
    ///     [0.0f32, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 4.0], [0.0, 0.0, -4.0],
    /// ];
    /// let mut scene = Scene::new();
    /// let body = scene.add_tetrahedra(&[[0u32, 1, 2, 3], [0, 2, 1, 4]], &corners)?;
    /// let mut detector = Detector::new(Backend::Cpu)?;
    /// let points = [[1.0f32, 1.0, -1.0], [1.0, 1.0, 0.0], [3.0, 3.0, 3.0]];
    /// assert_eq!(detector.locate(&scene, body, &points)?, [Some(1), Some(0), None]);
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// A stale id, a body of another kind than tetrahedra, positions or points that are not finite,
    /// a memory budget too small for the trees of the body.
    pub fn locate<R: Real>(
        &mut self,
        scene: &Scene,
        body: BodyId,
        points: &[[R; 3]],
    ) -> Result<Vec<Option<u32>>, Error> {
        self.probe(points.len(), |probes, shared, work| {
            Ok((probes.locate(scene, body, points, shared, work)?, 0))
        })
    }

    /// The element that is nearest to each point, if it is at most `most` away, in the unit of the
    /// scene: with its distance, the nearest point of it and the feature on which that lies.
    /// Elements are the faces of bodies of triangles and of tetrahedra (their surface, so a point
    /// inside has a distance), and the edges and points of other bodies.
    ///
    /// Which element is nearest is decided exactly; of several at the same distance it is the
    /// lowest by body and then by number. Distances are rounded down: never above the true one.
    /// Points take a few roundings: a few last bits of the largest coordinate of the element.
    ///
    /// A query for all bodies, the default, or [`Query::of`] one or [`Query::across`] several,
    /// which then are those that are looked at. Cost: per point a way down the tree of each body
    /// whose box may hold the nearest element.
    ///
    /// With [`Query::n_nearest`] the answer has that many elements per point, nearest first, those
    /// at the same distance in their order: [`Closest::of`].
    ///
    /// ```
    /// use impinge::{Backend, Detector, Query, Scene, exact::Feature};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// let floor = [[0.0f32, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
    /// scene.add_triangles(&[[0, 1, 2]], &floor)?;
    /// let mut detector = Detector::new(Backend::Cpu)?;
    /// let points = [[1.0f32, 1.0, 2.0], [-3.0, 0.0, 4.0], [0.0, 0.0, 99.0]];
    /// let closest = detector.closest(&scene, &points, 10.0, &Query::all())?;
    /// let [first, second, third] = [0, 1, 2].map(|point| closest.get(point));
    /// assert_eq!(first.map(|at| (at.distance, at.point)), Some((2.0, [1.0, 1.0, 0.0])));
    /// assert_eq!(second.map(|at| (at.distance, at.feature)), Some((5.0, Feature::Vertex(0))));
    /// assert_eq!(third, None);
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// A stale id, a query about pairs, a distance that is negative or NaN, no element asked for,
    /// positions or points that are not finite, a memory budget too small for the trees of the
    /// bodies.
    pub fn closest<R: Real>(
        &mut self,
        scene: &Scene,
        points: &[[R; 3]],
        most: f64,
        query: &Query,
    ) -> Result<Closest, Error> {
        let mut closest = self.homes.closest.take();
        closest.n_nearest = query.n_nearest as usize;
        self.probe(points.len(), |probes, shared, work| {
            let asked = (query, most);
            probes.closest(scene, asked, points, &mut closest.found, shared, work)?;
            Ok(((), closest.bytes()))
        })?;
        closest.stats.clone_from(&self.stats);
        Ok(closest)
    }

    /// What each ray hits: the points `origin + t direction`, for t from 0 to `most` (1 for
    /// segments, infinity for rays). The first hit, and with [`Query::hits`] whether there is any,
    /// or all. Elements are those of [`closest`](Detector::closest).
    ///
    /// Decided exactly: a ray that grazes an edge or a vertex hits all elements there, and one in
    /// the plane of a face hits it from an entry to an exit. The first hit is the one with the
    /// smallest t; of several it is the lowest by body and then by number. Values of t are rounded
    /// down. A direction of zero is the origin alone.
    ///
    /// ```
    /// use impinge::{Backend, Detector, Query, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// let floor = [[0.0f32, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
    /// scene.add_triangles(&[[0, 1, 2]], &floor)?;
    /// let mut detector = Detector::new(Backend::Cpu)?;
    /// let origins = [[1.0f32, 1.0, 2.0], [9.0, 1.0, 2.0]];
    /// let directions = [[0.0f32, 0.0, -1.0]; 2];
    /// let hits = detector.cast(&scene, &origins, &directions, f64::INFINITY, &Query::all())?;
    /// assert_eq!(hits.is_hit(), [true, false]);
    /// assert_eq!(hits.of(0)[0].t, 2.0);
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// A stale id, a query about pairs, a `most` that is negative or NaN, another number of
    /// directions than of origins, positions or rays that are not finite, a memory budget too small
    /// for the trees of the bodies.
    pub fn cast<R: Real>(
        &mut self,
        scene: &Scene,
        origins: &[[R; 3]],
        directions: &[[R; 3]],
        most: f64,
        query: &Query,
    ) -> Result<Hits, Error> {
        let mut hits = self.homes.hits.take();
        self.probe(origins.len(), |probes, shared, work| {
            let rays = [origins, directions];
            probes.cast(scene, (query, most), rays, &mut hits, shared, work)?;
            Ok(((), hits.bytes()))
        })?;
        hits.stats.clone_from(&self.stats);
        Ok(hits)
    }

    /// Asks about some points or rays, and measures it. `ask` also says how many bytes it holds
    /// beside trees and probes.
    fn probe<T>(
        &mut self,
        n: usize,
        ask: impl FnOnce(&mut Probes, &mut Shared<'_>, Work<'_>) -> Result<(T, u64), Error>,
    ) -> Result<T, Error> {
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
            let _shift = workers.shift((n as u64).saturating_mul(ELEMENTS_PER_PROBE));
            let work = Work { workers, control };
            let mut shared = Shared {
                distances,
                topologies,
            };
            let (answer, bytes) = ask(probes, &mut shared, work)?;
            distances.report(stats);
            stats.bytes_held += probes.bytes() + bytes;
            Ok(answer)
        })
    }
}
