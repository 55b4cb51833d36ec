//! Bodies: topology once, positions every frame.

use std::sync::Arc;

use crate::scene::elements::with_corners;
pub(crate) use crate::scene::elements::{BodyKind, Elements};
use crate::scene::elements::{Part, Topology, VertexRings};
use crate::scene::error::Error;
pub(crate) use crate::scene::ids::BodyId;
use crate::scene::ids::new_stamp;
use crate::scene::index::ElementIx;
use crate::scene::mesh::Mesh;
use crate::scene::position_rows::PositionRows;
use crate::scene::positions::{Given, NewPositions, Real};
pub(crate) use crate::scene::positions::{Positions, check_positions};
use crate::scene::transform::{Affine, RestPose};

/// Which bodies meet in [`Query::between_all`](crate::Query::between_all): two bodies meet when the
/// `category` of each shares a bit with the `mask` of the other. By default all bodies meet.
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
    topology: Arc<Topology>,
    positions: Positions,
    /// Where the vertices are at the end of a step; as many as `positions`, or `None` so far.
    end: Option<Positions>,
    /// Whether `end` counts. If not, only its memory is kept.
    moves: bool,
    /// How the body was moved by a transform, if it was.
    motion: Option<Box<RestPose>>,
    filter: Filter,
    thickness: f64,
    /// Of each vertex, if it was set.
    groups: Option<Arc<[u32]>>,
    pinned: Option<Arc<[bool]>>,
    topology_stamp: u64,
    positions_stamp: u64,
    step_stamp: u64,
    /// False while positions written in place have not been checked.
    checked: bool,
}

impl Body {
    /// The elements that the body was given as.
    pub fn elements(&self) -> &Elements {
        self.topology.given()
    }

    /// The elements of one part: those that the body was given as, or its vertices, edges or faces,
    /// which are found once per topology. Their numbers depend on the given elements alone.
    pub fn part(&self, part: Part) -> &Elements {
        self.topology.part(part)
    }

    /// The edges, `(n, 2)`: of tetrahedra those of their surface. They are found once per topology;
    /// their numbers, which pairs of edges have, depend on the elements alone.
    pub fn edges(&self) -> &Elements {
        self.topology.part(Part::Edges)
    }

    /// The faces, `(n, 3)`: of tetrahedra those of their surface.
    pub fn faces(&self) -> &Elements {
        self.topology.part(Part::Faces)
    }

    /// One name for equal parts.
    pub(crate) fn canonical(&self, part: Part) -> Part {
        self.topology.canonical(part)
    }

    /// The corners of an element of a part.
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
    /// without one ([`Scene::set_transform`]).
    pub fn transform(&self) -> Option<[[f64; 4]; 4]> {
        self.motion.as_ref().map(|motion| motion.matrix.matrix())
    }

    /// The positions that were given last, before any [transform](Scene::set_transform).
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

