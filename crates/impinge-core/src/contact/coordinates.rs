//! The coordinates of a corner, each the exact number rounded to nearest.
//!
//! A corner is a vertex, or the point where a segment pq crosses a plane or another segment's line.
//! That point is `(|Q| p + |P| q) / (|P| + |Q|)`. P and Q are determinants of different signs that
//! measure how far p and q are from the plane or line: `orient3d` for a plane, `orient2d` in a
//! projection for a line. Nothing cancels in the sum, so the weight of q is as precise as P and Q.
//!
//! Three stages, each with a bound on its own error. A stage's result counts when all numbers
//! within its bound round to the same one:
//!
//! 1. `f64`, for bodies in single precision;
//! 2. sums of two `f64` ([`Double`]), for either;
//! 3. integers, which have no error.
//!
//! So the coordinates depend on the exact point alone. They are the same on every machine, and
//! whichever pair of triangles leads to the point.

use super::double::{self, Double};
use impinge_exact::Point;
use impinge_exact::internal::{Integer, Projection, unit_of};

/// The precision to which coordinates are rounded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) enum Rounding {
    /// 24 bits.
    Single,
    /// 53 bits.
    Double,
}

/// A corner by the points that define it.
#[derive(Debug, Clone, Copy)]
pub(super) enum Definition {
    Vertex(Point),
    /// Where the segment between the first two points crosses the plane of the others.
    OnPlane([Point; 2], [Point; 3]),
    /// Where two segments of one plane cross.
    OnLine([Point; 2], [Point; 2]),
}

impl Definition {
    /// The coordinates, rounded to nearest, ties to even. A vertex has the coordinates that it was
    /// given.
    pub fn rounded(&self, precision: Rounding) -> Point {
        let rounded = match self {
            Definition::Vertex(point) => *point,
            Definition::OnPlane(ends, plane) => {
                let offsets = ends.map(|end| Offset::Plane(end, *plane));
                crossing(ends, offsets, precision)
            }
            Definition::OnLine(ends, line) => crossing(ends, from_line(ends, line), precision),
        };
        // Turns minus zero into zero.
        rounded.map(|x| x + 0.0)
    }
}

/// How far two points are from the line through two others, which crosses the line of the two
/// points.
fn from_line([p, q]: &[Point; 2], line: &[Point; 2]) -> [Offset; 2] {
    // No end of one lies on the line of the other.
    let projection = Projection::injective(p, q, &line[0]).unwrap_or(Projection::ALL[0]);
    let line = line.map(|point| projection.apply(&point));
    [p, q].map(|end| Offset::Line(projection.apply(end), line))
}

/// How far a point is from a plane, or from a line in a plane through the point, as a determinant.
#[derive(Clone, Copy)]
enum Offset {
    Plane(Point, [Point; 3]),
    Line([f64; 2], [[f64; 2]; 2]),
}

/// The arithmetic in which determinants are computed.
trait Arithmetic:
    Copy + std::ops::Add<Output = Self> + std::ops::Sub<Output = Self> + std::ops::Mul<Output = Self>
{
    fn difference(a: f64, b: f64) -> Self;
}

impl Arithmetic for f64 {
    fn difference(a: f64, b: f64) -> Self {
        a - b
    }
}

impl Arithmetic for Double {
    fn difference(a: f64, b: f64) -> Self {
        Double::difference(a, b)
    }
}

impl Offset {
    /// The determinant, in the precision of `T`.
    fn value<T: Arithmetic>(&self) -> T {
        match *self {
            Offset::Plane(d, [a, b, c]) => {
                let [a, b, c] = [a, b, c].map(|p| [0, 1, 2].map(|k| T::difference(p[k], d[k])));
                a[2] * (b[0] * c[1] - c[0] * b[1])
                    + b[2] * (c[0] * a[1] - a[0] * c[1])
                    + c[2] * (a[0] * b[1] - b[0] * a[1])
            }
            Offset::Line(p, [r, s]) => {
                let [r, s] = [r, s].map(|q| [0, 1].map(|k| T::difference(q[k], p[k])));
                r[0] * s[1] - s[0] * r[1]
            }
        }
    }

    /// The sum of the products' magnitudes, in `f64`: errors are relative to it.
    fn permanent(&self) -> f64 {
        match *self {
            Offset::Plane(d, [a, b, c]) => {
                let [a, b, c] = [a, b, c].map(|p| [0, 1, 2].map(|k| (p[k] - d[k]).abs()));
                a[2] * (b[0] * c[1] + c[0] * b[1])
                    + b[2] * (c[0] * a[1] + a[0] * c[1])
                    + c[2] * (a[0] * b[1] + b[0] * a[1])
            }
            Offset::Line(p, [r, s]) => {
                let [r, s] = [r, s].map(|q| [0, 1].map(|k| (q[k] - p[k]).abs()));
                r[0] * s[1] + s[0] * r[1]
            }
        }
    }

