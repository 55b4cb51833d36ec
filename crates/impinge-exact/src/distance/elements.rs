//! Distances of elements by their corners: one vertex, two ends of an edge, three corners of a
//! face.
//!
//! An edge and a face, and two faces, that share no point are as near as some vertex and face of
//! theirs, or some two edges: `docs/exactness.md`, "Distances".

use alloc::vec::Vec;
use core::cell::OnceCell;
use core::cmp::Ordering;

use super::features::PolygonPart;
use super::keep::below_excess;
use super::nearest::ExactPolygon;
use super::reach::Reach;
use super::rounded::{self, between, quotient};
use super::{Feature, NearestFeatures, filter, nearest};
use crate::algebra::Integer;
use crate::element_pair::ElementPair;
use crate::triangle::{passes_inside, segment_meets_triangle};
use crate::{Point, triangles_intersect};

/// 2^-20
const POWER_20: f64 = 1.0 / (1 << 20) as f64;

/// The edges of a face as vertex numbers.
const EDGES: [[usize; 2]; 3] = [[0, 1], [1, 2], [2, 0]];

/// The features of two elements that are nearest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct NearestOfElements {
    /// The feature of the first element, and of the second.
    pub features: [Feature; 2],
    /// Whether nearest points may not be the only ones.
    pub is_parallel: bool,
}

impl From<NearestFeatures> for NearestOfElements {
    /// Of the two elements of a pair, in its order.
    fn from(nearest: NearestFeatures) -> Self {
        Self {
            features: [nearest.a, nearest.b],
            is_parallel: nearest.is_parallel,
        }
    }
}

impl NearestOfElements {
    /// What a filter's number of a part stands for (`crate::filter::Near16`): none if the part is
    /// not known.
    #[inline]
    pub fn of_part(pair: ElementPair, number: u8) -> Option<Self> {
        Some(PolygonPart::numbered(number)?.named(pair, false).into())
    }

    /// In one byte:
    ///
    /// ```text
    ///   7     6      5   3 2   0
    /// | 0 | parallel |  b  |  a  |   vertex i: i, the face: 3, edge i: 4 + i
    /// ```
    #[inline]
    pub fn packed(self) -> u8 {
        let [a, b] = self.features.map(|feature| match feature {
            Feature::Vertex(ix) => ix,
            Feature::Face => 3,
            Feature::Edge(ix) => 4 + ix,
        });
        u8::from(self.is_parallel) << 6 | b << 3 | a
    }

    /// From the byte that [`packed`](Self::packed) makes.
    #[inline]
    pub fn unpacked(byte: u8) -> Self {
        let feature = |number: u8| match number {
            0..3 => Feature::Vertex(number),
            3 => Feature::Face,
            _ => Feature::Edge(number - 4),
        };
        Self {
            // Maps of arrays are calls, which cost more than all of this.
            features: [feature(byte & 7), feature(byte >> 3 & 7)],
            is_parallel: byte >> 6 == 1,
        }
    }

    /// ipc-toolkit's name of the distance type, given which pair it is, and whether the second
    /// element comes first in that. An edge and a face, or two faces, have the names of the kinds
    /// of the features, without numbers.
    pub fn name(&self, pair: Option<(ElementPair, bool)>) -> &'static str {
        let [a, b] = self.features;
        if let Some((pair, is_swapped)) = pair {
            let (a, b) = if is_swapped { (b, a) } else { (a, b) };
            let is_parallel = self.is_parallel;
            return NearestFeatures { a, b, is_parallel }.name(pair);
        }
        match (a, b) {
            (Feature::Vertex(_), Feature::Vertex(_)) => "P_P",
            (Feature::Vertex(_), Feature::Edge(_)) | (Feature::Edge(_), Feature::Vertex(_)) => {
                "P_E"
            }
            (Feature::Vertex(_), _) | (_, Feature::Vertex(_)) => "P_T",
            (Feature::Edge(_), Feature::Edge(_)) => "E_E",
            // Where an edge passes through a face.
            (Feature::Face, _) | (_, Feature::Face) => "E_T",
        }
    }
}

/// Whether the distance of two elements of one to three corners is at most a reach, if plain floats
/// can decide it.
#[inline]
pub fn are_within_certainly(a: &[Point], b: &[Point], reach: &Reach) -> Option<bool> {
    if let Some(simple) = Simple::new(a, b) {
        return filter::answer(simple.pair, &simple.points, reach);
    }
    let mut all_apart = true;
    for part in parts(a, b) {
        match filter::answer(part.simple.pair, &part.simple.points, reach) {
            Some(true) => return Some(true),
            Some(false) => {}
            None => all_apart = false,
        }
    }
    match all_apart {
        // Elements may also cross far from their borders, where all parts are apart.
        true => Some(elements_meet(a, b)),
        false => None,
    }
}

