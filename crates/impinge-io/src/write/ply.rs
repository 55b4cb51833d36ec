//! Writing PLY.

use std::fmt::Write as _;
use std::path::Path;

use super::atomic::AtomicFile;
use super::surface::surface;
use super::{ColoredMesh, any_f64, check};
use crate::error::{Error, Name, Place};
use crate::mesh::{Elements, Positions};

/// Writes bodies into one binary PLY file, with one colour per face.
///
/// Vertices are those given, in their order, body by body, so a mesh that is read back has the same
/// vertices and ids. The viewer must support face colours (MeshLab, CloudCompare and ParaView do;
/// for others write GLB). Each face also has the property `body`, the number of its body. The
/// surface of tetrahedra goes to the element `face`, and all tetrahedra go to an element `tetra`
/// (lists of four indices, colour, body), which viewers ignore and [`read`](crate::read) reads.
/// Positions are f32 if all bodies have f32, else f64: nothing is rounded.
///
/// # Errors
/// [`Error::Io`]; [`Error::Mismatch`] or [`Error::Index`] if the parts of a body do not fit
/// together; [`Error::TooLarge`] beyond 2^31 - 1 vertices.
pub fn write_ply(path: &Path, meshes: &[ColoredMesh]) -> Result<(), Error> {
    check(path, meshes)?;
    let n_vertices: u64 = meshes.iter().map(|mesh| mesh.positions.len() as u64).sum();
    check_n_vertices(path, n_vertices)?;
    let wide = any_f64(meshes);
    let surfaces: Vec<_> = meshes
        .iter()
        .map(|mesh| surface(mesh.positions, mesh.elements))
        .collect();
    let n_faces: usize = surfaces.iter().map(Vec::len).sum();
    let n_tetrahedra: usize = meshes
        .iter()
        .map(|mesh| {
            if let Elements::Tetrahedra(t) = mesh.elements {
                t.len()
            } else {
                0
            }
        })
        .sum();

    let mut file = AtomicFile::create(path)?;
    file.put(
        header(
            n_vertices,
            wide,
            &[("face", n_faces), ("tetra", n_tetrahedra)],
            true,
        )
        .as_bytes(),
    )?;
    for mesh in meshes {
        put_positions(&mut file, mesh.positions, wide)?;
    }
    let bodies = || {
        meshes.iter().zip(0i32..).scan(0u32, |next, (mesh, body)| {
            let first = *next;
            // The sum of all is below 2^31.
            *next += mesh.positions.len() as u32;
            Some((mesh, body, first))
        })
    };
    for ((mesh, body, first), faces) in bodies().zip(&surfaces) {
        for &(face, element_ix) in faces {
            put_corners(&mut file, &face, first)?;
            put_look(&mut file, mesh.color(element_ix), body)?;
        }
    }
    for (mesh, body, first) in bodies() {
        if let Elements::Tetrahedra(tetrahedra) = mesh.elements {
            for (element_ix, tetrahedron) in tetrahedra.iter().enumerate() {
                put_corners(&mut file, tetrahedron, first)?;
                put_look(&mut file, mesh.color(element_ix), body)?;
            }
        }
    }
    file.finish()
}

/// Writes triangles as a binary PLY file: positions, in their type and order, and faces, without
/// colours.
///
/// # Errors
/// [`Error::Io`]; [`Error::TooLarge`] beyond 2^31 - 1 vertices.
pub fn write_plain_ply(
    path: &Path,
    positions: &Positions,
    triangles: &[[u32; 3]],
) -> Result<(), Error> {
    let n_vertices = positions.len() as u64;
    check_n_vertices(path, n_vertices)?;
    let wide = matches!(positions, Positions::F64(_));
    let mut file = AtomicFile::create(path)?;
    file.put(header(n_vertices, wide, &[("face", triangles.len())], false).as_bytes())?;
    put_positions(&mut file, positions, wide)?;
    for corners in triangles {
        put_corners(&mut file, corners, 0)?;
    }
    file.finish()
}

/// Refuses numbers of vertices beyond the indices of `int`.
fn check_n_vertices(path: &Path, n_vertices: u64) -> Result<(), Error> {
    let limit = u64::from(i32::MAX.unsigned_abs());
    if n_vertices > limit {
        let name = path.display().to_string();
        return Err(Name(&name).too_large(Place::File, "number of vertices", limit, n_vertices));
    }
    Ok(())
}

fn put_positions(file: &mut AtomicFile, positions: &Positions, wide: bool) -> Result<(), Error> {
    match positions {
        Positions::F32(p) if !wide => p
            .as_flattened()
            .iter()
            .try_for_each(|c| file.put(&c.to_le_bytes())),
        Positions::F32(p) => p
            .as_flattened()
            .iter()
            .try_for_each(|c| file.put(&f64::from(*c).to_le_bytes())),
        Positions::F64(p) => p
            .as_flattened()
            .iter()
            .try_for_each(|c| file.put(&c.to_le_bytes())),
    }
}

fn put_corners(file: &mut AtomicFile, corners: &[u32], first: u32) -> Result<(), Error> {
    file.put(&[corners.len() as u8])?;
    corners
        .iter()
        .try_for_each(|corner| file.put(&(first + corner).to_le_bytes()))
}

fn put_look(file: &mut AtomicFile, color: [u8; 3], body: i32) -> Result<(), Error> {
    file.put(&color)?;
    file.put(&body.to_le_bytes())
}

/// The header of vertices and these elements, which have a colour and a body if they have a look.
fn header(n_vertices: u64, wide: bool, elements: &[(&str, usize)], has_look: bool) -> String {
    let float = if wide { "double" } else { "float" };
    let mut header = format!(
        "ply\nformat binary_little_endian 1.0\ncomment written by impinge\nelement vertex {n_vertices}\n"
    );
    for axis in ["x", "y", "z"] {
        // Writing to a string can't fail.
        let _ = writeln!(header, "property {float} {axis}");
    }
    for &(element, n) in elements {
        if n > 0 || element == "face" {
            let _ = writeln!(
                header,
                "element {element} {n}\nproperty list uchar int vertex_indices"
            );
            if has_look {
                header += "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty int body\n";
            }
        }
    }
    header + "end_header\n"
}
