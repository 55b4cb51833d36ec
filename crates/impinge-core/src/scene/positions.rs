//! Vertex positions: single or double precision, checked once.

use std::sync::Arc;

use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::position_rows::PositionRows;
use impinge_weld::Weld;

/// Vertex positions in the precision in which they were given.
#[derive(Debug, Clone, PartialEq)]
pub enum Positions {
    /// `(n, 3)` single precision.
    F32(PositionRows<f32>),
    /// `(n, 3)` double precision.
    F64(PositionRows<f64>),
}

impl Positions {
    /// Shares the rows of an owner, without a copy. The owner lives at least as long as these
    /// positions and their clones. It is asked for its rows once.
    pub fn shared<R: Real>(owner: Arc<impl AsRef<[[R; 3]]> + Send + Sync + 'static>) -> Self {
        R::held(PositionRows::shared(owner))
    }

    /// The number of vertices.
    pub fn len(&self) -> usize {
        match self {
            Positions::F32(positions) => positions.len(),
            Positions::F64(positions) => positions.len(),
        }
    }

    /// Whether there are no vertices.
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

    /// Widens to double precision if the others are in double precision.
    pub(crate) fn widen_as(&mut self, others: &Positions) {
        if let (Positions::F32(positions), Positions::F64(_)) = (&*self, others) {
            let wide = positions.iter().map(|position| position.map(f64::from));
            *self = Positions::F64(wide.collect());
        }
    }

    /// Whether the rows are those of an owner.
    pub(crate) fn is_shared(&self) -> bool {
        match self {
            Positions::F32(positions) => positions.is_shared(),
            Positions::F64(positions) => positions.is_shared(),
        }
    }

    /// Copies rows that are shared with their owner.
    pub(crate) fn own(&mut self) {
        match self {
            Positions::F32(positions) => {
                positions.own();
            }
            Positions::F64(positions) => {
                positions.own();
            }
        }
    }

    /// Refuses the first that is not finite.
    pub(crate) fn check(&self, body: BodyId) -> Result<(), Error> {
        match self {
            Positions::F32(positions) => check_positions(body, positions),
            Positions::F64(positions) => check_positions(body, positions),
        }
    }

    /// The positions at a fraction of the way to others, as many of the same precision:
    /// `start + fraction (end - start)`, each coordinate computed in double precision and rounded
    /// to that of the positions.
    pub(crate) fn blend(&self, end: &Positions, fraction: f64) -> Positions {
        match (self, end) {
            (Positions::F32(start), Positions::F32(end)) => {
                let pairs = start.iter().zip(end.iter());
                Positions::F32(pairs.map(|(x, y)| between(x, y, fraction)).collect())
            }
            _ => {
                let points = (0..self.len()).map(|vertex| self.blend_point(end, vertex, fraction));
                Positions::F64(points.collect())
            }
        }
    }

    /// One of the positions of [`blend`](Positions::blend).
    pub(crate) fn blend_point(&self, end: &Positions, vertex: usize, fraction: f64) -> [f64; 3] {
        match (self, end) {
            (Positions::F32(start), Positions::F32(end)) => {
                between(&start[vertex], &end[vertex], fraction).map(f64::from)
            }
            _ => between(&self.point(vertex), &end.point(vertex), fraction),
        }
    }

    /// How many vertices lie at the positions of others: as many as welding would remove.
    pub(crate) fn n_coincident(&self) -> usize {
        let weld = match self {
            Positions::F32(positions) => Weld::by_position(positions),
            Positions::F64(positions) => Weld::by_position(positions),
        };
        weld.n_welded()
    }

    /// The largest magnitude of a coordinate.
    pub(crate) fn magnitude(&self) -> f64 {
        // Magnitudes are ordered as their bits are, and compilers find the largest of many integers
        // at once.
        match self {
            Positions::F32(positions) => {
                let bits = positions.as_flattened().iter().map(|x| x.abs().to_bits());
                f32::from_bits(bits.max().unwrap_or(0)).into()
            }
            Positions::F64(positions) => {
                let bits = positions.as_flattened().iter().map(|x| x.abs().to_bits());
                f64::from_bits(bits.max().unwrap_or(0))
            }
        }
    }

    /// How far rounding may move a coordinate of [`blend`](Positions::blend) from the way to the
    /// end.
    pub(crate) fn most_rounded(&self, end: &Positions) -> f64 {
        // Half a unit in the last place of an `f32`, after four roundings in `f64` of numbers up to
        // twice as large.
        let (share, least) = match (self, end) {
            (Positions::F32(_), Positions::F32(_)) => {
                (2f64.powi(-24) + 2f64.powi(-49), 2f64.powi(-149))
            }
            _ => (2f64.powi(-49), f64::MIN_POSITIVE),
        };
        share * self.magnitude().max(end.magnitude()) + least
    }