/// [`elements_are_within`] for elements that [`are_within_certainly`] cannot decide.
pub fn unsure_are_within(a: &[Point], b: &[Point], reach: &Reach) -> bool {
    match Simple::new(a, b) {
        Some(Simple { pair, points, .. }) => nearest::are_within(pair, &points, reach),
        None => elements_are_within(a, b, reach),
    }
}

/// Whether the distance of two elements of one to three corners is at most a reach. Exact.
pub fn elements_are_within(a: &[Point], b: &[Point], reach: &Reach) -> bool {
    match Simple::new(a, b) {
        Some(Simple { pair, points, .. }) => super::are_within_reach(pair, &points, reach),
        None => {
            elements_meet(a, b)
                || parts(a, b).any(|part| {
                    let Simple { pair, points, .. } = part.simple;
                    super::are_within_reach(pair, &points, reach)
                })
        }
    }
}

/// The features of two elements of one to three corners that are nearest. Exact.
///
/// Of several pairs of features at the same distance it is the first of the smallest.
pub fn nearest_of_elements(a: &[Point], b: &[Point]) -> NearestOfElements {
    match Simple::new(a, b) {
        Some(simple) => simple.named(&super::nearest_features(simple.pair, &simple.points)),
        None if edge_passes_inside(a, b) => EDGE_THROUGH_FACE,
        None => Nearby::new(a, b).nearest,
    }
}

/// What is nearest where an edge passes through the inside of a face.
const EDGE_THROUGH_FACE: NearestOfElements = NearestOfElements {
    features: [Feature::Edge(0), Feature::Face],
    is_parallel: false,
};

/// Whether the elements are an edge and a face, and the open edge passes through the inside of the
/// face.
fn edge_passes_inside(a: &[Point], b: &[Point]) -> bool {
    match (a, b) {
        ([p, q], [r, s, t]) => passes_inside(p, q, &[*r, *s, *t]),
        _ => false,
    }
}

/// Nearest points of two elements of one to three corners, and their distance, rounded down: as in
/// [`closest_points`](super::closest_points).
pub fn closest_of_elements(a: &[Point], b: &[Point]) -> (NearestOfElements, f64, [Point; 2]) {
    if let Some(simple) = Simple::new(a, b) {
        let closest = super::closest_points(simple.pair, &simple.points);
        let points = simple.in_order(closest.points);
        return (simple.named(&closest.nearest), closest.distance, points);
    }
    if edge_passes_inside(a, b) {
        let point = where_crossed(&a[0], &a[1], &[b[0], b[1], b[2]]);
        return (EDGE_THROUGH_FACE, 0.0, [point, point]);
    }
    let nearby = Nearby::new(a, b);
    match nearby.way {
        Shortest::Between(simple) => {
            let closest = super::closest_points(simple.pair, &simple.points);
            let points = simple.in_order(closest.points);
            (nearby.nearest, closest.distance, points)
        }
        Shortest::Crossing(point) => (nearby.nearest, 0.0, [point, point]),
    }
}

/// A number that is at most the distance of two elements of one to three corners, and below it by
/// at most 2^-20 of it, or by a few times the smallest `f64`; 0 if and only if they touch or are as
/// near as that.
///
/// A bound in `f64` does for most pairs, and the largest `f64` that is not above the distance for
/// the others: the same bits on every machine.
pub fn distance_below(a: &[Point], b: &[Point]) -> f64 {
    match Simple::new(a, b) {
        Some(simple) => simple.distance_below(),
        None if elements_meet(a, b) => 0.0,
        None => parts(a, b)
            .map(|part| part.simple.distance_below())
            .fold(f64::INFINITY, f64::min),
    }
}

/// A number that is at most the distance of two elements of one to three corners minus the
/// thickness of both, and below that by at most 2^-20 of it, or by 2^-1045; 0 if and only if they
/// touch, or are at most as far apart as they are thick, or farther by less than that.
///
/// The thickness is an exact sum of two numbers. As in `distance_below`, a bound in `f64` does
/// for most pairs, and the distance rounded down for others; exact comparisons for those that are
/// left.
pub fn gap_below(a: &[Point], b: &[Point], thickness: [f64; 2]) -> f64 {
    if thickness == [0.0; 2] {
        return distance_below(a, b);
    }
    match Simple::new(a, b) {
        Some(simple) => simple.gap_below(thickness),
        None if elements_meet(a, b) => 0.0,
        None => parts(a, b)
            .map(|part| part.simple.gap_below(thickness))
            .fold(f64::INFINITY, f64::min),
    }
}

