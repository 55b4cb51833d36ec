//! Nearest points of many pairs whose nearest parts are known, some of them at a time.
//!
//! What it does: finds what [`closest_points`] finds, bit for bit, in twice the precision of
//! floats, eight pairs at a time. Where a rounding is in doubt, as where a distance is itself a
//! float, [`closest_points`] decides.
//!
//! How: with a corner C of the difference polygon, its edges E and F from there on, and N = E x F,
//!
//! ```text
//!          squared distance          shares of E and of F
//! corner   C . C
//! edge     |C x E|^2 / E . E         -C . E / E . E
//! face     (N . C)^2 / N . N         -N . (C x F) / N . N    N . (C x E) / N . N
//! ```
//!
//! Numerators and denominators of shares are rounded towards zero before they are divided, as
//! there. A number whose second float is 0 is exact if all coordinates are multiples of a unit that
//! is large enough: the number is then a multiple of a product of units, which is larger than its
//! error.
//!
//! Cost: 200 (corner), 800 (edge) or 1,500 (face) operations in floats for all lanes.

use super::features::PolygonPart;
use super::filter::edge_ends;
use super::rounded::{NearestPoints, closest_points, points_at};
use crate::Point;
use crate::element_pair::ElementPair;
use crate::filter::number::{Number, Vector, load_vertex};
use crate::filter::{LANES, Vertex8, put_point};
use crate::twice::{ERROR, MODERATE, Twice, size, two_product, two_sum};

/// A pair of elements, and the part of their difference polygon that is nearest.
#[derive(Clone, Copy, Debug)]
pub struct PairAtPart {
    /// What the points are.
    pub pair: ElementPair,
    /// In the order of the pair.
    pub points: [Point; 4],
    /// The number of the part, as filters give it. Numbers that no part has stand for an unknown
    /// one.
    pub part: u8,
}

/// Calls `each` with the place and the nearest points of each pair, in any order.
#[inline(always)]
pub fn closest_by_part<V: Vector>(
    pairs: &[PairAtPart],
    each: &mut impl FnMut(usize, NearestPoints),
) {
    for n_edges in 0..=2 {
        let mut parts = Parts8::default();
        let mut of_lane = [0; LANES];
        let mut n = 0;
        for ix in 0..=pairs.len() {
            if n == LANES || (n > 0 && ix == pairs.len()) {
                let found = Found8::new::<V>(&parts, n_edges, n);
                for (lane, &of_lane) in of_lane[..n].iter().enumerate() {
                    each(of_lane, found.closest(lane, &pairs[of_lane]));
                }
                n = 0;
            }
            let Some(pair) = pairs.get(ix) else {
                break;
            };
            let (corner, n_edges_of_part) = match PolygonPart::numbered(pair.part) {
                Some(PolygonPart::Corner(corner)) => (corner, 0),
                Some(PolygonPart::Edge(corner)) => (corner, 1),
                Some(PolygonPart::Face) => (0, 2),
                None => {
                    if n_edges == 0 {
                        each(ix, closest_points(pair.pair, &pair.points));
                    }
                    continue;
                }
            };
            if n_edges_of_part == n_edges {
                parts.set(n, pair, corner, n_edges);
                of_lane[n] = ix;
                n += 1;
            }
        }
    }
}

/// A corner of a polygon and up to two edges from there on per lane, each a difference of two
/// points: of the first from the second.
#[derive(Default)]
#[repr(align(64))]
struct Parts8 {
    corner: [Vertex8; 2],
    edges: [[Vertex8; 2]; 2],
}

impl Parts8 {
    #[inline(always)]
    fn set(&mut self, lane: usize, pair: &PairAtPart, corner: usize, n_edges: usize) {
        let [i, j] = pair.pair.corners()[corner];
        set_ends(&mut self.corner, lane, &pair.points, [j, i]);
        for (nth, edge) in self.edges.iter_mut().enumerate().take(n_edges) {
            set_ends(edge, lane, &pair.points, edge_ends(pair.pair, corner + nth));
        }
    }
}

