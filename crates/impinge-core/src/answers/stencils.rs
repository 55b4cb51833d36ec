//! Near pairs as stencils: vertices, coefficients and distances with their derivatives.

use std::sync::{Mutex, PoisonError};

use crate::answers::areas::Areas;
use crate::answers::near::{NearIter, NearPair, NearPairs};
use crate::answers::numbering::Numbering;
use crate::answers::pairs::Element;
use crate::answers::stencil::{Gradient, Hessian, Mollifier, NearestWay};
use crate::query::pair_kind::PairKind;
use crate::scene::Scene;
use crate::scene::by_body::ByBody;
use crate::scene::elements::{Elements, Part};
use crate::scene::error::Error;
use crate::scene::index::{ElementIx, Number, pair_numbers};
use crate::scene::positions::Positions;
use crate::search::sink;
use crate::workers::in_parts::{Room, filled_in_parts};
use impinge_exact::internal::NearestOfElements;
use impinge_exact::{Feature, Point};

/// What memory is for.
const WHAT: &str = "stencils";
/// Stencils that a thread takes at a time.
const PART: usize = 256;

/// Up to four vertices, and how the squared distance between them depends on their positions: what
/// a potential needs to know about two elements that are near each other.
///
/// | kind | vertices |
/// |---|---|
/// | [`VertexFace`](PairKind::VertexFace) | the vertex, three of the face |
/// | [`EdgeEdge`](PairKind::EdgeEdge) | two of either edge |
/// | [`EdgeVertex`](PairKind::EdgeVertex) | the vertex, two of the edge |
/// | [`VertexVertex`](PairKind::VertexVertex) | the two |
///
/// These are the orders of ipc-toolkit. Where there are fewer than four vertices, the first is
/// repeated. Coefficients and derivatives are 0 there, so sums over all four are right.
///
/// Numbers are computed in `f64` in one fixed order of operations: they have the same bits on every
/// machine. They are accurate to a few units in the last place of the sizes of the elements,
/// divided by the sine of the angle between edges that are nearly parallel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stencil {
    /// What is near what.
    pub kind: PairKind,
    /// The features that are nearest, in the order of the [kind](NearPair::features).
    pub features: [Feature; 2],
    /// The vertices by their numbers in the scene: see [`Stencils::offsets`].
    pub vertices: [u32; 4],
    /// How many pairs it stands for; or the [area](NearPairs::stencils_by_area) at rest that they
    /// stand for.
    pub weight: f64,
    /// The positions of the vertices.
    pub points: [Point; 4],
    /// What the mollifier compares with; 0 for none.
    threshold: f64,
}

impl Stencil {
    /// The numbers of the vertices that span the features, first those of the feature that comes
    /// first in `vertices`.
    fn spans(&self) -> [Span; 2] {
        let [a, b] = self.features;
        match self.kind {
            PairKind::EdgeVertex => [Span::of(b, 0, 1), Span::of(a, 1, 2)],
            PairKind::EdgeEdge => [Span::of(a, 0, 2), Span::of(b, 2, 2)],
            _ => [Span::of(a, 0, 1), Span::of(b, 1, 3)],
        }
    }

    fn way(&self) -> NearestWay {
        let [a, b] = self.spans();
        NearestWay::new(&self.points, a.all(), b.all())
    }

    fn mollifying(&self) -> Option<Mollifier> {
        Mollifier::below(&self.points, self.threshold)
    }

