//! The two determinants that everything else is made of, with exact signs.

use super::Point;
use super::algebra::{Integer, common_integers};
use super::sign::Sign;
use robust::{Coord, Coord3D};

/// Whether no two of the signs are strictly opposite: all at least zero, or all at most zero.
#[inline]
pub(super) fn on_one_side(signs: &[Sign]) -> bool {
    signs.iter().all(|&s| s != Sign::Negative) || signs.iter().all(|&s| s != Sign::Positive)
}

/// Whether all signs are nonzero and equal: all points strictly on one side of the plane.
#[inline]
pub(super) fn strictly_on_one_side(signs: &[Sign]) -> bool {
    signs.iter().all(|&s| s == Sign::Positive) || signs.iter().all(|&s| s == Sign::Negative)
}

/// The exact sign of `|a-c  b-c|` in the plane: [`Sign::Positive`] when a, b, c turn to the left,
/// [`Sign::Zero`] when they lie on one line (or coincide).
///
/// Exact for all finite coordinates.
///
/// ```
/// use impinge_exact::{Sign, orient2d};
/// assert_eq!(orient2d([0.0, 0.0], [1.0, 0.0], [0.0, 1.0]), Sign::Positive);
/// assert_eq!(orient2d([0.1, 0.1], [0.2, 0.2], [0.3, 0.3]), Sign::Zero);
/// ```
#[inline]
#[must_use]
pub fn orient2d(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> Sign {
    let [[ax, ay], [bx, by]] = [a, b].map(|p| [p[0] - c[0], p[1] - c[1]]);
    let (left, right) = (ax * by, ay * bx);
    let (det, bound) = (
        left - right,
        ORIENT2D_BOUND * (left.abs() + right.abs()) + UNDERFLOW,
    );
    if det > bound {
        return Sign::Positive;
    }
    if -det > bound {
        return Sign::Negative;
    }
    orient2d_adaptive(a, b, c)
}

/// The stages of growing precision behind [`orient2d`].
#[inline(never)]
fn orient2d_adaptive(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> Sign {
    if a == b || b == c || c == a {
        return Sign::Zero;
    }
    if !are_moderate([a, b, c].as_flattened()) {
        return orient2d_in_integers(a, b, c);
    }
    let coord = |p: [f64; 2]| Coord { x: p[0], y: p[1] };
    Sign::of(robust::orient2d(coord(a), coord(b), coord(c)))
}

#[cold]
#[inline(never)]
fn orient2d_in_integers(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> Sign {
    let ([ax, ay, bx, by, cx, cy], _) = common_integers([a[0], a[1], b[0], b[1], c[0], c[1]]);
    let left = &(&ax - &cx) * &(&by - &cy);
    let right = &(&ay - &cy) * &(&bx - &cx);
    (&left - &right).sign()
}

/// Whether all coordinates are zero or between 2^-250 and 2^250 in magnitude. Then no product,
/// error term or bound of the adaptive stages underflows or overflows (`docs/exactness.md`,
/// "Range"). False for NaN.
#[inline]
fn are_moderate(coordinates: &[f64]) -> bool {
    const SMALLEST: f64 = f64::from_bits((1023 - 250) << 52);
    const LARGEST: f64 = f64::from_bits((1023 + 250) << 52);
    coordinates.iter().fold(true, |all, x| {
        let size = x.abs();
        all & ((size == 0.0) | (SMALLEST..=LARGEST).contains(&size))
    })
}

/// More than 3 + 16 half-ulps, Shewchuk's bound for the first stage of `orient2d`.
const ORIENT2D_BOUND: f64 = 4.0 * HALF_ULP;

/// 2^-1000, far above what is lost where a product underflows.
const UNDERFLOW: f64 = f64::from_bits((1023 - 1000) << 52);

/// 7 + 56 half-ulps, Shewchuk's bound for the first stage of `orient3d`, rounded up.
const ORIENT3D_BOUND: f64 = 7.0 * HALF_ULP + 64.0 * HALF_ULP * HALF_ULP;

/// The unit roundoff of `f64`, 2^-53.
const HALF_ULP: f64 = f64::EPSILON / 2.0;

/// The exact sign of the determinant with rows a-d, b-d, c-d: on which side of the plane through
/// a, b, c the point d lies.
///
/// [`Sign::Positive`] when a, b, c appear clockwise as seen from d, [`Sign::Zero`] when all four
/// lie in one plane. Exact for all finite coordinates.
///
/// ```
/// use impinge_exact::{Sign, orient3d};
/// let (a, b, c) = ([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
/// assert_eq!(orient3d(&a, &b, &c, &[0.0, 0.0, -1.0]), Sign::Positive);
/// assert_eq!(orient3d(&a, &b, &c, &[1e30, 5.0, 0.0]), Sign::Zero);
/// assert_eq!(orient3d(&a, &b, &c, &[1e30, 5.0, 1e-40]), Sign::Negative);
/// ```
#[inline]
#[must_use]
pub fn orient3d(a: &Point, b: &Point, c: &Point, d: &Point) -> Sign {
    let [ax, ay, az] = [a[0] - d[0], a[1] - d[1], a[2] - d[2]];
    let [bx, by, bz] = [b[0] - d[0], b[1] - d[1], b[2] - d[2]];
    let [cx, cy, cz] = [c[0] - d[0], c[1] - d[1], c[2] - d[2]];
    let (bc, cb) = (bx * cy, cx * by);
    let (ca, ac) = (cx * ay, ax * cy);
    let (ab, ba) = (ax * by, bx * ay);
    let det = az * (bc - cb) + bz * (ca - ac) + cz * (ab - ba);
    let permanent = az.abs() * (bc.abs() + cb.abs())
        + bz.abs() * (ca.abs() + ac.abs())
        + cz.abs() * (ab.abs() + ba.abs());
    // A product of two differences that underflows is wrong by less than 2^-1074, and that times
    // the third.
    let bound = ORIENT3D_BOUND * permanent + UNDERFLOW * (az.abs() + bz.abs() + cz.abs() + 1.0);
    if det > bound {
        return Sign::Positive;
    }
    if -det > bound {
        return Sign::Negative;
    }
    orient3d_adaptive(a, b, c, d, permanent)
}

/// The stages of growing precision behind [`orient3d`], out of line because they are rare.
///
/// The usual reason to get here is that two points coincide (meshes whose vertices are not
/// welded), which would need the last stage.
#[cold]
#[inline(never)]
fn orient3d_adaptive(a: &Point, b: &Point, c: &Point, d: &Point, permanent: f64) -> Sign {
    if !are_moderate([*a, *b, *c, *d].as_flattened()) {
        return orient3d_in_integers(a, b, c, d);
    }
    // A computed difference is zero only if the exact one is, and nothing underflows. So a
    // zero permanent means that all six products are zero. Axis-aligned input often ends here.
    if permanent == 0.0 {
        return Sign::Zero;
    }
    if a == b || a == c || a == d || b == c || b == d || c == d {
        return Sign::Zero;
    }
    let coord = |p: &Point| Coord3D {
        x: p[0],
        y: p[1],
        z: p[2],
    };
    Sign::of(robust::orient3d(coord(a), coord(b), coord(c), coord(d)))
}

/// [`orient3d`] for coordinates that are very small, very large, or both.
#[cold]
#[inline(never)]
fn orient3d_in_integers(a: &Point, b: &Point, c: &Point, d: &Point) -> Sign {
    if a == b || a == c || a == d || b == c || b == d || c == d {
        return Sign::Zero;
    }
    let points = [a, b, c, d];
    let numbers: [f64; 12] = core::array::from_fn(|ix| points[ix / 3][ix % 3]);
    let (integers, _) = common_integers(numbers);
    let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = [0, 3, 6]
        .map(|first| [0, 1, 2].map(|axis: usize| &integers[first + axis] - &integers[9 + axis]));
    let minor = |x: &Integer, v: &Integer, u: &Integer, y: &Integer| &(x * v) - &(u * y);
    let det = &az * &minor(&bx, &cy, &cx, &by);
    let det = &det + &(&bz * &minor(&cx, &ay, &ax, &cy));
    let det = &det + &(&cz * &minor(&ax, &by, &bx, &ay));
    det.sign()
}

/// A projection onto a coordinate plane: the axis that is dropped, as the two that stay.
#[derive(Clone, Copy, Debug)]
pub struct Projection([usize; 2]);

impl Projection {
    /// The three projections.
    pub const ALL: [Self; 3] = [Self([0, 1]), Self([1, 2]), Self([2, 0])];

    /// The two coordinates that stay.
    #[inline]
    pub fn apply(self, p: &Point) -> [f64; 2] {
        [p[self.0[0]], p[self.0[1]]]
    }

    /// The two coordinates that stay, of three points.
    #[inline]
    pub(super) fn apply_all(self, points: &[Point; 3]) -> [[f64; 2]; 3] {
        points.each_ref().map(|point| self.apply(point))
    }

    /// The turn of the projected points.
    #[inline]
    pub fn turn(self, a: &Point, b: &Point, c: &Point) -> Sign {
        orient2d(self.apply(a), self.apply(b), self.apply(c))
    }

    /// A projection in which a, b, c do not lie on one line, so that it is one-to-one on their
    /// plane; `None` if the three lie on one line.
    #[inline]
    pub fn injective(a: &Point, b: &Point, c: &Point) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|projection| !projection.turn(a, b, c).is_zero())
    }
}

/// Whether three points lie on one line (or coincide).
#[inline]
pub fn collinear(a: &Point, b: &Point, c: &Point) -> bool {
    Projection::injective(a, b, c).is_none()
}
