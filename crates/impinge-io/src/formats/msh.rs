//! Gmsh MSH 2.x and 4.1, ascii and binary: `$Nodes` and `$Elements`; other sections are skipped.
//!
//! Source: Gmsh reference manual, "MSH file format" (4.1) and "Legacy formats" (2.2). Nodes have
//! tags, perhaps with gaps: vertices are numbered in the order of the file. Linear triangles,
//! quadrangles (cut into triangles) and tetrahedra are read, lines and points are counted, all
//! other element types are refused.

mod v2;
mod v4;

use crate::binary::{Cursor, Endian, Scalar};
use crate::collect::{Collector, check_n_vertices, finite};
use crate::error::{Error, Name, Place, shown};
use crate::mesh::Positions;
use crate::text::{Text, number};

pub(crate) fn read<'a>(bytes: &[u8], name: Name<'a>) -> Result<Collector<'a>, Error> {
    let mut file = File::open(bytes, name)?;
    let mut parts = Collector::new(name);
    let mut nodes: Option<Nodes> = None;
    while let Some(section) = file.section()? {
        match section {
            b"$Nodes" if nodes.is_some() => {
                return Err(name.syntax(file.text.place(), "one section $Nodes", "a second one"));
            }
            b"$Nodes" => {
                let read = if file.version == Version::V2 {
                    v2::nodes(&mut file)?
                } else {
                    v4::nodes(&mut file)?
                };
                file.end(section)?;
                nodes = Some(read.into_nodes(name, &mut parts)?);
            }
            b"$Elements" => {
                let nodes = nodes.as_ref().ok_or_else(|| {
                    name.syntax(file.text.place(), "$Nodes before $Elements", "none")
                })?;
                if file.version == Version::V2 {
                    v2::elements(&mut file, nodes, &mut parts)?
                } else {
                    v4::elements(&mut file, nodes, &mut parts)?
                }
                file.end(section)?;
            }
            other => file.skip_section(other)?,
        }
    }
    Ok(parts)
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Version {
    V2,
    V4,
}

/// A position in the file, the file's version and storage.
struct File<'a> {
    name: Name<'a>,
    bytes: &'a [u8],
    text: Text<'a>,
    version: Version,
    /// The byte order if the storage is binary.
    binary: Option<Endian>,
    /// The type of the counts and tags of version 4.1 in binary.
    size: Scalar,
}

impl<'a> File<'a> {
    /// Reads `$MeshFormat`.
    fn open(bytes: &'a [u8], name: Name<'a>) -> Result<Self, Error> {
        let mut text = Text::new(name, bytes);
        let magic = text.word().unwrap_or_default();
        if magic != b"$MeshFormat" {
            return Err(name.syntax(Place::Line(1), "'$MeshFormat'", shown(magic)));
        }
        let version = match text.need_word("a version")? {
            b"2" | b"2.0" | b"2.1" | b"2.2" => Version::V2,
            b"4.1" => Version::V4,
            other => {
                return Err(name.unsupported(
                    text.place(),
                    format!(
                        "MSH version {} (supported: 2.0 to 2.2 and 4.1)",
                        shown(other)
                    ),
                ));
            }
        };
        let is_binary = match text.number::<u32>("0 (ascii) or 1 (binary)")? {
            0 => false,
            1 => true,
            other => {
                return Err(name.syntax(
                    text.place(),
                    "0 (ascii) or 1 (binary)",
                    other.to_string(),
                ));
            }
        };
        let size = match text.number::<u32>("the size of numbers, 8")? {
            4 if version == Version::V4 => Scalar::U32,
            8 => Scalar::U64,
            other => {
                return Err(name.syntax(text.place(), "the size of numbers, 8", other.to_string()));
            }
        };
        let mut file = File {
            name,
            bytes,
            text,
            version,
            binary: None,
            size,
        };
        if is_binary {
            file.text.line();
            let mut cursor = file.cursor(Endian::Little);
            let place = cursor.place();
            let one = cursor.integer(Scalar::I32, "the number 1 that tells the byte order")?;
            file.advance(&cursor);
            file.text = file.text.in_bytes(0);
            file.binary = Some(match one {
                1 => Endian::Little,
                0x0100_0000 => Endian::Big,
                other => {
                    return Err(name.syntax(
                        place,
                        "the number 1 that tells the byte order",
                        other.to_string(),
                    ));
                }
            });
        }
        file.end(b"$MeshFormat")?;
        Ok(file)
    }

