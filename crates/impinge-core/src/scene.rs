//! Bodies: topology once, positions every frame.

use std::sync::atomic::{AtomicU64, Ordering};

use crate::error::Error;
use crate::exact;

/// Names a body of a [`Scene`]: a slot and the generation of its use.
///
/// Ids are ordered by slot. A slot is used again after its body was removed, under a new
/// generation, so an old id never names a new body by mistake.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BodyId {
    slot: u32,
    generation: u32,
}

impl BodyId {
    /// The body's number in the scene: 0 for the first body added, and so on.
    pub fn index(self) -> usize {
        self.slot as usize
    }

    pub(crate) fn slot(self) -> u32 {
        self.slot
    }
}

impl std::fmt::Display for BodyId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.slot)
    }
}

/// What a body is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Kind {
    /// Surface triangles, three vertex indices each.
    Triangles,
    /// Solid tetrahedra, four vertex indices each.
    Tetrahedra,
}

impl Kind {
    /// `"triangles"` or `"tetrahedra"`.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Triangles => "triangles",
            Kind::Tetrahedra => "tetrahedra",
        }
    }
}

/// The primitives of a body as vertex indices.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Elements {
    /// `(n, 3)` vertex indices.
    Triangles(Vec<[u32; 3]>),
    /// `(n, 4)` vertex indices.
    Tetrahedra(Vec<[u32; 4]>),
}

impl Elements {
    /// How many primitives there are.
    pub fn len(&self) -> usize {
        match self {
            Elements::Triangles(faces) => faces.len(),
            Elements::Tetrahedra(tets) => tets.len(),
        }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Triangles or tetrahedra.
    pub fn kind(&self) -> Kind {
        match self {
            Elements::Triangles(_) => Kind::Triangles,
            Elements::Tetrahedra(_) => Kind::Tetrahedra,
        }
    }

    /// The vertex indices of one primitive, three or four of them.
    pub fn corners(&self, primitive: usize) -> &[u32] {
        match self {
            Elements::Triangles(faces) => &faces[primitive],
            Elements::Tetrahedra(tets) => &tets[primitive],
        }
    }

    fn bytes(&self) -> usize {
        match self {
            Elements::Triangles(faces) => size_of_val(&faces[..]),
            Elements::Tetrahedra(tets) => size_of_val(&tets[..]),
        }
    }
}

impl From<Vec<[u32; 3]>> for Elements {
    fn from(faces: Vec<[u32; 3]>) -> Self {
        Elements::Triangles(faces)
    }
}

impl From<Vec<[u32; 4]>> for Elements {
    fn from(tets: Vec<[u32; 4]>) -> Self {
        Elements::Tetrahedra(tets)
    }
}

/// Vertex positions in the precision in which they were given.
#[derive(Debug, Clone, PartialEq)]
pub enum Positions {
    /// `(n, 3)` single precision.
    F32(Vec<[f32; 3]>),
    /// `(n, 3)` double precision.
    F64(Vec<[f64; 3]>),
}

impl Positions {
    /// How many vertices there are.
    pub fn len(&self) -> usize {
        match self {
            Positions::F32(positions) => positions.len(),
            Positions::F64(positions) => positions.len(),
        }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// One position in double precision (exact for both).
    #[inline]
    pub fn point(&self, vertex: usize) -> [f64; 3] {
        match self {
            Positions::F32(positions) => {
                let [x, y, z] = positions[vertex];
                [f64::from(x), f64::from(y), f64::from(z)]
            }
            Positions::F64(positions) => positions[vertex],
        }
    }

    fn precision(&self) -> &'static str {
        match self {
            Positions::F32(_) => "f32",
            Positions::F64(_) => "f64",
        }
    }