    /// About the share of a vertex's way by which rounding moves positions on it.
    pub(crate) fn share_of_rounding(&self, end: &Positions, vertex: usize) -> f64 {
        let [from, to] = [self, end].map(|positions| positions.point(vertex));
        let size = |p: [f64; 3]| p.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
        let way = size(std::array::from_fn(|k| to[k] - from[k]));
        self.unit_roundoff(end) * (size(from).max(size(to)) / way)
    }

    /// The unit roundoff of positions on the way to others.
    pub(crate) fn unit_roundoff(&self, end: &Positions) -> f64 {
        match (self, end) {
            (Positions::F64(_), Positions::F64(_)) => 2f64.powi(-53),
            _ => 2f64.powi(-24),
        }
    }

    pub(crate) fn precision(&self) -> &'static str {
        match self {
            Positions::F32(_) => "f32",
            Positions::F64(_) => "f64",
        }
    }

    /// Bytes of their own, without those that an owner shares.
    pub(crate) fn bytes(&self) -> usize {
        match self {
            Positions::F32(positions) => positions.bytes(),
            Positions::F64(positions) => positions.bytes(),
        }
    }
}

/// A point at a fraction of its way.
#[inline(always)]
fn between<R: Real>(start: &[R; 3], end: &[R; 3], fraction: f64) -> [R; 3] {
    if fraction >= 1.0 {
        return *end;
    }
    std::array::from_fn(|axis| {
        let (x, y) = (start[axis].widen(), end[axis].widen());
        let way = y - x;
        let at = if way.is_finite() {
            x + fraction * way
        } else {
            (1.0 - fraction) * x + fraction * y
        };
        // Rounding must not move it beyond the ends.
        R::round(at.clamp(x.min(y), x.max(y)))
    })
}

impl<R: Real> From<Vec<[R; 3]>> for Positions {
    fn from(positions: Vec<[R; 3]>) -> Self {
        R::held(positions.into())
    }
}

impl<R: Real, const N: usize> From<[[R; 3]; N]> for Positions {
    fn from(positions: [[R; 3]; N]) -> Self {
        positions.to_vec().into()
    }
}

impl<R: Real> From<&[[R; 3]]> for Positions {
    fn from(positions: &[[R; 3]]) -> Self {
        positions.to_vec().into()
    }
}

impl<R: Real> From<PositionRows<R>> for Positions {
    fn from(positions: PositionRows<R>) -> Self {
        R::held(positions)
    }
}

/// Positions for [`Scene::set_positions`](crate::Scene::set_positions): a reference is copied; a
/// `Vec`, an `Arc` and [`Positions`] are taken over without a copy.
#[derive(Debug)]
pub struct NewPositions<'a>(pub(crate) Given<'a>);

#[derive(Debug)]
pub(crate) enum Given<'a> {
    F32(&'a [[f32; 3]]),
    F64(&'a [[f64; 3]]),
    Whole(Positions),
}

impl NewPositions<'_> {
    pub(crate) fn len(&self) -> usize {
        match &self.0 {
            Given::F32(rows) => rows.len(),
            Given::F64(rows) => rows.len(),
            Given::Whole(positions) => positions.len(),
        }
    }
}

impl<'a, R: Real> From<&'a [[R; 3]]> for NewPositions<'a> {
    fn from(rows: &'a [[R; 3]]) -> Self {
        R::given(rows)
    }
}

impl<'a, R: Real, const N: usize> From<&'a [[R; 3]; N]> for NewPositions<'a> {
    fn from(rows: &'a [[R; 3]; N]) -> Self {
        rows.as_slice().into()
    }
}

impl<'a, R: Real> From<&'a Vec<[R; 3]>> for NewPositions<'a> {
    fn from(rows: &'a Vec<[R; 3]>) -> Self {
        rows.as_slice().into()
    }
}

impl<'a, R: Real> From<&'a PositionRows<R>> for NewPositions<'a> {
    fn from(rows: &'a PositionRows<R>) -> Self {
        rows[..].into()
    }
}

impl<'a> From<&'a Positions> for NewPositions<'a> {
    fn from(positions: &'a Positions) -> Self {
        match positions {
            Positions::F32(rows) => rows[..].into(),
            Positions::F64(rows) => rows[..].into(),
        }
    }
}

