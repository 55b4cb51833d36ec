//! The rotation in a deformation: polar decomposition that handles inversion.
//!
//! Müller & Gross 2004 use the rotation R of F = R S. If an element is inverted (det F < 0), the
//! polar decomposition gives a reflection. Irving, Teran & Fedkiw 2004 (section 4) use the singular
//! value decomposition F = U Σ Vᵀ with proper rotations U, V and let the *smallest* singular value
//! be negative, so that the element is pushed back along the direction in which it is least
//! inverted. R = U Vᵀ.
//!
//! For det F well above 0 both agree, and Newton's iteration for the polar factor, scaled
//! (Higham 1986, section 3), is several times faster than an SVD; otherwise the SVD is used.

use nalgebra::{Matrix3, Vector3};

/// Below this share of the determinant of a conformal map of the same size, Newton's iteration
/// would need many steps or converge to a reflection, so the SVD is used.
const WELL_CONDITIONED: f64 = 1e-2;

/// The rotation nearest to `f` (in the Frobenius norm): orthogonal, determinant 1. It does not
/// depend on the scale of `f`; for a zero or non-finite `f` it is the identity.
pub fn rotation(f: &Matrix3<f64>) -> Matrix3<f64> {
    let size = f.norm() / 3f64.sqrt();
    if !(size.is_finite() && size > 0.0) {
        return Matrix3::identity();
    }
    let f = f / size;
    if f.determinant() > WELL_CONDITIONED {
        newton(f)
    } else {
        signed_svd(&f)
    }
}

/// Cofactors: `det(f)` times the inverse, transposed, but defined for every matrix.
pub(crate) fn cofactors(f: &Matrix3<f64>) -> Matrix3<f64> {
    let [a, b, c] = [f.column(0), f.column(1), f.column(2)].map(Vector3::from);
    Matrix3::from_columns(&[b.cross(&c), c.cross(&a), a.cross(&b)])
}

fn newton(mut r: Matrix3<f64>) -> Matrix3<f64> {
    // Quadratic convergence: 3 to 5 rounds in practice, 10 at the threshold.
    for _ in 0..20 {
        let cofactors = cofactors(&r);
        let det = r.column(0).dot(&cofactors.column(0));
        let inverse_transposed = cofactors / det;
        let scale = (inverse_transposed.norm_squared() / r.norm_squared())
            .sqrt()
            .sqrt();
        let next = (r * scale + inverse_transposed / scale) * 0.5;
        let change = (next - r).norm_squared();
        r = next;
        // The error after a round is of the order of its change squared.
        if change < 1e-16 {
            break;
        }
    }
    r
}

fn signed_svd(f: &Matrix3<f64>) -> Matrix3<f64> {
    let svd = f.svd(true, true);
    let (Some(mut u), Some(v_t)) = (svd.u, svd.v_t) else {
        return Matrix3::identity();
    };
    if u.determinant() * v_t.determinant() < 0.0 {
        // U or V is a reflection; reversing the axis of the smallest singular value makes it a
        // rotation.
        let smallest = svd.singular_values.imin();
        u.column_mut(smallest).neg_mut();
    }
    let r = u * v_t;
    // The decomposition of a matrix of rank 1 or less may lack full bases.
    let defect = (r.transpose() * r - Matrix3::identity()).norm();
    if defect < 1e-6 {
        r
    } else {
        from_dominant_axes(f)
    }
}

/// For matrices of (nearly) rank 1: a rotation that maps the direction in which `f` is largest as
/// `f` does. All such rotations are equally near to `f`, so any will do.
fn from_dominant_axes(f: &Matrix3<f64>) -> Matrix3<f64> {
    let eigen = (f.transpose() * f).symmetric_eigen();
    let from: Vector3<f64> = eigen
        .eigenvectors
        .column(eigen.eigenvalues.imax())
        .into_owned();
    let to = f * from;
    nalgebra::Rotation3::rotation_between(&from, &to)
        .unwrap_or_else(|| {
            // Opposite directions: half a turn about any perpendicular axis.
            let across = from.cross(&Vector3::ith(from.iamin(), 1.0));
            nalgebra::Rotation3::from_axis_angle(
                &nalgebra::Unit::new_normalize(across),
                std::f64::consts::PI,
            )
        })
        .into_inner()
}

#[cfg(test)]
mod tests {
    use super::*;
    use impinge_scenes::Random;
    use nalgebra::Rotation3;

    fn random_matrix(random: &mut Random) -> Matrix3<f64> {
        Matrix3::from_fn(|_, _| f64::from(random.range(-1.0, 1.0)))
    }

    fn is_rotation(r: &Matrix3<f64>) -> bool {
        (r.transpose() * r - Matrix3::identity()).norm() < 1e-9
            && (r.determinant() - 1.0).abs() < 1e-9
    }

    #[test]
    fn the_stretch_is_symmetric_and_no_rotation_is_nearer() {
        let mut random = Random::new(1);
        for round in 0..20_000 {
            let f = random_matrix(&mut random);
            let r = rotation(&f);
            assert!(is_rotation(&r), "round {round}: {r}");
            let s = r.transpose() * f;
            assert!((s - s.transpose()).norm() < 1e-7, "round {round}: {s}");
            let turn = Rotation3::from_scaled_axis(nalgebra::Vector3::from_fn(|_, _| {
                f64::from(random.range(-0.5, 0.5))
            }));
            let other = turn.into_inner() * r;
            assert!((f - r).norm() <= (f - other).norm() + 1e-9, "round {round}");
        }
    }

    #[test]
    fn both_ways_agree_where_both_are_taken() {
        let mut random = Random::new(2);
        let mut n = 0;
        while n < 2_000 {
            let f = random_matrix(&mut random);
            let f = f / (f.norm() / 3f64.sqrt());
            if f.determinant() < WELL_CONDITIONED {
                continue;
            }
            n += 1;
            assert!((newton(f) - signed_svd(&f)).norm() < 1e-6, "{f}");
        }
    }

    #[test]
    fn an_inverted_element_is_least_inverted_along_its_shortest_axis() {
        let turn = Rotation3::from_euler_angles(0.3, -1.2, 2.0).into_inner();
        let f = turn * Matrix3::from_diagonal(&Vector3::new(1.1, 0.9, -0.2));
        assert!((rotation(&f) - turn).norm() < 1e-9);
    }

    #[test]
    fn degenerate_matrices_have_a_rotation() {
        let flat = Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0);
        assert!((rotation(&flat) - Matrix3::identity()).norm() < 1e-9);
        let line = Vector3::new(1.0, 2.0, 3.0);
        for f in [
            Matrix3::zeros(),
            Matrix3::identity() * 1e-200,
            -Matrix3::identity(),
            line * line.transpose(),
            -line * line.transpose(),
            line * Vector3::new(-2.0, 1.0, 0.5).transpose(),
            Matrix3::from_element(f64::NAN),
            Matrix3::from_element(f64::INFINITY),
        ] {
            assert!(is_rotation(&rotation(&f)), "{f} {}", rotation(&f));
        }
    }
}