    /// The number of primitives.
    pub fn n_primitives(&self) -> usize {
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

    /// The group of each vertex, if [groups](Scene::set_groups) were set.
    pub(crate) fn groups(&self) -> Option<&Arc<[u32]>> {
        self.groups.as_ref()
    }

    /// Whether each vertex is pinned, if [that](Scene::set_pinned) was set.
    pub(crate) fn pinned(&self) -> Option<&Arc<[bool]>> {
        self.pinned.as_ref()
    }

    /// The vertices at most some number of edges away from each vertex.
    pub(crate) fn vertex_rings(&self, n_rings: u32) -> Arc<VertexRings> {
        self.topology.rings(self.n_vertices(), n_rings)
    }

    /// How thick the body is, in the unit of the scene: see [`Scene::set_thickness`].
    pub fn thickness(&self) -> f64 {
        self.thickness
    }

    /// Changes when the body is re-meshed; equal stamps mean equal topology.
    pub(crate) fn topology_stamp(&self) -> u64 {
        self.topology_stamp
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
        self.checked
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
    fn check(&self, body: BodyId, positions: &NewPositions<'_>) -> Result<(), Error> {
        self.check_number(body, positions.len())?;
        match &positions.0 {
            Given::F32(rows) => check_positions(body, rows),
            Given::F64(rows) => check_positions(body, rows),
            Given::Whole(positions) => positions.check(body),
        }
    }

    /// Sets checked positions at the end of a step.
    fn set_end(&mut self, mut end: Positions) {
        self.positions.widen_as(&end);
        end.widen_as(&self.positions);
        self.end = Some(end);
        self.moves = true;
        self.step_stamp = new_stamp();
    }

    fn has_moved(&mut self, checked: bool) {
        self.positions_stamp = new_stamp();
        self.step_stamp = self.positions_stamp;
        self.moves = false;
        self.motion = None;
        self.checked = checked;
    }
}

/// A slot for one body; empty after the body was removed.
#[derive(Debug, Clone)]
struct Slot(Option<(BodyId, Body)>);

/// The bodies and where their vertices are now.
///
/// ```
/// use impinge::Scene;
/// # fn main() -> Result<(), impinge::Error> {
/// let mut scene = Scene::new();
/// let a = scene.add_triangles(&[[0, 1, 2]], &[[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])?;
/// scene.set_positions(a, &[[0.0f32, 0.0, 0.1], [1.0, 0.0, 0.1], [0.0, 1.0, 0.1]])?;
/// # Ok(()) }
/// ```
#[derive(Debug, Clone, Default)]
pub struct Scene {
    slots: Vec<Slot>,
    free: Vec<u32>,
    /// Changes whenever anything may have changed; equal stamps mean equal scenes.
    stamp: u64,
    /// Changes whenever anything but positions may have changed.
    arrangement: u64,
}

impl Scene {
    /// An empty scene.
    pub fn new() -> Self {
        Scene::default()
    }

    /// Adds a body of triangles: `faces` is `(n, 3)` vertex indices, `positions` `(v, 3)`.
    ///
    /// # Errors
    /// An index out of range, a position that is not finite.
    pub fn add_triangles<R: Real>(
        &mut self,
        faces: &[[u32; 3]],
        positions: &[[R; 3]],
    ) -> Result<BodyId, Error> {
        self.add((faces.to_vec(), R::store(positions)))
    }

    /// Adds a body of tetrahedra: `tets` is `(n, 4)` vertex indices, `positions` `(v, 3)`.
    /// Orientation does not matter; a flat tetrahedron is the flat set that it is.
    ///
    /// # Errors
    /// As [`add_triangles`](Scene::add_triangles).
    pub fn add_tetrahedra<R: Real>(
        &mut self,
        tets: &[[u32; 4]],
        positions: &[[R; 3]],
    ) -> Result<BodyId, Error> {
        self.add((tets.to_vec(), R::store(positions)))
    }

    /// Adds a body of edges, such as strands of hair: `edges` is `(n, 2)` vertex indices,
    /// `positions` `(v, 3)`.
    ///
    /// # Errors
    /// As [`add_triangles`](Scene::add_triangles).
    pub fn add_edges<R: Real>(
        &mut self,
        edges: &[[u32; 2]],
        positions: &[[R; 3]],
    ) -> Result<BodyId, Error> {
        self.add((edges.to_vec(), R::store(positions)))
    }

    /// Adds a body of points, one for each of `positions`, `(v, 3)`.
    ///
    /// # Errors
    /// As [`add_triangles`](Scene::add_triangles).
    pub fn add_points<R: Real>(&mut self, positions: &[[R; 3]]) -> Result<BodyId, Error> {
        let points = (0u32..).zip(positions).map(|(vertex, _)| [vertex]);
        self.add((Elements::Points(points.collect()), R::store(positions)))
    }

    /// Adds a body and takes over its arrays, without a copy: a [`Mesh`], such as one read from a
    /// file, or elements and positions.
    ///
    /// # Errors
    /// As [`add_triangles`](Scene::add_triangles).
    pub fn add(&mut self, mesh: impl Into<Mesh>) -> Result<BodyId, Error> {
        let slot = match self.free.last() {
            Some(&slot) => slot,
            None => u32::try_from(self.slots.len()).map_err(|_| Error::TooMany {
                what: "bodies",
                given: self.slots.len() as u64 + 1,
                limit: u64::from(u32::MAX),
            })?,
        };
        let id = BodyId::new(slot);
        let body = checked_body(id, mesh.into(), Filter::default())?;
        let held = Slot(Some((id, body)));
        match self.free.pop() {
            Some(_) => self.slots[id.index()] = held,
            None => self.slots.push(held),
        }
        self.rearranged();
        Ok(id)
    }

    /// Adds many bodies in one call: all of them, or none.
    ///
    /// Body `i` has the elements `element_offsets[i]..element_offsets[i + 1]` and the positions
    /// `vertex_offsets[i]..vertex_offsets[i + 1]`; its elements name its own vertices, from 0. Both
    /// offsets have one number more than there are bodies: they begin with 0, never fall, and end
    /// with the number of elements and of positions.
    ///
    /// ```
    /// use impinge_core::{Elements, Scene};
    /// # fn main() -> Result<(), impinge_core::Error> {
    /// let mut scene = Scene::new();
    /// let faces = Elements::Triangles(vec![[0, 1, 2]; 2]);
    /// let triangle = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// let bodies = scene.add_many(&faces, &[0, 1, 2], &[triangle; 2].concat(), &[0, 3, 6])?;
    /// assert_eq!(bodies.len(), 2);
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// As [`add`](Scene::add); offsets that are not as described.
    pub fn add_many<R: Real>(
        &mut self,
        elements: &Elements,
        element_offsets: &[usize],
        positions: &[[R; 3]],
        vertex_offsets: &[usize],
    ) -> Result<Vec<BodyId>, Error> {
        check_offsets("element_offsets", element_offsets, elements.len())?;
        check_offsets("vertex_offsets", vertex_offsets, positions.len())?;
        if element_offsets.len() != vertex_offsets.len() {
            return Err(Error::Setting {
                setting: "vertex_offsets",
                given: format!("{} numbers", vertex_offsets.len()),
                allowed: "as many as element_offsets has",
            });
        }
        let mut ids = Vec::with_capacity(element_offsets.len() - 1);
        self.slots.reserve(element_offsets.len() - 1);
        for (part, vertices) in element_offsets.windows(2).zip(vertex_offsets.windows(2)) {
            let part: Elements =
                with_corners!(elements, |all| all[part[0]..part[1]].to_vec().into());
            let added = self.add((part, R::store(&positions[vertices[0]..vertices[1]])));
            match added {
                Ok(id) => ids.push(id),
                Err(error) => {
                    // In reverse, so that slots become free in the same order as before.
                    for &id in ids.iter().rev() {
                        self.remove(id)?;
                    }
                    return Err(error);
                }
            }
        }
        Ok(ids)
    }

    /// Removes a body; a later body may reuse its slot.
    ///
    /// # Errors
    /// The id names no body.
    pub fn remove(&mut self, body: BodyId) -> Result<(), Error> {
        self.body(body)?;
        self.slots[body.index()] = Slot(None);
        self.free.push(body.slot());
        self.rearranged();
        Ok(())
    }

    /// Gives a body new topology and positions under its old id.
    ///
    /// # Errors
    /// As [`add`](Scene::add); the body is unchanged then.
    pub fn remesh(&mut self, body: BodyId, mesh: impl Into<Mesh>) -> Result<(), Error> {
        let old = self.body(body)?;
        let (filter, thickness) = (old.filter, old.thickness);
        let remeshed = checked_body(body, mesh.into(), filter)?;
        *self.body_mut(body)? = Body {
            thickness,
            ..remeshed
        };
        Ok(())
    }

    /// Moves the vertices: `(v, 3)` positions, as many as the body has vertices, and checked now.
    /// The precision may differ from frame to frame. A new step starts: the body stands still until
    /// its end positions are [set](Scene::set_end_positions).
    ///
    /// A slice, and a reference to a `Vec`, an array or [`Positions`], is copied. A `Vec` and
    /// `Positions` are taken over, and an `Arc` of something that has rows is shared, without a
    /// copy: the body drops it when it gets other positions or is removed. Two shared arrays serve
    /// a simulation: write the one that the scene has dropped, give it, and go on with the other.
    ///
    /// ```
    /// use std::sync::Arc;
    /// use impinge::Scene;
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// let body = scene.add_triangles(&[[0, 1, 2]], &[[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])?;
    /// let mut frames = [vec![[0.0f32; 3]; 3], vec![[0.0f32; 3]; 3]].map(Arc::new);
    /// for step in 0..10u8 {
    ///     let next = Arc::get_mut(&mut frames[usize::from(step % 2)]).expect("dropped by the scene");
    ///     next[1] = [1.0, 0.0, step.into()];
    ///     scene.set_positions(body, Arc::clone(&frames[usize::from(step % 2)]))?;
    /// }
    /// assert_eq!(scene.body(body)?.positions().point(1), [1.0, 0.0, 9.0]);
    /// # Ok(()) }
    /// ```
    ///
    /// Where a body must write its positions ([`positions_mut`](Scene::positions_mut),
    /// [`set_transform`](Scene::set_transform)), it copies a shared array first.
    ///
    /// # Errors
    /// A wrong number of positions, or one that is refused: the body keeps its old positions then.
    pub fn set_positions<'a>(
        &mut self,
        body: BodyId,
        positions: impl Into<NewPositions<'a>>,
    ) -> Result<(), Error> {
        let positions = positions.into();
        let target = self.moved_body(body)?;
        target.check(body, &positions)?;
        store(&mut target.positions, positions);
        target.has_moved(true);
        Ok(())
    }

    /// Sets the vertex positions at the end of a step, `(v, 3)`, copied or not as by
    /// [`set_positions`](Scene::set_positions). Each vertex moves from
    /// [`positions`](Body::positions) to its end position on a straight line at constant speed.
    /// They hold until the next [`set_positions`](Scene::set_positions),
    /// [`positions_mut`](Scene::positions_mut), [`set_transform`](Scene::set_transform),
    /// [`remesh`](Scene::remesh) or [`clear_end_positions`](Scene::clear_end_positions). A body
    /// that has none stands still. For a rigid body, see
    /// [`set_end_transform`](Scene::set_end_transform).
    ///
    /// If start and end have different precisions, the single-precision one is widened, which is
    /// exact.
    ///
    /// # Errors
    /// A wrong number of positions, or one that is refused: the body keeps its old end positions
    /// then.
    pub fn set_end_positions<'a>(
        &mut self,
        body: BodyId,
        positions: impl Into<NewPositions<'a>>,
    ) -> Result<(), Error> {
        let positions = positions.into();
        let target = self.moved_body(body)?;
        target.check(body, &positions)?;
        let mut end = target.end.take().unwrap_or_else(|| f32::store(&[]));
        store(&mut end, positions);
        target.set_end(end);
        Ok(())
    }