    /// The start of the next section; `None` at the end of the file.
    fn section(&mut self) -> Result<Option<&'a [u8]>, Error> {
        match self.text.word() {
            None => Ok(None),
            Some(word) if word.starts_with(b"$") => Ok(Some(word)),
            Some(word) => Err(self
                .name
                .syntax(self.text.place(), "a section ('$…')", shown(word))),
        }
    }

    /// Reads `$EndX` for the section `$X`.
    fn end(&mut self, section: &[u8]) -> Result<(), Error> {
        let expected = end_of(section);
        let word = self.text.need_word(&String::from_utf8_lossy(&expected))?;
        if word != expected {
            return Err(self
                .name
                .syntax(self.text.place(), shown(&expected), shown(word)));
        }
        Ok(())
    }

    /// Skips a section, whose content may be anything.
    fn skip_section(&mut self, section: &[u8]) -> Result<(), Error> {
        let end = end_of(section);
        let rest = self.text.rest();
        let mut from = 0;
        while let Some(found) = rest[from..].iter().position(|&b| b == b'$') {
            from += found;
            if rest[from..].starts_with(&end) {
                self.text.skip(from + end.len());
                return Ok(());
            }
            from += 1;
        }
        Err(self
            .name
            .syntax(self.text.place(), shown(&end), "the end of the file"))
    }

    /// A cursor at the current place, for binary data.
    fn cursor(&self, endian: Endian) -> Cursor<'a> {
        Cursor::new(self.name, self.bytes, self.text.offset(), endian)
    }

    /// Advances to the position of `cursor`.
    fn advance(&mut self, cursor: &Cursor) {
        self.text.skip(cursor.offset() - self.text.offset());
    }
}

fn end_of(section: &[u8]) -> Vec<u8> {
    [b"$End", section.strip_prefix(b"$").unwrap_or(section)].concat()
}

/// Tags and positions in the order of the file.
struct RawNodes {
    tags: Vec<i64>,
    positions: Vec<[f64; 3]>,
    /// Where the section starts.
    place: Place,
}

impl RawNodes {
    fn with_capacity(place: Place, n: u64, room: u64) -> Self {
        let n = n.min(room) as usize;
        RawNodes {
            tags: Vec::with_capacity(n),
            positions: Vec::with_capacity(n),
            place,
        }
    }

    fn push_position(&mut self, name: Name, place: Place, position: [f64; 3]) -> Result<(), Error> {
        self.positions
            .push(finite(name, place, self.positions.len(), position)?);
        Ok(())
    }

    fn into_nodes(self, name: Name, parts: &mut Collector) -> Result<Nodes, Error> {
        check_n_vertices(name, self.place, self.positions.len() as u64)?;
        parts.positions = Positions::F64(self.positions);
        Nodes::new(name, self.place, self.tags)
    }
}

/// Maps a node's tag to its vertex.
enum Nodes {
    /// Consecutive tags, as in most files.
    Run { first: i64, n: usize },
    /// Tags with their vertices, sorted by tag.
    Sorted(Vec<(i64, u32)>),
}

