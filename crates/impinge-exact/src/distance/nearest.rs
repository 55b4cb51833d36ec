//! Which features of two elements are nearest, and whether they are within a distance; in integers.

use core::cmp::Ordering;

use super::features::{NearestFeatures, PolygonPart};
use super::filter;
use super::reach::Reach;
use super::{WholeVector, cross, difference, dot};
use crate::algebra::{Coordinate, Eight, Factor, Four, Integer, Two, Unit, Whole, common_integers};
use crate::element_pair::ElementPair;
use crate::{Point, Sign};

/// The nearest features of two elements.
///
/// The points and their order are those of the [`ElementPair`]. Exact for finite coordinates.
///
/// ```
/// use impinge_exact::{ElementPair, Feature, nearest_features};
/// let points = [[0.0, -9.0, 3.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]];
/// let nearest = nearest_features(ElementPair::VertexFace, &points);
/// assert_eq!((nearest.a, nearest.b), (Feature::Vertex(0), Feature::Edge(0)));
/// assert_eq!(nearest.name(ElementPair::VertexFace), "P_E0");
/// ```
#[must_use]
pub fn nearest_features(pair: ElementPair, points: &[Point; 4]) -> NearestFeatures {
    if let Some(part) = filter::nearest_part(pair, points) {
        return part.named(pair, false);
    }
    nearest_features_exactly(pair, points)
}

/// A function of its own, so that the filter's stack frame stays small.
#[inline(never)]
fn nearest_features_exactly(pair: ElementPair, points: &[Point; 4]) -> NearestFeatures {
    let reach = Reach::from(0.0);
    match ExactPolygon::short(pair, points, &reach) {
        Some(polygon) => polygon.nearest_features(pair),
        None => ExactPolygon::of_any_size(pair, points, &reach).nearest_features(pair),
    }
}

/// [`are_within`](super::are_within) by integers alone.
pub(super) fn are_within(pair: ElementPair, points: &[Point; 4], reach: &Reach) -> bool {
    compare(pair, points, reach) != Sign::Positive
}

/// The sign of how much farther apart than a distance two elements are, by integers alone.
pub(super) fn compare(pair: ElementPair, points: &[Point; 4], reach: &Reach) -> Sign {
    match ExactPolygon::short(pair, points, reach) {
        Some(polygon) => polygon.compare(),
        None => ExactPolygon::of_any_size(pair, points, reach).compare(),
    }
}

/// The difference polygon at one moment, and a distance, as integers times one power of two.
pub(super) struct ExactPolygon<T: Coordinate> {
    n_corners: usize,
    /// With fewer than four corners, the list repeats.
    corners: [WholeVector<T>; 4],
    /// From each corner to the next. A single corner has no edge, a segment one.
    edges: [WholeVector<T>; 4],
    normal: Option<WholeVector<Two<T>>>,
    distance: T,
    /// The exponent of the power of two.
    pub(super) exponent: i64,
}

impl ExactPolygon<i64> {
    /// The polygon in integers of fixed width, if its coordinates and the distance are short
    /// enough.
    pub(super) fn short(pair: ElementPair, points: &[Point; 4], reach: &Reach) -> Option<Self> {
        let numbers = pair.corners();
        let n_corners = numbers.len();
        let pairs = core::array::from_fn(|ix| numbers[ix % n_corners].map(|ix| &points[ix]));
        let (unit, corners) = Unit::differences(pairs, reach.high)?;
        let mut is_whole = true;
        let mut distance = 0;
        for &part in &reach.parts {
            let (part, is_part) = unit.count(part);
            is_whole &= is_part;
            distance += part;
        }
        is_whole.then(|| Self::new(n_corners, corners, distance, unit.exponent))
    }
}