/// The distance of two elements of one to three corners that share no point, rounded down as in
/// [`closest_points`](super::closest_points), if that is below a limit.
pub fn distance_under(a: &[Point], b: &[Point], limit: f64) -> Option<f64> {
    if let Some(simple) = Simple::new(a, b) {
        return simple.distance_under(limit);
    }
    let mut least = None;
    for part in parts(a, b) {
        let limit = least.unwrap_or(limit);
        least = part.simple.distance_under(limit).or(least);
    }
    least
}

/// [`distance_below`] by bounds of the distance in `f64`
/// ([`distance_bounds`](crate::filter::distance_bounds)), where these do.
#[inline]
pub fn below_by_bounds([low, high]: [f64; 2]) -> Option<f64> {
    (low > high * (1.0 - POWER_20)).then_some(low)
}

/// [`gap_below`] by bounds of the distance in `f64`, where these do.
#[inline]
pub fn gap_by_bounds(bounds: [f64; 2], thickness: [f64; 2]) -> Option<f64> {
    if thickness == [0.0; 2] {
        return below_by_bounds(bounds);
    }
    let [low, high] = gap_between(bounds, thickness);
    if high <= 0.0 {
        return Some(0.0);
    }
    below_by_bounds([low, high]).filter(|&low| low > 0.0)
}

/// Numbers between which a distance minus a thickness is, by such numbers of the distance.
#[inline]
fn gap_between([low, high]: [f64; 2], [a, b]: [f64; 2]) -> [f64; 2] {
    let sum = a + b;
    [
        (low - sum.next_up()).next_down(),
        (high - sum.next_down()).next_up(),
    ]
}

/// Two elements that one [`ElementPair`] stands for.
#[derive(Clone, Copy)]
struct Simple {
    pair: ElementPair,
    points: [Point; 4],
    /// Whether the second element comes first.
    is_swapped: bool,
}

impl Simple {
    #[inline]
    fn new(a: &[Point], b: &[Point]) -> Option<Self> {
        let mut points = [[0.0; 3]; 4];
        let (pair, is_swapped) = match (a.len(), b.len()) {
            (1, 1) => (ElementPair::VertexVertex, false),
            (1, 2) => (ElementPair::VertexEdge, false),
            (2, 1) => (ElementPair::VertexEdge, true),
            (1, 3) => (ElementPair::VertexFace, false),
            (3, 1) => (ElementPair::VertexFace, true),
            (2, 2) => (ElementPair::EdgeEdge, false),
            _ => return None,
        };
        let (first, second) = if is_swapped { (b, a) } else { (a, b) };
        points[..first.len()].copy_from_slice(first);
        points[first.len()..first.len() + second.len()].copy_from_slice(second);
        Some(Self {
            pair,
            points,
            is_swapped,
        })
    }

    fn distance_below(&self) -> f64 {
        let bounds = filter::bounds(self.pair, &self.points);
        bounds
            .and_then(below_by_bounds)
            .unwrap_or_else(|| rounded::distance(self.pair, &self.points))
    }

    fn gap_below(&self, thickness: [f64; 2]) -> f64 {
        let bounds = filter::bounds(self.pair, &self.points);
        if let Some(gap) = bounds.and_then(|bounds| gap_by_bounds(bounds, thickness)) {
            return gap;
        }
        let distance = rounded::distance(self.pair, &self.points);
        let bounds = [distance, distance.next_up()];
        gap_by_bounds(bounds, thickness).unwrap_or_else(|| {
            let between = gap_between(bounds, thickness);
            below_excess(thickness, (self.pair, &self.points), between)
        })
    }

    fn distance_under(&self, limit: f64) -> Option<f64> {
        let bounds = filter::bounds(self.pair, &self.points);
        if bounds.is_some_and(|[low, _]| low >= limit) {
            return None;
        }
        Some(rounded::distance(self.pair, &self.points)).filter(|&distance| distance < limit)
    }

    fn in_order<T>(&self, [first, second]: [T; 2]) -> [T; 2] {
        if self.is_swapped {
            [second, first]
        } else {
            [first, second]
        }
    }