impl<R: Real> From<Vec<[R; 3]>> for NewPositions<'_> {
    fn from(rows: Vec<[R; 3]>) -> Self {
        Positions::from(rows).into()
    }
}

impl From<Positions> for NewPositions<'_> {
    fn from(positions: Positions) -> Self {
        NewPositions(Given::Whole(positions))
    }
}

impl<R: Real> From<PositionRows<R>> for NewPositions<'_> {
    fn from(rows: PositionRows<R>) -> Self {
        Positions::from(rows).into()
    }
}

impl<R: Real> From<Arc<Vec<[R; 3]>>> for NewPositions<'_> {
    /// Shares them with their owner: see [`Positions::shared`].
    fn from(owner: Arc<Vec<[R; 3]>>) -> Self {
        Positions::shared(owner).into()
    }
}

mod sealed {
    pub trait Sealed {}
    impl Sealed for f32 {}
    impl Sealed for f64 {}
}

/// `f32` or `f64`: both are stored as given, and answers are exact for both.
pub trait Real: sealed::Sealed + impinge_weld::Coordinate + Send + Sync + 'static {
    #[doc(hidden)]
    fn all_finite(numbers: &[Self]) -> bool;
    #[doc(hidden)]
    fn widen(self) -> f64;
    #[doc(hidden)]
    fn round(x: f64) -> Self;
    #[doc(hidden)]
    fn stored(positions: &mut Positions) -> Option<&mut PositionRows<Self>>;
    #[doc(hidden)]
    fn held(positions: PositionRows<Self>) -> Positions;
    #[doc(hidden)]
    fn given(positions: &[[Self; 3]]) -> NewPositions<'_>;
    #[doc(hidden)]
    fn store(positions: &[[Self; 3]]) -> Positions {
        positions.to_vec().into()
    }
}

impl Real for f32 {
    /// Adding one to an exponent of all ones carries into the sign bit, so any infinity or NaN sets
    /// that bit. The compiler vectorises this, but not `is_finite`.
    #[inline]
    fn all_finite(numbers: &[f32]) -> bool {
        const EXPONENT: u32 = 0x7f80_0000;
        const ONE: u32 = 0x0080_0000;
        let bad = numbers
            .iter()
            .fold(0, |bad, x| bad | ((x.to_bits() & EXPONENT) + ONE));
        bad >> 31 == 0
    }
    #[inline(always)]
    fn widen(self) -> f64 {
        f64::from(self)
    }
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation, reason = "rounded to the nearest")]
    fn round(x: f64) -> f32 {
        x as f32
    }
    fn stored(positions: &mut Positions) -> Option<&mut PositionRows<f32>> {
        match positions {
            Positions::F32(positions) => Some(positions),
            Positions::F64(_) => None,
        }
    }
    fn held(positions: PositionRows<f32>) -> Positions {
        Positions::F32(positions)
    }
    fn given(positions: &[[f32; 3]]) -> NewPositions<'_> {
        NewPositions(Given::F32(positions))
    }
}

impl Real for f64 {
    /// As for `f32`.
    #[inline]
    fn all_finite(numbers: &[f64]) -> bool {
        const EXPONENT: u64 = 0x7ff0_0000_0000_0000;
        const ONE: u64 = 0x0010_0000_0000_0000;
        let bad = numbers
            .iter()
            .fold(0, |bad, x| bad | ((x.to_bits() & EXPONENT) + ONE));
        bad >> 63 == 0
    }
    #[inline(always)]
    fn widen(self) -> f64 {
        self
    }
    #[inline(always)]
    fn round(x: f64) -> f64 {
        x
    }
    fn stored(positions: &mut Positions) -> Option<&mut PositionRows<f64>> {
        match positions {
            Positions::F64(positions) => Some(positions),
            Positions::F32(_) => None,
        }
    }
    fn held(positions: PositionRows<f64>) -> Positions {
        Positions::F64(positions)
    }
    fn given(positions: &[[f64; 3]]) -> NewPositions<'_> {
        NewPositions(Given::F64(positions))
    }
}

/// Refuses positions that are not finite; the error names the first.
pub(crate) fn check_positions<R: Real>(body: BodyId, positions: &[[R; 3]]) -> Result<(), Error> {
    // One branch per chunk keeps the common case, all positions good, at memory speed.
    for (chunk_ix, chunk) in positions.chunks(1024).enumerate() {
        if R::all_finite(chunk.as_flattened()) {
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
        }
    }
    Ok(())
}