impl ExactPolygon<Integer> {
    /// The polygon in integers of any size.
    pub(super) fn of_any_size(pair: ElementPair, points: &[Point; 4], reach: &Reach) -> Self {
        let finite = |x: f64| if x.is_finite() { x } else { 0.0 };
        let numbers: [f64; 12 + Reach::PARTS] = core::array::from_fn(|ix| match ix {
            12.. => finite(reach.parts[ix - 12]),
            _ => finite(points[ix / 3][ix % 3]),
        });
        let (integers, exponent) = common_integers(numbers);
        let coordinate = |i: usize, j: usize, k: usize| &integers[3 * i + k] - &integers[3 * j + k];
        let numbers = pair.corners();
        let corners = core::array::from_fn(|ix| {
            let [i, j] = numbers[ix % numbers.len()];
            core::array::from_fn(|k| coordinate(i, j, k))
        });
        let distance = Reach::sum(&integers[12..]);
        Self::new(numbers.len(), corners, distance, exponent)
    }

    /// Which of two polygons is nearer to the origin, given their nearest parts.
    pub(super) fn compare_distances(
        &self,
        nearest: PolygonPart,
        (other, of_other): (&Self, PolygonPart),
    ) -> Ordering {
        let (over, under) = self.square_of_distance(nearest);
        let (over_other, under_other) = other.square_of_distance(of_other);
        // Squares are over 4 to the exponent.
        let exponents = [self, other].map(|polygon| 2 * polygon.exponent);
        let least = exponents[0].min(exponents[1]);
        let [shift, shift_other] =
            exponents.map(|exponent| u64::try_from(exponent - least).expect("not below the least"));
        let left = (&over * &under_other).shifted(shift);
        let right = (&over_other * &under).shifted(shift_other);
        (&left - &right).sign().order()
    }
}

impl<T: Coordinate> ExactPolygon<T> {
    fn new(n_corners: usize, corners: [WholeVector<T>; 4], distance: T, exponent: i64) -> Self {
        let edges: [WholeVector<T>; 4] =
            core::array::from_fn(|ix| difference(&corners[(ix + 1) % n_corners], &corners[ix]));
        let normal = (n_corners > 2)
            .then(|| cross(&edges[0], &edges[1]))
            .filter(|normal| !normal.iter().all(|x| x.sign().is_zero()));
        Self {
            n_corners,
            corners,
            edges,
            normal,
            distance,
            exponent,
        }
    }

    pub(super) fn corners(&self) -> &[WholeVector<T>] {
        &self.corners[..self.n_corners]
    }

    /// From each corner to the next. A single corner has no edge, a segment one.
    pub(super) fn edges(&self) -> &[WholeVector<T>] {
        let n = self.n_corners;
        &self.edges[..if n > 2 { n } else { n - 1 }]
    }

    /// Whether it has more than two corners but no normal.
    pub(super) fn is_flat(&self) -> bool {
        self.n_corners > 2 && self.normal.is_none()
    }

    /// The nearest part, and whether its distance is 0.
    pub(super) fn nearest_and_touching(&self) -> (PolygonPart, bool) {
        let nearest = self.nearest();
        let (over, _) = self.square_of_distance(nearest);
        (nearest, over.sign().is_zero())
    }

    fn nearest_features(&self, pair: ElementPair) -> NearestFeatures {
        self.nearest().named(pair, self.is_flat())
    }

    /// The sign of how much farther away than the distance the origin is.
    pub(super) fn compare(&self) -> Sign {
        let (over, under) = self.square_of_distance(self.nearest());
        let square = self.distance.product(&self.distance).widened();
        over.minus(&square.product(&under)).sign()
    }

    fn after(&self, ix: usize) -> &WholeVector<T> {
        &self.corners[(ix + 1) % self.n_corners]
    }

    /// Whether the origin's projection onto the line of an edge is strictly between the ends.
    fn is_beside(&self, ix: usize) -> bool {
        dot(&self.corners[ix], &self.edges[ix]).sign() == Sign::Negative
            && dot(self.after(ix), &self.edges[ix]).sign() == Sign::Positive
    }

    /// The part whose relative interior contains the nearest point.
    pub(super) fn nearest(&self) -> PolygonPart {
        match &self.normal {
            Some(normal) => self.nearest_of_polygon(normal),
            None => self.nearest_of_segment(),
        }
    }

