//! Segments: whether two meet, in a plane and in space. A segment may be a single point.

use super::Point;
use super::orientation::{Projection, orient2d, orient3d};

/// Whether two points are the same. Zero equals minus zero.
#[inline]
pub(super) fn same(p: &Point, q: &Point) -> bool {
    p == q
}

/// Whether `p` comes no later than `q` in lexicographic order.
fn no_later<const N: usize>(p: &[f64; N], q: &[f64; N]) -> bool {
    p.iter()
        .zip(q)
        .find(|(x, y)| x != y)
        .is_none_or(|(x, y)| x < y)
}

/// The ends of a segment in lexicographic order.
fn sorted<'a, const N: usize>(p: &'a [f64; N], q: &'a [f64; N]) -> (&'a [f64; N], &'a [f64; N]) {
    if no_later(p, q) { (p, q) } else { (q, p) }
}

/// Whether segments on one line overlap. Along a line lexicographic order is the order of the
/// line, in one direction or the other, so this is the overlap of two intervals.
fn overlap_on_line<const N: usize>(p: &[f64; N], q: &[f64; N], r: &[f64; N], s: &[f64; N]) -> bool {
    let (p, q) = sorted(p, q);
    let (r, s) = sorted(r, s);
    no_later(p, s) && no_later(r, q)
}

/// Whether `v` lies strictly between `u` and `z`, three points of one line.
#[inline]
pub fn strictly_between(v: &Point, u: &Point, z: &Point) -> bool {
    let (low, high) = sorted(u, z);
    !same(v, low) && !same(v, high) && no_later(low, v) && no_later(v, high)
}

/// Whether the closed segments pq and rs of one plane share a point.
///
/// If the ends of neither segment lie strictly on one side of the other's line, and not all
/// four points lie on one line, then the lines cross in one point which both segments contain.
pub(super) fn segments_intersect_2d(p: [f64; 2], q: [f64; 2], r: [f64; 2], s: [f64; 2]) -> bool {
    let (r_side, s_side) = (orient2d(p, q, r), orient2d(p, q, s));
    if r_side.strictly_same(s_side) {
        return false;
    }
    let (p_side, q_side) = (orient2d(r, s, p), orient2d(r, s, q));
    if p_side.strictly_same(q_side) {
        return false;
    }
    let all_zero = [r_side, s_side, p_side, q_side]
        .iter()
        .all(|side| side.is_zero());
    !all_zero || overlap_on_line(&p, &q, &r, &s)
}

/// Whether the closed segments pq and rs in space share a point.
pub(super) fn segments_intersect(p: &Point, q: &Point, r: &Point, s: &Point) -> bool {
    if !orient3d(p, q, r, s).is_zero() {
        return false;
    }
    // All four lie in one plane. A projection in which some three of them keep a turn is
    // one-to-one on that plane; where there is none, all four lie on one line.
    let triples = [(p, q, r), (p, q, s), (p, r, s), (q, r, s)];
    let injective = triples
        .into_iter()
        .find_map(|(x, y, z)| Projection::injective(x, y, z));
    match injective {
        Some(projection) => segments_intersect_2d(
            projection.apply(p),
            projection.apply(q),
            projection.apply(r),
            projection.apply(s),
        ),
        None => overlap_on_line(p, q, r, s),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Segments of one line never decide a triangle's answer alone, so they are asked here.
    #[test]
    fn segments_of_one_line_overlap_or_not() {
        let at = |t: f64| [t, 2.0 * t];
        let cases = [
            ([0.0, 1.0, 1.0, 2.0], true),
            ([0.0, 1.0, 2.0, 3.0], false),
            ([0.0, 3.0, 2.0, 1.0], true),
            ([1.0, 1.0, 0.0, 2.0], true),
            ([1.0, 1.0, 1.0, 1.0], true),
            ([1.0, 1.0, 2.0, 2.0], false),
        ];
        for (ends, expected) in cases {
            for [p, q, r, s] in [[0, 1, 2, 3], [1, 0, 2, 3], [2, 3, 0, 1], [3, 2, 1, 0]] {
                let [p, q, r, s] = [p, q, r, s].map(|ix: usize| at(ends[ix]));
                assert_eq!(segments_intersect_2d(p, q, r, s), expected, "{ends:?}");
                let lift = |[x, y]: [f64; 2]| [x, y, -x];
                let [p, q, r, s] = [p, q, r, s].map(lift);
                assert_eq!(segments_intersect(&p, &q, &r, &s), expected, "{ends:?}");
            }
        }
    }
}
