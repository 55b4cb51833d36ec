//! Faces in the form that is drawn: three corners each, with normals.

#[cfg(feature = "gpu")]
use impinge::wgpu;

use crate::picture::{Face, Normals, Picture, Surface};
use crate::view::Frame;

/// A corner of a face, the input of the vertex shader and of the renderer on the CPU.
#[derive(Debug, Clone, Copy)]
#[cfg_attr(feature = "gpu", derive(bytemuck::Pod, bytemuck::Zeroable))]
#[repr(C)]
pub(crate) struct Corner {
    /// In the coordinates of a [`Frame`].
    pub position: [f32; 3],
    /// In 32767ths; the last one is not used.
    normal: [i16; 4],
    /// sRGB; the last one is not used.
    color: [u8; 4],
}

impl Corner {
    /// The unit normal, as a device reads it.
    pub fn normal(&self) -> [f64; 3] {
        [0, 1, 2].map(|k| f64::from(self.normal[k]) / f64::from(i16::MAX))
    }

    /// sRGB, 0 to 1.
    pub fn color(&self) -> [f32; 3] {
        [0, 1, 2].map(|k| f32::from(self.color[k]) / 255.0)
    }
}

/// The layout of [`Corner`].
#[cfg(feature = "gpu")]
pub(crate) const CORNER: [wgpu::VertexAttribute; 3] =
    wgpu::vertex_attr_array![0 => Float32x3, 1 => Snorm16x4, 2 => Unorm8x4];

/// Bytes per face.
#[cfg(feature = "gpu")]
pub(crate) const FACE_BYTES: u64 = 3 * size_of::<Corner>() as u64;

/// Cosine of the sharpest edge that still looks smooth: 50 degrees.
const SMOOTHEST: f64 = 0.642_787_609_686_539_3;

/// Passes on the corners of all faces for which `wanted` holds, at most `n_faces` faces at a time.
pub(crate) fn chunks(
    picture: &Picture,
    frame: &Frame,
    n_faces: usize,
    wanted: impl Fn(&Face) -> bool,
    mut take: impl FnMut(&[Corner]),
) {
    let mut chunk = Vec::new();
    let hidden = hidden_faces(picture, frame, &wanted);
    let mut hidden = hidden.iter().peekable();
    let mut number = 0u32;
    for surface in &picture.surfaces {
        if !surface.faces.iter().any(&wanted) {
            continue;
        }
        let at_vertices = match surface.normals {
            Normals::Flat => Vec::new(),
            Normals::Smooth => vertex_normals(surface, frame),
        };
        for face in surface.faces.iter().filter(|face| wanted(face)) {
            number += 1;
            if hidden.next_if_eq(&&number).is_some() {
                continue;
            }
            let points = surface.points(face).map(|point| frame.place(point));
            let flat = normal(points);
            for (ix, point) in face.corners.into_iter().zip(points) {
                let smooth = at_vertices.get(ix as usize).copied();
                let normal = smooth
                    .filter(|&smooth| dot(smooth, flat) >= SMOOTHEST)
                    .unwrap_or(flat);
                let [r, g, b] = face.color;
                chunk.push(Corner {
                    position: point.map(|x| x as f32),
                    normal: [snorm(normal[0]), snorm(normal[1]), snorm(normal[2]), 0],
                    color: [r, g, b, 255],
                });
            }
            if chunk.len() >= 3 * n_faces {
                take(&chunk);
                chunk.clear();
            }
        }
    }
    if !chunk.is_empty() {
        take(&chunk);
    }
}

