//! Writing VTU.

use std::fmt::Write as _;
use std::path::Path;

use super::atomic::AtomicFile;
use super::{ColoredMesh, any_f64, check};
use crate::error::Error;
use crate::mesh::{Elements, Positions};

/// VTK's cell types.
const TRIANGLE: u8 = 5;
const TETRA: u8 = 10;

/// Writes bodies into one VTU file (VTK XML unstructured grid, raw appended data), for ParaView and
/// the like.
///
/// Cells are the elements in their order, body by body. Cell data: `body`, the number of the body
/// (i32); `color`, red, green, blue (u8); and, if any body has
/// [`colliding`](ColoredMesh::colliding), `colliding` (u8, 0 or 1; 0 for bodies without it).
/// Positions are f32 if all bodies have f32, else f64: nothing is rounded.
///
/// # Errors
/// [`Error::Io`]; [`Error::Mismatch`] or [`Error::Index`] if the parts of a body do not fit
/// together.
pub fn write_vtu(path: &Path, meshes: &[ColoredMesh]) -> Result<(), Error> {
    check(path, meshes)?;
    let wide = any_f64(meshes);
    let mut data = Appended::default();
    let points = points(&mut data, meshes, wide);
    let cells = cells(&mut data, meshes);
    let cell_data = cell_data(&mut data, meshes);
    let n_points: usize = meshes.iter().map(|mesh| mesh.positions.len()).sum();
    let n_cells: usize = meshes.iter().map(|mesh| mesh.elements.len()).sum();

    document(
        path,
        &data,
        [n_points, n_cells],
        [&points, &cells, &cell_data],
    )
}

/// Writes a file from the XML elements of points, cells and cell data, and the appended data.
pub(super) fn document(
    path: &Path,
    data: &Appended,
    [n_points, n_cells]: [usize; 2],
    [points, cells, cell_data]: [&str; 3],
) -> Result<(), Error> {
    let mut file = AtomicFile::create(path)?;
    file.put(
        format!(
            "<?xml version=\"1.0\"?>\n\
             <VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n\
             <UnstructuredGrid>\n<Piece NumberOfPoints=\"{n_points}\" NumberOfCells=\"{n_cells}\">\n\
             <Points>\n{points}</Points>\n<Cells>\n{cells}</Cells>\n<CellData>\n{cell_data}</CellData>\n\
             </Piece>\n</UnstructuredGrid>\n<AppendedData encoding=\"raw\">\n_"
        )
        .as_bytes(),
    )?;
    file.put(&data.bytes)?;
    file.put(b"\n</AppendedData>\n</VTKFile>\n")?;
    file.finish()
}

/// The appended data: arrays, each preceded by its length in bytes.
#[derive(Default)]
pub(super) struct Appended {
    bytes: Vec<u8>,
}

impl Appended {
    /// Adds an array and returns its XML element.
    pub fn array<const N: usize>(
        &mut self,
        kind: &str,
        name: &str,
        n_components: usize,
        values: impl Iterator<Item = [u8; N]>,
    ) -> String {
        let offset = self.bytes.len();
        self.bytes.extend_from_slice(&[0; 8]);
        values.for_each(|value| self.bytes.extend_from_slice(&value));
        let length = (self.bytes.len() - offset - 8) as u64;
        self.bytes[offset..offset + 8].copy_from_slice(&length.to_le_bytes());
        let mut element = format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\" format=\"appended\" offset=\"{offset}\""
        );
        if n_components > 1 {
            // Writing to a string can't fail.
            let _ = write!(element, " NumberOfComponents=\"{n_components}\"");
        }
        element + "/>\n"
    }
}

fn points(data: &mut Appended, meshes: &[ColoredMesh], wide: bool) -> String {
    if wide {
        let all = meshes
            .iter()
            .flat_map(|mesh| mesh.positions.to_f64())
            .flatten();
        return data.array("Float64", "Points", 3, all.map(f64::to_le_bytes));
    }
    let f32s = meshes.iter().filter_map(|mesh| {
        if let Positions::F32(p) = mesh.positions {
            Some(p.as_flattened())
        } else {
            None
        }
    });
    data.array(
        "Float32",
        "Points",
        3,
        f32s.flatten().map(|c| c.to_le_bytes()),
    )
}

fn cells(data: &mut Appended, meshes: &[ColoredMesh]) -> String {
    let firsts = meshes.iter().scan(0i64, |next, mesh| {
        let first = *next;
        *next += mesh.positions.len() as i64;
        Some((mesh, first))
    });
    let connectivity = firsts.flat_map(|(mesh, first)| {
        mesh.elements
            .indices()
            .iter()
            .map(move |&ix| (first + i64::from(ix)).to_le_bytes())
    });
    let connectivity = data.array("Int64", "connectivity", 1, connectivity);
    let sizes_and_types = || {
        meshes.iter().flat_map(|mesh| {
            let cell = match mesh.elements {
                Elements::Triangles(_) => (3i64, TRIANGLE),
                Elements::Tetrahedra(_) => (4, TETRA),
            };
            std::iter::repeat_n(cell, mesh.elements.len())
        })
    };
    let offsets = sizes_and_types().scan(0i64, |end, (size, _)| {
        *end += size;
        Some(end.to_le_bytes())
    });
    let offsets = data.array("Int64", "offsets", 1, offsets);
    let types = data.array(
        "UInt8",
        "types",
        1,
        sizes_and_types().map(|(_, kind)| [kind]),
    );
    connectivity + &offsets + &types
}

fn cell_data(data: &mut Appended, meshes: &[ColoredMesh]) -> String {
    let bodies = meshes
        .iter()
        .zip(0i32..)
        .flat_map(|(mesh, body)| std::iter::repeat_n(body.to_le_bytes(), mesh.elements.len()));
    let mut elements = data.array("Int32", "body", 1, bodies);
    if meshes.iter().any(|mesh| mesh.colliding.is_some()) {
        let flags = meshes.iter().flat_map(|mesh| {
            (0..mesh.elements.len())
                .map(|ix| [u8::from(mesh.colliding.is_some_and(|flags| flags[ix]))])
        });
        elements += &data.array("UInt8", "colliding", 1, flags);
    }
    let colors = meshes
        .iter()
        .flat_map(|mesh| (0..mesh.elements.len()).map(|ix| mesh.color(ix)));
    elements + &data.array("UInt8", "color", 3, colors)
}