    /// Clears a body's end positions: it stands still.
    ///
    /// # Errors
    /// The id names no body.
    pub fn clear_end_positions(&mut self, body: BodyId) -> Result<(), Error> {
        let target = self.moved_body(body)?;
        target.moves = false;
        target.step_stamp = new_stamp();
        Ok(())
    }

    /// The positions of a body that stores `R`, to be written in place without a copy. The next
    /// detection checks them, and its error names a bad vertex. End positions are cleared, as by
    /// [`set_positions`](Scene::set_positions).
    ///
    /// # Errors
    /// The id names no body, or it stores the other precision.
    pub fn positions_mut<R: Real>(&mut self, body: BodyId) -> Result<&mut [[R; 3]], Error> {
        let target = self.moved_body(body)?;
        target.has_moved(false);
        stored(body, &mut target.positions).map(|stored| stored.own().as_mut_slice())
    }

    /// Moves a body by an affine matrix, such as a rigid motion, without passing its vertices
    /// again. It moves the rest positions, which are those given last ([`add`](Scene::add),
    /// [`set_positions`](Scene::set_positions), [`remesh`](Scene::remesh)). A second transform
    /// replaces the first; they do not accumulate.
    ///
    /// Answers are exact for the moved vertices. These are rounded in a fixed way, so they have the
    /// same bits on every backend: row `[a, b, c, d]` of the matrix takes `(x, y, z)` to
    /// `((a x + b y) + c z) + d`. Each product and each sum is rounded to `f64` in this order, none
    /// is fused with another, and the last sum is rounded once more to the precision of the rest
    /// positions. So a rotation deforms a body by the rounding error.
    ///
    /// End positions are cleared, as by [`set_positions`](Scene::set_positions).
    ///
    /// ```
    /// use impinge_core::{Positions, Scene};
    /// # fn main() -> Result<(), impinge_core::Error> {
    /// let mut scene = Scene::new();
    /// let body = scene.add_triangles(&[[0, 1, 2]], &[[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])?;
    /// let up = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.5], [0.0, 0.0, 0.0, 1.0]];
    /// scene.set_transform(body, &up)?;
    /// assert_eq!(scene.body(body)?.positions().point(1), [1.0, 0.0, 0.5]);
    /// assert_eq!(scene.body(body)?.rest_positions().point(1), [1.0, 0.0, 0.0]);
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// The id names no body; a matrix that is not finite, or whose last row is not `[0, 0, 0, 1]`;
    /// rest positions that were written in place and are refused; a moved position that is refused.
    /// The body is unchanged then.
    pub fn set_transform(&mut self, body: BodyId, matrix: &[[f64; 4]; 4]) -> Result<(), Error> {
        let matrix = Affine::new(matrix)?;
        let target = self.moved_body(body)?;
        if !target.checked {
            target.positions.check(body)?;
        }
        let previous = target.motion.take();
        let (rest, before) = match previous {
            Some(motion) => (motion.rest, Some(motion.matrix)),
            None => (Arc::new(target.positions.clone()), None),
        };
        matrix.write(&rest, &mut target.positions);
        if let Err(error) = target.positions.check(body) {
            // Restore the previous positions: computing them again gives the same bits.
            match before {
                Some(matrix) => matrix.write(&rest, &mut target.positions),
                None => target.positions.clone_from(&rest),
            }
            target.motion = before.map(|matrix| Box::new(RestPose { rest, matrix }));
            return Err(error);
        }
        target.has_moved(true);
        target.motion = Some(Box::new(RestPose { rest, matrix }));
        Ok(())
    }

