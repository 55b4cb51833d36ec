//! Meshes for the page's view in three dimensions.
//!
//! A mesh is base64 in an element of the page that browsers do not read before it is asked for:
//! positions as `f32` from the middle of the mesh in units of its radius, three corners per face as
//! `u32`, one colour per face as `u8`, all little-endian. Faces without a finding come first; those of
//! an assembly are in the order of its parts.

use impinge_render::{Camera, Face, Focus, Surface};

use super::base64;
use crate::picture::bounds;

/// The most faces on a page, for all meshes together: about 25 MB of text.
const MOST_FACES: usize = 1_000_000;
/// The most and the fewest faces of one mesh.
const OF_ONE: [usize; 2] = [2_000, 200_000];

/// The most faces of a mesh where a page has so many meshes.
pub fn share(n_meshes: usize) -> usize {
    let [low, high] = OF_ONE;
    (MOST_FACES / n_meshes.max(1)).clamp(low, high)
}

/// A point to look at, and the size of what is there.
pub type Spot = ([f64; 3], f64);

/// The element with a mesh. Of a mesh with more than `most` faces it holds those that have a
/// finding and those around the places; of one without places, nothing. `parts`: how many faces
/// each part of an assembly has.
pub fn element(surface: &Surface, places: &[Spot], parts: &[usize], most: usize) -> Option<String> {
    let n_faces = surface.faces.len();
    let chosen: Vec<usize> = if n_faces <= most {
        (0..n_faces).collect()
    } else if places.is_empty() {
        return None;
    } else {
        around(surface, places, most)
    };
    let mut end = 0;
    let ends = parts.iter().map(|n| {
        end += n;
        chosen.partition_point(|&ix| ix < end).to_string()
    });
    let parts = match parts {
        [] => String::new(),
        _ => format!("data-parts=\"{}\" ", ends.collect::<Vec<_>>().join(",")),
    };
    let faces = chosen.iter().map(|&ix| surface.faces[ix]);
    let (fine, found): (Vec<Face>, Vec<Face>) = faces.partition(|face| !face.shows_through);
    let n_fine = fine.len();

    let mut number = vec![u32::MAX; surface.positions.len()];
    let mut corners = Vec::new();
    let mut points = Vec::new();
    let mut palette: Vec<[u8; 3]> = Vec::new();
    let mut colors = Vec::new();
    for face in fine.iter().chain(&found) {
        for corner in face.corners {
            let place = &mut number[corner as usize];
            if *place == u32::MAX {
                *place = points.len() as u32;
                points.push(surface.positions[corner as usize]);
            }
            corners.push(*place);
        }
        let known = palette.iter().position(|&color| color == face.color);
        let color = known.unwrap_or_else(|| {
            palette.push(face.color);
            palette.len() - 1
        });
        colors.push(color as u8);
    }
    let (middle, radius) = ball(&points)?;
    let mut bytes = Vec::with_capacity(12 * points.len() + 4 * corners.len() + colors.len());
    for point in &points {
        for k in 0..3 {
            bytes.extend((((point[k] - middle[k]) / radius) as f32).to_le_bytes());
        }
    }
    for corner in &corners {
        bytes.extend(corner.to_le_bytes());
    }
    bytes.extend(&colors);

    let colors: Vec<String> = palette.iter().flatten().map(u8::to_string).collect();
    let [x, y, z] = middle;
    let mut text = format!(
        "<script type=\"application/octet-stream\" {parts}data-points=\"{}\" data-fine=\"{n_fine}\" data-found=\"{}\" \
         data-all=\"{n_faces}\" data-middle=\"{x:?},{y:?},{z:?}\" data-radius=\"{radius:?}\" data-colors=\"{}\">",
        points.len(),
        found.len(),
        colors.join(",")
    );
    text += &base64(&bytes);
    text += "</script>";
    Some(text)
}

/// What the view looks at and from where, as attributes.
pub fn attributes(camera: &Camera, focus: &Focus) -> String {
    let ([x, y, z], distance) = (focus.target, focus.distance);
    let (azimuth, elevation) = (camera.azimuth, camera.elevation);
    format!(
        "data-point=\"{x:?},{y:?},{z:?}\" data-from=\"{azimuth:.1},{elevation:.1},{distance:?}\""
    )
}

/// The numbers of the faces with a finding and of those that are nearest to a place, by their first
/// corner and in sizes of the place.
fn around(surface: &Surface, places: &[Spot], most: usize) -> Vec<usize> {
    let far = |face: &Face| {
        if face.shows_through {
            return 0.0;
        }
        let corner = surface.positions[face.corners[0] as usize];
        let to = |(point, size): &Spot| {
            let [x, y, z] = [0, 1, 2].map(|k| corner[k] - point[k]);
            x.hypot(y).hypot(z) / size.max(f64::MIN_POSITIVE)
        };
        places.iter().map(to).fold(f64::INFINITY, f64::min)
    };
    let mut order: Vec<(f64, usize)> = surface.faces.iter().map(far).zip(0..).collect();
    order.select_nth_unstable_by(most, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut chosen: Vec<usize> = order[..most].iter().map(|&(_, ix)| ix).collect();
    chosen.sort_unstable();
    chosen
}

/// The middle of the box around points, and how far its corners are from there; none where nothing
/// can be drawn.
fn ball(points: &[[f64; 3]]) -> Option<([f64; 3], f64)> {
    let [low, high] = bounds(points);
    let half = [0, 1, 2].map(|k| high[k] / 2.0 - low[k] / 2.0);
    let middle = [0, 1, 2].map(|k| low[k] + half[k]);
    let radius = half[0].hypot(half[1]).hypot(half[2]);
    (radius > 0.0 && radius.is_finite()).then_some((middle, radius))
}