    /// ipc-toolkit's name of the distance type, as [`NearPair::name`].
    pub fn name(&self) -> &'static str {
        NearPair::named(self.kind, self.features)
    }

    /// The way from one nearest point to the other is the sum of coefficients times positions.
    ///
    /// The coefficients of one element sum to 1, those of the other to -1. The first vertex counts
    /// with plus.
    pub fn coefficients(&self) -> [f64; 4] {
        self.way().coefficients
    }

    /// The square of the distance.
    pub fn squared_distance(&self) -> f64 {
        self.way().squared_distance()
    }

    /// The derivatives of the squared distance by x, y and z of the first vertex, of the second and
    /// so on.
    pub fn gradient(&self) -> Gradient {
        self.way().gradient()
    }

    /// The second derivatives of the squared distance, exactly symmetric. They hold while the same
    /// features stay nearest.
    pub fn hessian(&self) -> Hessian {
        self.way().hessian()
    }

    /// Whether the mollifier is below 1: edges that are nearly parallel, where
    /// [`NearPairs::stencils`] was given positions at rest.
    pub fn is_mollified(&self) -> bool {
        self.mollifying().is_some()
    }

    /// The factor that makes a potential of edges smooth where they become parallel and another
    /// type of distance takes over (Li et al., *Incremental Potential Contact*, 2020, section 4.4).
    pub fn mollifier(&self) -> f64 {
        self.mollifying().map_or(1.0, |factor| factor.value())
    }

    /// The derivatives of the mollifier.
    pub fn mollifier_gradient(&self) -> Gradient {
        self.mollifying()
            .map_or([0.0; 12], |factor| factor.gradient())
    }

    /// The second derivatives of the mollifier, exactly symmetric.
    pub fn mollifier_hessian(&self) -> Hessian {
        self.mollifying()
            .map_or([[0.0; 12]; 12], |factor| factor.hessian())
    }

    /// Between the nearest features alone, unless it is mollified. What is spanned by equal
    /// vertices is then equal: vertices of edges and pairs of vertices are in ascending order.
    fn reduced(self) -> Self {
        let [a, b] = self.spans();
        // A vertex comes first.
        let (a, b) = if a.n > b.n { (b, a) } else { (a, b) };
        let kind = match (a.n, b.n) {
            (1, 1) => PairKind::VertexVertex,
            (1, 2) => PairKind::EdgeVertex,
            // Nothing is left out.
            _ => return self,
        };
        if self.is_mollified() {
            return self;
        }
        let mut slots = [0; 4];
        slots[0] = a.all()[0];
        slots[1..=b.n].copy_from_slice(b.all());
        let sorted = if b.n == 1 { 0..2 } else { 1..3 };
        slots[sorted].sort_unstable_by_key(|&slot| self.vertices[slot]);
        let n = 1 + b.n;
        for ix in n..4 {
            slots[ix] = slots[0];
        }
        Stencil {
            kind,
            features: match kind {
                PairKind::EdgeVertex => [Feature::Edge(0), Feature::Vertex(0)],
                _ => [Feature::Vertex(0); 2],
            },
            vertices: slots.map(|slot| self.vertices[slot]),
            points: slots.map(|slot| self.points[slot]),
            threshold: 0.0,
            ..self
        }
    }
}

/// Up to three of the four vertices.
struct Span {
    slots: [usize; 3],
    n: usize,
}

impl Span {
    /// Of a feature of an element whose `n` vertices begin with `first`.
    fn of(feature: Feature, first: usize, n: usize) -> Self {
        let slot = |ix: u8| first + usize::from(ix) % n;
        match feature {
            Feature::Vertex(ix) => Span {
                slots: [slot(ix); 3],
                n: 1,
            },
            Feature::Edge(ix) => Span {
                slots: [slot(ix), slot(ix + 1), first],
                n: 2,
            },
            Feature::Face => Span {
                slots: [first, first + 1, first + 2],
                n: 3,
            },
        }
    }

    fn all(&self) -> &[usize] {
        &self.slots[..self.n]
    }
}

/// Stencils of near pairs: [`NearPairs::stencils`].
#[derive(Debug, Clone, Default)]
pub struct Stencils {
    rows: Vec<Stencil>,
    /// The first vertex of each body by its index, and one past the last.
    offsets: Vec<u32>,
    /// How many threads compute columns, at most.
    threads: usize,
}

impl NearPairs {
    /// A [`Stencil`] per pair, in the same order, at the positions that the scene has now: with
    /// distances, gradients and Hessians for a potential. Features are those that were nearest when
    /// the pairs were found.
    ///
    /// A potential of contact sums over [`Stencils::merged`] in place of pairs. Positions at
    /// `rest`, in the order of the stencils' [numbers](Stencils::offsets), switch on the mollifier
    /// of nearly parallel edges. Its threshold depends on their lengths at rest.
    ///
    /// ```
    /// use impinge::{Backend, Detector, Query, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// scene.add_triangles(&[[0, 1, 2]], &[[0.0f32, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]])?;
    /// scene.add_points(&[[1.0f32, 1.0, 0.5]])?;
    /// let mut detector = Detector::new(Backend::Cpu)?;
    /// let near = detector.near(&scene, 0.5, &Query::between_all())?;
    /// // Each contact pushes with 2000 times what is missing to a distance of 1.
    /// let mut forces = vec![[0.0; 3]; 4];
    /// for contact in &near.stencils(&scene, None)?.merged()? {
    ///     let missing = 1.0 - contact.squared_distance().sqrt();
    ///     let push = contact.weight * 2000.0 * missing / contact.squared_distance().sqrt() / 2.0;
    ///     for (vertex, slope) in contact.vertices.iter().zip(contact.gradient().chunks(3)) {
    ///         for k in 0..3 {
    ///             forces[*vertex as usize][k] += push * slope[k];
    ///         }
    ///     }
    /// }
    /// assert_eq!(forces[3], [0.0, 0.0, 1000.0]); // the point is vertex 3 of the scene
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// Pairs with an edge and a face or two faces, which have no stencil; pairs of another scene or
    /// of a body that was re-meshed; refused positions; a number of positions at rest that is not
    /// that of the scene's vertices.
    pub fn stencils(&self, scene: &Scene, rest: Option<&[Point]>) -> Result<Stencils, Error> {
        self.iter().stencils(scene, rest)
    }

