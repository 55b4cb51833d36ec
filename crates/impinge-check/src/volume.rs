//! The signed volume of a closed surface: its sign, exactly, and its value, rounded once.
//!
//! Six times the volume is the sum of the determinants of all faces. A sum of floats with a bound
//! of its error gives the sign of most meshes; where it cannot tell, and for the value, coordinates
//! are integers over one power of two, and so is the sum.

use impinge::exact::internal::{Integer, unit_of};
use impinge::exact::{Point, Sign};

/// The unit roundoff of `f64`.
const HALF_ULP: f64 = f64::EPSILON / 2.0;

/// The exact sign of the volume that faces enclose: positive if their normals point outward.
///
/// Of a surface that intersects itself, each part of space counts as often as the surface winds
/// around it.
pub fn sign(faces: impl Iterator<Item = [Point; 3]> + Clone) -> Sign {
    let (mut sum, mut permanent, mut n) = (0.0f64, 0.0f64, 0.0f64);
    let mut largest = 0.0f64;
    for [a, b, c] in faces.clone() {
        let minors = [
            (b[1] * c[2], b[2] * c[1]),
            (b[2] * c[0], b[0] * c[2]),
            (b[0] * c[1], b[1] * c[0]),
        ];
        for (x, (left, right)) in a.iter().zip(minors) {
            sum += x * (left - right);
            permanent += x.abs() * (left.abs() + right.abs());
        }
        for x in [a, b, c].as_flattened() {
            largest = largest.max(x.abs());
        }
        n += 3.0;
    }
    // Each term has three roundings and takes part in at most n additions; the sums themselves
    // round too. Products of coordinates in this range neither overflow nor lose more to underflow
    // than the last term.
    if largest < 1e100 && permanent < 1e300 {
        let bound = 2.0 * (n + 8.0) * HALF_ULP * permanent + n * 1e-200;
        if sum > bound {
            return Sign::Positive;
        }
        if -sum > bound {
            return Sign::Negative;
        }
    }
    sixfold(faces).0.sign()
}

/// The volume that faces enclose, rounded to the nearest `f64`; infinite if it is larger than any.
pub fn rounded(faces: impl Iterator<Item = [Point; 3]> + Clone) -> f64 {
    let (sixfold, unit) = sixfold(faces);
    sixfold.quotient(&Integer::from(6), 3 * unit, 53, -1074)
}

/// Six times the volume: an integer, and the exponent of the unit whose cube it counts.
fn sixfold(faces: impl Iterator<Item = [Point; 3]> + Clone) -> (Integer, i64) {
    let coordinates = faces.clone().flatten().flatten();
    let unit = coordinates.filter_map(unit_of).min().unwrap_or(0);
    let mut sum = Integer::zero();
    for corners in faces {
        let [a, b, c] = corners.map(|point| point.map(|x| Integer::of_multiple(x, unit)));
        let minors = [
            &(&b[1] * &c[2]) - &(&b[2] * &c[1]),
            &(&b[2] * &c[0]) - &(&b[0] * &c[2]),
            &(&b[0] * &c[1]) - &(&b[1] * &c[0]),
        ];
        for (x, minor) in a.iter().zip(&minors) {
            sum = &sum + &(x * minor);
        }
    }
    (sum, unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The faces of the tetrahedron at the origin with edges of length `size`, shifted, outward.
    fn tetrahedron(size: f64, shift: f64) -> Vec<[Point; 3]> {
        let corner = |axis: usize| {
            let mut at = [shift; 3];
            at[axis] += size;
            at
        };
        let [o, x, y, z] = [[shift; 3], corner(0), corner(1), corner(2)];
        vec![[o, y, x], [o, x, z], [x, y, z], [y, o, z]]
    }

    #[test]
    fn values_are_rounded_once() {
        let volume = |faces: &[[Point; 3]]| rounded(faces.iter().copied());
        assert_eq!(volume(&tetrahedron(1.0, 0.0)), 1.0 / 6.0);
        assert_eq!(volume(&tetrahedron(3.0, 1e9)), 4.5);
        // 1e15 + 0.125 is a float; its cube is lost in any sum of floats.
        assert_eq!(volume(&tetrahedron(0.125, 1e15)), 0.125f64.powi(3) / 6.0);
        assert_eq!(volume(&tetrahedron(1e150, 0.0)), f64::INFINITY);
        assert_eq!(volume(&[]), 0.0);
    }

    #[test]
    fn signs_are_exact_far_from_the_origin() {
        for (size, shift) in [(1.0, 0.0), (0.125, 1e15), (1e-160, 0.0), (1e150, 0.0)] {
            let faces = tetrahedron(size, shift);
            assert_eq!(
                sign(faces.iter().copied()),
                Sign::Positive,
                "{size} {shift}"
            );
            let turned = faces.iter().map(|&[a, b, c]| [a, c, b]);
            assert_eq!(sign(turned), Sign::Negative, "{size} {shift}");
        }
        // A face on both sides has none.
        let [o, x, y] = [[0.1, 0.2, 0.3], [1.1, 0.7, 0.9], [0.3, 2.2, 1e9]];
        assert_eq!(sign([[o, x, y], [o, y, x]].into_iter()), Sign::Zero);
    }
}
