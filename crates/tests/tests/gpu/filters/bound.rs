//! The determinant of the GPU's filter, as `docs/exactness.md` specifies it, in a model of WGSL's
//! arithmetic: results rounded up or down at random, sums in random order, products fused or
//! distributed at random, subnormal numbers flushed or not. Signs that it calls sure must be right.

use super::generators::{Kind, Random};
use impinge_core::exact::{Sign, orient3d};

const BOUND: f32 = 1.0 / 65_536.0;
pub const SMALLEST: f32 = 1.0 / 4_294_967_296.0;
pub const LARGEST: f32 = 1_099_511_627_776.0;
pub const NARROWING: f32 = 1.0 / 4_194_304.0;

/// Arithmetic in `f32` that guarantees only what WGSL guarantees.
pub struct Device<'a>(pub &'a mut Random);

impl Device<'_> {
    /// A random integer below `n`, for orders of operations.
    pub fn below(&mut self, n: u64) -> u64 {
        self.0.below(n)
    }

    /// A product in any order.
    pub fn product(&mut self, factors: &[f32]) -> f32 {
        let mut factors = factors.to_vec();
        while factors.len() > 1 {
            let x = factors.swap_remove(self.below(factors.len() as u64) as usize);
            let y = factors.swap_remove(self.below(factors.len() as u64) as usize);
            let product = self.multiply(x, y);
            factors.push(product);
        }
        factors[0]
    }

    fn coin(&mut self) -> bool {
        self.0.below(2) == 0
    }

    fn maybe_flushed(&mut self, x: f32) -> f32 {
        if x.is_subnormal() && self.coin() {
            0.0
        } else {
            x
        }
    }

    /// A neighbour of the exact value `sum + error`: a rounded sum and its exact error.
    fn rounded(&mut self, sum: f64, error: f64) -> f32 {
        let nearest = sum as f32;
        let exact_minus_nearest = (sum - f64::from(nearest)) + error;
        let up = self.coin();
        let result = if exact_minus_nearest > 0.0 && up {
            nearest.next_up()
        } else if exact_minus_nearest < 0.0 && !up {
            nearest.next_down()
        } else {
            nearest
        };
        self.maybe_flushed(result)
    }

    pub fn add(&mut self, x: f32, y: f32) -> f32 {
        let (x, y) = (self.maybe_flushed(x), self.maybe_flushed(y));
        self.add_wide(f64::from(x), f64::from(y))
    }

    /// A sum of two doubles, rounded once: two-sum (Knuth) gives the error of the double sum.
    fn add_wide(&mut self, x: f64, y: f64) -> f32 {
        let sum = x + y;
        let part = sum - x;
        let error = (x - (sum - part)) + (y - part);
        self.rounded(sum, error)
    }

    fn multiply(&mut self, x: f32, y: f32) -> f32 {
        let (x, y) = (self.maybe_flushed(x), self.maybe_flushed(y));
        self.rounded(f64::from(x) * f64::from(y), 0.0)
    }

    /// x y + z, fused or not.
    fn multiply_add(&mut self, x: f32, y: f32, z: f32) -> f32 {
        if self.coin() {
            let (x, y, z) = (
                self.maybe_flushed(x),
                self.maybe_flushed(y),
                self.maybe_flushed(z),
            );
            self.add_wide(f64::from(x) * f64::from(y), f64::from(z))
        } else {
            let product = self.multiply(x, y);
            self.add(product, z)
        }
    }

    fn difference(&mut self, p: &[f32; 3], q: &[f32; 3]) -> [f32; 3] {
        std::array::from_fn(|axis| self.add(p[axis], -q[axis]))
    }

    fn sum_in_any_order<const N: usize>(&mut self, terms: [f32; N]) -> f32 {
        let mut terms = terms.to_vec();
        while terms.len() > 1 {
            let x = terms.swap_remove(self.0.below(terms.len() as u64) as usize);
            let y = terms.swap_remove(self.0.below(terms.len() as u64) as usize);
            let sum = self.add(x, y);
            terms.push(sum);
        }
        terms[0]
    }

    /// (d x e) . f
    fn determinant(&mut self, d: &[f32; 3], e: &[f32; 3], f: &[f32; 3]) -> f32 {
        const CYCLES: [[usize; 3]; 3] = [[0, 1, 2], [1, 2, 0], [2, 0, 1]];
        match self.0.below(3) {
            // As written.
            0 => {
                let terms = CYCLES.map(|[i, j, k]| {
                    let right = self.multiply(d[j], e[i]);
                    let normal = self.multiply_add(d[i], e[j], -right);
                    (normal, f[k])
                });
                let [x, y, z] = self.0.permutation().map(|ix: usize| terms[ix]);
                let first = self.multiply(x.0, x.1);
                let second = self.multiply_add(y.0, y.1, first);
                self.multiply_add(z.0, z.1, second)
            }
            // The dot product in any order.
            1 => {
                let terms = CYCLES.map(|[i, j, k]| {
                    let left = self.multiply(d[i], e[j]);
                    let normal = self.multiply_add(-d[j], e[i], left);
                    self.multiply(normal, f[k])
                });
                self.sum_in_any_order(terms)
            }
            // Distributed into six monomials.
            _ => {
                let mut monomials = [0.0; 6];
                for (cycle_ix, [i, j, k]) in CYCLES.into_iter().enumerate() {
                    let (left, right) = (self.multiply(e[j], f[k]), self.multiply(d[j], f[k]));
                    monomials[2 * cycle_ix] = self.multiply(d[i], left);
                    monomials[2 * cycle_ix + 1] = -self.multiply(right, e[i]);
                }
                self.sum_in_any_order(monomials)
            }
        }
    }

    /// The bound of the determinant's error; `None` if it is unsure whatever its value.
    /// `narrowing` is the N of the document, zero for `f32` bodies.
    fn bound(&mut self, vectors: [&[f32; 3]; 3], narrowing: f32) -> Option<f32> {
        let sizes = vectors.map(|v| v.iter().fold(0.0, |size: f32, x| size.max(x.abs())));
        if sizes.iter().any(|&size| size < SMALLEST) {
            return None;
        }
        let [d, e, f] = sizes.map(|size| self.add(size, narrowing));
        let (de, ef, fd) = (
            self.multiply(d, e),
            self.multiply(e, f),
            self.multiply(f, d),
        );
        let own = self.multiply(de, f);
        let own = self.multiply(BOUND, own);
        let pairs = self.sum_in_any_order([de, ef, fd]);
        let inherited = self.multiply(4.0 * narrowing, pairs);
        Some(self.add(own, inherited))
    }

    /// The sign of orient3d(a, b, c, o) if it is sure, and the computed value.
    fn side(&mut self, [a, b, c, o]: &[[f32; 3]; 4], narrowing: f32) -> (Option<Sign>, f32) {
        let (d, e, f) = (
            self.difference(a, o),
            self.difference(b, o),
            self.difference(c, o),
        );
        let value = self.determinant(&d, &e, &f);
        let sign = match self.bound([&d, &e, &f], narrowing) {
            Some(bound) if value > bound => Some(Sign::Positive),
            Some(bound) if value < -bound => Some(Sign::Negative),
            _ => None,
        };
        (sign, value)
    }
}