    /// The same, weighted by area, so that a potential does not depend on how fine a mesh is. Areas
    /// are those of ipc-toolkit's `use_area_weighting`, at rest: of a vertex a third of each face
    /// around it (without faces, half the length of each of its edges; without edges, 1), of an
    /// edge a third of each face beside it (without faces, its length).
    ///
    /// | kind | weight |
    /// |---|---|
    /// | [`VertexFace`](PairKind::VertexFace) | 1/4 of the area of the vertex |
    /// | [`EdgeEdge`](PairKind::EdgeEdge) | 1/4 of the areas of both edges |
    /// | [`EdgeVertex`](PairKind::EdgeVertex) | 1/2 of the area of the vertex |
    /// | [`VertexVertex`](PairKind::VertexVertex) | 1/2 of the areas of both vertices |
    ///
    /// # Errors
    /// As [`stencils`](NearPairs::stencils).
    pub fn stencils_by_area(&self, scene: &Scene, rest: &[Point]) -> Result<Stencils, Error> {
        self.iter().stencils_by_area(scene, rest)
    }
}

impl NearIter<'_> {
    /// [`NearPairs::stencils`] of the pairs that are left.
    ///
    /// # Errors
    /// As there.
    pub fn stencils(self, scene: &Scene, rest: Option<&[Point]>) -> Result<Stencils, Error> {
        self.stencils_weighted(scene, rest, None)
    }

    /// [`NearPairs::stencils_by_area`] of the pairs that are left.
    ///
    /// # Errors
    /// As there.
    pub fn stencils_by_area(self, scene: &Scene, rest: &[Point]) -> Result<Stencils, Error> {
        self.stencils_weighted(scene, Some(rest), Some(AreasOfBodies::default()))
    }

    /// Weighted by areas, or not.
    fn stencils_weighted(
        self,
        scene: &Scene,
        rest: Option<&[Point]>,
        mut areas: Option<AreasOfBodies>,
    ) -> Result<Stencils, Error> {
        let offsets = offsets(scene)?;
        if let Some(rest) = rest {
            check_rest(scene, rest)?;
        }
        for (id, body) in scene.bodies() {
            if !body.is_checked() {
                body.positions().check(id)?;
            }
        }
        let (n, threads) = (self.len(), self.threads());
        let rows = sink::with_capacity(n, WHAT)?;
        let parts = PartsOfScene {
            scene,
            offsets: &offsets,
            numbering: self.numbering(),
        };
        let refused = Mutex::new(None);
        let rows = filled_in_parts(rows, n, PART, threads, |first, room| {
            let mut reader = Reader {
                parts,
                rest,
                sides: [None, None],
            };
            for (kind, keys, nearest) in self.clone().after(first).runs() {
                for (&key, &nearest) in keys.iter().zip(nearest).take(room.n_left()) {
                    if let Err(error) = reader.read(kind, key, nearest, room) {
                        let mut refused = refused.lock().unwrap_or_else(PoisonError::into_inner);
                        if refused.as_ref().is_none_or(|(other, _)| first < *other) {
                            *refused = Some((first, error));
                        }
                        return;
                    }
                }
            }
        });
        if let Some((_, error)) = refused.into_inner().unwrap_or_else(PoisonError::into_inner) {
            return Err(error);
        }
        let mut rows = rows.unwrap_or_default();
        if let (Some(areas), Some(rest)) = (&mut areas, rest) {
            for (row, pair) in rows.iter_mut().zip(self) {
                row.weight = areas.weight(scene, &offsets, rest, pair.kind, sides(&pair)?)?;
            }
        }
        Ok(Stencils {
            rows,
            offsets,
            threads,
        })
    }
}

