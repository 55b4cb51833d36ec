//! One body: its elements, its positions, and what was said about it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::scene::elements::{BodyKind, Elements, Part, Parts, VertexRings};
use crate::scene::error::Error;
use crate::scene::ids::{BodyId, new_stamp};
use crate::scene::index::ElementIx;
use crate::scene::mesh::Mesh;
use crate::scene::positions::{Given, NewPositions, Positions, check_positions};
use crate::scene::thickness::{Each, HeldThickness};
use crate::scene::transform::RestPose;

/// Which different bodies meet in [`Query::all`](crate::Query::all), the default, and in
/// [`Query::between_all`](crate::Query::between_all): two bodies meet when the `category` of each
/// shares a bit with the `mask` of the other. By default all bodies meet. Filters never decide
/// about self-collision, and queries that name bodies ([`between`](crate::Query::between),
/// [`of`](crate::Query::of), [`across`](crate::Query::across)) ignore them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Filter {
    /// The categories to which the body belongs.
    pub category: u64,
    /// The categories that it meets.
    pub mask: u64,
}

impl Default for Filter {
    fn default() -> Self {
        Filter {
            category: 1,
            mask: u64::MAX,
        }
    }
}

impl Filter {
    /// Whether bodies with these two filters meet.
    #[inline]
    pub fn meets(self, other: Filter) -> bool {
        self.category & other.mask != 0 && other.category & self.mask != 0
    }
}

/// One body: elements, positions, filter.
#[derive(Debug, Clone)]
pub struct Body {
    pub(super) parts: Parts,
    pub(super) positions: Positions,
    /// Where the vertices are at the end of a step; as many as `positions`, or `None` so far.
    pub(super) end: Option<Positions>,
    /// Whether `end` counts. If not, only memory of the body's own is kept.
    pub(super) moves: bool,
    /// Whether a transform made it, while it counts.
    pub(super) is_end_transformed: bool,
    /// How the body was moved by a transform, if it was.
    pub(super) motion: Option<Box<RestPose>>,
    pub(super) filter: Filter,
    pub(super) thickness: HeldThickness,
    /// Of each vertex, if it was set.
    pub(super) groups: Option<Arc<[u32]>>,
    pub(super) pinned: Option<Arc<[bool]>>,
    pub(super) mesh_stamp: u64,
    pub(super) topology_stamp: u64,
    pub(super) positions_stamp: u64,
    pub(super) step_stamp: u64,
    /// False while positions written in place, or given without a copy, have not been checked.
    pub(super) checked: Checked,
}

/// Whether positions were checked. A question, which only reads the body, may find that they are
/// good.
#[derive(Debug)]
pub(super) struct Checked(AtomicBool);

impl Clone for Checked {
    fn clone(&self) -> Self {
        Checked(AtomicBool::new(self.0.load(Ordering::Relaxed)))
    }
}

impl Body {
    /// A body of a mesh.
    ///
    /// # Errors
    /// More elements or vertices than 32 bits number, a position or an index that is refused.
    pub(super) fn new(id: BodyId, mesh: Mesh, filter: Filter) -> Result<Body, Error> {
        let Mesh {
            elements,
            positions,
            ..
        } = mesh;
        let limit = u64::from(u32::MAX);
        for (what, given) in [
            ("elements of one body", elements.len() as u64),
            ("vertices of one body", positions.len() as u64),
        ] {
            if given > limit {
                return Err(Error::TooMany { what, given, limit });
            }
        }
        positions.check(id)?;
        let n_vertices = positions.len();
        let bad_index = elements.first_bad_index(n_vertices);
        if let Some((element, index)) = bad_index {
            return Err(Error::VertexIndexOutOfRange {
                body: id,
                element,
                index,
                n_vertices,
            });
        }
        let stamp = new_stamp();
        Ok(Body {
            parts: Parts::new(elements),
            positions,
            end: None,
            moves: false,
            is_end_transformed: false,
            motion: None,
            filter,
            thickness: HeldThickness::default(),
            groups: None,
            pinned: None,
            mesh_stamp: stamp,
            topology_stamp: new_stamp(),
            positions_stamp: stamp,
            step_stamp: stamp,
            checked: Checked(AtomicBool::new(true)),
        })
    }