    fn named(&self, nearest: &NearestFeatures) -> NearestOfElements {
        NearestOfElements {
            features: self.in_order([nearest.a, nearest.b]),
            is_parallel: nearest.is_parallel,
        }
    }
}

/// A vertex and a face, or two edges, of two larger elements.
struct PartOfPair {
    simple: Simple,
    /// The numbers of the vertex, edge or face in each element.
    numbers: [usize; 2],
}

/// The number of a face in itself.
const WHOLE: usize = 0;

/// The vertices and faces, and the edges and edges, of an edge and a face or of two faces.
fn parts<'a>(a: &'a [Point], b: &'a [Point]) -> impl Iterator<Item = PartOfPair> + 'a {
    let edges = |of: &'a [Point]| EDGES.into_iter().take(if of.len() == 3 { 3 } else { 1 });
    let vertices_of_a = (0..a.len()).filter(|_| b.len() == 3).filter_map(|ix| {
        Some(PartOfPair {
            simple: Simple::new(&a[ix..=ix], b)?,
            numbers: [ix, WHOLE],
        })
    });
    let vertices_of_b = (0..b.len()).filter(|_| a.len() == 3).filter_map(|ix| {
        Some(PartOfPair {
            simple: Simple::new(a, &b[ix..=ix])?,
            numbers: [WHOLE, ix],
        })
    });
    let pairs_of_edges = edges(a).enumerate().flat_map(move |(m, [i, j])| {
        edges(b).enumerate().filter_map(move |(n, [k, l])| {
            Some(PartOfPair {
                simple: Simple::new(&[a[i], a[j]], &[b[k], b[l]])?,
                numbers: [m, n],
            })
        })
    });
    vertices_of_a.chain(vertices_of_b).chain(pairs_of_edges)
}

impl PartOfPair {
    /// The difference polygon in integers of any size.
    fn polygon(&self) -> ExactPolygon<Integer> {
        let Simple { pair, points, .. } = &self.simple;
        ExactPolygon::of_any_size(*pair, points, &Reach::from(0.0))
    }

    /// Features of the part as features of the elements, each with how many dimensions it has.
    fn features(&self, nearest: &NearestFeatures) -> [(u8, Feature); 2] {
        let number = |x: usize| u8::try_from(x).unwrap_or(0);
        let of_part = self.simple.in_order([nearest.a, nearest.b]);
        let is_edges = self.simple.pair == ElementPair::EdgeEdge;
        core::array::from_fn(|side| match of_part[side] {
            Feature::Vertex(end) if is_edges => {
                let corner = EDGES[self.numbers[side]][usize::from(end) % 2];
                (0, Feature::Vertex(number(corner)))
            }
            Feature::Edge(_) if is_edges => (1, Feature::Edge(number(self.numbers[side]))),
            // The vertex of a vertex and a face.
            Feature::Vertex(_) if (side == 0) != self.simple.is_swapped => {
                (0, Feature::Vertex(number(self.numbers[side])))
            }
            Feature::Vertex(ix) => (0, Feature::Vertex(ix)),
            Feature::Edge(ix) => (1, Feature::Edge(ix)),
            Feature::Face => (2, Feature::Face),
        })
    }
}

/// How two elements that no [`ElementPair`] stands for are nearest.
struct Nearby {
    nearest: NearestOfElements,
    way: Shortest,
}

enum Shortest {
    /// Nearest points of a vertex and a face, or of two edges.
    Between(Simple),
    /// Where an edge passes through a face.
    Crossing(Point),
}

impl Nearby {
    fn new(a: &[Point], b: &[Point]) -> Self {
        let parts: Vec<PartOfPair> = parts(a, b).collect();
        let bounds: Vec<[f64; 2]> = parts
            .iter()
            .map(|part| {
                let bounds = filter::bounds(part.simple.pair, &part.simple.points);
                bounds.unwrap_or([0.0, f64::INFINITY])
            })
            .collect();
        let most = bounds
            .iter()
            .fold(f64::INFINITY, |most: f64, bounds| most.min(bounds[1]));
        // Those that may be nearest, compared exactly.
        let near = parts.iter().zip(&bounds).filter(|(_, of)| of[0] <= most);
        let mut best: Option<MeasuredPart<'_>> = None;
        let mut has_tie = false;
        for part in near.map(|(part, _)| MeasuredPart::new(part)) {
            let Some(other) = &best else {
                best = Some(part);
                continue;
            };
            match part.compare(other) {
                Ordering::Less => (best, has_tie) = (Some(part), false),
                Ordering::Greater => {}
                Ordering::Equal => {
                    has_tie |= part.features != other.features;
                    if part.order() < other.order() {
                        best = Some(part);
                    }
                }
            }
        }
        let best = best.expect("some part has the least upper bound");
        let crossing = if best.is_touching {
            None
        } else {
            crossing(a, b)
        };
        if let Some((features, point)) = crossing {
            return Self {
                nearest: NearestOfElements {
                    features,
                    // Two faces that cross share a segment.
                    is_parallel: a.len() == b.len(),
                },
                way: Shortest::Crossing(point),
            };
        }
        Self {
            nearest: NearestOfElements {
                features: best.features.map(|(_, feature)| feature),
                is_parallel: has_tie || best.is_flat,
            },
            way: Shortest::Between(best.part.simple),
        }
    }
}

