//! The colours of bodies, in meshes and in pictures.

/// sRGB.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BodyColors {
    /// The colour of elements that take part in a pair.
    pub colliding: [u8; 3],
    /// The colour of all other elements.
    pub other: [u8; 3],
}

/// Red, blue, green, orange, …
const COLLIDING: [[u8; 3]; 8] = [
    [214, 39, 40],
    [27, 95, 217],
    [44, 160, 44],
    [255, 127, 14],
    [148, 103, 189],
    [23, 190, 207],
    [227, 119, 194],
    [188, 189, 34],
];

/// Two greys that are just distinguishable.
const OTHER: [[u8; 3]; 2] = [[200, 200, 200], [172, 178, 188]];

/// The colours of a body by its number; they repeat after the last one.
pub fn body(ix: usize) -> BodyColors {
    BodyColors {
        colliding: COLLIDING[ix % COLLIDING.len()],
        other: OTHER[ix % OTHER.len()],
    }
}