    /// The elements that the body was given as.
    pub fn elements(&self) -> &Elements {
        self.parts.given()
    }

    /// The elements of one part: those that the body was given as, or its vertices, edges or faces,
    /// which are found once per topology. Their numbers depend on the given elements alone, but for
    /// edges that were [set](crate::Scene::set_edges).
    pub fn part(&self, part: Part) -> &Elements {
        self.parts.part(part)
    }

    /// The edges, `(n, 2)`: of tetrahedra those of their surface. They are found once per topology;
    /// their numbers, which pairs of edges have, depend on the elements alone, unless they were
    /// [set](crate::Scene::set_edges).
    pub fn edges(&self) -> &Elements {
        self.part(Part::Edges)
    }

    /// Whether the edges have the numbers that the caller [set](crate::Scene::set_edges).
    pub fn has_own_edges(&self) -> bool {
        self.parts.own_edges.is_some()
    }

    /// The faces, `(n, 3)`: of tetrahedra those of their surface.
    pub fn faces(&self) -> &Elements {
        self.parts.part(Part::Faces)
    }

    /// One name for equal parts.
    pub(crate) fn canonical(&self, part: Part) -> Part {
        self.parts.canonical(part)
    }

    /// The corners of an element of a part.
    #[inline]
    pub(crate) fn corners<'a>(&'a self, part: Part, element: &'a ElementIx) -> &'a [u32] {
        match part {
            // Vertices are numbered as positions are.
            Part::Vertices => element.as_corners(),
            _ => self.part(part).corners(element.index()),
        }
    }

    /// The current positions: where a step starts.
    pub fn positions(&self) -> &Positions {
        &self.positions
    }

    /// The positions at the end of a step, in the precision of [`positions`](Body::positions).
    /// `None` for a body that stands still.
    pub fn end_positions(&self) -> Option<&Positions> {
        self.end.as_ref().filter(|_| self.moves)
    }

    /// The matrix that moved the vertices from the [rest positions](Body::rest_positions); `None`
    /// without one ([`Scene::set_transform`](crate::Scene::set_transform)), and after a step was
    /// [taken](crate::Advance::apply).
    pub fn transform(&self) -> Option<[[f64; 4]; 4]> {
        let matrix = self.motion.as_ref().and_then(|motion| motion.matrix);
        matrix.map(|matrix| matrix.matrix())
    }

    /// The positions from which [transforms](crate::Scene::set_transform) start: those that were
    /// given last, or reached by the last step that was [taken](crate::Advance::apply). A step
    /// whose end a [transform](crate::Scene::set_end_transform) set leaves them as they are.
    pub fn rest_positions(&self) -> &Positions {
        match &self.motion {
            Some(motion) => &motion.rest,
            None => &self.positions,
        }
    }

    /// Points, edges, triangles or tetrahedra.
    pub fn kind(&self) -> BodyKind {
        self.elements().kind()
    }

    /// The number of elements.
    pub fn n_elements(&self) -> usize {
        self.elements().len()
    }

    /// The number of vertices.
    pub fn n_vertices(&self) -> usize {
        self.positions.len()
    }

    /// Which bodies it meets.
    pub fn filter(&self) -> Filter {
        self.filter
    }

    /// The group of each vertex, if [groups](crate::Scene::set_groups) were set.
    pub fn groups(&self) -> Option<&[u32]> {
        self.groups.as_deref()
    }

    /// Whether each vertex is [pinned](crate::Scene::set_pinned), if any is.
    pub fn pinned(&self) -> Option<&[bool]> {
        self.pinned.as_deref()
    }

    /// The same [groups](Body::groups), shared.
    pub(crate) fn shared_groups(&self) -> Option<Arc<[u32]>> {
        self.groups.clone()
    }

    /// What is [pinned](Body::pinned), shared.
    pub(crate) fn shared_pinned(&self) -> Option<Arc<[bool]>> {
        self.pinned.clone()
    }

