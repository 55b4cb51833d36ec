//! Which instruction set is used, and how a kernel is compiled once per set.

use crate::bvh::bounds::Aabb;
use crate::query::settings::InstructionSet;

use super::{LaneBounds, Simd};
use impinge_exact::NearestPoints;
use impinge_exact::internal::{PairAtPart, closest_by_part};

/// The instruction sets that kernels are compiled for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Isa {
    /// Plain loops.
    Portable,
    /// 256 bits.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// 512 bits.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Isa {
    /// Whether `put_corners` looks up corners among a cluster's own vertices.
    pub(crate) fn looks_corners_up(self) -> bool {
        #[cfg(target_arch = "x86_64")]
        {
            self == Isa::Avx512
        }
        #[cfg(not(target_arch = "x86_64"))]
        {
            false
        }
    }

    /// Whether `add_runs` is faster than computing boxes: with plain loops it is not.
    pub(crate) fn reads_runs(self) -> bool {
        self != Isa::Portable
    }

    /// The best instruction set that this processor has and that is allowed.
    pub fn detect(allowed: InstructionSet) -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            if allowed >= InstructionSet::Avx512
                && is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512vl")
                && is_x86_feature_detected!("avx512dq")
                && is_x86_feature_detected!("avx512bw")
                && is_x86_feature_detected!("avx512vbmi2")
                && is_x86_feature_detected!("bmi1")
                && is_x86_feature_detected!("bmi2")
                && is_x86_feature_detected!("popcnt")
                && is_x86_feature_detected!("lzcnt")
            {
                return Isa::Avx512;
            }
            if allowed >= InstructionSet::Avx2
                && is_x86_feature_detected!("avx2")
                && is_x86_feature_detected!("bmi1")
                && is_x86_feature_detected!("bmi2")
                && is_x86_feature_detected!("popcnt")
                && is_x86_feature_detected!("lzcnt")
            {
                return Isa::Avx2;
            }
        }
        let _ = allowed;
        Isa::Portable
    }
}

/// Calls a kernel `fn kernel(simd: impl Simd, …)`, marked `inline(always)`, compiled for `$isa`.
macro_rules! with_isa {
    ($isa:expr, $kernel:path, $(<$($generic:ident: $bound:ident),+>)? ($($name:ident: $type:ty = $value:expr),* $(,)?) $(-> $result:ty)?) => {{
        // A separate function, like the others: without optimisation, a kernel's stack frame is
        // half a megabyte.
        fn portable$(<$($generic: $bound),+>)?($($name: $type),*) $(-> $result)? {
            $kernel($crate::simd::Portable, $($name),*)
        }
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2,bmi1,bmi2,popcnt,lzcnt")]
        fn avx2$(<$($generic: $bound),+>)?($($name: $type),*) $(-> $result)? {
            // SAFETY: the caller's features include AVX2.
            $kernel(unsafe { $crate::simd::Avx2::new() }, $($name),*)
        }
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx512vbmi2,avx2,bmi1,bmi2,popcnt,lzcnt")]
        fn avx512$(<$($generic: $bound),+>)?($($name: $type),*) $(-> $result)? {
            // SAFETY: the caller's features include AVX-512 F, VL, DQ, BW and VBMI2.
            $kernel(unsafe { $crate::simd::Avx512::new() }, $($name),*)
        }
        match $isa {
            $crate::simd::Isa::Portable => portable($($value),*),
            // SAFETY: an `Isa` is only ever one that `Isa::detect` found on this processor.
            #[cfg(target_arch = "x86_64")]
            $crate::simd::Isa::Avx2 => unsafe { avx2($($value),*) },
            // SAFETY: `Isa::detect` gives `Avx512` only where the processor has these features.
            #[cfg(target_arch = "x86_64")]
            $crate::simd::Isa::Avx512 => unsafe { avx512($($value),*) },
        }
    }};
}
pub(crate) use with_isa;

/// The nearest points of each pair.
pub fn closest_of_pairs(isa: Isa, pairs: &[PairAtPart], found: &mut [Option<NearestPoints>]) {
    with_isa!(isa, all_closest, (
        pairs: &[PairAtPart] = pairs,
        found: &mut [Option<NearestPoints>] = found,
    ));
}

#[inline(always)]
fn all_closest<S: Simd>(_: S, pairs: &[PairAtPart], found: &mut [Option<NearestPoints>]) {
    closest_by_part::<S::F64>(pairs, &mut |ix, closest| found[ix] = Some(closest));
}

/// For each query, which of the lanes of `among` it overlaps: `overlaps_64` for callers that are
/// not themselves compiled once per instruction set. Answers as many queries as there are masks.
pub fn masks(isa: Isa, boxes: &LaneBounds, among: u64, queries: &[Aabb], masks: &mut [u64]) {
    with_isa!(isa, all_masks, (
        boxes: &LaneBounds = boxes,
        among: u64 = among,
        queries: &[Aabb] = queries,
        masks: &mut [u64] = masks,
    ));
}

#[inline(always)]
fn all_masks<S: Simd>(
    simd: S,
    boxes: &LaneBounds,
    among: u64,
    queries: &[Aabb],
    masks: &mut [u64],
) {
    for (mask, query) in masks.iter_mut().zip(queries) {
        *mask = simd.overlaps_64(boxes, query, among);
    }
}
