//! The bodies of a scene: added, removed, found, and told whom they meet.

use crate::scene::body::{Body, Filter};
use crate::scene::elements::{Elements, Part, with_corners};
use crate::scene::error::Error;
use crate::scene::ids::{BodyId, new_stamp};
use crate::scene::mesh::Mesh;
use crate::scene::positions::{Positions, Real};
use crate::scene::thickness::{HeldThickness, Thickness};

/// A part of a body, and the stamp of the numbers of its elements.
pub(crate) type NumberedPart = (BodyId, Part, u64);

/// A slot for one body; empty after the body was removed.
#[derive(Debug, Clone)]
struct Slot(Option<(BodyId, Body)>);

/// The bodies and where their vertices are now.
///
/// ```
/// use impinge::Scene;
/// # fn main() -> Result<(), impinge::Error> {
/// let mut scene = Scene::new();
/// let corners = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let a = scene.add_triangles(&[[0, 1, 2]], &corners)?;
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
    /// Of the scene and its clones alone; 0 before its first body.
    family: u64,
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
    /// Whether elements intersect is asked of the tetrahedra. Distances, steps, points and rays are
    /// about the *surface*: the faces that are not between two tetrahedra. It bounds the body as
    /// long as no tetrahedron is turned inside out, or over into its neighbour: then a face between
    /// two lies at the border, and nothing stops there. So in a step that inverts one, other bodies
    /// may get in, though it is [free](crate::Detector::is_free). A solver that lets them invert
    /// looks at the signs of its volumes, or adds all faces as a body of triangles.
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
        let family = match self.family {
            0 => new_stamp(),
            own => own,
        };
        let id = BodyId::new(slot, family);
        let body = Body::new(id, mesh.into(), Filter::default())?;
        self.family = family;
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
    /// use impinge::{Elements, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
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

    /// Gives a body new topology and positions under its old id. Its filter stays, and its
    /// thickness if it is one number. The end of its step, its transform, the thickness, groups and
    /// pins of its parts and the caller's numbers of edges are forgotten.
    ///
    /// # Errors
    /// As [`add`](Scene::add); the body is unchanged then.
    pub fn remesh(&mut self, body: BodyId, mesh: impl Into<Mesh>) -> Result<(), Error> {
        let old = self.body(body)?;
        // The elements are others now.
        let thickness = match old.thickness.each {
            None => old.thickness.clone(),
            Some(_) => HeldThickness::default(),
        };
        let filter = old.filter;
        let remeshed = Body::new(body, mesh.into(), filter)?;
        *self.body_mut(body)? = Body {
            thickness,
            ..remeshed
        };
        Ok(())
    }

    /// Sets which other bodies a body meets in [`Query::all`](crate::Query::all), the default, and
    /// in [`Query::between_all`](crate::Query::between_all). Self-collision does not depend on it,
    /// nor do queries that name their bodies.
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
    /// of elements all of whose vertices are pinned are left out of every query, so pin no vertices
    /// that move by a script: two such bodies would pass through each other.
    /// [`distance`](crate::Detector::distance) and [`nearest`](crate::Detector::nearest) look at
    /// all elements, whatever is pinned. [`remesh`](Scene::remesh) forgets it.
    ///
    /// # Errors
    /// The id names no body; more or fewer flags than vertices.
    pub fn set_pinned(&mut self, body: BodyId, pinned: &[bool]) -> Result<(), Error> {
        let held = self.body_mut(body)?;
        check_per_vertex(body, "pinned", pinned.len(), held.n_vertices())?;
        held.pinned = pinned.contains(&true).then(|| pinned.into());
        Ok(())
    }

    /// Sets how thick a body is, in the unit of the scene; 0 for a new body. Of two elements,
    /// whether of one body or of two, each adds its own:
    ///
    /// - to the distance of [`near`](crate::Detector::near), without rounding;
    /// - to the [separation](crate::Query::separation) that elements keep in a step
    ///   ([`impacts`](crate::Detector::impacts) to [`truncate`](crate::Detector::truncate)), and to
    ///   the gap that boxes of [`candidates`](crate::Detector::candidates) may have. `a + b`, and
    ///   then `separation + (a + b)`, are rounded up to `f64`.
    ///
    /// From the distances of [`neighbours`](crate::Detector::neighbours) and
    /// [`safe_distances`](crate::Detector::safe_distances) it is taken. What intersects, what
    /// touches or is nearest to a point, and how far apart bodies are, is asked of the elements
    /// themselves.
    ///
    /// One number holds for all elements, and [`remesh`](Scene::remesh) keeps it. [`Thickness`]
    /// also takes one number per vertex, edge or face, which `remesh` forgets: the body has a
    /// thickness of 0 then.
    ///
    /// ```
    /// use impinge::{Backend, Detector, Query, Scene, Thickness};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// let points = scene.add_points(&[[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])?;
    /// scene.set_thickness(points, Thickness::vertices(&[0.75, 0.25, 0.5][..]))?;
    /// let near = Detector::new(Backend::Cpu)?.near(&scene, 0.0, &Query::all())?;
    /// // 0.75 + 0.25 reaches over 1, 0.25 + 0.5 does not, and 0.75 + 0.5 not over 2.
    /// assert_eq!(near.rows().collect::<Vec<_>>(), [[0, 0, 0, 1]]);
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// The id names no body; a thickness that is negative or not finite; more or fewer numbers than
    /// the body has vertices, edges or faces.
    pub fn set_thickness<'a>(
        &mut self,
        body: BodyId,
        thickness: impl Into<Thickness<'a>>,
    ) -> Result<(), Error> {
        let held = self.body(body)?;
        let thickness = thickness
            .into()
            .held(body, &held.parts, held.n_vertices())?;
        self.body_mut(body)?.thickness = thickness;
        Ok(())
    }

    /// A clone that shares no positions with their owners.
    #[doc(hidden)]
    pub fn deep_clone(&self) -> Self {
        let mut clone = self.clone();
        clone.each_body(Body::own_positions);
        clone
    }

    /// A clone without filters and pinned vertices: near in it is what is near by positions and
    /// thickness alone, for pairs at rest.
    #[doc(hidden)]
    pub fn at_rest(&self) -> Self {
        let mut clone = self.clone();
        clone.rearranged();
        clone.each_body(|body| (body.filter, body.pinned) = (Filter::default(), None));
        clone
    }

    fn each_body(&mut self, change: impl Fn(&mut Body)) {
        let held = self.slots.iter_mut();
        held.filter_map(|slot| slot.0.as_mut())
            .for_each(|(_, body)| change(body));
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

    /// The same for a scene and its clones, and for no other; 0 of one that never had a body.
    pub(crate) fn family(&self) -> u64 {
        self.family
    }

    /// Refuses a body that was never in this scene, nor in one of its family: not one that was
    /// removed.
    pub(crate) fn check_known(&self, body: BodyId) -> Result<(), Error> {
        match body.may_be_of(self.family) {
            true => Ok(()),
            false => Err(self.unknown(body)),
        }
    }

    fn rearranged(&mut self) {
        self.stamp = new_stamp();
        self.arrangement = self.stamp;
    }

    pub(super) fn body_mut(&mut self, body: BodyId) -> Result<&mut Body, Error> {
        self.rearranged();
        self.moved_body(body)
    }

    /// A body of which only positions are changed.
    pub(super) fn moved_body(&mut self, body: BodyId) -> Result<&mut Body, Error> {
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
                body.parts.bytes()
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

    /// The parts whose elements have other numbers than they had.
    pub(crate) fn renumbered(
        &self,
        parts: impl Iterator<Item = NumberedPart>,
    ) -> impl Iterator<Item = (BodyId, Part)> {
        let is_new = |&(id, part, stamp): &NumberedPart| {
            let body = self.body(id);
            body.is_ok_and(|body| body.numbers_stamp(part) != stamp)
        };
        parts.filter(is_new).map(|(id, part, _)| (id, part))
    }
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