impl Nodes {
    fn new(name: Name, place: Place, tags: Vec<i64>) -> Result<Self, Error> {
        let first = tags.first().copied().unwrap_or(1);
        if tags
            .iter()
            .zip(0i64..)
            .all(|(&tag, ix)| first.checked_add(ix) == Some(tag))
        {
            return Ok(Nodes::Run {
                first,
                n: tags.len(),
            });
        }
        let mut sorted: Vec<(i64, u32)> = tags.into_iter().zip(0u32..).collect();
        sorted.sort_unstable();
        if let Some(twice) = sorted.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            return Err(name.syntax(
                place,
                "a tag of its own for each node",
                format!("the tag {} twice", twice[0].0),
            ));
        }
        Ok(Nodes::Sorted(sorted))
    }

    fn vertex(&self, name: Name, place: Place, tag: i64) -> Result<u32, Error> {
        let (found, n) = match self {
            Nodes::Run { first, n } => {
                let ix = tag
                    .checked_sub(*first)
                    .and_then(|ix| u32::try_from(ix).ok());
                (ix.filter(|&ix| (ix as usize) < *n), *n)
            }
            Nodes::Sorted(sorted) => (
                sorted
                    .binary_search_by_key(&tag, |&(tag, _)| tag)
                    .ok()
                    .map(|found| sorted[found].1),
                sorted.len(),
            ),
        };
        found.ok_or_else(|| {
            name.syntax(
                place,
                format!("the tag of one of the {n} nodes"),
                tag.to_string(),
            )
        })
    }
}

/// How an element type is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Shape {
    Point,
    Line,
    Polygon,
    Tetrahedron,
}

/// Shape and number of nodes of the element type `kind`.
fn shape(name: Name, place: Place, kind: i64) -> Result<(Shape, usize), Error> {
    Ok(match kind {
        15 => (Shape::Point, 1),
        1 => (Shape::Line, 2),
        8 => (Shape::Line, 3),
        26 => (Shape::Line, 4),
        27 => (Shape::Line, 5),
        28 => (Shape::Line, 6),
        2 => (Shape::Polygon, 3),
        3 => (Shape::Polygon, 4),
        4 => (Shape::Tetrahedron, 4),
        5..=7 => {
            let volume = ["hexahedra", "prisms", "pyramids"][(kind - 5) as usize];
            return Err(name.unsupported(
                place,
                format!(
                    "element type {kind} ({volume}; supported: triangles, quadrangles and tetrahedra)"
                ),
            ));
        }
        9..=140 => {
            return Err(name.unsupported(place, format!("element type {kind} (of higher order; supported: triangles, quadrangles and tetrahedra)")));
        }
        _ => return Err(name.syntax(place, "an element type", kind.to_string())),
    })
}

/// Adds an element with its node tags to `parts`.
fn put(
    parts: &mut Collector,
    nodes: &Nodes,
    shape: Shape,
    tags: &[i64],
    place: Place,
) -> Result<(), Error> {
    match shape {
        Shape::Point => parts.n_points += 1,
        Shape::Line => parts.n_lines += 1,
        Shape::Polygon => {
            parts.corners.clear();
            for &tag in tags {
                parts.corners.push(nodes.vertex(parts.name, place, tag)?);
            }
            parts.polygon(place)?;
        }
        Shape::Tetrahedron => {
            let mut corners = [0; 4];
            for (corner, &tag) in corners.iter_mut().zip(tags) {
                *corner = nodes.vertex(parts.name, place, tag)?;
            }
            parts.tetrahedra.push(corners);
        }
    }
    Ok(())
}

/// The most nodes that an element of a known [`Shape`] has.
const MOST_NODES: usize = 6;

/// Reads the node tags of an element from text.
fn text_tags<'t>(
    file: &mut File,
    tags: &'t mut [i64; MOST_NODES],
    n: usize,
) -> Result<&'t [i64], Error> {
    for tag in &mut tags[..n] {
        let word = file.text.need_word("a node tag")?;
        *tag = number(file.name, file.text.place(), word, "a node tag")?;
    }
    Ok(&tags[..n])
}

/// Reads a count line of version 2: only the number, then the end of the line. Binary data starts
/// after it.
fn count_line(file: &mut File, what: &str) -> Result<u64, Error> {
    let n = file.text.number(what)?;
    if file.binary.is_some() {
        file.text.line();
    }
    Ok(n)
}