    /// The vertices at most some number of edges away from each vertex.
    pub(crate) fn vertex_rings(&self, n_rings: u32) -> Arc<VertexRings> {
        self.parts.rings(self.n_vertices(), n_rings)
    }

    /// How thick the body is, in the unit of the scene: the thickness of its thickest element. See
    /// [`Scene::set_thickness`](crate::Scene::set_thickness).
    pub fn thickness(&self) -> f64 {
        self.thickness.most
    }

    /// The thickness of each vertex, edge or face, as it was given, and which of these; `None` if
    /// all of the body is equally thick.
    pub fn thickness_by_element(&self) -> Option<(Part, &[f64])> {
        self.thickness.each.as_ref().map(|each| each.given())
    }

    /// How thick each element is, if it was given by element.
    pub(crate) fn thickness_of_each(&self) -> Option<&Arc<Each>> {
        self.thickness.each.as_ref()
    }

    /// Whether there is an end that a transform made.
    #[doc(hidden)]
    pub fn has_end_by_transform(&self) -> bool {
        self.moves && self.is_end_transformed
    }

    /// Changes when the body is re-meshed; equal stamps mean equal topology.
    pub(crate) fn topology_stamp(&self) -> u64 {
        self.topology_stamp
    }

    /// Changes when the elements of a part get other numbers: when the body is re-meshed, of edges
    /// also when they are [set](crate::Scene::set_edges).
    pub(crate) fn numbers_stamp(&self, part: Part) -> u64 {
        match part {
            Part::Edges => self.topology_stamp,
            _ => self.mesh_stamp,
        }
    }

    /// Changes whenever positions may have changed.
    pub(crate) fn positions_stamp(&self) -> u64 {
        self.positions_stamp
    }

    /// Changes whenever positions at the start or the end of a step may have changed.
    pub(crate) fn step_stamp(&self) -> u64 {
        self.step_stamp
    }

    pub(crate) fn is_checked(&self) -> bool {
        self.checked.0.load(Ordering::Relaxed)
    }

    /// All positions were found to be finite.
    pub(crate) fn set_checked(&self) {
        self.checked.0.store(true, Ordering::Relaxed);
    }

    /// Refuses a number of positions other than that of the vertices.
    fn check_number(&self, body: BodyId, given: usize) -> Result<(), Error> {
        match self.n_vertices() {
            expected if expected == given => Ok(()),
            expected => Err(Error::WrongNumberOfPositions {
                body,
                given,
                expected,
            }),
        }
    }

    /// Refuses new positions of another number, and the first that is not finite.
    pub(crate) fn check(&self, body: BodyId, positions: &NewPositions<'_>) -> Result<(), Error> {
        self.check_number(body, positions.len())?;
        match &positions.0 {
            Given::F32(rows) => check_positions(body, rows),
            Given::F64(rows) => check_positions(body, rows),
            Given::Whole(positions) => positions.check(body),
        }
    }

    /// As [`check`](Body::check), but leaves many positions that are not copied to the next
    /// question: to read them twice would take a third of the time of a detection. Returns whether
    /// they were looked at.
    pub(super) fn check_now(
        &self,
        body: BodyId,
        positions: &NewPositions<'_>,
    ) -> Result<bool, Error> {
        const FEW: usize = 1 << 15;
        if matches!(positions.0, Given::Whole(_)) && positions.len() > FEW {
            self.check_number(body, positions.len())?;
            return Ok(false);
        }
        self.check(body, positions)?;
        Ok(true)
    }

    /// Refuses positions that nothing has checked yet and that are not finite.
    pub(crate) fn check_once(&self, body: BodyId) -> Result<(), Error> {
        if !self.is_checked() {
            self.positions.check(body)?;
            self.set_checked();
        }
        Ok(())
    }

    /// Sets checked positions at the end of a step.
    pub(super) fn set_end(&mut self, mut end: Positions, is_transformed: bool) {
        self.positions.widen_as(&end);
        end.widen_as(&self.positions);
        self.end = Some(end);
        self.moves = true;
        self.is_end_transformed = is_transformed;
        self.step_stamp = new_stamp();
    }