    /// Sets where a step takes a body, by an affine matrix: its end positions are the
    /// [rest positions](Body::rest_positions) moved by the matrix, rounded as by
    /// [`set_transform`](Scene::set_transform), and hold as long as any
    /// [end positions](Scene::set_end_positions). The two matrices of a step are those of its two
    /// ends; both start from rest, neither from the other.
    ///
    /// **Each vertex goes straight, at constant speed, from its rounded position to its rounded
    /// end position**, not along the arc of a turn, and each point of an element goes straight
    /// with its vertices. What is proven of a step is proven of this motion. Halfway through a
    /// turn the body is smaller, by a factor of the cosine of half the angle; half a turn takes
    /// it through its axis.
    ///
    /// At each moment, a point at distance r from the axis of a screw motion by the angle w
    /// (radians) is at most r w² / 8 away from where that motion would have it, plus the rounding
    /// of the two ends. So a large turn is cut into n equal steps with
    /// `n = ceil(w * sqrt(r / (8.0 * d)))`, where r is that of the farthest vertex and `d` the
    /// deviation that is allowed. With 2 d (d of each of two bodies) as
    /// [`separation`](crate::Query::separation), a step that is free is free for the screw motion
    /// as well, up to that rounding.
    ///
    /// After a step, call `set_transform` with the matrix of its end: the positions are then the
    /// end positions, bit by bit. A step taken by [`apply`](crate::Advance::apply) gives the body
    /// the positions reached, which are then its rest positions.
    ///
    /// ```
    /// use impinge_core::Scene;
    /// # fn main() -> Result<(), impinge_core::Error> {
    /// let mut scene = Scene::new();
    /// let blade = scene.add_triangles(&[[0, 1, 2]], &[[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 0.1]])?;
    /// let turned = |angle: f64| {
    ///     let (sin, cos) = angle.sin_cos();
    ///     [[cos, -sin, 0.0, 0.0], [sin, cos, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
    /// };
    /// // A half turn, of which no step may leave the arc by more than 0.01.
    /// let (angle, radius, deviation) = (std::f64::consts::PI, 2.0, 0.01);
    /// let n = (angle * f64::sqrt(radius / (8.0 * deviation))).ceil();
    /// assert_eq!(n, 16.0);
    /// for step in 0..16 {
    ///     scene.set_transform(blade, &turned(angle * f64::from(step) / n))?;
    ///     scene.set_end_transform(blade, &turned(angle * f64::from(step + 1) / n))?;
    ///     // ... ask about the step
    /// }
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// As [`set_transform`](Scene::set_transform); the body keeps its old end positions then.
    pub fn set_end_transform(&mut self, body: BodyId, matrix: &[[f64; 4]; 4]) -> Result<(), Error> {
        let matrix = Affine::new(matrix)?;
        let target = self.moved_body(body)?;
        if !target.checked {
            target.positions.check(body)?;
        }
        // The memory of end positions that no longer count is used again.
        let unused = target.end.take_if(|_| !target.moves);
        let mut end = unused.unwrap_or_else(|| f32::store(&[]));
        matrix.write(target.rest_positions(), &mut end);
        end.check(body)?;
        target.set_end(end);
        Ok(())
    }