#[inline(always)]
fn set_ends(ends: &mut [Vertex8; 2], lane: usize, points: &[Point; 4], numbers: [usize; 2]) {
    for (end, number) in ends.iter_mut().zip(numbers) {
        put_point(end, lane, &points[number]);
    }
}

/// The distances, and the shares of the edges.
#[derive(Default)]
struct Found8 {
    is_certain: u8,
    distances: [f64; LANES],
    shares: [[f64; LANES]; 2],
}

impl Found8 {
    #[cfg_attr(target_family = "wasm", inline(never))]
    #[cfg_attr(not(target_family = "wasm"), inline(always))]
    fn new<V: Vector>(parts: &Parts8, n_edges: usize, n: usize) -> Self {
        let mut found = Self::default();
        let mut first = 0;
        while first < n {
            let corner = load_difference::<V>(&parts.corner, first);
            let [e, f] = [
                load_difference::<V>(&parts.edges[0], first),
                load_difference::<V>(&parts.edges[1], first),
            ];
            let (is_certain, distance, shares) = match n_edges {
                0 => of_corner(&corner),
                1 => of_edge(&corner, &e),
                _ => of_face(&corner, &e, &f),
            };
            found.is_certain |= V::bits(is_certain) << first;
            distance.store(&mut found.distances, first);
            shares[0].store(&mut found.shares[0], first);
            shares[1].store(&mut found.shares[1], first);
            first += V::N;
        }
        found
    }

    fn closest(&self, lane: usize, pair: &PairAtPart) -> NearestPoints {
        match PolygonPart::numbered(pair.part) {
            Some(part) if self.is_certain >> lane & 1 == 1 => NearestPoints {
                nearest: part.named(pair.pair, false),
                distance: self.distances[lane],
                points: points_at(
                    pair.pair,
                    part,
                    &pair.points,
                    self.shares.map(|of| of[lane]),
                ),
            },
            _ => closest_points(pair.pair, &pair.points),
        }
    }
}

#[inline(always)]
fn load_difference<V: Vector>(ends: &[Vertex8; 2], first: usize) -> [Twice<V>; 3] {
    let [from, to] = [
        load_vertex::<V>(&ends[0], first),
        load_vertex::<V>(&ends[1], first),
    ];
    Twice::difference(&to, &from)
}

/// Where numbers are certain, a distance, and shares.
type Certain<V> = (<V as Number>::Mask, V, [V; 2]);

#[inline(always)]
fn of_corner<V: Vector>(corner: &[Twice<V>; 3]) -> Certain<V> {
    let zero = V::splat(0.0);
    let c = size(corner);
    let [over, rest] = Twice::dot(corner, corner).0;
    let (is_certain, distance) = root_below([over, rest, V::splat(ERROR) * (c * c)]);
    (is_certain & is_moderate(c), distance, [zero; 2])
}

#[inline(always)]
fn of_edge<V: Vector>(corner: &[Twice<V>; 3], edge: &[Twice<V>; 3]) -> Certain<V> {
    let zero = V::splat(0.0);
    let (c, e) = (size(corner), size(edge));
    let error = V::splat(ERROR);
    let moment = Twice::cross(corner, edge);
    let under = Twice::dot(edge, edge);
    let of_under = error * (e * e);
    let square = Twice::dot(&moment, &moment).over(under, error * (c * e * (c * e)), of_under);
    let (is_certain, distance) = root_below(square);
    let along = Twice::dot(corner, edge).turned(V::splat(-1.0));
    let short = are_multiples(edge, e, SHORT);
    let (is_under, under) = towards_zero(under, of_under, short);
    let short = short & are_multiples(corner, c, SHORT);
    let (is_over, over) = towards_zero(along, error * (c * e), short);
    let is_certain = is_certain & is_under & is_over & is_moderate(c) & is_moderate(e);
    (is_certain, distance, [over / under, zero])
}

