//! The registers of x86-64: 256 and 512 bits.
//!
//! A register is made and used only inside functions compiled for its instruction set, and those
//! are called only where the processor was found to have it: the contract of
//! [`internal`](crate::internal).

use core::arch::x86_64::*;

use super::memory::{read, write};
use super::*;

/// The result of some operations, in a function compiled for an instruction set, in which they are
/// safe. It is inlined into every function that is compiled for that set.
macro_rules! compiled {
    ($set:literal, ($($name:ident: $type:ty = $value:expr),*) -> $result:ty { $operations:expr }) => {{
        #[inline]
        #[target_feature(enable = $set)]
        fn compiled($($name: $type),*) -> $result {
            $operations
        }
        // SAFETY: registers of a set are used only where the processor has it, by the contract of
        // `internal`.
        unsafe { compiled($($value),*) }
    }};
}

macro_rules! register {
    (
        $(#[$doc:meta])*
        $set:literal $type:ident($register:ident), $mask:ident($bits:ident), $limits:expr,
        add $add:ident, sub $sub:ident, mul $mul:ident, div $div:ident,
        max $max:ident, sqrt $sqrt:ident,
        splat |$x:ident| $splat:expr,
        abs |$y:ident| $abs:expr,
        gt |$a:ident, $b:ident| $gt:expr,
        select |$m:ident, $yes:ident, $no:ident| $select:expr,
        and |$p:ident, $q:ident| $and:expr,
        or |$r:ident, $s:ident| $or:expr,
        xor |$t:ident, $u:ident| $xor:expr,
        not |$v:ident| $not:expr $(,)?
    ) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy)]
        pub struct $type(pub $register);

        /// A condition for each number.
        #[derive(Debug, Clone, Copy)]
        pub struct $mask($bits);

        operator!($type, Add, add, |a, b| $type(compiled!(
            $set, (a: $register = a.0, b: $register = b.0) -> $register { $add(a, b) }
        )));
        operator!($type, Sub, sub, |a, b| $type(compiled!(
            $set, (a: $register = a.0, b: $register = b.0) -> $register { $sub(a, b) }
        )));
        operator!($type, Mul, mul, |a, b| $type(compiled!(
            $set, (a: $register = a.0, b: $register = b.0) -> $register { $mul(a, b) }
        )));
        operator!($type, Div, div, |a, b| $type(compiled!(
            $set, (a: $register = a.0, b: $register = b.0) -> $register { $div(a, b) }
        )));
        operator!($mask, BitAnd, bitand, |a, b| $mask(compiled!(
            $set, ($p: $bits = a.0, $q: $bits = b.0) -> $bits { $and }
        )));
        operator!($mask, BitOr, bitor, |a, b| $mask(compiled!(
            $set, ($r: $bits = a.0, $s: $bits = b.0) -> $bits { $or }
        )));
        operator!($mask, BitXor, bitxor, |a, b| $mask(compiled!(
            $set, ($t: $bits = a.0, $u: $bits = b.0) -> $bits { $xor }
        )));

        impl Not for $mask {
            type Output = Self;
            #[inline(always)]
            fn not(self) -> Self {
                $mask(compiled!($set, ($v: $bits = self.0) -> $bits { $not }))
            }
        }

        impl Number for $type {
            type Mask = $mask;
            const LIMITS: FormatLimits = $limits;

            #[inline(always)]
            fn splat(x: f64) -> Self {
                $type(compiled!($set, ($x: f64 = x) -> $register { $splat }))
            }
            #[inline(always)]
            fn abs(self) -> Self {
                $type(compiled!($set, ($y: $register = self.0) -> $register { $abs }))
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                $type(compiled!($set, (x: $register = self.0) -> $register { $sqrt(x) }))
            }
            #[inline(always)]
            fn larger(self, other: Self) -> Self {
                $type(compiled!(
                    $set, (a: $register = self.0, b: $register = other.0) -> $register { $max(a, b) }
                ))
            }
            #[inline(always)]
            fn gt(self, other: Self) -> $mask {
                $mask(compiled!(
                    $set, ($a: $register = self.0, $b: $register = other.0) -> $bits { $gt }
                ))
            }
            #[inline(always)]
            fn select(mask: $mask, yes: Self, no: Self) -> Self {
                $type(compiled!(
                    $set,
                    ($m: $bits = mask.0, $yes: $register = yes.0, $no: $register = no.0) -> $register {
                        $select
                    }
                ))
            }
        }
    };
}

