//! VTU, the unstructured grid of VTK XML files: ascii, inline base64, and appended data raw or in
//! base64; compressed by zlib or LZ4 or not at all. All pieces become one body.
//!
//! Source: VTK File Formats (Kitware), "XML file formats"; vtkXMLDataReader.cxx for the block
//! header of compressed data.

mod array;
mod xml;

use self::array::{Appended, Arrays};
use self::xml::{Document, Node};
use super::cells;
use crate::binary::{Endian, Scalar};
use crate::budget::{self, Budget};
use crate::collect::{Collector, check_n_vertices};
use crate::error::{Error, Name, Place, shown};
use crate::mesh::Positions;
use crate::options::ReadOptions;

pub(crate) fn read<'a>(
    bytes: &[u8],
    name: Name<'a>,
    options: &ReadOptions,
) -> Result<Collector<'a>, Error> {
    let file = File::split(bytes, name)?;
    let document = Document::parse(file.xml, APPENDED, name)?;
    let root = document
        .root()
        .ok_or_else(|| name.syntax(Place::File, "the element 'VTKFile'", "none"))?;
    if root.tag() != "VTKFile" {
        return Err(name.syntax(
            root.place(),
            "the element 'VTKFile'",
            shown(root.tag().as_bytes()),
        ));
    }
    let kind = root.attribute("type").unwrap_or_default();
    if kind != "UnstructuredGrid" {
        return Err(name.unsupported(
            root.place(),
            format!(
                "the VTK file type {} (supported: UnstructuredGrid)",
                shown(kind.as_bytes())
            ),
        ));
    }
    let mut arrays = Arrays {
        name,
        xml: file.xml,
        appended: file.appended(root)?,
        endian: match root.attribute("byte_order") {
            None | Some("LittleEndian") => Endian::Little,
            Some("BigEndian") => Endian::Big,
            Some(other) => {
                return Err(name.syntax(
                    root.place(),
                    "'LittleEndian' or 'BigEndian'",
                    shown(other.as_bytes()),
                ));
            }
        },
        header: match root.attribute("header_type") {
            None | Some("UInt32") => Scalar::U32,
            Some("UInt64") => Scalar::U64,
            Some(other) => {
                return Err(name.syntax(
                    root.place(),
                    "'UInt32' or 'UInt64'",
                    shown(other.as_bytes()),
                ));
            }
        },
        compressor: match root.attribute("compressor") {
            None | Some("") => None,
            Some("vtkZLibDataCompressor") => Some(array::Compressor::Zlib),
            Some("vtkLZ4DataCompressor") => Some(array::Compressor::Lz4),
            Some(other) => {
                return Err(name.unsupported(
                    root.place(),
                    format!(
                        "the compressor {} (supported: zlib and LZ4)",
                        shown(other.as_bytes())
                    ),
                ));
            }
        },
        budget: Budget::new(budget::most_expanded(
            bytes.len() as u64,
            options.max_expanded_bytes.max(16 * bytes.len() as u64),
        )),
    };
    let mut parts = Collector::new(name);
    let grid = root
        .child("UnstructuredGrid")
        .ok_or_else(|| name.syntax(root.place(), "an element 'UnstructuredGrid'", "none"))?;
    for piece in grid.children("Piece") {
        read_piece(&mut arrays, piece, &mut parts)?;
    }
    Ok(parts)
}

/// The tag of the element that holds appended data.
const APPENDED: &str = "AppendedData";

/// The two parts of a file: XML, and the appended data, which may be any bytes.
struct File<'b> {
    name: Name<'b>,
    /// The file, or its beginning up to the start tag of the appended data.
    xml: &'b str,
    /// The bytes after the `_` that starts the appended data, and the offset of the first.
    behind: Option<(&'b [u8], usize)>,
}

impl<'b> File<'b> {
    fn split(bytes: &'b [u8], name: Name<'b>) -> Result<Self, Error> {
        let text = |bytes| {
            std::str::from_utf8(bytes).map_err(|error| {
                name.syntax(
                    Place::Byte(error.valid_up_to() as u64),
                    "XML in UTF-8",
                    "other bytes",
                )
            })
        };
        let Some(tag) = find(bytes, format!("<{APPENDED}").as_bytes()) else {
            return Ok(File {
                name,
                xml: text(bytes)?,
                behind: None,
            });
        };
        let missing = |what| name.syntax(Place::Byte(tag as u64), what, "the end of the file");
        let find_from = |from: usize, wanted| {
            bytes[from..]
                .iter()
                .position(|&b| b == wanted)
                .map(|ix| from + ix)
        };
        let open = find_from(tag, b'>').ok_or_else(|| missing("'>'"))?;
        if bytes[open - 1] == b'/' {
            return Ok(File {
                name,
                xml: text(bytes)?,
                behind: None,
            });
        }
        let mark = find_from(open, b'_').ok_or_else(|| missing("'_' and the appended data"))?;
        Ok(File {
            name,
            xml: text(&bytes[..=open])?,
            behind: Some((&bytes[mark + 1..], mark + 1)),
        })
    }

