//! A mesh whose faces of zero area are neighbours.

use crate::common::{BOX, corners};

/// Two boxes that touch along an edge, three of whose four faces there are split, at a quarter, a
/// half and three quarters of it. A face of zero area stitches each split to the whole edge: these
/// faces are neighbours of one another there.
pub fn stitched_boxes() -> (Vec<[i64; 3]>, Vec<[u32; 3]>) {
    let mut points = corners([-4, -4, 0], [0, 0, 4]);
    points.extend(corners([0, 0, 0], [4, 4, 4]));
    let mut faces = BOX.to_vec();
    faces.extend(BOX.map(|face| face.map(|v| v + 8)));
    for middle in 16..19 {
        let is_on = |v: u32| v < 16 && points[v as usize][..2] == [0, 0];
        let has_edge = |&[x, y, z]: &[u32; 3]| x < 16 && !is_on(x) && is_on(y) && is_on(z);
        let turns = |[x, y, z]: [u32; 3]| [[x, y, z], [y, z, x], [z, x, y]];
        let whole = |&face: &[u32; 3]| turns(face).into_iter().find(has_edge);
        let at = (0..faces.len()).find(|&at| whole(&faces[at]).is_some());
        let face = faces.remove(at.unwrap_or_default());
        let [x, y, z] = whole(&face).unwrap_or(face);
        points.push([0, 0, i64::from(middle) - 15]);
        faces.extend([[x, y, middle], [x, middle, z], [y, z, middle]]);
    }
    (points, faces)
}