/// A part, its nearest features and whether their distance is 0.
struct MeasuredPart<'a> {
    part: &'a PartOfPair,
    features: [(u8, Feature); 2],
    is_flat: bool,
    is_touching: bool,
    nearest: PolygonPart,
    /// For other distances, made when one is needed: most parts that are compared touch.
    polygon: OnceCell<ExactPolygon<Integer>>,
}

impl<'a> MeasuredPart<'a> {
    fn new(part: &'a PartOfPair) -> Self {
        let Simple { pair, points, .. } = &part.simple;
        let polygon = OnceCell::new();
        let ((nearest, is_touching), is_flat) =
            match ExactPolygon::short(*pair, points, &Reach::from(0.0)) {
                Some(short) => (short.nearest_and_touching(), short.is_flat()),
                None => {
                    let long = polygon.get_or_init(|| part.polygon());
                    (long.nearest_and_touching(), long.is_flat())
                }
            };
        Self {
            features: part.features(&nearest.named(*pair, is_flat)),
            part,
            is_flat,
            is_touching,
            nearest,
            polygon,
        }
    }

    /// Small features first.
    fn order(&self) -> (u8, [(u8, Feature); 2]) {
        (self.features[0].0 + self.features[1].0, self.features)
    }

    fn polygon(&self) -> &ExactPolygon<Integer> {
        self.polygon.get_or_init(|| self.part.polygon())
    }

    fn compare(&self, other: &Self) -> Ordering {
        if self.is_touching || other.is_touching {
            return other.is_touching.cmp(&self.is_touching);
        }
        let of_other = (other.polygon(), other.nearest);
        self.polygon().compare_distances(self.nearest, of_other)
    }
}

/// Whether an edge and a face, or two faces, share a point. Exact.
pub fn elements_meet(a: &[Point], b: &[Point]) -> bool {
    match (a, b) {
        ([p, q], [r, s, t]) | ([r, s, t], [p, q]) => segment_meets_triangle(p, q, &[*r, *s, *t]),
        ([p, q, r], [s, t, u]) => triangles_intersect(&[*p, *q, *r], &[*s, *t, *u]),
        _ => false,
    }
}

/// An edge of one element that passes through the inside of a face of the other, and the rounded
/// point where it does. The borders of the elements must touch neither each other nor a face.
fn crossing(a: &[Point], b: &[Point]) -> Option<([Feature; 2], Point)> {
    if !elements_meet(a, b) {
        return None;
    }
    let through = |edges: &[Point], face: &[Point]| -> Option<(Feature, Point)> {
        let face: [Point; 3] = face.try_into().ok()?;
        let n = if edges.len() == 3 { 3 } else { 1 };
        (0..n).find_map(|ix| {
            let [p, q] = EDGES[ix].map(|corner| edges[corner]);
            if !segment_meets_triangle(&p, &q, &face) {
                return None;
            }
            let number = u8::try_from(ix).unwrap_or(0);
            Some((Feature::Edge(number), where_crossed(&p, &q, &face)))
        })
    };
    if let Some((edge, point)) = through(a, b) {
        return Some(([edge, Feature::Face], point));
    }
    let (edge, point) = through(b, a)?;
    Some(([Feature::Face, edge], point))
}

/// Where an edge passes a face, by the exact heights of its ends.
fn where_crossed(p: &Point, q: &Point, [a, b, c]: &[Point; 3]) -> Point {
    let heights = rounded::heights(p, q, [a, b, c]);
    let share = quotient(&heights[0], &(&heights[0] - &heights[1]));
    between(p, q, share)
}