    fn appended(&self, root: Node) -> Result<Option<Appended<'b>>, Error> {
        let (Some((bytes, start)), Some(node)) = (self.behind, root.child(APPENDED)) else {
            return Ok(None);
        };
        let is_base64 = match node.attribute("encoding") {
            Some("raw") => false,
            None | Some("base64") => true,
            Some(other) => {
                return Err(self.name.syntax(
                    node.place(),
                    "'raw' or 'base64'",
                    shown(other.as_bytes()),
                ));
            }
        };
        // Base64 ends at the end tag; raw data may contain any bytes, even the end tag.
        let end = if is_base64 {
            bytes.iter().position(|&b| b == b'<').unwrap_or(bytes.len())
        } else {
            bytes.len()
        };
        Ok(Some(Appended {
            bytes: &bytes[..end],
            start,
            is_base64,
        }))
    }
}

fn find(bytes: &[u8], tag: &[u8]) -> Option<usize> {
    let mut from = 0;
    while let Some(found) = bytes[from..].iter().position(|&b| b == tag[0]) {
        from += found;
        if bytes[from..].starts_with(tag) {
            return Some(from);
        }
        from += 1;
    }
    None
}

/// Adds the points and cells of a piece.
fn read_piece(arrays: &mut Arrays, piece: Node, parts: &mut Collector) -> Result<(), Error> {
    let name = parts.name;
    let number = |attribute: &str| {
        let value = piece.attribute(attribute).unwrap_or_default();
        value.trim().parse::<u64>().map_err(|_| {
            name.syntax(
                piece.place(),
                format!("a number in '{attribute}'"),
                shown(value.as_bytes()),
            )
        })
    };
    let (n_points, n_cells) = (number("NumberOfPoints")?, number("NumberOfCells")?);
    let first = parts.n_vertices();
    check_n_vertices(name, piece.place(), first.saturating_add(n_points))?;
    if n_points > 0 {
        let points = piece
            .child("Points")
            .and_then(|points| points.child("DataArray"));
        let points = points.ok_or_else(|| {
            name.syntax(
                piece.place(),
                "an element 'Points' with a 'DataArray'",
                "none",
            )
        })?;
        let values = arrays.read(points)?;
        if values.len() as u64 != 3 * n_points {
            return Err(name.count(
                points.place(),
                "coordinates",
                3 * n_points,
                values.len() as u64,
            ));
        }
        // Small integers become f32, which takes 12 bytes per point.
        arrays.budget.charge(name, points.place(), n_points, 12)?;
        append(
            &mut parts.positions,
            values.positions(name, points.place(), first)?,
        );
    }
    if n_cells == 0 {
        return Ok(());
    }
    let cells = piece
        .child("Cells")
        .ok_or_else(|| name.syntax(piece.place(), "an element 'Cells'", "none"))?;
    let mut array = |title: &str| {
        let node = cells
            .children("DataArray")
            .find(|array| array.attribute("Name") == Some(title));
        let node = node.ok_or_else(|| {
            name.syntax(
                cells.place(),
                format!("a 'DataArray' named '{title}'"),
                "none",
            )
        })?;
        Ok::<_, Error>((arrays.read(node)?, node.place()))
    };
    let ((connectivity, connectivity_at), (offsets, offsets_at), (types, types_at)) =
        (array("connectivity")?, array("offsets")?, array("types")?);
    for (values, at, what) in [
        (&offsets, offsets_at, "offsets of cells"),
        (&types, types_at, "types of cells"),
    ] {
        if values.len() as u64 != n_cells {
            return Err(name.count(at, what, n_cells, values.len() as u64));
        }
    }
    // Indices of one byte become corners of four bytes, and a polygon of n corners becomes n - 2
    // triangles.
    arrays.budget.charge(
        name,
        connectivity_at,
        connectivity.len() as u64,
        size_of::<[u32; 3]>() as u64,
    )?;
    let mut start = 0usize;
    let mut indices = Vec::new();
    for cell in 0..offsets.len() {
        let offset = offsets.integer(cell);
        let end = usize::try_from(offset)
            .ok()
            .filter(|end| (start..=connectivity.len()).contains(end));
        let end = end.ok_or_else(|| {
            name.syntax(
                offsets_at,
                format!(
                    "an offset of cell {cell} from {start} to {}",
                    connectivity.len()
                ),
                offset.to_string(),
            )
        })?;
        indices.clear();
        for ix in start..end {
            let index = connectivity.integer(ix);
            if u64::try_from(index).is_ok_and(|index| index < n_points) {
                // Both are below 2^32: no overflow.
                indices.push(index + first as i64);
            } else {
                return Err(Error::Index {
                    at: name.at(connectivity_at),
                    index,
                    first: 0,
                    n_vertices: n_points,
                });
            }
        }
        cells::put(parts, types.integer(cell), &indices, types_at)?;
        start = end;
    }
    Ok(())
}

/// Appends `more` to `positions`; the result is f32 as long as all pieces are.
fn append(positions: &mut Positions, more: Positions) {
    if positions.is_empty() {
        *positions = more;
        return;
    }
    match (&mut *positions, more) {
        (Positions::F32(all), Positions::F32(more)) => all.extend(more),
        (Positions::F64(all), Positions::F64(more)) => all.extend(more),
        (_, more) => {
            let mut all = positions.to_f64();
            all.extend(more.to_f64());
            *positions = Positions::F64(all);
        }
    }
}