impl Device<'_> {
    /// d x e in the plane of x and y.
    fn planar(&mut self, d: &[f32; 3], e: &[f32; 3]) -> f32 {
        if self.coin() {
            let right = self.multiply(d[1], e[0]);
            self.multiply_add(d[0], e[1], -right)
        } else {
            let left = self.multiply(d[0], e[1]);
            self.multiply_add(-d[1], e[0], left)
        }
    }

    /// The sign of the turn from a - o to b - o in the plane of x and y if it is sure, and the
    /// computed value.
    fn turn(&mut self, [a, b, o]: [&[f32; 3]; 3], narrowing: f32) -> (Option<Sign>, f32) {
        let (d, e) = (self.difference(a, o), self.difference(b, o));
        let value = self.planar(&d, &e);
        let widest = d
            .iter()
            .chain(&e)
            .fold(0.0, |size: f32, x| size.max(x.abs()));
        if widest < SMALLEST {
            return (None, value);
        }
        let wide = self.add(widest, narrowing);
        let own = self.multiply(BOUND, wide);
        let factor = self.multiply_add(8.0, narrowing, own);
        // The kernels hold two determinants against this bound.
        let bound = 0.5 * self.multiply(wide, factor);
        let sign = match value {
            value if value > bound => Some(Sign::Positive),
            value if value < -bound => Some(Sign::Negative),
            _ => None,
        };
        (sign, value)
    }
}

/// Points for the model: all coordinates at most `LARGEST`.
fn points(random: &mut Random, kind: Kind, scale: f64) -> Option<[[f64; 3]; 4]> {
    let points = kind.points::<4>(random).map(|p| p.map(|x| x * scale));
    let fits = |x: &f64| x.abs() <= f64::from(LARGEST);
    points.iter().flatten().all(fits).then_some(points)
}

#[test]
fn device_determinants_are_right_where_they_are_sure() {
    let mut random = Random::new(20);
    let (mut n, mut n_sure, mut n_wrong_value) = (0, 0, 0);
    for kind in [
        Kind::Lattice(3),
        Kind::Plain,
        Kind::AnyF32,
        Kind::Palette,
        Kind::NearlyTouching,
        Kind::Skewed(2),
    ] {
        // From scales where differences are barely above `SMALLEST`, up to `LARGEST`.
        for scale in [
            1.0,
            2.0_f64.powi(-29),
            2.0_f64.powi(-31),
            2.0_f64.powi(14),
            2.0_f64.powi(38),
        ] {
            for _ in 0..10_000 {
                let Some(points) = points(&mut random, kind, scale) else {
                    continue;
                };
                let narrow = points.map(|p| p.map(|x| x as f32));
                let points = narrow.map(|p| p.map(f64::from));
                let [a, b, c, o] = &points;
                let exact = orient3d(a, b, c, o);
                let (sign, value) = Device(&mut random).side(&narrow, 0.0);
                n += 1;
                n_wrong_value +=
                    u32::from(value != 0.0 && (value > 0.0) != (exact == Sign::Positive));
                if let Some(sign) = sign {
                    n_sure += 1;
                    assert_eq!(
                        sign, exact,
                        "{kind:?} by {scale:e}: {narrow:?} gives {value:e}"
                    );
                }
            }
        }
    }
    assert!(n_sure > n / 5, "{n_sure} of {n} are sure");
    assert!(
        n_wrong_value > n / 100,
        "the model is too kind: {n_wrong_value} of {n} values have a wrong sign"
    );
}

