//! A small random number generator: the same numbers on every machine.

/// SplitMix64 (Steele, Lea, Flood 2014, "Fast splittable pseudorandom number generators"): a
/// counter in steps of the golden ratio, mixed. Good enough for scenes, not for cryptography.
#[derive(Debug, Clone)]
pub struct Random(u64);

impl Random {
    /// A generator; equal seeds give equal numbers.
    pub fn new(seed: u64) -> Self {
        Random(seed)
    }

    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    }

    /// Uniform in 0 to 1, 1 excluded: a multiple of 2^-24, so exact.
    pub fn unit(&mut self) -> f32 {
        // 24 bits fit the significand of f32: neither the cast nor the product rounds.
        (self.bits() >> 40) as f32 / (1u32 << 24) as f32
    }

    /// Uniform in `low` to `high`.
    pub fn range(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// Uniform in 0 to `n`, `n` excluded; 0 for `n` = 0.
    pub fn below(&mut self, n: u32) -> u32 {
        // The high half of a 32 x 32 bit product (Lemire 2019); its bias is below 2^-32 n.
        let product = (self.bits() >> 32) * u64::from(n);
        (product >> 32) as u32
    }

    /// A point uniform in the box from `low` to `high` on all axes.
    pub fn point(&mut self, low: f32, high: f32) -> [f32; 3] {
        std::array::from_fn(|_| self.range(low, high))
    }
}