register! {
    /// Four numbers in a 256-bit register. To be used where `avx2` was detected.
    "avx2" Avx2(__m256d), Avx2Mask(__m256d), FormatLimits::F64,
    add _mm256_add_pd, sub _mm256_sub_pd, mul _mm256_mul_pd, div _mm256_div_pd,
    max _mm256_max_pd, sqrt _mm256_sqrt_pd,
    splat |x| _mm256_set1_pd(x),
    abs |x| _mm256_andnot_pd(_mm256_set1_pd(-0.0), x),
    gt |a, b| _mm256_cmp_pd::<_CMP_GT_OQ>(a, b),
    select |mask, yes, no| _mm256_blendv_pd(no, yes, mask),
    and |a, b| _mm256_and_pd(a, b),
    or |a, b| _mm256_or_pd(a, b),
    xor |a, b| _mm256_xor_pd(a, b),
    not |a| _mm256_xor_pd(a, _mm256_castsi256_pd(_mm256_set1_epi32(-1))),
}

register! {
    /// Eight `f32` in a 256-bit register. To be used where `avx2` was detected.
    "avx2" Avx2F32(__m256), Avx2F32Mask(__m256), FormatLimits::F32,
    add _mm256_add_ps, sub _mm256_sub_ps, mul _mm256_mul_ps, div _mm256_div_ps,
    max _mm256_max_ps, sqrt _mm256_sqrt_ps,
    splat |x| _mm256_set1_ps(x as f32),
    abs |x| _mm256_andnot_ps(_mm256_set1_ps(-0.0), x),
    gt |a, b| _mm256_cmp_ps::<_CMP_GT_OQ>(a, b),
    select |mask, yes, no| _mm256_blendv_ps(no, yes, mask),
    and |a, b| _mm256_and_ps(a, b),
    or |a, b| _mm256_or_ps(a, b),
    xor |a, b| _mm256_xor_ps(a, b),
    not |a| _mm256_xor_ps(a, _mm256_castsi256_ps(_mm256_set1_epi32(-1))),
}

register! {
    /// Eight numbers in a 512-bit register. To be used where `avx512f` was detected.
    "avx512f" Avx512(__m512d), Avx512Mask(__mmask8), FormatLimits::F64,
    add _mm512_add_pd, sub _mm512_sub_pd, mul _mm512_mul_pd, div _mm512_div_pd,
    max _mm512_max_pd, sqrt _mm512_sqrt_pd,
    splat |x| _mm512_set1_pd(x),
    abs |x| _mm512_abs_pd(x),
    gt |a, b| _mm512_cmp_pd_mask::<_CMP_GT_OQ>(a, b),
    select |mask, yes, no| _mm512_mask_blend_pd(mask, no, yes),
    and |a, b| a & b,
    or |a, b| a | b,
    xor |a, b| a ^ b,
    not |a| !a,
}

register! {
    /// Sixteen `f32` in a 512-bit register. To be used where `avx512f` was detected.
    "avx512f" Avx512F32(__m512), Avx512F32Mask(__mmask16), FormatLimits::F32,
    add _mm512_add_ps, sub _mm512_sub_ps, mul _mm512_mul_ps, div _mm512_div_ps,
    max _mm512_max_ps, sqrt _mm512_sqrt_ps,
    splat |x| _mm512_set1_ps(x as f32),
    abs |x| _mm512_abs_ps(x),
    gt |a, b| _mm512_cmp_ps_mask::<_CMP_GT_OQ>(a, b),
    select |mask, yes, no| _mm512_mask_blend_ps(mask, no, yes),
    and |a, b| a & b,
    or |a, b| a | b,
    xor |a, b| a ^ b,
    not |a| !a,
}

impl Vector for Avx2 {
    const N: usize = 4;

    #[inline(always)]
    fn load(lanes: &[f64; LANES], first: usize) -> Self {
        Avx2(read::<[f64; 4], _>(
            lanes[first..].first_chunk().expect("four lanes"),
        ))
    }
    #[inline(always)]
    fn store(self, lanes: &mut [f64; LANES], first: usize) {
        write::<[f64; 4], _>(
            self.0,
            lanes[first..].first_chunk_mut().expect("four lanes"),
        );
    }
    #[inline(always)]
    fn bits(mask: Avx2Mask) -> u8 {
        compiled!("avx2", (mask: __m256d = mask.0) -> u8 { _mm256_movemask_pd(mask) as u8 })
    }
}