/// The numbers, from 1, ascending, of wanted faces that a later one with the same corners hides.
/// Very many coincident faces, each of which covers many pixels, would otherwise take forever.
fn hidden_faces(picture: &Picture, frame: &Frame, wanted: &impl Fn(&Face) -> bool) -> Vec<u32> {
    let faces = || {
        let surfaces = picture.surfaces.iter();
        surfaces.flat_map(|surface| {
            let faces = surface.faces.iter().filter(|face| wanted(face));
            faces.map(|face| {
                let mut points = surface.points(face);
                points
                    .sort_unstable_by(|p, q| p.partial_cmp(q).unwrap_or(std::cmp::Ordering::Equal));
                points.map(|point| frame.place(point).map(|x| (x as f32).to_bits()))
            })
        })
    };
    let mut numbered: Vec<(u64, u32)> = faces().map(|key| hash(&key)).zip(1..).collect();
    numbered.sort_unstable();
    if !numbered.windows(2).any(|pair| pair[0].0 == pair[1].0) {
        return Vec::new();
    }
    // Different faces may have one hash.
    let keys: Vec<[[u32; 3]; 3]> = faces().collect();
    let key = |number: u32| &keys[number as usize - 1];
    numbered.sort_unstable_by(|x, y| key(x.1).cmp(key(y.1)).then(x.1.cmp(&y.1)));
    let pairs = numbered.windows(2);
    let hidden = pairs.filter(|pair| key(pair[0].1) == key(pair[1].1));
    let mut hidden: Vec<u32> = hidden.map(|pair| pair[0].1).collect();
    hidden.sort_unstable();
    hidden
}

fn hash(key: &[[u32; 3]; 3]) -> u64 {
    key.as_flattened().iter().fold(0, |sum: u64, &bits| {
        (sum.rotate_left(5) ^ u64::from(bits)).wrapping_mul(0x9e37_79b9_7f4a_7c15)
    })
}

/// Unit normals of vertices: the mean normal of the faces around a vertex, weighted by their angles
/// there.
fn vertex_normals(surface: &Surface, frame: &Frame) -> Vec<[f64; 3]> {
    let mut sums = vec![[0.0; 3]; surface.positions.len()];
    for face in &surface.faces {
        let points = surface.points(face).map(|point| frame.place(point));
        let flat = normal(points);
        for k in 0..3 {
            let a = unit(sub(points[(k + 1) % 3], points[k]));
            let b = unit(sub(points[(k + 2) % 3], points[k]));
            let angle = dot(a, b).clamp(-1.0, 1.0).acos();
            let sum = &mut sums[face.corners[k] as usize];
            for (sum, x) in sum.iter_mut().zip(flat) {
                *sum += angle * x;
            }
        }
    }
    sums.into_iter().map(unit).collect()
}

/// The unit normal, or 0 for a face without area.
fn normal([a, b, c]: [[f64; 3]; 3]) -> [f64; 3] {
    let (u, v) = (sub(b, a), sub(c, a));
    unit([
        u[1] * v[2] - u[2] * v[1],
        u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0],
    ])
}

fn unit(v: [f64; 3]) -> [f64; 3] {
    let length = dot(v, v).sqrt();
    if length > 0.0 {
        v.map(|x| x / length)
    } else {
        [0.0; 3]
    }
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| a[k] - b[k])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// A number of -1 to 1 in 32767ths.
fn snorm(x: f64) -> i16 {
    (x * f64::from(i16::MAX)).round() as i16
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Work, not time: of many coincident faces only the last is drawn, whatever order its corners
    /// have.
    #[test]
    fn of_coincident_faces_the_last_is_drawn() {
        const N: u32 = 300_000;
        let face = |corners: [u32; 3], ix: u32| Face {
            corners,
            color: [(ix % 251) as u8, 0, 0],
            shows_through: ix.is_multiple_of(3),
        };
        let orders = [[0, 1, 2], [2, 0, 1], [1, 0, 2]];
        let mut faces: Vec<Face> = (0..N).map(|ix| face(orders[ix as usize % 3], ix)).collect();
        faces.insert(7, face([0, 1, 3], 9));
        let surface = Surface {
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 2.0, 0.0]],
            faces,
            normals: Normals::Smooth,
        };
        // The same triangle once more, in another surface.
        let mut other = surface.clone();
        other.faces = vec![face([1, 2, 0], 100)];
        let picture = Picture {
            surfaces: vec![surface, other],
            ..Picture::default()
        };
        let frame = Frame::of(&picture);
        for (shown, expected) in [
            (false, [9, 100]),
            (true, [9, ((N - 1) / 3 * 3 % 251) as u8]),
        ] {
            let mut colors = Vec::new();
            let wanted = |face: &Face| !shown || face.shows_through;
            chunks(&picture, &frame, 1000, wanted, |corners| {
                colors.extend(corners.chunks(3).map(|face| face[0].color[0]));
            });
            assert_eq!(colors, expected);
        }
    }
}