    /// Clears the end. Memory of the body's own is kept for the next one, and rows of an owner are
    /// dropped.
    pub(super) fn clear_end(&mut self) {
        self.moves = false;
        self.end.take_if(|end| end.is_shared());
        self.step_stamp = new_stamp();
    }

    pub(super) fn has_moved(&mut self, checked: bool) {
        self.clear_end();
        self.positions_stamp = self.step_stamp;
        self.motion = None;
        *self.checked.0.get_mut() = checked;
    }
}

/// Whether all of these vertices of a body are [pinned](Body::pinned).
pub(crate) fn are_all_pinned(pinned: &[bool], corners: &[u32]) -> bool {
    corners.iter().all(|&corner| pinned[corner as usize])
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use crate::{Backend, Detector, Method, Query, Scene, Settings};

    /// A strip of triangles with so many vertices.
    fn strip(scene: &mut Scene, n: u32) -> (crate::BodyId, Vec<[f32; 3]>) {
        let faces: Vec<[u32; 3]> = (2..n).map(|ix| [ix - 2, ix - 1, ix]).collect();
        let points = (0..n)
            .map(|ix| [ix as f32, (ix % 2) as f32, 0.0])
            .collect::<Vec<_>>();
        let body = scene.add_triangles(&faces, &points).expect("good");
        (body, points)
    }

    /// What is given without a copy is looked at by the first question alone, whichever it is.
    #[test]
    fn questions_remember_that_positions_are_finite() {
        let mut scene = Scene::new();
        let (body, points) = strip(&mut scene, 40_000);
        let (small, few) = strip(&mut scene, 100);
        let is_checked = |scene: &Scene| scene.body(body).expect("held").is_checked();
        for method in [Method::Clusters, Method::Cells] {
            let settings = Settings::from(Backend::Cpu).method(method);
            for threads in [1, 2] {
                let mut detector = Detector::new(settings.clone().threads(threads)).expect("good");
                for question in 0..5 {
                    let lent = Arc::new(points.clone());
                    scene
                        .set_positions(body, Arc::clone(&lent))
                        .expect("as many");
                    scene.set_positions(small, few.clone()).expect("good");
                    assert!(!is_checked(&scene) && scene.body(small).expect("held").is_checked());
                    let copy = scene.clone();
                    let query = Query::all();
                    match question {
                        0 => drop(detector.detect(&scene, &query).expect("good")),
                        1 => drop(detector.near(&scene, 0.1, &query).expect("good")),
                        2 => drop(detector.distance(&scene, body, small).expect("good")),
                        3 => {
                            scene
                                .set_end_positions(body, Arc::clone(&lent))
                                .expect("good");
                            drop(
                                detector
                                    .truncate(&scene, &Query::between(small, body))
                                    .expect("good"),
                            );
                        }
                        _ => drop(
                            detector
                                .closest(&scene, &[[0.0; 3]], 1.0, &query)
                                .expect("good"),
                        ),
                    }
                    assert!(is_checked(&scene), "{method:?} {threads} {question}");
                    assert!(!is_checked(&copy));
                }
            }
        }
    }

    /// Bodies that a step is not asked about take it, too.
    #[test]
    fn steps_refuse_what_moves_though_nobody_asks_about_it() {
        let mut scene = Scene::new();
        let (body, mut points) = strip(&mut scene, 40_000);
        let (a, _) = strip(&mut scene, 10);
        let (b, _) = strip(&mut scene, 10);
        points[7][1] = f32::NAN;
        scene.set_positions(body, points.clone()).expect("as many");
        points[7][1] = 0.0;
        scene.set_end_positions(body, points).expect("good");
        let mut detector = Detector::new(Backend::Cpu).expect("good");
        let query = Query::between(a, b);
        for error in [
            detector.advance(&scene, &query).map(drop),
            detector.truncate(&scene, &query).map(drop),
        ] {
            let error = error.expect_err("it has no way").to_string();
            assert!(error.contains("vertex 7"), "{error}");
        }
    }
}
