//! The oracle: whole numbers of a unit, brute force, and other algorithms than those of the crate.

use dashu_int::IBig;
use impinge_scenes::Random;

/// Whole numbers without rounding or overflow.
pub trait Whole: Clone + Ord + Default {
    fn plus(&self, other: &Self) -> Self;
    fn minus(&self, other: &Self) -> Self;
    fn times(&self, other: &Self) -> Self;
    /// A random number that is larger than all coordinates, on average.
    fn far(random: &mut Random) -> Self;
}

macro_rules! whole {
    ($type:ty, |$random:ident| $far:expr) => {
        impl Whole for $type {
            fn plus(&self, other: &Self) -> Self {
                self + other
            }
            fn minus(&self, other: &Self) -> Self {
                self - other
            }
            fn times(&self, other: &Self) -> Self {
                self * other
            }
            fn far($random: &mut Random) -> Self {
                let x = $far;
                if $random.below(2) == 0 { x } else { -x }
            }
        }
    };
}

whole!(IBig, |random| IBig::from(random.bits() >> 1) << 70);
// Coordinates below 2^9. (Tests look for overflows.)
whole!(i64, |random| (random.bits() >> 34) as i64);

/// A vector in multiples of the unit.
pub type Vector<N = IBig> = [N; 3];

/// Coordinates are multiples of 2^-120.
const UNIT: i32 = -120;

/// A float in multiples of the unit.
pub fn whole(x: f64) -> IBig {
    let bits = x.to_bits();
    let biased = (bits >> 52) as i32 & 0x7ff;
    let fraction = (bits & ((1 << 52) - 1)) as i64;
    if biased == 0 {
        assert_eq!(fraction, 0, "{x:e} is no multiple of the unit");
        return IBig::ZERO;
    }
    let shift = biased - 1075 - UNIT;
    assert!(shift >= 0, "{x:e} is no multiple of the unit");
    let magnitude = IBig::from(fraction | 1 << 52) << shift as usize;
    if x < 0.0 { -magnitude } else { magnitude }
}

pub fn vector(point: [f64; 3]) -> Vector {
    point.map(whole)
}

pub fn sub<N: Whole>(p: &Vector<N>, q: &Vector<N>) -> Vector<N> {
    [0, 1, 2].map(|k| p[k].minus(&q[k]))
}

pub fn cross<N: Whole>(p: &Vector<N>, q: &Vector<N>) -> Vector<N> {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| p[i].times(&q[j]).minus(&p[j].times(&q[i])))
}

pub fn dot<N: Whole>(p: &Vector<N>, q: &Vector<N>) -> N {
    let [x, y, z] = [0, 1, 2].map(|k| p[k].times(&q[k]));
    x.plus(&y).plus(&z)
}

pub fn sign<N: Whole>(x: &N) -> i32 {
    match x.cmp(&N::default()) {
        std::cmp::Ordering::Less => -1,
        std::cmp::Ordering::Equal => 0,
        std::cmp::Ordering::Greater => 1,
    }
}

/// The sign of the volume of a tetrahedron.
pub fn volume<N: Whole>(a: &Vector<N>, b: &Vector<N>, c: &Vector<N>, d: &Vector<N>) -> i32 {
    sign(&dot(&cross(&sub(b, a), &sub(c, a)), &sub(d, a)))
}

/// Whether a segment contains a point.
fn is_on_segment<N: Whole>(p: &Vector<N>, a: &Vector<N>, b: &Vector<N>) -> bool {
    if a == b {
        return p == a;
    }
    let (way, to) = (sub(b, a), sub(p, a));
    let along = dot(&way, &to);
    cross(&way, &to).iter().all(|x| sign(x) == 0) && sign(&along) >= 0 && along <= dot(&way, &way)
}

/// Whether a triangle, which may be degenerate, contains a point.
pub fn is_on<N: Whole>(p: &Vector<N>, [a, b, c]: &[Vector<N>; 3]) -> bool {
    let edges = [(a, b), (b, c), (c, a)];
    if edges.iter().any(|(x, y)| is_on_segment(p, x, y)) {
        return true;
    }
    let normal = cross(&sub(b, a), &sub(c, a));
    sign(&dot(&normal, &sub(p, a))) == 0
        && edges.iter().all(|(x, y)| {
            let inner = cross(&normal, &sub(y, x));
            sign(&dot(&inner, &sub(p, x))) > 0
        })
}

/// How often a closed surface winds around a point that is not on it: the crossings of a segment to
/// a random far point, and of another one if it meets any edge.
pub fn winding<N: Whole>(p: &Vector<N>, faces: &[[Vector<N>; 3]], random: &mut Random) -> i32 {
    'ways: loop {
        let far: Vector<N> = [(); 3].map(|()| N::far(random));
        let mut sum = 0;
        for [a, b, c] in faces {
            let (near_side, far_side) = (volume(a, b, c, p), volume(a, b, c, &far));
            if near_side == 0 {
                // The segment leaves the plane of the face at once, beside it.
                continue;
            }
            let around = [(a, b), (b, c), (c, a)].map(|(x, y)| volume(p, &far, x, y));
            if around.contains(&0) || far_side == 0 {
                continue 'ways;
            }
            let is_through = around[0] == around[1] && around[1] == around[2];
            if is_through && near_side * far_side < 0 {
                // The far end is on the side of the normal: the segment leaves.
                sum += far_side;
            }
        }
        return sum;
    }
}

/// A fraction of squares of units; the denominator is positive.
#[derive(Debug, Clone)]
pub struct Fraction(pub IBig, pub IBig);

impl Fraction {
    pub fn compare(&self, other: &Fraction) -> std::cmp::Ordering {
        (&self.0 * &other.1).cmp(&(&other.0 * &self.1))
    }

    fn lesser(self, other: Fraction) -> Fraction {
        if other.compare(&self).is_lt() {
            other
        } else {
            self
        }
    }

    /// How the square root, in multiples of the unit, compares with a float.
    pub fn compare_root(&self, x: f64) -> std::cmp::Ordering {
        let x = whole(x);
        self.0.cmp(&(&(&x * &x) * &self.1))
    }
}

fn to_segment(p: &Vector, a: &Vector, b: &Vector) -> Fraction {
    let (way, to) = (sub(b, a), sub(p, a));
    let (along, length) = (dot(&way, &to), dot(&way, &way));
    if along <= IBig::ZERO {
        return Fraction(dot(&to, &to), IBig::ONE);
    }
    if along >= length {
        let to = sub(p, b);
        return Fraction(dot(&to, &to), IBig::ONE);
    }
    let moment = cross(&way, &to);
    Fraction(dot(&moment, &moment), length)
}

/// The square of the distance of a point from an element of one to three corners.
pub fn squared_distance(p: &Vector, corners: &[Vector]) -> Fraction {
    match corners {
        [a] => to_segment(p, a, a),
        [a, b] => to_segment(p, a, b),
        [a, b, c] => {
            let edges = [(a, b), (b, c), (c, a)];
            let to_edges = edges.map(|(x, y)| to_segment(p, x, y));
            let [first, second, third] = to_edges;
            let least = first.lesser(second).lesser(third);
            let normal = cross(&sub(b, a), &sub(c, a));
            let square = dot(&normal, &normal);
            let is_above = edges
                .iter()
                .all(|(x, y)| dot(&cross(&normal, &sub(y, x)), &sub(p, x)) > IBig::ZERO);
            if square == IBig::ZERO || !is_above {
                return least;
            }
            let height = dot(&normal, &sub(p, a));
            Fraction(&height * &height, square)
        }
        _ => panic!("one to three corners"),
    }
}