/// The elements of a pair, a vertex before an edge or a face.
///
/// # Errors
/// An edge and a face, or two faces.
#[inline(always)]
fn sides(pair: &NearPair) -> Result<[(Element, Part); 2], Error> {
    let parts = pair.kind.parts();
    match pair.kind {
        PairKind::VertexFace | PairKind::EdgeEdge | PairKind::VertexVertex => {
            Ok([(pair.a, parts[0]), (pair.b, parts[1])])
        }
        PairKind::EdgeVertex => Ok([(pair.b, parts[1]), (pair.a, parts[0])]),
        PairKind::EdgeFace | PairKind::FaceFace => Err(no_stencil(pair.kind, (pair.a, pair.b))),
    }
}

#[cold]
fn no_stencil(kind: PairKind, (a, b): (Element, Element)) -> Error {
    Error::Setting {
        setting: "kinds",
        given: format!(
            "{} (element {} of body {} and {} of body {}; `near` gives no such pairs if its query names the kinds vf and ee)",
            kind.name(),
            a.element,
            a.body,
            b.element,
            b.body
        ),
        allowed: "vf, ee, ev or vv",
    }
}

/// Reads the stencils of pairs by their keys. The parts of one are often those of the next, so they
/// are held: to name the elements of a pair and to look these up takes three times as long.
struct Reader<'a> {
    parts: PartsOfScene<'a>,
    rest: Option<&'a [Point]>,
    sides: [Option<PartOfBody<'a>>; 2],
}

/// The parts of a scene that pairs name.
#[derive(Clone, Copy)]
struct PartsOfScene<'a> {
    scene: &'a Scene,
    offsets: &'a [u32],
    numbering: &'a Numbering,
}

/// A part of a body.
struct PartOfBody<'a> {
    /// The first and the last number of its elements.
    numbers: [Number; 2],
    part: Part,
    elements: &'a Elements,
    positions: &'a Positions,
    /// The number of its first vertex.
    offset: u32,
}

impl<'a> PartsOfScene<'a> {
    /// The part that has the element with this number: the one that is held, or held now.
    #[inline(always)]
    fn hold<'b>(
        self,
        held: &'b mut Option<PartOfBody<'a>>,
        number: Number,
    ) -> Result<&'b PartOfBody<'a>, Error> {
        if !held.as_ref().is_some_and(|part| part.has(number)) {
            *held = None;
        }
        match held {
            Some(part) => Ok(part),
            none => Ok(none.insert(self.find(number)?)),
        }
    }

    #[cold]
    fn find(self, number: Number) -> Result<PartOfBody<'a>, Error> {
        let (numbers, (id, part, stamp)) = self.numbering.part_of(number);
        let body = self.scene.body(id)?;
        if body.numbers_stamp(part) != stamp {
            return Err(Error::Remeshed { body: id });
        }
        Ok(PartOfBody {
            numbers,
            part,
            elements: body.part(part),
            positions: body.positions(),
            offset: self.offsets[id.index()],
        })
    }
}

impl Reader<'_> {
    /// The stencil of a pair, which stands for itself. Each vertex and point goes from where it is
    /// to where it belongs: in between, the four would be stored apart and loaded together, for
    /// which a processor waits.
    #[inline(always)]
    fn read(
        &mut self,
        kind: PairKind,
        key: u64,
        nearest: u8,
        to: &mut Room<'_, Stencil>,
    ) -> Result<(), Error> {
        let (parts, mut numbers) = (self.parts, pair_numbers(key));
        // Which corner of which side each vertex is.
        let slots = match kind {
            PairKind::VertexFace => [(0, 0), (1, 0), (1, 1), (1, 2)],
            PairKind::EdgeEdge => [(0, 0), (0, 1), (1, 0), (1, 1)],
            PairKind::VertexVertex => [(0, 0), (1, 0), (0, 0), (0, 0)],
            PairKind::EdgeVertex => {
                // The vertex comes before the edge.
                numbers.reverse();
                [(0, 0), (1, 0), (1, 1), (0, 0)]
            }
            PairKind::EdgeFace | PairKind::FaceFace => {
                return Err(no_stencil(kind, parts.numbering.pair(key)));
            }
        };
        let [a, b] = &mut self.sides;
        let (a, b) = (parts.hold(a, numbers[0])?, parts.hold(b, numbers[1])?);
        let elements = [a.element(numbers[0]), b.element(numbers[1])];
        let corners = [a.corners(&elements[0]), b.corners(&elements[1])];
        let corner = |ix: usize| {
            let (side, ix) = slots[ix];
            ([a, b][side], corners[side][ix])
        };
        let vertex = |ix| {
            let (of, corner) = corner(ix);
            of.offset + corner
        };
        let point = |ix| {
            let (of, corner) = corner(ix);
            of.positions.point(corner as usize)
        };
        let vertices = [vertex(0), vertex(1), vertex(2), vertex(3)];
        let threshold = match (self.rest, kind) {
            (Some(rest), PairKind::EdgeEdge) => {
                Mollifier::threshold(&vertices.map(|vertex| rest[vertex as usize]))
            }
            _ => 0.0,
        };
        to.put(Stencil {
            kind,
            features: NearestOfElements::unpacked(nearest).features,
            vertices,
            weight: 1.0,
            points: [point(0), point(1), point(2), point(3)],
            threshold,
        });
        Ok(())
    }
}