    fn bytes(&self) -> usize {
        match self {
            Positions::F32(positions) => size_of_val(&positions[..]),
            Positions::F64(positions) => size_of_val(&positions[..]),
        }
    }
}

impl From<Vec<[f32; 3]>> for Positions {
    fn from(positions: Vec<[f32; 3]>) -> Self {
        Positions::F32(positions)
    }
}

impl From<Vec<[f64; 3]>> for Positions {
    fn from(positions: Vec<[f64; 3]>) -> Self {
        Positions::F64(positions)
    }
}

mod sealed {
    pub trait Sealed {}
    impl Sealed for f32 {}
    impl Sealed for f64 {}
}

/// `f32` or `f64`: both are taken as they are and answered exactly.
pub trait Real: sealed::Sealed + Copy + Send + Sync + 'static {
    #[doc(hidden)]
    fn in_range(self) -> bool;
    #[doc(hidden)]
    fn widen(self) -> f64;
    #[doc(hidden)]
    fn stored(positions: &mut Positions) -> Option<&mut Vec<[Self; 3]>>;
    #[doc(hidden)]
    fn store(positions: &[[Self; 3]]) -> Positions;
}

impl Real for f32 {
    #[inline(always)]
    fn in_range(self) -> bool {
        self.is_finite()
    }
    #[inline(always)]
    fn widen(self) -> f64 {
        f64::from(self)
    }
    fn stored(positions: &mut Positions) -> Option<&mut Vec<[f32; 3]>> {
        match positions {
            Positions::F32(positions) => Some(positions),
            Positions::F64(_) => None,
        }
    }
    fn store(positions: &[[f32; 3]]) -> Positions {
        Positions::F32(positions.to_vec())
    }
}

impl Real for f64 {
    #[inline(always)]
    fn in_range(self) -> bool {
        exact::in_range(self)
    }
    #[inline(always)]
    fn widen(self) -> f64 {
        self
    }
    fn stored(positions: &mut Positions) -> Option<&mut Vec<[f64; 3]>> {
        match positions {
            Positions::F64(positions) => Some(positions),
            Positions::F32(_) => None,
        }
    }
    fn store(positions: &[[f64; 3]]) -> Positions {
        Positions::F64(positions.to_vec())
    }
}

/// Who meets whom in [`Query::all`](crate::Query::all): two bodies meet when each one's
/// `category` shares a bit with the other one's `mask`. By default everybody meets everybody.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Filter {
    /// The groups to which the body belongs.
    pub category: u64,
    /// The groups that it meets.
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

/// Stamps tell a detector what has changed since it last looked. They come from one counter
/// for the whole process, so no two states of any two bodies ever carry the same one.
fn new_stamp() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(1);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

/// One body: primitives, positions, filter.
#[derive(Debug, Clone)]
pub struct Body {
    elements: Elements,
    positions: Positions,
    filter: Filter,
    topology_stamp: u64,
    positions_stamp: u64,
    /// False while positions written in place have not been looked at.
    checked: bool,
}

impl Body {
    /// The primitives.
    pub fn elements(&self) -> &Elements {
        &self.elements
    }

    /// The current positions.
    pub fn positions(&self) -> &Positions {
        &self.positions
    }

    /// Triangles or tetrahedra.
    pub fn kind(&self) -> Kind {
        self.elements.kind()
    }

    /// How many primitives it has.
    pub fn n_primitives(&self) -> usize {
        self.elements.len()
    }

    /// How many vertices it has.
    pub fn n_vertices(&self) -> usize {
        self.positions.len()
    }

    /// Who it meets.
    pub fn filter(&self) -> Filter {
        self.filter
    }

    /// Changes when the body is re-meshed; equal stamps mean equal topology.
    pub(crate) fn topology_stamp(&self) -> u64 {
        self.topology_stamp
    }

    /// Changes whenever positions may have changed.
    pub(crate) fn positions_stamp(&self) -> u64 {
        self.positions_stamp
    }

    pub(crate) fn is_checked(&self) -> bool {
        self.checked
    }

    /// The corners of one primitive in double precision; a triangle repeats its last corner.
    #[inline]
    pub(crate) fn corner_points(&self, primitive: usize) -> [[f64; 3]; 4] {
        let corners = self.elements.corners(primitive);
        std::array::from_fn(|k| {
            self.positions
                .point(corners[k.min(corners.len() - 1)] as usize)
        })
    }
}

#[derive(Debug, Clone, Default)]
struct Slot {
    generation: u32,
    body: Option<Body>,
}

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
}

impl Scene {
    /// An empty scene.
    pub fn new() -> Self {
        Scene::default()
    }

