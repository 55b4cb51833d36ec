//! `impinge step --advance` and `--truncate`: how far a step can be taken, and the bodies there.

use impinge::{BodyId, Positions};
use impinge_io::{ColoredMesh, Elements, write_obj, write_ply};

use crate::error::Error;
use crate::origins::Origin;
use crate::values::{ReachedFile, ReachedFormat};

use super::load::Moving;

/// Fails unless there is a file per body, of a format that holds it.
pub fn check((option, files): (&str, &[ReachedFile]), bodies: &Moving) -> Result<(), Error> {
    let n = bodies.ids.len();
    if files.len() != n {
        let text = format!(
            "{option} writes a file per body: {} are named for {n} bodies",
            files.len()
        );
        return Err(Error::Usage(text));
    }
    let misfits = |(file, given): &(&ReachedFile, &Elements)| {
        file.format == ReachedFormat::Obj && matches!(given, Elements::Tetrahedra(_))
    };
    match files.iter().zip(&bodies.given).find(misfits) {
        None => Ok(()),
        Some((file, _)) => Err(Error::Usage(format!(
            "{option} {}: OBJ files hold triangles: write tetrahedra as .ply",
            impinge_io::printable(&file.path)
        ))),
    }
}

/// Writes each body at the positions that were reached, with the vertices and elements of its
/// files, so that the files can begin the next step.
pub fn write<'a>(
    files: &[ReachedFile],
    bodies: &'a Moving,
    reached: impl Fn(BodyId) -> Option<&'a Positions>,
) -> Result<(), Error> {
    for (ix, (file, given)) in files.iter().zip(&bodies.given).enumerate() {
        let id = bodies.ids[ix];
        let positions = match reached(id) {
            Some(positions) => positions,
            None => bodies.scene.body(id)?.positions(),
        };
        let map = bodies.origins.of(ix).and_then(Origin::map);
        let positions = as_given(positions, map);
        match given {
            Elements::Triangles(faces) if file.format == ReachedFormat::Obj => {
                write_obj(&file.path, &positions, faces)?;
            }
            elements => {
                let mesh = ColoredMesh {
                    positions: &positions,
                    elements,
                    element_colors: None,
                    colliding: None,
                    name: &bodies.names[ix][0],
                };
                write_ply(&file.path, &[mesh])?;
            }
        }
    }
    Ok(())
}

fn as_given(positions: &Positions, map: Option<&[u32]>) -> impinge_io::Positions {
    fn of<T: Copy>(positions: &[T], map: Option<&[u32]>) -> Vec<T> {
        match map {
            None => positions.to_vec(),
            Some(map) => map
                .iter()
                .map(|&vertex| positions[vertex as usize])
                .collect(),
        }
    }
    match positions {
        Positions::F32(positions) => impinge_io::Positions::F32(of(positions, map)),
        Positions::F64(positions) => impinge_io::Positions::F64(of(positions, map)),
    }
}