    /// Sets which bodies a body meets in [`Query::between_all`](crate::Query::between_all).
    ///
    /// # Errors
    /// The id names no body.
    pub fn set_filter(&mut self, body: BodyId, filter: Filter) -> Result<(), Error> {
        self.body_mut(body)?.filter = filter;
        Ok(())
    }

    /// Puts each vertex of a body into a group, for
    /// [`Exclusion::groups`](crate::Exclusion::groups): one number per vertex. A body whose groups
    /// were never set is in no group. [`remesh`](Scene::remesh) forgets them.
    ///
    /// # Errors
    /// The id names no body; more or fewer groups than vertices.
    pub fn set_groups(&mut self, body: BodyId, groups: &[u32]) -> Result<(), Error> {
        let held = self.body_mut(body)?;
        check_per_vertex(body, "groups", groups.len(), held.n_vertices())?;
        held.groups = Some(groups.into());
        Ok(())
    }

    /// Says which vertices of a body are pinned, where they never move: one flag per vertex. Pairs
    /// of elements all of whose vertices are pinned are left out of every query.
    /// [`remesh`](Scene::remesh) forgets it.
    ///
    /// # Errors
    /// The id names no body; more or fewer flags than vertices.
    pub fn set_pinned(&mut self, body: BodyId, pinned: &[bool]) -> Result<(), Error> {
        let held = self.body_mut(body)?;
        check_per_vertex(body, "pinned", pinned.len(), held.n_vertices())?;
        held.pinned = pinned.contains(&true).then(|| pinned.into());
        Ok(())
    }

