//! Which features of two elements are nearest, and whether they are within a distance; in integers.

use std::cmp::Ordering;

use super::features::{Nearest, Part};
use super::filter;
use super::reach::Reach;
use super::{Vector, cross, difference, dot};
use crate::exact::algebra::{Integer, common_integers};
use crate::exact::element_pair::ElementPair;
use crate::exact::{Point, Sign};

/// The nearest features of two elements.
///
/// The points and their order are those of the [`ElementPair`]. Exact for coordinates [`in_range`](crate::exact::in_range).
///
/// ```
/// use impinge::exact::{ElementPair, Feature, nearest_features};
/// let points = [[0.0, -9.0, 3.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]];
/// let nearest = nearest_features(ElementPair::VertexFace, &points);
/// assert_eq!((nearest.a, nearest.b), (Feature::Vertex(0), Feature::Edge(0)));
/// assert_eq!(nearest.name(ElementPair::VertexFace), "P_E0");
/// ```
#[must_use]
pub fn nearest_features(pair: ElementPair, points: &[Point; 4]) -> Nearest {
    if let Some(part) = filter::nearest_part(pair, points) {
        return part.named(pair, false);
    }
    let polygon = Polygon::new(pair, points, &Reach::from(0.0));
    polygon.nearest().named(pair, polygon.is_flat())
}

/// [`are_within`](super::are_within) by integers alone.
pub(super) fn are_within(pair: ElementPair, points: &[Point; 4], reach: &Reach) -> bool {
    let polygon = Polygon::new(pair, points, reach);
    let nearest = polygon.nearest();
    let (over, under) = polygon.square_of_distance(nearest);
    let square = &polygon.distance * &polygon.distance;
    (&over - &(&square * &under)).sign() != Sign::Positive
}

/// The difference polygon at one moment, and a distance, as integers times one power of two.
pub(super) struct Polygon {
    pub(super) corners: Vec<Vector>,
    /// From each corner to the next: no edge for a single corner, one for a segment.
    pub(super) edges: Vec<Vector>,
    normal: Option<Vector>,
    distance: Integer,
    /// The exponent of the power of two.
    pub(super) exponent: i64,
}

impl Polygon {
    pub(super) fn new(pair: ElementPair, points: &[Point; 4], reach: &Reach) -> Self {
        let finite = |x: f64| if x.is_finite() { x } else { 0.0 };
        let numbers: [f64; 12 + Reach::PARTS] = std::array::from_fn(|ix| match ix {
            12.. => finite(reach.parts[ix - 12]),
            _ => finite(points[ix / 3][ix % 3]),
        });
        let (integers, exponent) = common_integers(numbers);
        let point = |ix: usize| -> Vector { std::array::from_fn(|k| integers[3 * ix + k].clone()) };
        let corners: Vec<Vector> = pair
            .corners()
            .iter()
            .map(|&[i, j]| difference(&point(i), &point(j)))
            .collect();
        let n = corners.len();
        let n_edges = if n > 2 { n } else { n - 1 };
        let edges: Vec<Vector> = (0..n_edges)
            .map(|ix| difference(&corners[(ix + 1) % n], &corners[ix]))
            .collect();
        let normal = (n > 2)
            .then(|| cross(&edges[0], &edges[1]))
            .filter(|normal| !normal.iter().all(Integer::is_zero));
        Self {
            corners,
            edges,
            normal,
            distance: Reach::sum(&integers[12..]),
            exponent,
        }
    }

    /// Whether it has more than two corners but no normal.
    pub(super) fn is_flat(&self) -> bool {
        self.corners.len() > 2 && self.normal.is_none()
    }

    fn after(&self, ix: usize) -> &Vector {
        &self.corners[(ix + 1) % self.corners.len()]
    }

