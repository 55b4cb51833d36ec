//! Types of indices: numbers that mean different things have different types.
//!
//! ```text
//! PartIx     a part of a frame
//! ClusterIx   a cluster of a clustering
//! Slot       an element, by where it is in the order of a clustering
//! ElementIx   an element, by its number in its part of the body: as users number it
//! Number      an element, by its number among those of all parts of a frame
//! VertexIx    a vertex of a body, where it is passed around by itself
//!
//!             clustering          part
//!    Slot   ----------->  ElementIx  <----->  Number      two of them make the key of a pair
//! ```
//!
//! Bodies are named by [`BodyId`](crate::BodyId). The corners of elements, as users give them and
//! as kernels read them, are arrays of `u32`: vertices as the positions of their body are numbered.
//! Inside a kernel, indices are `u32` too; they get their type where they leave it.

use std::ops::Range;

/// The most elements that a group holds: one bit each in a 64-bit mask.
pub const GROUP: usize = 64;

macro_rules! index_types {
    ($($(#[$doc:meta])+ $name:ident)+) => {$(
        $(#[$doc])+
        #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(transparent)]
        pub struct $name(u32);

        impl $name {
            /// The index with this number.
            #[inline(always)]
            pub const fn new(raw: u32) -> Self {
                $name(raw)
            }

            /// The index of an entry of a list, which has at most 2^32 of them.
            #[inline(always)]
            pub const fn from_usize(index: usize) -> Self {
                debug_assert!(index as u32 as usize == index);
                $name(index as u32)
            }

            /// As a number: for kernels, devices and users.
            #[inline(always)]
            pub const fn raw(self) -> u32 {
                self.0
            }

            /// As an index of a list.
            #[inline(always)]
            pub const fn index(self) -> usize {
                self.0 as usize
            }

            /// The first `n` indices.
            #[inline(always)]
            pub fn up_to(n: usize) -> impl ExactSizeIterator<Item = Self> + Clone {
                Self::each(0..n)
            }

            /// The indices of a range of entries of a list.
            #[inline(always)]
            pub fn each(range: Range<usize>) -> impl ExactSizeIterator<Item = Self> + Clone {
                (Self::from_usize(range.start).0..Self::from_usize(range.end).0).map($name)
            }
        }
    )+};
}

index_types! {
    /// A part of a frame.
    PartIx

    /// A cluster of a clustering.
    ClusterIx

    /// Where an element is in the order of a clustering: cluster after cluster, [`GROUP`] elements
    /// each. Methods without clusters leave elements in the order in which users number them.
    ///
    /// ```text
    ///  31            6 5       0
    /// +---------------+---------+
    /// |    cluster    |  lane   |
    /// +---------------+---------+
    /// ```
    Slot

    /// An element of a part of a body, as users number it. Vertices are numbered as positions are.
    ElementIx

    /// The global number of an element in a frame: see [`frame`](crate::plan).
    Number

    /// A vertex of a body, as its positions are numbered.
    VertexIx
}

impl ClusterIx {
    /// The slot of the element in a lane.
    #[inline(always)]
    pub const fn slot(self, lane: u32) -> Slot {
        Slot(self.0 * GROUP as u32 + lane)
    }

    /// The slots of its elements, if all clusters have `n` elements together.
    #[inline(always)]
    pub fn slots(self, n: usize) -> Range<usize> {
        let first = self.index() * GROUP;
        first.min(n)..n.min(first + GROUP)
    }
}

impl Slot {
    /// The cluster that it belongs to.
    #[inline(always)]
    pub const fn cluster(self) -> ClusterIx {
        ClusterIx(self.0 / GROUP as u32)
    }

    /// Where it is in the cluster.
    #[inline(always)]
    pub const fn lane(self) -> u32 {
        self.0 % GROUP as u32
    }
}

impl ElementIx {
    /// The corners of a vertex, which is its own only corner.
    pub(crate) fn as_corners(&self) -> &[u32] {
        std::slice::from_ref(&self.0)
    }
}

impl Number {
    /// The number of an element, if this is the first number of its part.
    #[inline(always)]
    pub const fn plus(self, element: ElementIx) -> Number {
        Number(self.0 + element.0)
    }

    /// The element that has this number, given the first number of its part.
    #[inline(always)]
    pub const fn minus(self, first: Number) -> ElementIx {
        ElementIx(self.0 - first.0)
    }

    /// The key of a pair of which this is the lower number.
    #[inline(always)]
    pub const fn key_with(self, higher: Number) -> u64 {
        self.first_key() | higher.0 as u64
    }

    /// The lowest key of a pair whose lower number is this one.
    #[inline(always)]
    pub const fn first_key(self) -> u64 {
        (self.0 as u64) << 32
    }
}

/// The key of a pair of elements, lower number first: see [`frame`](crate::plan).
#[inline(always)]
pub fn pair_key(a: Number, b: Number) -> u64 {
    let (low, high) = if a < b { (a, b) } else { (b, a) };
    low.key_with(high)
}

/// The lower number of a pair.
#[inline(always)]
pub const fn lower_number(key: u64) -> Number {
    Number((key >> 32) as u32)
}

/// The numbers of a pair, lower number first.
#[inline(always)]
pub const fn pair_numbers(key: u64) -> [Number; 2] {
    [lower_number(key), Number(key as u32)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_a_cluster_and_a_lane() {
        for raw in [0, 63, 64, 65, 1000, u32::MAX] {
            let slot = Slot::new(raw);
            assert_eq!(slot.cluster().slot(slot.lane()), slot);
        }
        let slots = ClusterIx::up_to(3).map(|cluster| cluster.slots(130));
        assert_eq!(Vec::from_iter(slots), [0..64, 64..128, 128..130]);
        assert!(ClusterIx::new(3).slots(130).is_empty());
    }

    #[test]
    fn keys_are_sorted_as_pairs_of_numbers_are() {
        let numbers = [0, 1, 7, u32::MAX - 1, u32::MAX].map(Number::new);
        let mut keys = Vec::new();
        for (ix, &low) in numbers.iter().enumerate() {
            for &high in &numbers[ix..] {
                assert_eq!(pair_key(low, high), pair_key(high, low));
                assert_eq!(pair_numbers(pair_key(low, high)), [low, high]);
                assert_eq!(lower_number(low.key_with(high)), low);
                keys.push(pair_key(low, high));
            }
            assert!(low.first_key() <= pair_key(low, low));
        }
        assert!(keys.is_sorted());
    }

    #[test]
    fn a_number_is_that_of_an_element_of_a_part() {
        let (first, element) = (Number::new(100), ElementIx::new(5));
        assert_eq!(first.plus(element), Number::new(105));
        assert_eq!(first.plus(element).minus(first), element);
    }
}