    /// The largest magnitude of a coordinate.
    fn size(&self) -> f64 {
        let of = |coordinates: &[f64]| {
            coordinates
                .iter()
                .fold(0.0, |size: f64, x| size.max(x.abs()))
        };
        match self {
            Offset::Plane(d, plane) => of(d).max(of(plane.as_flattened())),
            Offset::Line(p, line) => of(p).max(of(line.as_flattened())),
        }
    }

    fn coordinates(&self) -> Vec<f64> {
        match self {
            Offset::Plane(d, plane) => [&d[..], plane.as_flattened()].concat(),
            Offset::Line(p, line) => [&p[..], line.as_flattened()].concat(),
        }
    }

    /// The determinant as an integer, for coordinates that are multiples of `2^unit`.
    fn exact(&self, unit: i64) -> Integer {
        let whole = |x: f64| Integer::of_multiple(x, unit);
        match self {
            Offset::Plane(d, plane) => {
                let [a, b, c] = plane.map(|p| [0, 1, 2].map(|k| &whole(p[k]) - &whole(d[k])));
                let minor =
                    |p: &[Integer; 3], q: &[Integer; 3]| &(&p[0] * &q[1]) - &(&q[0] * &p[1]);
                let [x, y, z] = [
                    &a[2] * &minor(&b, &c),
                    &b[2] * &minor(&c, &a),
                    &c[2] * &minor(&a, &b),
                ];
                &(&x + &y) + &z
            }
            Offset::Line(p, line) => {
                let [r, s] = line.map(|q| [0, 1].map(|k| &whole(q[k]) - &whole(p[k])));
                &(&r[0] * &s[1]) - &(&s[0] * &r[1])
            }
        }
    }
}

fn crossing(ends: &[Point; 2], offsets: [Offset; 2], precision: Rounding) -> Point {
    in_single(ends, offsets, precision)
        .or_else(|| in_double(ends, offsets, precision))
        .unwrap_or_else(|| in_integers(ends, offsets, precision))
}

/// Beyond these sizes of the larger permanent a product's rounding error may underflow, or a sum
/// overflow: with coordinates up to `LARGEST`, what underflows is below 2^-1073 times that.
/// Positions in single precision are all within.
const SAFE: std::ops::Range<f64> = 1e-200..1e200;
/// The same for positions in double precision.
const SAFE_DOUBLE: std::ops::Range<f64> = 1e-120..1e200;
/// The largest coordinate.
const LARGEST: f64 = 1e80;

/// More than the relative error of any one operation in `f64`, and more than Shewchuk's 7 + 56 u
/// for the determinant.
const ERROR_F64: f64 = 8.0 * f64::EPSILON / 2.0;

/// Stage 1: the weight of q and then the point in `f64`.
///
/// With P and Q known to ε each, the weight P / (P + Q) is known to ε / (P + Q), since both have
/// one sign.
fn in_single(ends: &[Point; 2], offsets: [Offset; 2], precision: Rounding) -> Option<Point> {
    if precision != Rounding::Single {
        return None;
    }
    let permanent = greatest(offsets, precision)?;
    let [p, q] = offsets.map(|offset| offset.value::<f64>().abs());
    let sum = p + q;
    let weight = p / sum;
    let weight_error = 2.0 * ERROR_F64 * permanent / sum + ERROR_F64;
    let mut point = [0.0; 3];
    for axis in 0..3 {
        let [from, to] = ends.map(|end| end[axis]);
        let x = from + (to - from) * weight;
        let size = from.abs() + to.abs();
        let error = size * (weight_error + ERROR_F64);
        point[axis] = single_between(x - error, x + error)?;
    }
    Some(point)
}

/// Stage 2: the same in sums of two `f64`.
fn in_double(ends: &[Point; 2], offsets: [Offset; 2], precision: Rounding) -> Option<Point> {
    // Each determinant has a depth of eight operations.
    const ERROR: f64 = 16.0 * double::ERROR;
    let permanent = greatest(offsets, precision)?;
    let [p, q] = offsets.map(|offset| offset.value::<Double>().abs());
    let sum = p + q;
    let weight = p / sum;
    let weight_error = 2.0 * ERROR * permanent / sum.high + ERROR;
    let mut point = [0.0; 3];
    for axis in 0..3 {
        let [from, to] = ends.map(|end| end[axis]);
        let size = from.abs() + to.abs();
        if size != 0.0 && !SAFE.contains(&size) {
            return None;
        }
        let x = Double::from(from) + Double::difference(to, from) * weight;
        // The last part is for the rounding of x.low ± error.
        let error = size * (weight_error + ERROR) + 4.0 * f64::EPSILON * x.low.abs();
        let (below, above) = (x.high + (x.low - error), x.high + (x.low + error));
        point[axis] = match precision {
            Rounding::Single => single_between(below, above)?,
            Rounding::Double => (below == above).then_some(below)?,
        };
    }
    Some(point)
}