#[test]
fn device_determinants_of_narrowed_positions_are_right_where_they_are_sure() {
    let mut random = Random::new(21);
    let (mut n, mut n_sure, mut n_wrong_value) = (0, 0, 0);
    for kind in [
        Kind::Plain,
        Kind::NearlyTouching64,
        Kind::Lattice(3),
        Kind::Skewed(2),
    ] {
        for scale in [1.0, 2.0_f64.powi(-28), 2.0_f64.powi(10)] {
            for _ in 0..10_000 {
                let Some(points) = points(&mut random, kind, scale) else {
                    continue;
                };
                // Not representable in `f32`, and sometimes far from the origin.
                let shift = random.pick(&[0.0, 1.0, 1000.0]) * scale;
                let points =
                    points.map(|p| p.map(|x| x * 1.1 + shift + 1e-9 * scale * random.unit()));
                let [a, b, c, o] = &points;
                let exact = orient3d(a, b, c, o);
                let narrow = points.map(|p| p.map(|x| x as f32));
                let largest = narrow
                    .iter()
                    .flatten()
                    .fold(0.0, |m: f32, x| m.max(x.abs()));
                let (sign, value) = Device(&mut random).side(&narrow, NARROWING * largest);
                n += 1;
                n_wrong_value +=
                    u32::from(value != 0.0 && (value > 0.0) != (exact == Sign::Positive));
                if let Some(sign) = sign {
                    n_sure += 1;
                    assert_eq!(
                        sign, exact,
                        "{kind:?} by {scale:e}: {points:?} gives {value:e}"
                    );
                }
            }
        }
    }
    assert!(n_sure > n / 5, "{n_sure} of {n} are sure");
    assert!(
        n_wrong_value > n / 100,
        "the model is too kind: {n_wrong_value} of {n} values have a wrong sign"
    );
}

#[test]
fn device_turns_in_a_plane_are_right_where_they_are_sure() {
    let mut random = Random::new(22);
    let (mut n, mut n_sure, mut n_wrong_value) = (0, 0, 0);
    for kind in [
        Kind::Lattice(3),
        Kind::Plain,
        Kind::AnyF32,
        Kind::NearlyTouching,
        Kind::Skewed(2),
    ] {
        for is_narrowed in [false, true] {
            for scale in [1.0, 2.0_f64.powi(-29), 2.0_f64.powi(14), 2.0_f64.powi(38)] {
                for _ in 0..5_000 {
                    let Some(points) = points(&mut random, kind, scale) else {
                        continue;
                    };
                    // The first corner, and two that are nearly in line with it.
                    let share = random.unit();
                    let [a, mut b, o, _] = points.map(|p| {
                        let blur = if is_narrowed { 1e-9 * scale } else { 0.0 };
                        p.map(|x| x + blur)
                    });
                    if random.below(2) == 0 {
                        for axis in 0..3 {
                            b[axis] = o[axis] + share * (a[axis] - o[axis]);
                        }
                    }
                    let narrow = [a, b, o].map(|p| p.map(|x| x as f32));
                    let [a, b, o] = match is_narrowed {
                        true => [a, b, o],
                        false => narrow.map(|p| p.map(f64::from)),
                    };
                    let flat = |p: [f64; 3]| [p[0], p[1], 0.0];
                    let exact = orient3d(&flat(a), &flat(b), &[o[0], o[1], 1.0], &flat(o));
                    let largest = narrow
                        .iter()
                        .flatten()
                        .fold(0.0, |m: f32, x| m.max(x.abs()));
                    let slack = if is_narrowed {
                        NARROWING * largest
                    } else {
                        0.0
                    };
                    let [p, q, r] = &narrow;
                    let (sign, value) = Device(&mut random).turn([p, q, r], slack);
                    n += 1;
                    n_wrong_value +=
                        u32::from(value != 0.0 && (value > 0.0) != (exact == Sign::Positive));
                    if let Some(sign) = sign {
                        n_sure += 1;
                        assert_eq!(sign, exact, "{kind:?} by {scale:e}: {narrow:?}");
                    }
                }
            }
        }
    }
    assert!(n_sure > n / 5, "{n_sure} of {n} are sure");
    assert!(
        n_wrong_value > n / 100,
        "the model is too kind: {n_wrong_value} of {n} values have a wrong sign"
    );
}