    /// Whether the origin's projection onto the line of an edge is strictly between the ends.
    fn is_beside(&self, ix: usize) -> bool {
        dot(&self.corners[ix], &self.edges[ix]).sign() == Sign::Negative
            && dot(self.after(ix), &self.edges[ix]).sign() == Sign::Positive
    }

    /// The part whose relative interior contains the nearest point.
    pub(super) fn nearest(&self) -> Part {
        match &self.normal {
            Some(normal) => self.nearest_of_polygon(normal),
            None => self.nearest_of_segment(),
        }
    }

    /// The nearest part of a polygon with a normal. If the origin's projection is in the polygon, that is the face. If the
    /// projection is beyond an edge and between its ends, it is that edge. Else it is the corner from which both edges lead
    /// away from the origin.
    fn nearest_of_polygon(&self, normal: &Vector) -> Part {
        let is_inner: Vec<Sign> = (0..self.edges.len())
            .map(|ix| dot(normal, &cross(&self.corners[ix], &self.edges[ix])).sign())
            .collect();
        if is_inner.iter().all(|&sign| sign == Sign::Positive) {
            return Part::Face;
        }
        let edge =
            (0..self.edges.len()).find(|&ix| is_inner[ix] != Sign::Positive && self.is_beside(ix));
        if let Some(ix) = edge {
            return Part::Edge(ix);
        }
        let n = self.corners.len();
        let is_nearest = |ix: &usize| {
            let before = (ix + n - 1) % n;
            dot(&self.corners[*ix], &self.edges[*ix]).sign() != Sign::Negative
                && dot(&self.corners[*ix], &self.edges[before]).sign() != Sign::Positive
        };
        Part::Corner((0..n).find(is_nearest).unwrap_or(0))
    }

    /// The nearest part of a segment or a point: the nearest of its corners and of the edges that the origin is beside.
    fn nearest_of_segment(&self) -> Part {
        // The order of ipc-toolkit's names: EA0_EB0, EA0_EB1, EA1_EB0, EA1_EB1, EA_EB0, EA_EB1, EA0_EB, EA1_EB.
        let (corner_order, edge_order): (&[usize], &[usize]) = match self.corners.len() {
            1 => (&[0], &[]),
            2 => (&[0, 1], &[0]),
            3 => (&[0, 1, 2], &[0, 1, 2]),
            _ => (&[0, 3, 1, 2], &[0, 2, 3, 1]),
        };
        let corners = corner_order.iter().map(|&ix| Part::Corner(ix));
        let edges = edge_order
            .iter()
            .filter(|&&ix| self.is_beside(ix))
            .map(|&ix| Part::Edge(ix));
        corners
            .chain(edges)
            .reduce(|best, part| match self.compare(part, best) {
                Ordering::Less => part,
                _ => best,
            })
            .unwrap_or(Part::Corner(0))
    }

    fn compare(&self, a: Part, b: Part) -> Ordering {
        let (over_a, under_a) = self.square_of_distance(a);
        let (over_b, under_b) = self.square_of_distance(b);
        match (&(&over_a * &under_b) - &(&over_b * &under_a)).sign() {
            Sign::Negative => Ordering::Less,
            Sign::Zero => Ordering::Equal,
            Sign::Positive => Ordering::Greater,
        }
    }

    /// The square of the origin's distance from the line, plane or point of a part, as a fraction.
    pub(super) fn square_of_distance(&self, part: Part) -> (Integer, Integer) {
        match (part, &self.normal) {
            (Part::Face, Some(normal)) => {
                let f = dot(normal, &self.corners[0]);
                (&f * &f, dot(normal, normal))
            }
            (Part::Edge(ix), _) => {
                let moment = cross(&self.corners[ix], &self.edges[ix]);
                (dot(&moment, &moment), dot(&self.edges[ix], &self.edges[ix]))
            }
            (Part::Corner(ix), _) => (dot(&self.corners[ix], &self.corners[ix]), Integer::from(1)),
            (Part::Face, None) => unreachable!("a polygon without inside has no face"),
        }
    }
}