    /// The nearest part of a polygon with a normal. If the origin's projection is in the polygon,
    /// that is the face. If the projection is beyond an edge and between its ends, it is that edge.
    /// Else it is the corner from which both edges lead away from the origin.
    fn nearest_of_polygon(&self, normal: &WholeVector<Two<T>>) -> PolygonPart {
        let n = self.n_corners;
        let mut is_inner = [Sign::Positive; 4];
        for (ix, edge) in self.edges().iter().enumerate() {
            is_inner[ix] = dot(normal, &cross(&self.corners[ix], edge)).sign();
        }
        if is_inner.iter().all(|&sign| sign == Sign::Positive) {
            return PolygonPart::Face;
        }
        let edge = (0..n).find(|&ix| is_inner[ix] != Sign::Positive && self.is_beside(ix));
        if let Some(ix) = edge {
            return PolygonPart::Edge(ix);
        }
        let is_nearest = |ix: &usize| {
            let before = (ix + n - 1) % n;
            dot(&self.corners[*ix], &self.edges[*ix]).sign() != Sign::Negative
                && dot(&self.corners[*ix], &self.edges[before]).sign() != Sign::Positive
        };
        PolygonPart::Corner((0..n).find(is_nearest).unwrap_or(0))
    }

    /// The nearest part of a segment or a point: the nearest of its corners and of the edges that
    /// the origin is beside.
    fn nearest_of_segment(&self) -> PolygonPart {
        // The order of ipc-toolkit's names: EA0_EB0, EA0_EB1, EA1_EB0, EA1_EB1, EA_EB0, EA_EB1,
        // EA0_EB, EA1_EB.
        let (corner_order, edge_order): (&[usize], &[usize]) = match self.n_corners {
            1 => (&[0], &[]),
            2 => (&[0, 1], &[0]),
            3 => (&[0, 1, 2], &[0, 1, 2]),
            _ => (&[0, 3, 1, 2], &[0, 2, 3, 1]),
        };
        let square = |ix: usize| dot(&self.corners[ix], &self.corners[ix]);
        let mut part = corner_order[0];
        let mut least = square(part);
        for &ix in &corner_order[1..] {
            let other = square(ix);
            if other.minus(&least).sign() == Sign::Negative {
                (part, least) = (ix, other);
            }
        }
        let mut nearest = PolygonPart::Corner(part);
        let mut least = (least.widened(), Four::<T>::one());
        for &ix in edge_order.iter().filter(|&&ix| self.is_beside(ix)) {
            let other = self.square_of_border(PolygonPart::Edge(ix));
            let (left, right) = (other.0.product(&least.1), least.0.product(&other.1));
            if left.minus(&right).sign() == Sign::Negative {
                (nearest, least) = (PolygonPart::Edge(ix), other);
            }
        }
        nearest
    }

    /// The square of the origin's distance from the line, plane or point of a part, as a fraction.
    pub(super) fn square_of_distance(&self, part: PolygonPart) -> (Eight<T>, Four<T>) {
        match (part, &self.normal) {
            (PolygonPart::Face, Some(normal)) => {
                let corner = self.corners[0].each_ref().map(T::widened);
                let f = dot(normal, &corner);
                (f.product(&f), dot(normal, normal))
            }
            _ => {
                let (over, under) = self.square_of_border(part);
                (over.widened(), under)
            }
        }
    }

    /// The square of the origin's distance from a corner or the line of an edge, as a fraction.
    fn square_of_border(&self, part: PolygonPart) -> (Four<T>, Four<T>) {
        match part {
            PolygonPart::Edge(ix) => {
                let edge = &self.edges[ix];
                let moment = cross(&self.corners[ix], edge);
                (dot(&moment, &moment), dot(edge, edge).widened())
            }
            PolygonPart::Corner(ix) => {
                let corner = &self.corners[ix];
                (dot(corner, corner).widened(), Four::<T>::one())
            }
            PolygonPart::Face => {
                unreachable!("a face is no border, and only a polygon with an inside has one")
            }
        }
    }
}