/// The larger permanent; `None` unless sizes are safe.
fn greatest(offsets: [Offset; 2], precision: Rounding) -> Option<f64> {
    let [p, q] = offsets.map(|offset| offset.permanent());
    let greatest = p.max(q);
    let is_safe = match precision {
        Rounding::Single => SAFE.contains(&greatest),
        Rounding::Double => {
            SAFE_DOUBLE.contains(&greatest) && offsets.iter().all(|offset| offset.size() <= LARGEST)
        }
    };
    is_safe.then_some(greatest)
}

/// The single-precision number to which all numbers from `below` to `above` round; `None` if there
/// are several. Both ends may have been rounded to `f64`.
fn single_between(below: f64, above: f64) -> Option<f64> {
    let [below, above] = [below.next_down(), above.next_up()].map(|x| f64::from(x as f32));
    (below == above).then_some(below)
}

/// Stage 3: all coordinates as multiples of one power of two.
fn in_integers(ends: &[Point; 2], offsets: [Offset; 2], precision: Rounding) -> Point {
    let unit = offsets
        .iter()
        .flat_map(Offset::coordinates)
        .chain(ends.as_flattened().iter().copied())
        .filter_map(unit_of)
        .min()
        .unwrap_or(0);
    let [p, q] = offsets.map(|offset| offset.exact(unit).abs());
    let sum = &p + &q;
    let (bits, lowest) = match precision {
        Rounding::Single => (24, -149),
        Rounding::Double => (53, -1074),
    };
    [0, 1, 2].map(|axis| {
        let [from, to] = ends.map(|end| Integer::of_multiple(end[axis], unit));
        if sum.is_zero() {
            return ends[0][axis];
        }
        (&(&from * &q) + &(&to * &p)).quotient(&sum, unit, bits, lowest)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stages(definition: &Definition, precision: Rounding) -> [Option<Point>; 3] {
        let (ends, offsets) = match definition {
            Definition::Vertex(_) => unreachable!(),
            Definition::OnPlane(ends, plane) => (ends, ends.map(|end| Offset::Plane(end, *plane))),
            Definition::OnLine(ends, line) => (ends, from_line(ends, line)),
        };
        [
            in_single(ends, offsets, precision),
            in_double(ends, offsets, precision),
            Some(in_integers(ends, offsets, precision)),
        ]
    }

    /// A stage that gives a result agrees with integers, and it mostly gives one.
    #[test]
    fn stages_agree() {
        let mut random = impinge_testing::random::Random::new(7);
        let mut sure = [0usize; 2];
        let mut n = 0usize;
        for round in 0..6_000 {
            let precision = [Rounding::Single, Rounding::Double][round % 2];
            let scale = [1.0, 1e-3, 1e12, 1e-25][round / 2 % 4];
            let mut point = || {
                random.point(-1.0, 1.0).map(|x| match precision {
                    Rounding::Single => f64::from(x * scale as f32),
                    Rounding::Double => f64::from(x) * 1.1 * scale,
                })
            };
            let definition = match round % 6 {
                0 | 1 => {
                    // Four points in the plane x = z, and where the segments between them cross.
                    let [p, q, r, s] = [0; 4].map(|_| {
                        let [x, y, _] = point();
                        [x, y, x]
                    });
                    let turn = |a: &Point, b: &Point, c: &Point| {
                        impinge_exact::orient2d([a[0], a[1]], [b[0], b[1]], [c[0], c[1]])
                    };
                    if !turn(&p, &q, &r).strictly_opposite(turn(&p, &q, &s))
                        || !turn(&r, &s, &p).strictly_opposite(turn(&r, &s, &q))
                    {
                        continue;
                    }
                    Definition::OnLine([p, q], [r, s])
                }
                _ => {
                    let plane = [point(), point(), point()];
                    let [p, q] = [point(), point()];
                    let height =
                        |x: &Point| impinge_exact::orient3d(&plane[0], &plane[1], &plane[2], x);
                    if !height(&p).strictly_opposite(height(&q)) {
                        continue;
                    }
                    Definition::OnPlane([p, q], plane)
                }
            };
            n += 1;
            let [first, second, exact] = stages(&definition, precision);
            for (stage, found) in [first, second].into_iter().enumerate() {
                if let Some(found) = found {
                    assert_eq!(Some(found), exact, "stage {stage} of {definition:?}");
                    sure[stage] += 1;
                }
            }
            assert_eq!(definition.rounded(precision), exact.unwrap());
        }
        assert!(
            n > 1_500 && sure[0] > n * 4 / 10 && sure[1] > n * 9 / 10,
            "{sure:?} of {n}"
        );
    }
}
