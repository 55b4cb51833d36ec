//! What several tests build on.

/// The faces of a box, outward. Corner 4 x + 2 y + z is at the high end of the axes whose digit is
/// 1.
pub const BOX: [[u32; 3]; 12] = [
    [0, 1, 3],
    [0, 3, 2],
    [4, 6, 7],
    [4, 7, 5],
    [0, 4, 5],
    [0, 5, 1],
    [2, 3, 7],
    [2, 7, 6],
    [0, 2, 6],
    [0, 6, 4],
    [1, 5, 7],
    [1, 7, 3],
];

/// The corners of a box.
pub fn corners<T: Copy>(low: [T; 3], high: [T; 3]) -> Vec<[T; 3]> {
    let end = |ix: usize, axis: usize| [low, high][ix >> (2 - axis) & 1][axis];
    (0..8)
        .map(|ix| [0, 1, 2].map(|axis| end(ix, axis)))
        .collect()
}
