//! Which of two elements is nearer to a point, and how near an element is at least.
//!
//! Between two elements exact fractions decide. For searches there are floats that certainly
//! enclose a distance.

use core::cmp::Ordering;

use super::features::PolygonPart;
use super::filter;
use super::nearest::ExactPolygon;
use super::reach::Reach;
use crate::Point;
use crate::element_pair::ElementPair;

/// A point and an element of one to three corners as a pair of elements. A longer list counts as
/// its first three corners.
#[inline]
pub fn paired(point: &Point, corners: &[Point]) -> (ElementPair, [Point; 4]) {
    let pair = match corners.len() {
        0 | 1 => ElementPair::VertexVertex,
        2 => ElementPair::VertexEdge,
        _ => ElementPair::VertexFace,
    };
    let mut points = [*point; 4];
    for (to, from) in points[1..].iter_mut().zip(corners) {
        *to = *from;
    }
    (pair, points)
}

/// Two numbers between which the distance of a point from an element of one to three corners
/// certainly is.
#[inline]
pub fn point_distance_bounds(point: &Point, corners: &[Point]) -> [f64; 2] {
    let (pair, points) = paired(point, corners);
    filter::bounds(pair, &points).unwrap_or([0.0, f64::INFINITY])
}

/// The number of the part of the element that is nearest to a point, as filters give it; of no
/// part, where floats cannot tell.
pub fn nearest_part_of_element(point: &Point, corners: &[Point]) -> u8 {
    let (pair, points) = paired(point, corners);
    filter::part_number(pair, &points)
}

/// Which of two elements of one to three corners is nearer to a point: exact. Numbers of their
/// nearest parts, where they are known, save work.
pub fn compare_point_distances(point: &Point, a: (&[Point], u8), b: (&[Point], u8)) -> Ordering {
    // Features in common are met often: neighbours share the edge or the vertex that is nearest.
    if let (Some(of_a), Some(of_b)) = (feature(a), feature(b))
        && of_a == of_b
    {
        return Ordering::Equal;
    }
    let [(a, of_a), (b, of_b)] = [a, b].map(|(corners, part)| {
        let (pair, points) = paired(point, corners);
        let polygon = ExactPolygon::of_any_size(pair, &points, &Reach::from(0.0));
        let nearest = PolygonPart::numbered(part).unwrap_or_else(|| polygon.nearest());
        (polygon, nearest)
    });
    a.compare_distances(of_a, (&b, of_b))
}

/// The ends of the edge, or twice the vertex, that is a part; none for the inside of a face.
fn feature((corners, part): (&[Point], u8)) -> Option<[Point; 2]> {
    match PolygonPart::numbered(part)? {
        PolygonPart::Face => None,
        PolygonPart::Corner(ix) => Some([*corners.get(ix)?; 2]),
        PolygonPart::Edge(ix) => {
            let ends = [*corners.get(ix)?, corners[(ix + 1) % corners.len()]];
            // One name for both directions.
            Some(if ends[0] < ends[1] {
                ends
            } else {
                [ends[1], ends[0]]
            })
        }
    }
}
