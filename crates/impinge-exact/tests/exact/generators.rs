//! Random points of many kinds, most of them made to cause trouble.

/// A small generator of pseudo-random numbers: splitmix64 (Steele, Lea, Flood 2014).
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// An integer below `n`.
    pub fn below(&mut self, n: u64) -> u64 {
        self.bits() % n
    }

    /// A number in [-1, 1).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * (2.0 / (1_u64 << 53) as f64) - 1.0
    }

    pub fn pick<T: Copy>(&mut self, values: &[T]) -> T {
        values[self.below(values.len() as u64) as usize]
    }

    /// A random order of 0..N.
    pub fn permutation<const N: usize>(&mut self) -> [usize; N] {
        let mut order = std::array::from_fn(|ix| ix);
        for ix in (1..N).rev() {
            order.swap(ix, self.below(ix as u64 + 1) as usize);
        }
        order
    }

    /// A finite `f32` of any exponent, widened; all bit patterns are equally likely.
    pub fn any_f32(&mut self) -> f64 {
        loop {
            let x = f32::from_bits(self.bits() as u32);
            if x.is_finite() {
                return f64::from(x);
            }
        }
    }
}

/// A kind of points.
#[derive(Clone, Copy, Debug)]
pub enum Kind {
    /// Integer points {0..n}^3: many are coincident, collinear or coplanar.
    Lattice(u64),
    /// Lattice points under one linear map with 24-bit entries: degenerate in no axis.
    Skewed(u64),
    /// Lattice points {0..n}^2 of one plane in general position: all coplanar, often collinear or
    /// coincident.
    Planar(u64),
    /// `f32` numbers of similar size.
    Plain,
    /// Any finite `f32`, from the smallest subnormal to the largest number.
    AnyF32,
    /// A few values of very different size, so that coordinates often coincide.
    Palette,
    /// Blends of common points, rounded to `f32`, then moved by at most one unit in the last place.
    NearlyTouching,
    /// As `NearlyTouching`, in `f64`.
    NearlyTouching64,
    /// `f64` numbers of any exponent.
    WideF64,
    /// A few `f64` from both ends of the range and from between.
    Ends,
    /// Lattice points, each axis times a power of two of its own, from one end of the range to the
    /// other.
    Stretched(u64),
    /// As `NearlyTouching64`, times a power of two near one end of the range.
    NearlyTouchingAtEnds,
}

impl Kind {
    pub const ALL: [Self; 13] = [
        Self::Lattice(2),
        Self::Lattice(3),
        Self::Skewed(2),
        Self::Planar(4),
        Self::Plain,
        Self::AnyF32,
        Self::Palette,
        Self::NearlyTouching,
        Self::NearlyTouching64,
        Self::WideF64,
        Self::Ends,
        Self::Stretched(2),
        Self::NearlyTouchingAtEnds,
    ];

    /// Whether coordinates leave the range in which doubles decide: big integers make the tests
    /// slow.
    pub fn is_wide(self) -> bool {
        matches!(
            self,
            Self::WideF64 | Self::Ends | Self::Stretched(_) | Self::NearlyTouchingAtEnds
        )
    }

