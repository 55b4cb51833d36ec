//! Near pairs as stencils.

use std::sync::{Arc, Mutex, PoisonError};

use super::{NearIter, NearPair, NearPairs};
use crate::answers::areas::Areas;
use crate::answers::numbering::Numbering;
use crate::answers::pairs::Element;
use crate::answers::stencil::Threshold;
use crate::answers::stencils::{PART, StencilRow, Stencils, WHAT};
use crate::query::pair_kind::PairKind;
use crate::scene::Scene;
use crate::scene::by_body::ByBody;
use crate::scene::elements::{Elements, Part};
use crate::scene::error::Error;
use crate::scene::index::{ElementIx, Number, pair_numbers};
use crate::search::sink;
use crate::workers::in_parts::{PartWriter, filled_in_parts};
use impinge_exact::Point;
use impinge_exact::internal::NearestOfElements;

impl NearPairs {
    /// A [`Stencil`](crate::Stencil) per pair, in the same order, at the positions that the scene
    /// has now: with distances, gradients and Hessians for a potential. Features are those that
    /// were nearest when the pairs were found.
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
            body.check_once(id)?;
        }
        let (n, threads) = (self.len(), self.threads());
        let rows = sink::with_capacity(n, WHAT)?;
        let parts = PartsOfScene {
            scene,
            offsets: &offsets,
            numbering: self.numbering(),
        };
        let refused = Mutex::new(None);
        let rows = filled_in_parts(rows, n, PART, threads, |first, writer| {
            let mut reader = Reader {
                parts,
                rest,
                sides: [None, None],
            };
            for (kind, keys, nearest) in self.clone().after(first).runs() {
                for (&key, &nearest) in keys.iter().zip(nearest).take(writer.n_missing()) {
                    if let Err(error) = reader.read(kind, key, nearest, writer) {
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
            points: Arc::new(if n == 0 { Vec::new() } else { points(scene)? }),
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
            offset: self.offsets[id.index()],
        })
    }
}

impl Reader<'_> {
    /// The stencil of a pair, which stands for itself.
    #[inline(always)]
    fn read(
        &mut self,
        kind: PairKind,
        key: u64,
        nearest: u8,
        to: &mut PartWriter<'_, StencilRow>,
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
        let vertex = |(side, ix): (usize, usize)| [a, b][side].offset + corners[side][ix];
        let [i, j, k, l] = slots;
        let vertices = [vertex(i), vertex(j), vertex(k), vertex(l)];
        let threshold = match (self.rest, kind) {
            (Some(rest), PairKind::EdgeEdge) => {
                Threshold::at_rest(&vertices.map(|vertex| rest[vertex as usize]))
            }
            _ => Threshold::default(),
        };
        to.put(StencilRow {
            kind,
            features: NearestOfElements::unpacked(nearest).features,
            vertices,
            weight: 1.0,
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

/// The vertices of all bodies.
fn points(scene: &Scene) -> Result<Vec<Point>, Error> {
    let n_vertices = scene.bodies().map(|(_, body)| body.n_vertices()).sum();
    let mut points = sink::with_capacity(n_vertices, WHAT)?;
    for (_, body) in scene.bodies() {
        let positions = body.positions();
        points.extend((0..body.n_vertices()).map(|vertex| positions.point(vertex)));
    }
    Ok(points)
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