impl PartOfBody<'_> {
    #[inline(always)]
    fn has(&self, number: Number) -> bool {
        self.numbers[0] <= number && number <= self.numbers[1]
    }

    #[inline(always)]
    fn element(&self, number: Number) -> ElementIx {
        number.minus(self.numbers[0])
    }

    #[inline(always)]
    fn corners<'b>(&'b self, element: &'b ElementIx) -> &'b [u32] {
        self.elements.corners_in(self.part, element)
    }
}

impl Stencils {
    /// One stencil per contact: features that several pairs share are named once, with the sum of
    /// their weights. Sorted by kind, then vertices.
    ///
    /// A vertex above an edge is near both of its faces and to the edges beside it; these pairs
    /// become one stencil of the vertex and the edge. Nearly parallel edges stay pairs of edges,
    /// since a mollifier belongs to each. These are the sets and weights of ipc-toolkit's
    /// `NormalCollisions` of type IPC; with weights by area, of
    /// [those](NearPairs::stencils_by_area). Where two types have the same distance, as for a
    /// vertex exactly above an edge, ipc-toolkit may name the other.
    ///
    /// # Errors
    /// There is no memory for them.
    pub fn merged(&self) -> Result<Self, Error> {
        let mut rows = sink::with_capacity(self.rows.len(), WHAT)?;
        rows.extend(self.rows.iter().map(|row| row.reduced()));
        // Those with equal keys are equal but for weights, which are summed from the smallest on.
        rows.sort_unstable_by(|a, b| a.key().cmp(&b.key()).then(a.weight.total_cmp(&b.weight)));
        rows.dedup_by(|next, kept| {
            let is_same = next.key() == kept.key();
            if is_same {
                kept.weight += next.weight;
            }
            is_same
        });
        self.with(rows)
    }

    /// Some of them, or all in another order: those with these numbers.
    ///
    /// # Errors
    /// There is no memory for them.
    ///
    /// # Panics
    /// There is no stencil with such a number.
    pub fn select(&self, numbers: &[usize]) -> Result<Self, Error> {
        let mut rows = sink::with_capacity(numbers.len(), WHAT)?;
        rows.extend(numbers.iter().map(|&ix| self.rows[ix]));
        self.with(rows)
    }

    /// Others of the same scene.
    fn with(&self, rows: Vec<Stencil>) -> Result<Self, Error> {
        let mut offsets = sink::with_capacity(self.offsets.len(), WHAT)?;
        offsets.extend_from_slice(&self.offsets);
        Ok(Stencils {
            rows,
            offsets,
            threads: self.threads,
        })
    }