#[cfg_attr(target_family = "wasm", inline(never))]
#[cfg_attr(not(target_family = "wasm"), inline(always))]
fn of_face<V: Vector>(corner: &[Twice<V>; 3], e: &[Twice<V>; 3], f: &[Twice<V>; 3]) -> Certain<V> {
    let zero = V::splat(0.0);
    let (of_c, of_e, of_f) = (size(corner), size(e), size(f));
    let (error, of_both) = (V::splat(ERROR), of_e * of_f);
    let normal = Twice::cross(e, f);
    let under = Twice::dot(&normal, &normal);
    let of_under = error * (of_both * of_both);
    // The square of a height that is larger than its error.
    let height = Twice::dot(&normal, corner);
    let size_of_height = height.0[0].abs();
    let of_height = error * (of_both * of_c);
    let of_square = V::splat(4.0) * (size_of_height * of_height)
        + V::splat(ERROR) * (size_of_height * size_of_height);
    let square = height.times(height).over(under, of_square, of_under);
    let (is_certain, mut distance) = root_below(square);
    let mut is_certain = is_certain & size_of_height.gt(of_height);
    // In a plane of two axes the distance is a coordinate.
    for axis in 0..3 {
        let is_flat = is_zero(e[axis].0[0]) & is_zero(f[axis].0[0]);
        let [high, low] = corner[axis]
            .turned(V::select(
                zero.gt(corner[axis].0[0]),
                V::splat(-1.0),
                V::splat(1.0),
            ))
            .0;
        distance = V::select(
            is_flat,
            V::select(zero.gt(low), before(high), high),
            distance,
        );
        is_certain = is_certain | is_flat;
    }
    let short = are_multiples(e, of_e, SHORTER) & are_multiples(f, of_f, SHORTER);
    let (is_under, under) = towards_zero(under, of_under, short);
    let short = short & are_multiples(corner, of_c, SHORTER);
    let along_e = Twice::dot(&normal, &Twice::cross(corner, f)).turned(V::splat(-1.0));
    let along_f = Twice::dot(&normal, &Twice::cross(corner, e));
    let (is_along_e, along_e) = towards_zero(along_e, error * (of_both * (of_c * of_f)), short);
    let (is_along_f, along_f) = towards_zero(along_f, error * (of_both * (of_c * of_e)), short);
    let is_moderate = is_moderate(of_c) & is_moderate(of_e) & is_moderate(of_f);
    (
        is_certain & is_under & is_along_e & is_along_f & is_moderate,
        distance,
        [along_e / under, along_f / under],
    )
}

#[inline(always)]
fn is_moderate<V: Vector>(size: V) -> V::Mask {
    V::splat(MODERATE.end).gt(size) & size.gt(V::splat(MODERATE.start))
}

#[inline(always)]
fn is_zero<V: Vector>(x: V) -> V::Mask {
    !x.abs().gt(V::splat(0.0))
}

/// The float before a normal one above 0.
#[inline(always)]
fn before<V: Vector>(x: V) -> V {
    x * V::splat(1.0 - f64::EPSILON / 2.0)
}

/// 2^8 and 2^31: see [`are_multiples`].
const SHORT: f64 = 256.0;
/// See [`SHORT`].
const SHORTER: f64 = (1u64 << 31) as f64;

/// Whether the coordinates of a vector are floats and multiples of a unit, at least 2^-54 of its
/// size times a factor. Products of two such with [`SHORT`], or of four with [`SHORTER`], are then
/// multiples of more than [`ERROR`] times their sizes.
#[inline(always)]
fn are_multiples<V: Vector>(vector: &[Twice<V>; 3], size: V, factor: f64) -> V::Mask {
    let large = V::splat(factor) * size;
    let [x, y, z] = vector;
    let off = |x: &Twice<V>| (((x.0[0] + large) - large) - x.0[0]).abs() + x.0[1].abs();
    is_zero(off(x) + off(y) + off(z))
}