    /// Adds a body of triangles: `faces` is `(n, 3)` vertex indices, `positions` `(v, 3)`.
    ///
    /// # Errors
    /// An index out of range, a position that is not finite or outside the exact range.
    pub fn add_triangles<R: Real>(
        &mut self,
        faces: &[[u32; 3]],
        positions: &[[R; 3]],
    ) -> Result<BodyId, Error> {
        self.add(Elements::Triangles(faces.to_vec()), R::store(positions))
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
        self.add(Elements::Tetrahedra(tets.to_vec()), R::store(positions))
    }

    /// Adds a body whose arrays are handed over without a copy.
    ///
    /// # Errors
    /// As [`add_triangles`](Scene::add_triangles).
    pub fn add(
        &mut self,
        elements: impl Into<Elements>,
        positions: impl Into<Positions>,
    ) -> Result<BodyId, Error> {
        let slot = match self.free.last() {
            Some(&slot) => slot,
            None => u32::try_from(self.slots.len()).map_err(|_| Error::TooMany {
                what: "bodies",
                given: self.slots.len() as u64 + 1,
                limit: u64::from(u32::MAX),
            })?,
        };
        let generation = self
            .slots
            .get(slot as usize)
            .map_or(1, |slot| slot.generation.wrapping_add(1).max(1));
        let id = BodyId { slot, generation };
        let body = checked_body(id, elements.into(), positions.into(), Filter::default())?;
        if self.free.pop().is_none() {
            self.slots.push(Slot::default());
        }
        self.slots[slot as usize] = Slot {
            generation,
            body: Some(body),
        };
        Ok(id)
    }

    /// Removes a body; its slot may be used again by a later one.
    ///
    /// # Errors
    /// The id names no body.
    pub fn remove(&mut self, body: BodyId) -> Result<(), Error> {
        self.body(body)?;
        self.slots[body.index()].body = None;
        self.free.push(body.slot);
        Ok(())
    }

    /// Gives a body new topology and positions under its old id.
    ///
    /// # Errors
    /// As [`add`](Scene::add); the body is unchanged then.
    pub fn remesh(
        &mut self,
        body: BodyId,
        elements: impl Into<Elements>,
        positions: impl Into<Positions>,
    ) -> Result<(), Error> {
        let filter = self.body(body)?.filter;
        let remeshed = checked_body(body, elements.into(), positions.into(), filter)?;
        *self.body_mut(body)? = remeshed;
        Ok(())
    }

    /// Moves the vertices: `(v, 3)` positions, as many as the body has vertices. The precision
    /// may differ from frame to frame; the array is copied and checked.
    ///
    /// # Errors
    /// A wrong number of positions, or one that is refused: the body keeps its old positions then.
    pub fn set_positions<R: Real>(
        &mut self,
        body: BodyId,
        positions: &[[R; 3]],
    ) -> Result<(), Error> {
        let target = self.body_mut(body)?;
        if positions.len() != target.n_vertices() {
            return Err(Error::WrongNumberOfPositions {
                body,
                given: positions.len(),
                expected: target.n_vertices(),
            });
        }
        check_positions(body, positions)?;
        match R::stored(&mut target.positions) {
            Some(stored) => stored.copy_from_slice(positions),
            None => target.positions = R::store(positions),
        }
        target.positions_stamp = new_stamp();
        target.checked = true;
        Ok(())
    }

    /// The positions of a body that stores `R`, to be written in place: the way without a copy.
    /// What is written is checked by the next detection, which names a refused vertex.
    ///
    /// # Errors
    /// The id names no body, or it stores the other precision.
    pub fn positions_mut<R: Real>(&mut self, body: BodyId) -> Result<&mut [[R; 3]], Error> {
        let target = self.body_mut(body)?;
        target.positions_stamp = new_stamp();
        target.checked = false;
        let stored = target.positions.precision();
        match R::stored(&mut target.positions) {
            Some(positions) => Ok(positions),
            None => Err(Error::WrongPrecision {
                body,
                stored,
                asked: if stored == "f32" { "f64" } else { "f32" },
            }),
        }
    }

    /// Sets who a body meets in [`Query::all`](crate::Query::all).
    ///
    /// # Errors
    /// The id names no body.
    pub fn set_filter(&mut self, body: BodyId, filter: Filter) -> Result<(), Error> {
        self.body_mut(body)?.filter = filter;
        Ok(())
    }