    /// A number, row or matrix of each, in order: computed on threads of the rayon pool at hand, at
    /// most as many as the detector has that found the pairs. However many there are, the bytes are
    /// the same.
    ///
    /// ```
    /// # use impinge::{Backend, Detector, Query, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// use impinge::Stencil;
    /// let mut scene = Scene::new();
    /// scene.add_triangles(&[[0, 1, 2]], &[[0.0f32, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]])?;
    /// scene.add_points(&[[1.0f32, 1.0, 0.5]])?;
    /// let near = Detector::new(Backend::Cpu)?.near(&scene, 1.0, &Query::between_all())?;
    /// let contacts = near.stencils(&scene, None)?.merged()?;
    /// assert_eq!(contacts.column(Stencil::squared_distance)?, [0.25]);
    /// assert_eq!(contacts.column(Stencil::hessian)?[0][2][2], 2.0);
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// There is no memory for them.
    pub fn column<T: Copy + Send>(
        &self,
        of: impl Fn(&Stencil) -> T + Sync,
    ) -> Result<Vec<T>, Error> {
        let n = self.rows.len();
        let column = sink::with_capacity(n, WHAT)?;
        let column = filled_in_parts(column, n, PART, self.threads, |first, room| {
            for row in self.rows[first..].iter().take(room.n_left()) {
                room.put(of(row));
            }
        });
        Ok(column.unwrap_or_default())
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// All of them, in order.
    pub fn iter(&self) -> std::slice::Iter<'_, Stencil> {
        self.rows.iter()
    }

    /// Vertices are numbered through the whole scene, body after body in the order of their ids.
    /// Vertex `v` of a body has number `offsets()[body.index()] + v`; the last entry is the number
    /// of vertices of the scene.
    pub fn offsets(&self) -> &[u32] {
        &self.offsets
    }
}

impl Stencil {
    /// What is equal of stencils that are merged.
    fn key(&self) -> (PairKind, [u32; 4], [Feature; 2]) {
        (self.kind, self.vertices, self.features)
    }
}

impl<'a> IntoIterator for &'a Stencils {
    type Item = &'a Stencil;
    type IntoIter = std::slice::Iter<'a, Stencil>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

/// Areas of bodies, found when first needed.
#[derive(Default)]
struct AreasOfBodies(ByBody<Areas>);

impl AreasOfBodies {
    /// The weight of a pair. A vertex comes before an edge or a face.
    fn weight(
        &mut self,
        scene: &Scene,
        offsets: &[u32],
        rest: &[Point],
        kind: PairKind,
        pair: [(Element, Part); 2],
    ) -> Result<f64, Error> {
        // Each pair is seen from both sides, and faces as well as edges tell of the same surface.
        let (share, weighing) = match kind {
            PairKind::VertexFace => (0.25, &pair[..1]),
            PairKind::EdgeEdge => (0.25, &pair[..]),
            PairKind::EdgeVertex => (0.5, &pair[..1]),
            _ => (0.5, &pair[..]),
        };
        let mut sum = 0.0;
        for &(element, part) in weighing {
            let ix = element.body.index();
            let areas = match self.0.entry(element.body) {
                Some(areas) => areas,
                none => none.insert(Areas::new(
                    scene.body(element.body)?,
                    &rest[offsets[ix] as usize..offsets[ix + 1] as usize],
                )?),
            };
            let list = match part {
                Part::Edges => &areas.edges,
                _ => &areas.vertices,
            };
            sum += list[element.element as usize];
        }
        Ok(share * sum)
    }
}

/// The first vertex of each body by its index, and one past the last.
fn offsets(scene: &Scene) -> Result<Vec<u32>, Error> {
    let n_slots = scene.bodies().last().map_or(0, |(id, _)| id.index() + 1);
    let mut offsets = sink::filled(0, n_slots + 1, WHAT)?;
    for (id, body) in scene.bodies() {
        offsets[id.index() + 1] = body.n_vertices() as u64;
    }
    let mut n = 0;
    for offset in &mut offsets {
        n += *offset;
        *offset = n;
    }
    match u32::try_from(n) {
        Ok(_) => Ok(offsets.into_iter().map(|offset| offset as u32).collect()),
        Err(_) => Err(Error::TooMany {
            what: "vertices",
            given: n,
            limit: u64::from(u32::MAX),
        }),
    }
}

/// Refuses positions at rest that are not as many as the scene has, and those that are not finite.
fn check_rest(scene: &Scene, rest: &[Point]) -> Result<(), Error> {
    let n_vertices: usize = scene.bodies().map(|(_, body)| body.n_vertices()).sum();
    if rest.len() != n_vertices {
        return Err(Error::Setting {
            setting: "rest",
            given: format!("{} positions for {n_vertices} vertices", rest.len()),
            allowed: "as many as all bodies have vertices, one body after another,",
        });
    }
    let bad = |(_, value): &(usize, &Point)| !value.iter().all(|x| x.is_finite());
    match rest.iter().enumerate().find(bad) {
        None => Ok(()),
        Some((row, &value)) => Err(Error::NonFinitePoint {
            what: "rest",
            row,
            value,
        }),
    }
}
