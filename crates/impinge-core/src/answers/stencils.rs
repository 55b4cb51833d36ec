//! Stencils: vertices, coefficients and distances with their derivatives.

use std::slice;
use std::sync::Arc;

use crate::answers::stencil::{Gradient, Hessian, Mollifier, NearestWay, Threshold};
use crate::query::pair_kind::PairKind;
use crate::scene::error::Error;
use crate::search::sink;
use crate::workers::in_parts::filled_in_parts;
use impinge_exact::{Feature, Point};

/// What memory is for.
pub(super) const WHAT: &str = "stencils";
/// Stencils that a thread takes at a time.
pub(super) const PART: usize = 256;

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
    /// The features that are nearest, in the order of the [kind](crate::NearPair::features).
    pub features: [Feature; 2],
    /// The vertices by their numbers in the scene: see [`Stencils::offsets`].
    pub vertices: [u32; 4],
    /// How many pairs it stands for; or the [area](crate::NearPairs::stencils_by_area) at rest that
    /// they stand for.
    pub weight: f64,
    /// The positions of the vertices.
    pub points: [Point; 4],
    /// What the mollifier compares with; 0 for none.
    threshold: Threshold,
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

    /// ipc-toolkit's name of the distance type, as [`NearPair::name`](crate::NearPair::name).
    pub fn name(&self) -> &'static str {
        self.kind.named(self.features)
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
    /// [`NearPairs::stencils`](crate::NearPairs::stencils) was given positions at rest.
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
    fn reduced(self) -> StencilRow {
        let [a, b] = self.spans();
        // A vertex comes first.
        let (a, b) = if a.n > b.n { (b, a) } else { (a, b) };
        let kind = match (a.n, b.n) {
            (1, 1) => PairKind::VertexVertex,
            (1, 2) => PairKind::EdgeVertex,
            // Nothing is left out.
            _ => return self.row(),
        };
        if self.is_mollified() {
            return self.row();
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
        StencilRow {
            kind,
            features: match kind {
                PairKind::EdgeVertex => [Feature::Edge(0), Feature::Vertex(0)],
                _ => [Feature::Vertex(0); 2],
            },
            vertices: slots.map(|slot| self.vertices[slot]),
            weight: self.weight,
            threshold: Threshold::default(),
        }
    }

    fn row(&self) -> StencilRow {
        StencilRow {
            kind: self.kind,
            features: self.features,
            vertices: self.vertices,
            weight: self.weight,
            threshold: self.threshold,
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

/// A stencil without its points: these would take most of the memory, and writing them most of the
/// time.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StencilRow {
    pub kind: PairKind,
    pub features: [Feature; 2],
    pub vertices: [u32; 4],
    pub weight: f64,
    pub threshold: Threshold,
}

impl StencilRow {
    /// With the points of its vertices, of all of a scene.
    #[inline(always)]
    fn at(&self, points: &[Point]) -> Stencil {
        let [a, b, c, d] = self.vertices;
        Stencil {
            kind: self.kind,
            features: self.features,
            vertices: self.vertices,
            weight: self.weight,
            points: [
                points[a as usize],
                points[b as usize],
                points[c as usize],
                points[d as usize],
            ],
            threshold: self.threshold,
        }
    }

    /// What is equal of stencils that are merged.
    fn key(&self) -> (PairKind, [u32; 4], [Feature; 2]) {
        (self.kind, self.vertices, self.features)
    }
}

/// Stencils of near pairs: [`NearPairs::stencils`](crate::NearPairs::stencils).
#[derive(Clone, Default)]
pub struct Stencils {
    pub(super) rows: Vec<StencilRow>,
    /// Where the vertices of the scene are.
    pub(super) points: Arc<Vec<Point>>,
    /// The first vertex of each body by its index, and one past the last.
    pub(super) offsets: Vec<u32>,
    /// How many threads compute columns, at most.
    pub(super) threads: usize,
}

/// Stencils in order: [`Stencils::iter`].
#[derive(Debug, Clone)]
pub struct StencilIter<'a> {
    rows: slice::Iter<'a, StencilRow>,
    points: &'a [Point],
}

impl Iterator for StencilIter<'_> {
    type Item = Stencil;

    #[inline]
    fn next(&mut self) -> Option<Stencil> {
        self.rows.next().map(|row| row.at(self.points))
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        self.rows.size_hint()
    }
}

impl ExactSizeIterator for StencilIter<'_> {}

impl Stencils {
    /// One stencil per contact: features that several pairs share are named once, with the sum of
    /// their weights. Sorted by kind, then vertices.
    ///
    /// A vertex above an edge is near both of its faces and to the edges beside it; these pairs
    /// become one stencil of the vertex and the edge. Nearly parallel edges stay pairs of edges,
    /// since a mollifier belongs to each. These are the sets and weights of ipc-toolkit's
    /// `NormalCollisions` of type IPC; with weights by area, of
    /// [those](crate::NearPairs::stencils_by_area). Where two types have the same distance, as for
    /// a vertex exactly above an edge, ipc-toolkit may name the other.
    ///
    /// # Errors
    /// There is no memory for them.
    pub fn merged(&self) -> Result<Self, Error> {
        let mut rows = sink::with_capacity(self.rows.len(), WHAT)?;
        rows.extend(self.iter().map(Stencil::reduced));
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
    fn with(&self, rows: Vec<StencilRow>) -> Result<Self, Error> {
        let mut offsets = sink::with_capacity(self.offsets.len(), WHAT)?;
        offsets.extend_from_slice(&self.offsets);
        Ok(Stencils {
            rows,
            points: self.points.clone(),
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
        let column = filled_in_parts(column, n, PART, self.threads, |first, writer| {
            for row in self.rows[first..].iter().take(writer.n_missing()) {
                writer.put(of(&row.at(&self.points)));
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

    /// One of them.
    pub fn get(&self, ix: usize) -> Option<Stencil> {
        self.rows.get(ix).map(|row| row.at(&self.points))
    }

    /// All of them, in order.
    pub fn iter(&self) -> StencilIter<'_> {
        StencilIter {
            rows: self.rows.iter(),
            points: &self.points,
        }
    }

    /// Vertices are numbered through the whole scene, body after body in the order of their ids.
    /// Vertex `v` of a body has number `offsets()[body.index()] + v`; the last entry is the number
    /// of vertices of the scene.
    pub fn offsets(&self) -> &[u32] {
        &self.offsets
    }
}

impl std::fmt::Debug for Stencils {
    /// How many there are.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut short = f.debug_struct("Stencils");
        short.field("len", &self.len());
        short.finish_non_exhaustive()
    }
}

impl<'a> IntoIterator for &'a Stencils {
    type Item = Stencil;
    type IntoIter = StencilIter<'a>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}
