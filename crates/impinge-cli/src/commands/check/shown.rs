//! The problems of meshes in colours: mesh files and pictures.
//!
//! Rows say which elements have which problem, so meshes are only read once more.

use std::io::Write;
use std::path::Path;

use impinge_check::{Checked, Problem, Row};
use impinge_io::ColoredMesh;
use impinge_render::Surface;

use super::args::CheckArgs;
use crate::error::Error;
use crate::load::to_elements;
use crate::meshes::write_colored;
use crate::output::out;
use crate::values::MeshFile;

/// The colour of elements without a finding.
const FINE: [u8; 3] = [200, 200, 200];

/// All meshes that could be checked, with the marks of their elements.
fn marked(rows: &[Row]) -> Result<Vec<(String, Checked)>, Error> {
    let checked: Vec<(String, Checked)> = rows
        .iter()
        .filter_map(|row| Some((row.path.clone(), Checked::of_row(row)?)))
        .collect();
    if checked.is_empty() {
        return Err(Error::Usage(
            "no mesh could be checked, so there is nothing to draw".to_owned(),
        ));
    }
    Ok(checked)
}

fn color(checked: &Checked, element: usize) -> [u8; 3] {
    checked.marks[element].first().map_or(FINE, Problem::color)
}

/// Writes the meshes, welded as in the check; each element has the colour of its most serious
/// problem.
pub fn write_mesh(file: &MeshFile, rows: &[Row]) -> Result<(), Error> {
    let checked = marked(rows)?;
    let colors: Vec<Vec<[u8; 3]>> = checked
        .iter()
        .map(|(_, checked)| {
            (0..checked.marks.len())
                .map(|ix| color(checked, ix))
                .collect()
        })
        .collect();
    let colliding: Vec<Vec<bool>> = checked
        .iter()
        .map(|(_, checked)| {
            checked
                .marks
                .iter()
                .map(|marks| marks.has(Problem::SelfIntersection))
                .collect()
        })
        .collect();
    let meshes: Vec<ColoredMesh> = checked
        .iter()
        .zip(&colors)
        .zip(&colliding)
        .map(|(((name, checked), colors), colliding)| ColoredMesh {
            positions: &checked.mesh.positions,
            elements: &checked.mesh.elements,
            element_colors: Some(colors),
            colliding: Some(colliding),
            name,
        })
        .collect();
    write_colored(file, &meshes)
}

/// Prints the meaning of the colours.
pub fn print_legend() -> Result<(), Error> {
    let entries =
        Problem::ALL.map(|problem| format!("{} {}", problem.color_name(), problem.name()));
    writeln!(out(), "colours: {}", entries.join(", "))?;
    Ok(())
}

/// Draws the meshes in the same colours. Elements with a problem show through faces that hide
/// them.
pub fn draw(path: &Path, rows: &[Row], args: &CheckArgs) -> Result<(), Error> {
    let meshes = marked(rows)?;
    let surfaces = meshes.iter().map(|(_, checked)| surface(checked));
    crate::picture::Drawer::new(&args.picture, None, 1)?.draw(path, surfaces.collect())
}

/// A mesh in these colours.
pub fn surface(checked: &Checked) -> Surface {
    let mesh = &checked.mesh;
    let elements = to_elements(mesh.elements.clone());
    Surface::of_elements(mesh.positions.to_f64(), &elements, |element| {
        let is_marked = checked.marks[element].first().is_some();
        (color(checked, element), is_marked)
    })
}

#[cfg(test)]
mod tests {
    use impinge_check::{Options, check_mesh};
    use impinge_io::{Elements, Mesh, Positions};

    use super::*;

    #[test]
    fn faces_between_tetrahedra_are_drawn_only_where_there_is_a_problem() {
        let points = vec![
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [1.0, 1.0, 1.0],
        ];
        let counts = |tets: &[[u32; 4]]| {
            let mesh = Mesh {
                positions: Positions::F32(points.clone()),
                elements: Elements::Tetrahedra(tets.to_vec()),
            };
            let faces = surface(&check_mesh(mesh, &Options::default()).unwrap()).faces;
            let n_through = faces.iter().filter(|face| face.shows_through).count();
            (faces.len(), n_through)
        };
        assert_eq!(counts(&[[0, 1, 2, 3], [4, 1, 3, 2]]), (6, 0));
        // The second one twice: all three are at the face that the two had between them.
        assert_eq!(counts(&[[0, 1, 2, 3], [4, 1, 3, 2], [4, 1, 3, 2]]), (7, 7));
    }
}