    /// A body by its id.
    ///
    /// # Errors
    /// The id names no body.
    pub fn body(&self, body: BodyId) -> Result<&Body, Error> {
        match self.slots.get(body.index()) {
            Some(slot) if slot.generation == body.generation && slot.body.is_some() => {
                Ok(slot.body.as_ref().expect("just looked"))
            }
            slot => Err(Error::UnknownBody {
                body,
                present: slot.map_or(0, |slot| slot.generation),
            }),
        }
    }

    fn body_mut(&mut self, body: BodyId) -> Result<&mut Body, Error> {
        self.body(body)?;
        Ok(self.slots[body.index()].body.as_mut().expect("just looked"))
    }

    /// All bodies in the order of their ids.
    pub fn bodies(&self) -> impl Iterator<Item = (BodyId, &Body)> {
        (0u32..).zip(&self.slots).filter_map(|(slot, held)| {
            let generation = held.generation;
            held.body
                .as_ref()
                .map(|body| (BodyId { slot, generation }, body))
        })
    }

    /// How many bodies there are.
    pub fn n_bodies(&self) -> usize {
        self.slots.len() - self.free.len()
    }

    /// Bytes held for topology and positions.
    pub fn bytes(&self) -> usize {
        self.bodies()
            .map(|(_, body)| body.elements.bytes() + body.positions.bytes())
            .sum()
    }

    /// Whether a slot is in use.
    pub(crate) fn holds(&self, slot: usize) -> bool {
        self.slots.get(slot).is_some_and(|held| held.body.is_some())
    }

    /// The body in a slot that is known to be in use.
    #[inline]
    pub(crate) fn body_in(&self, slot: u32) -> &Body {
        self.slots[slot as usize]
            .body
            .as_ref()
            .expect("a participant's slot is in use")
    }
}

fn checked_body(
    id: BodyId,
    elements: Elements,
    positions: Positions,
    filter: Filter,
) -> Result<Body, Error> {
    let limit = u64::from(u32::MAX);
    for (what, given) in [
        ("primitives of one body", elements.len() as u64),
        ("vertices of one body", positions.len() as u64),
    ] {
        if given > limit {
            return Err(Error::TooMany { what, given, limit });
        }
    }
    match &positions {
        Positions::F32(positions) => check_positions(id, positions)?,
        Positions::F64(positions) => check_positions(id, positions)?,
    }
    let n_vertices = positions.len();
    let bad_index = match &elements {
        Elements::Triangles(faces) => first_bad_index(faces, n_vertices),
        Elements::Tetrahedra(tets) => first_bad_index(tets, n_vertices),
    };
    if let Some((primitive, index)) = bad_index {
        return Err(Error::VertexIndexOutOfRange {
            body: id,
            primitive,
            index,
            n_vertices,
        });
    }
    Ok(Body {
        elements,
        positions,
        filter,
        topology_stamp: new_stamp(),
        positions_stamp: new_stamp(),
        checked: true,
    })
}

fn first_bad_index<const N: usize>(
    elements: &[[u32; N]],
    n_vertices: usize,
) -> Option<(usize, u32)> {
    elements
        .iter()
        .enumerate()
        .find_map(|(primitive, corners)| {
            corners
                .iter()
                .find(|&&index| index as usize >= n_vertices)
                .map(|&index| (primitive, index))
        })
}

/// Refuses the first position that is not finite or outside the exact range.
pub(crate) fn check_positions<R: Real>(body: BodyId, positions: &[[R; 3]]) -> Result<(), Error> {
    // One branch a chunk keeps the common case, all good, at memory speed.
    for (chunk_ix, chunk) in positions.chunks(1024).enumerate() {
        let good = chunk
            .as_flattened()
            .iter()
            .fold(true, |good, x| good & x.in_range());
        if good {
            continue;
        }
        for (vertex, position) in chunk.iter().enumerate() {
            let vertex = chunk_ix * 1024 + vertex;
            let value = position.map(R::widen);
            if value.iter().any(|x| !x.is_finite()) {
                return Err(Error::NonFinitePosition {
                    body,
                    vertex,
                    value,
                });
            }
            if let Some(&value) = value.iter().find(|&&x| !exact::in_range(x)) {
                return Err(Error::CoordinateOutOfRange {
                    body,
                    vertex,
                    value,
                });
            }
        }
    }
    Ok(())
}