    /// Sets how thick a body is, in the unit of the scene: what its elements add to the distance of
    /// [`near`](crate::Detector::near). 0 for a new body. Two elements of one body add it twice.
    ///
    /// # Errors
    /// The id names no body; a thickness that is negative or not finite.
    pub fn set_thickness(&mut self, body: BodyId, thickness: f64) -> Result<(), Error> {
        if !(thickness >= 0.0 && thickness.is_finite()) {
            return Err(Error::Setting {
                setting: "thickness",
                given: thickness.to_string(),
                allowed: "a finite number that is not below 0",
            });
        }
        self.body_mut(body)?.thickness = thickness;
        Ok(())
    }

    /// A body by its id.
    ///
    /// # Errors
    /// The id names no body.
    pub fn body(&self, body: BodyId) -> Result<&Body, Error> {
        match self.slots.get(body.index()) {
            Some(Slot(Some((id, held)))) if *id == body => Ok(held),
            _ => Err(self.unknown(body)),
        }
    }

    /// Changes whenever anything may have changed; equal stamps mean equal scenes.
    pub(crate) fn stamp(&self) -> u64 {
        self.stamp
    }

    /// Changes whenever anything but positions may have changed; equal stamps mean the same bodies.
    pub(crate) fn arrangement(&self) -> u64 {
        self.arrangement
    }

    fn rearranged(&mut self) {
        self.stamp = new_stamp();
        self.arrangement = self.stamp;
    }

    fn body_mut(&mut self, body: BodyId) -> Result<&mut Body, Error> {
        self.rearranged();
        self.moved_body(body)
    }

    /// A body of which only positions are changed.
    fn moved_body(&mut self, body: BodyId) -> Result<&mut Body, Error> {
        let unknown = self.unknown(body);
        self.stamp = new_stamp();
        match self.slots.get_mut(body.index()) {
            Some(Slot(Some((id, held)))) if *id == body => Ok(held),
            _ => Err(unknown),
        }
    }

    fn unknown(&self, body: BodyId) -> Error {
        Error::UnknownBody {
            body,
            n_bodies: self.n_bodies(),
        }
    }

    /// All bodies in the order of their ids.
    pub fn bodies(&self) -> impl Iterator<Item = (BodyId, &Body)> {
        let held = self.slots.iter().filter_map(|Slot(held)| held.as_ref());
        held.map(|(id, body)| (*id, body))
    }