/// A positive number rounded towards zero, and where that is certain. Where `are_short` is set the
/// number is exact if its second float is 0.
#[inline(always)]
fn towards_zero<V: Vector>(
    Twice([high, low]): Twice<V>,
    error: V,
    are_short: V::Mask,
) -> (V::Mask, V) {
    let is_certain = low.abs().gt(error) | (are_short & is_zero(low));
    (
        is_certain & high.gt(error + error),
        V::select(V::splat(0.0).gt(low), before(high), high),
    )
}

/// The largest float that is not above the root of a number, and where that is certain. The number
/// is a positive float, what is left, at most half a last bit, and more than the error of both.
#[inline(always)]
fn root_below<V: Vector>([number, rest, doubt]: [V; 3]) -> (V::Mask, V) {
    const UNIT: f64 = f64::EPSILON * f64::EPSILON;
    let root = number.sqrt();
    let [square, error] = two_product(root, root);
    // A step of Newton's method. What it leaves out, and roundings, are below two units.
    let step = (((number - square) - error) + rest) / (root + root);
    let doubt = doubt / root + V::splat(16.0 * UNIT) * root;
    let [root, rest] = two_sum(root, step);
    (
        rest.abs().gt(doubt),
        V::select(V::splat(0.0).gt(rest), before(root), root),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::distance::filter::part_number;
    use crate::filter::number;
    use crate::filter::{Points8, bounds_and_parts};
    use crate::tests::on_all;
    use impinge_testing::random::Random;

    type Bits = (crate::NearestFeatures, u64, [[u64; 3]; 2]);

    fn bits(closest: &NearestPoints) -> Bits {
        let points = closest.points.map(|point| point.map(f64::to_bits));
        (closest.nearest, closest.distance.to_bits(), points)
    }

    fn found<V: Vector>(pairs: &[PairAtPart]) -> Vec<Bits> {
        let mut found = vec![None; pairs.len()];
        closest_by_part::<V>(pairs, &mut |ix, closest| found[ix] = Some(bits(&closest)));
        found
            .into_iter()
            .map(|one| one.expect("all are found"))
            .collect()
    }

    on_all!(f64: fn each_register(pairs: &[PairAtPart]) -> Vec<Bits> = found);

    /// How many lanes are certain.
    fn n_certain(pairs: &[PairAtPart], n_edges: usize) -> usize {
        let mut parts = Parts8::default();
        let mut n = 0;
        for pair in pairs {
            let corner = match PolygonPart::numbered(pair.part) {
                Some(PolygonPart::Corner(corner)) if n_edges == 0 => corner,
                Some(PolygonPart::Edge(corner)) if n_edges == 1 => corner,
                Some(PolygonPart::Face) if n_edges == 2 => 0,
                _ => continue,
            };
            parts.set(n, pair, corner, n_edges);
            n += 1;
        }
        let found = Found8::new::<number::Portable>(&parts, n_edges, n);
        (found.is_certain & ((1u16 << n) - 1) as u8).count_ones() as usize
    }

    /// Numbers of few and of many bits, of many sizes, near and far, in planes of two axes, and
    /// nearly degenerate: what registers say is what integers say, of every part of a polygon.
    #[test]
    fn as_integers_say() {
        let mut random = Random::new(99);
        let mut pairs = Vec::new();
        // Of corners, edges and faces: how many there are, and how many are certain.
        let mut n = [[0usize; 2]; 3];
        for round in 0..240_000 {
            let size = [1.0, 1e-9, 1e12, 3e-31, 1e-6][round % 5];
            let n_bits = [2, 4, 17, 23, 40, 52][round % 6];
            let far = [0.0, 0.0, 0.5, 30.0, 1e6][round / 30 % 5];
            let mut number = || {
                let whole = (random.bits() % (2 << n_bits)) as f64 / (1u64 << n_bits) as f64;
                size * (whole - 1.0)
            };
            let mut points: [Point; 4] = [(); 4].map(|()| [(); 3].map(|()| number()));
            points[0][2] += far * size;
            if round % 7 == 0 {
                let level = points[1][round / 7 % 3];
                for point in &mut points[1..] {
                    point[round / 7 % 3] = level;
                }
            }
            if round % 11 == 0 {
                // Nearly along a line.
                let [_, p, q, r] = &mut points;
                for ((p, q), r) in p.iter().zip(q.iter()).zip(r) {
                    *r = 0.5 * (p + q) + 1e-3 * *r;
                }
            }
            let pair = [
                ElementPair::VertexFace,
                ElementPair::EdgeEdge,
                ElementPair::VertexFace,
            ][round / 3 % 3];
            let pair = [pair, pair, ElementPair::VertexEdge][usize::from(round % 13 == 0) * 2];
            let part = part_number(pair, &points);
            pairs.push(PairAtPart { pair, points, part });
            // Not all lanes are used.
            if pairs.len() < 7 {
                continue;
            }
            for (pair, found) in pairs.iter().zip(each_register(&pairs)) {
                assert_eq!(
                    found,
                    bits(&closest_points(pair.pair, &pair.points)),
                    "{pair:?}"
                );
                match PolygonPart::numbered(pair.part) {
                    Some(PolygonPart::Corner(_)) => n[0][0] += 1,
                    Some(PolygonPart::Edge(_)) => n[1][0] += 1,
                    Some(PolygonPart::Face) => n[2][0] += 1,
                    None => {}
                }
            }
            for (n_edges, n) in n.iter_mut().enumerate() {
                n[1] += n_certain(&pairs, n_edges);
            }
            pairs.clear();
        }
        for [n_all, n_certain] in n {
            assert!(n_all > 10_000 && 4 * n_certain > 3 * n_all, "{n:?}");
        }
        println!("{n:?}");
    }

    /// Faces of lattices and points over them: distances and shares are floats.
    #[test]
    fn of_lattices() {
        let mut random = Random::new(5);
        let mut n = [0; 2];
        for _ in 0..4_000 {
            let mut pairs = Vec::new();
            while pairs.len() < 8 {
                let points: [Point; 4] =
                    [(); 4].map(|()| [(); 3].map(|()| f64::from(random.below(8))));
                let pair = ElementPair::VertexFace;
                let part = part_number(pair, &points);
                pairs.push(PairAtPart { pair, points, part });
            }
            for (pair, found) in pairs.iter().zip(each_register(&pairs)) {
                assert_eq!(
                    found,
                    bits(&closest_points(pair.pair, &pair.points)),
                    "{pair:?}"
                );
            }
            n[0] += pairs.iter().filter(|pair| pair.part == 8).count();
            n[1] += n_certain(&pairs, 2);
        }
        println!("{n:?}");
        assert!(2 * n[1] > n[0], "{n:?}");
    }

    /// Bounds and parts of eight pairs are those of one after the other.
    #[test]
    fn parts_of_eight() {
        let mut random = Random::new(3);
        for round in 0..2_000 {
            let pair = [ElementPair::VertexFace, ElementPair::EdgeEdge][round % 2];
            let all: [[Point; 4]; LANES] = [(); LANES].map(|()| {
                [(); 4].map(|()| {
                    [(); 3].map(|()| f64::from(random.below([9, 1 << 30][round / 2 % 2])))
                })
            });
            let mut points = Points8::default();
            for (lane, of_lane) in all.iter().enumerate() {
                for (ix, point) in of_lane.iter().enumerate() {
                    put_point(&mut points.0[ix], lane, point);
                }
            }
            let (bounds, parts) = bounds_and_parts::<number::Portable>(pair, &points);
            for (lane, of_lane) in all.iter().enumerate() {
                assert_eq!(parts[lane], part_number(pair, of_lane), "{of_lane:?}");
                let one = crate::distance::filter::bounds(pair, of_lane);
                assert_eq!(one, Some([bounds.low[lane], bounds.high[lane]]));
            }
        }
    }
}