impl Vector for Avx512 {
    const N: usize = LANES;

    #[inline(always)]
    fn load(lanes: &[f64; LANES], _: usize) -> Self {
        Avx512(read(lanes))
    }
    #[inline(always)]
    fn store(self, lanes: &mut [f64; LANES], _: usize) {
        write(self.0, lanes);
    }
    #[inline(always)]
    fn bits(mask: Avx512Mask) -> u8 {
        mask.0
    }
}

impl Lookup for Avx2F32 {
    const N: usize = 8;
    type Slots = __m256i;

    #[inline(always)]
    fn slots(slots: &[u8; BATCH], first: usize) -> __m256i {
        let eight: &[u8; 8] = slots[first..].first_chunk().expect("eight lanes");
        let eight = i64::from_le_bytes(*eight);
        compiled!("avx2", (eight: i64 = eight) -> __m256i {
            _mm256_and_si256(
                _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(eight)),
                _mm256_set1_epi32(TABLE as i32 - 1),
            )
        })
    }
    #[inline(always)]
    fn look_up(table: &[f32; TABLE], slots: __m256i) -> Self {
        #[inline]
        #[target_feature(enable = "avx2")]
        fn gather(table: &[f32; TABLE], slots: __m256i) -> __m256 {
            let slots = _mm256_and_si256(slots, _mm256_set1_epi32(TABLE as i32 - 1));
            // SAFETY: every slot is below the length of the table, as just made.
            unsafe { _mm256_i32gather_ps::<4>(table.as_ptr(), slots) }
        }
        // SAFETY: registers of AVX2 are used only where the processor has it, by the contract of
        // `internal`.
        Avx2F32(unsafe { gather(table, slots) })
    }
    #[inline(always)]
    fn row(numbers: &[f32], first: usize) -> Self {
        Avx2F32(read::<[f32; 8], _>(
            numbers[first..].first_chunk().expect("eight numbers"),
        ))
    }
    #[inline(always)]
    fn put(self, row: &mut [f32], first: usize) {
        write::<[f32; 8], _>(
            self.0,
            row[first..].first_chunk_mut().expect("eight numbers"),
        );
    }
    #[inline(always)]
    fn bits(mask: Avx2F32Mask) -> u16 {
        compiled!("avx2", (mask: __m256 = mask.0) -> u16 { _mm256_movemask_ps(mask) as u16 })
    }
}

impl Lookup for Avx512F32 {
    const N: usize = 16;
    type Slots = __m512i;

    #[inline(always)]
    fn slots(slots: &[u8; BATCH], _: usize) -> __m512i {
        compiled!("avx512f", (slots: __m128i = read(slots)) -> __m512i {
            _mm512_cvtepu8_epi32(slots)
        })
    }
    #[inline(always)]
    fn look_up(table: &[f32; TABLE], slots: __m512i) -> Self {
        const {
            assert!(TABLE == 64, "two permutations of 32 and a choice");
        }
        let (rows, _) = table.as_chunks::<16>();
        // A permutation reads the five lowest bits of a slot, the blend reads the sixth.
        Avx512F32(compiled!(
            "avx512f",
            (rows: [__m512; 4] = [read(&rows[0]), read(&rows[1]), read(&rows[2]), read(&rows[3])],
             slots: __m512i = slots) -> __m512 {{
                let low = _mm512_permutex2var_ps(rows[0], slots, rows[1]);
                let high = _mm512_permutex2var_ps(rows[2], slots, rows[3]);
                let is_high = _mm512_test_epi32_mask(slots, _mm512_set1_epi32(32));
                _mm512_mask_blend_ps(is_high, low, high)
            }}
        ))
    }
    #[inline(always)]
    fn row(numbers: &[f32], first: usize) -> Self {
        Avx512F32(read::<[f32; 16], _>(
            numbers[first..].first_chunk().expect("sixteen numbers"),
        ))
    }
    #[inline(always)]
    fn put(self, row: &mut [f32], first: usize) {
        write::<[f32; 16], _>(
            self.0,
            row[first..].first_chunk_mut().expect("sixteen numbers"),
        );
    }
    #[inline(always)]
    fn bits(mask: Avx512F32Mask) -> u16 {
        mask.0
    }
}