    /// The number of bodies.
    pub fn n_bodies(&self) -> usize {
        self.slots.len() - self.free.len()
    }

    /// Bytes held for topology and positions.
    pub fn bytes(&self) -> usize {
        self.bodies()
            .map(|(_, body)| {
                body.topology.bytes()
                    + body.positions.bytes()
                    + body.end.as_ref().map_or(0, Positions::bytes)
                    + body.motion.as_ref().map_or(0, |motion| motion.rest.bytes())
            })
            .sum()
    }

    /// Whether a slot is in use.
    pub(crate) fn holds(&self, slot: usize) -> bool {
        self.slots.get(slot).is_some_and(|held| held.0.is_some())
    }

    /// The body in a slot that is known to be in use.
    #[inline]
    pub(crate) fn body_in(&self, slot: u32) -> &Body {
        let held = self.slots[slot as usize].0.as_ref();
        &held.expect("a part's slot is in use").1
    }
}

/// The positions, if they are of this precision.
fn stored<R: Real>(body: BodyId, positions: &mut Positions) -> Result<&mut PositionRows<R>, Error> {
    let stored = positions.precision();
    R::stored(positions).ok_or(Error::WrongPrecision {
        body,
        stored,
        asked: if stored == "f32" { "f64" } else { "f32" },
    })
}

/// Refuses offsets that do not partition `n` elements or positions.
fn check_offsets(setting: &'static str, offsets: &[usize], n: usize) -> Result<(), Error> {
    let refused = |given, allowed| {
        Err(Error::Setting {
            setting,
            given,
            allowed,
        })
    };
    match (offsets.first(), offsets.last()) {
        (Some(0), Some(&last)) if last == n => {}
        (Some(0), Some(last)) => {
            return refused(
                format!("{last} as the last of {n}"),
                "their number as the last",
            );
        }
        (Some(first), _) => return refused(format!("{first} as the first"), "0 as the first"),
        _ => return refused("none".to_owned(), "one more than there are bodies"),
    }
    match offsets.windows(2).position(|pair| pair[0] > pair[1]) {
        None => Ok(()),
        Some(ix) => refused(
            format!("{} after {} at {}", offsets[ix + 1], offsets[ix], ix + 1),
            "numbers that never fall",
        ),
    }
}

/// Stores checked positions. Memory of the body's own is reused.
fn store(stored: &mut Positions, new: NewPositions<'_>) {
    match new.0 {
        Given::F32(rows) => copy(stored, rows),
        Given::F64(rows) => copy(stored, rows),
        Given::Whole(positions) => *stored = positions,
    }
}

fn copy<R: Real>(stored: &mut Positions, rows: &[[R; 3]]) {
    match R::stored(stored) {
        Some(own) if own.len() == rows.len() => own.copy_from(rows),
        _ => *stored = R::store(rows),
    }
}

fn check_per_vertex(
    body: BodyId,
    what: &'static str,
    given: usize,
    n_vertices: usize,
) -> Result<(), Error> {
    match given == n_vertices {
        true => Ok(()),
        false => Err(Error::PerVertex {
            body,
            what,
            given,
            n_vertices,
        }),
    }
}

fn checked_body(id: BodyId, mesh: Mesh, filter: Filter) -> Result<Body, Error> {
    let Mesh {
        elements,
        positions,
        ..
    } = mesh;
    let limit = u64::from(u32::MAX);
    for (what, given) in [
        ("primitives of one body", elements.len() as u64),
        ("vertices of one body", positions.len() as u64),
    ] {
        if given > limit {
            return Err(Error::TooMany { what, given, limit });
        }
    }
    positions.check(id)?;
    let n_vertices = positions.len();
    let bad_index = elements.first_bad_index(n_vertices);
    if let Some((primitive, index)) = bad_index {
        return Err(Error::VertexIndexOutOfRange {
            body: id,
            primitive,
            index,
            n_vertices,
        });
    }
    let stamp = new_stamp();
    Ok(Body {
        topology: Arc::new(Topology::new(elements)),
        positions,
        end: None,
        moves: false,
        motion: None,
        filter,
        thickness: 0.0,
        groups: None,
        pinned: None,
        topology_stamp: new_stamp(),
        positions_stamp: stamp,
        step_stamp: stamp,
        checked: true,
    })
}
