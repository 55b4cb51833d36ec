//! VTK's cell types, which `.vtk` and `.vtu` share.
//!
//! Source: VTK File Formats (Kitware), "Cell types", and vtkCellType.h.

use crate::collect::Collector;
use crate::error::{Error, Place};

/// Adds the cell of type `kind` with these point indices to `parts`; polygons and strips are cut
/// into triangles.
pub(crate) fn put(
    parts: &mut Collector,
    kind: i64,
    indices: &[i64],
    place: Place,
) -> Result<(), Error> {
    let name = parts.name;
    let needs = |n: usize| {
        if indices.len() == n {
            Ok(())
        } else {
            Err(name.count(
                place,
                format!("points of a cell of type {kind}"),
                n as u64,
                indices.len() as u64,
            ))
        }
    };
    match kind {
        0 => {}
        1 | 2 => parts.n_points += 1,
        // Lines, polylines, and curves of higher order.
        3 | 4 | 21 | 35 | 60 | 68 | 75 => parts.n_lines += 1,
        5..=9 => {
            match kind {
                5 => needs(3)?,
                8 | 9 => needs(4)?,
                _ => {}
            }
            parts.corners.clear();
            for &index in indices {
                let corner = parts.vertex(index, 0, place)?;
                parts.corners.push(corner);
            }
            match kind {
                6 if indices.len() < 3 => {
                    return Err(name.count(
                        place,
                        "points of a strip, or more",
                        3,
                        indices.len() as u64,
                    ));
                }
                6 => parts.strip(),
                8 => {
                    // A VTK pixel lists its corners row by row, not in cyclic order.
                    parts.corners.swap(2, 3);
                    parts.polygon(place)?;
                }
                _ => parts.polygon(place)?,
            }
        }
        10 => {
            needs(4)?;
            let mut tetrahedron = [0; 4];
            for (corner, &index) in tetrahedron.iter_mut().zip(indices) {
                *corner = parts.vertex(index, 0, place)?;
            }
            parts.tetrahedra.push(tetrahedron);
        }
        11..=16 | 42 => {
            let what = match kind {
                11 => "voxels",
                12 => "hexahedra",
                13 => "wedges",
                14 => "pyramids",
                15 | 16 => "prisms",
                _ => "polyhedra",
            };
            return Err(name.unsupported(
                place,
                format!("cell type {kind} ({what}; supported: triangles, polygons and tetrahedra)"),
            ));
        }
        17..=81 => {
            return Err(name.unsupported(
                place,
                format!(
                    "cell type {kind} (of higher order; supported: triangles, polygons and tetrahedra)"
                ),
            ));
        }
        _ => return Err(name.syntax(place, "a cell type", kind.to_string())),
    }
    Ok(())
}