    /// N points of this kind.
    pub fn points<const N: usize>(self, random: &mut Random) -> [[f64; 3]; N] {
        match self {
            Self::Lattice(n) => [(); N].map(|()| [(); 3].map(|()| random.below(n + 1) as f64)),
            Self::Skewed(n) => on_skewed_lattice(random, [n, n, n]),
            Self::Planar(n) => on_skewed_lattice(random, [n, n, 0]),
            Self::Plain => [(); N].map(|()| [(); 3].map(|()| f64::from(random.unit() as f32))),
            Self::AnyF32 => [(); N].map(|()| [(); 3].map(|()| random.any_f32())),
            Self::Palette => {
                let tiny = f64::from(f32::from_bits(1));
                let huge = f64::from(f32::MAX);
                let values = [
                    0.0,
                    -0.0,
                    tiny,
                    -tiny,
                    1e-20,
                    1.0,
                    -1.0,
                    1.0 + 1e-7,
                    3e37,
                    huge,
                    -huge,
                ];
                [(); N].map(|()| [(); 3].map(|()| f64::from(random.pick(&values) as f32)))
            }
            Self::NearlyTouching => nearly_touching(random, |x, steps| {
                let x = x as f32;
                f64::from(match steps {
                    1 => x.next_up(),
                    2 => x.next_down(),
                    _ => x,
                })
            }),
            Self::NearlyTouching64 => nearly_touching(random, |x, steps| match steps {
                1 => x.next_up(),
                2 => x.next_down(),
                _ => x,
            }),
            Self::WideF64 => [(); N].map(|()| {
                [(); 3].map(|()| {
                    let exponent = random.below(1023 + 1075) as i32 - 1074;
                    let mantissa = (1.0 + random.unit().abs()).min(1.999);
                    scaled(mantissa, exponent) * random.pick(&[-1.0, 1.0])
                })
            }),
            Self::Ends => {
                let least = f64::from_bits(1);
                let values = [
                    0.0,
                    -0.0,
                    least,
                    -3.0 * least,
                    1e-320,
                    f64::MIN_POSITIVE,
                    5e-76,
                    -1e-160,
                    1.0,
                    -1.0,
                    1.0_f64.next_up(),
                    1e160,
                    -f64::MAX / 4.0,
                    f64::MAX,
                    -f64::MAX,
                ];
                [(); N].map(|()| [(); 3].map(|()| random.pick(&values)))
            }
            Self::Stretched(n) => {
                let exponents = [(); 3].map(|()| random.pick(&[-1074, -1030, -700, 0, 700, 1022]));
                [(); N].map(|()| exponents.map(|by| scaled(random.below(n + 1) as f64 * 0.99, by)))
            }
            Self::NearlyTouchingAtEnds => {
                let exponent = random.pick(&[-1060, -1000, -300, 300, 1020]);
                nearly_touching(random, |x, steps| {
                    let x = scaled(x, exponent);
                    match steps {
                        1 => x.next_up(),
                        2 => x.next_down(),
                        _ => x,
                    }
                })
            }
        }
    }
}

/// A number times a power of two, which may itself be out of range.
fn scaled(x: f64, exponent: i32) -> f64 {
    let half = exponent / 2;
    x * 2.0_f64.powi(half) * 2.0_f64.powi(exponent - half)
}

/// N points of {0..n}^3, with an n for each axis, under a random linear map with 24-bit entries.
fn on_skewed_lattice<const N: usize>(random: &mut Random, n: [u64; 3]) -> [[f64; 3]; N] {
    let axes = [(); 3].map(|()| [(); 3].map(|()| (random.unit() * 8e6).round()));
    [(); N].map(|()| {
        let at = n.map(|n| random.below(n + 1) as f64);
        std::array::from_fn(|k| (0..3).map(|axis| at[axis] * axes[axis][k]).sum())
    })
}

/// N points, each a blend with small integer weights of three of four common points.
fn nearly_touching<const N: usize>(
    random: &mut Random,
    round: impl Fn(f64, u64) -> f64,
) -> [[f64; 3]; N] {
    let common: [[f64; 3]; 4] = [(); 4].map(|()| [(); 3].map(|()| f64::from(random.unit() as f32)));
    [(); N].map(|()| {
        let weights = [(); 3].map(|()| random.below(4) as f64);
        let sum: f64 = weights.iter().sum::<f64>().max(1.0);
        let corners = [(); 3].map(|()| random.pick(&common));
        std::array::from_fn(|axis| {
            let blend: f64 = (0..3).map(|k| weights[k] * corners[k][axis]).sum();
            let at = blend / sum;
            round(if at.abs() < 1e-30 { 0.0 } else { at }, random.below(6))
        })
    })
}
