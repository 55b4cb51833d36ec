//! The header of a PLY file.

use crate::binary::{Endian, Scalar};
use crate::collect::check_n_vertices;
use crate::error::{Error, Name, Place, shown};
use crate::text::{Line, Text, number};

/// How the records are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Storage {
    Ascii,
    Binary(Endian),
}

/// How an element is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Vertices,
    Faces,
    Tristrips,
    Tetrahedra,
    Edges,
    Other,
}

#[derive(Debug, Clone)]
pub(super) enum Property {
    Scalar {
        name: Vec<u8>,
        scalar: Scalar,
    },
    List {
        name: Vec<u8>,
        count: Scalar,
        item: Scalar,
    },
}

#[derive(Debug, Clone)]
pub(super) struct Element {
    pub name: String,
    pub kind: Kind,
    /// The number of records, as announced.
    pub count: u64,
    pub properties: Vec<Property>,
    /// The line of the header that announces it.
    pub line: u64,
}

#[derive(Debug, Clone)]
pub(super) struct Header {
    pub storage: Storage,
    pub elements: Vec<Element>,
    /// The count of the element `vertex`.
    pub n_vertices: u64,
}

impl Header {
    /// Reads up to and including the line `end_header`.
    pub(super) fn read(name: Name, text: &mut Text) -> Result<Self, Error> {
        let magic = text.line().map_or(&[][..], |line| line.bytes);
        if magic.trim_ascii() != b"ply" {
            return Err(name.syntax(Place::Line(1), "'ply'", shown(magic)));
        }
        let mut storage = None;
        let mut elements: Vec<Element> = Vec::new();
        loop {
            let line = text
                .line()
                .ok_or_else(|| name.syntax(text.place(), "'end_header'", "the end of the file"))?;
            let mut words = line.words();
            match words.next() {
                None | Some(b"comment" | b"obj_info") => {}
                Some(b"format") => storage = Some(read_format(name, line)?),
                Some(b"element") => elements.push(Element::read(name, line)?),
                Some(b"property") => {
                    let element = elements.last_mut().ok_or_else(|| {
                        name.syntax(line.place(), "an 'element' first", "'property'")
                    })?;
                    element.properties.push(read_property(name, line)?);
                }
                Some(b"end_header") => break,
                Some(word) => {
                    return Err(name.syntax(
                        line.place(),
                        "'element', 'property' or 'end_header'",
                        shown(word),
                    ));
                }
            }
        }
        let storage = storage
            .ok_or_else(|| name.syntax(text.place(), "a line 'format' in the header", "none"))?;
        let mut vertices = elements
            .iter()
            .filter(|element| element.kind == Kind::Vertices);
        let first = vertices.next().ok_or_else(|| {
            name.syntax(text.place(), "an element 'vertex' in the header", "none")
        })?;
        if let Some(second) = vertices.next() {
            return Err(name.syntax(
                Place::Line(second.line),
                "one element 'vertex'",
                "a second one",
            ));
        }
        first.axes(name)?;
        check_n_vertices(name, Place::Line(first.line), first.count)?;
        Ok(Header {
            storage,
            n_vertices: first.count,
            elements,
        })
    }
}

fn read_format(name: Name, line: Line) -> Result<Storage, Error> {
    match line.words().nth(1) {
        Some(b"ascii") => Ok(Storage::Ascii),
        Some(b"binary_little_endian") => Ok(Storage::Binary(Endian::Little)),
        Some(b"binary_big_endian") => Ok(Storage::Binary(Endian::Big)),
        other => Err(name.syntax(
            line.place(),
            "'ascii', 'binary_little_endian' or 'binary_big_endian'",
            other.map_or("the end of the line".to_owned(), shown),
        )),
    }
}

fn read_property(name: Name, line: Line) -> Result<Property, Error> {
    let mut words = line.words().skip(1);
    let mut next = |expected: &str| {
        words
            .next()
            .ok_or_else(|| name.syntax(line.place(), expected, "the end of the line"))
    };
    let scalar = |word: &[u8]| {
        Ok(match word {
            b"char" | b"int8" => Scalar::I8,
            b"uchar" | b"uint8" => Scalar::U8,
            b"short" | b"int16" => Scalar::I16,
            b"ushort" | b"uint16" => Scalar::U16,
            b"int" | b"int32" => Scalar::I32,
            b"uint" | b"uint32" => Scalar::U32,
            b"int64" => Scalar::I64,
            b"uint64" => Scalar::U64,
            b"float" | b"float32" => Scalar::F32,
            b"double" | b"float64" => Scalar::F64,
            other => return Err(name.syntax(line.place(), "a type of number", shown(other))),
        })
    };
    match next("a type")? {
        b"list" => {
            let (count, item) = (
                scalar(next("the type of a list's length")?)?,
                scalar(next("the type of a list's items")?)?,
            );
            if count.is_float() {
                return Err(name.syntax(
                    line.place(),
                    "an integer type for a list's length",
                    "a floating one",
                ));
            }
            Ok(Property::List {
                name: next("a name")?.to_vec(),
                count,
                item,
            })
        }
        word => Ok(Property::Scalar {
            scalar: scalar(word)?,
            name: next("a name")?.to_vec(),
        }),
    }
}

/// Bytes of some properties, if none of them is a list.
fn size_of_scalars(properties: &[Property]) -> Option<usize> {
    let sizes = properties.iter().map(|property| match property {
        Property::Scalar { scalar, .. } => Some(scalar.size()),
        Property::List { .. } => None,
    });
    sizes.sum()
}

impl Element {
    fn read(name: Name, line: Line) -> Result<Self, Error> {
        let mut words = line.words().skip(1);
        let mut next = |expected: &str| {
            words
                .next()
                .ok_or_else(|| name.syntax(line.place(), expected, "the end of the line"))
        };
        let title = next("the name of an element")?;
        let kind = match title {
            b"vertex" => Kind::Vertices,
            b"face" => Kind::Faces,
            b"tristrips" => Kind::Tristrips,
            b"tetra" | b"tetrahedra" | b"tet" | b"tets" => Kind::Tetrahedra,
            b"edge" => Kind::Edges,
            _ => Kind::Other,
        };
        let count = number(
            name,
            line.place(),
            next("the number of records")?,
            "the number of records",
        )?;
        Ok(Element {
            name: String::from_utf8_lossy(title).into_owned(),
            kind,
            count,
            properties: Vec::new(),
            line: line.number,
        })
    }

    /// Bytes per record, if all records have the same size.
    pub(super) fn stride(&self) -> Option<usize> {
        size_of_scalars(&self.properties)
    }

    /// Bytes of the shortest possible record; at least 1 if there are properties.
    pub(super) fn least_size(&self) -> usize {
        let size = |property: &Property| match property {
            Property::Scalar { scalar, .. } => scalar.size(),
            Property::List { count, .. } => count.size(),
        };
        self.properties.iter().map(size).sum::<usize>().max(1)
    }

    /// Which properties are x, y and z.
    pub(super) fn axes(&self, name: Name) -> Result<[usize; 3], Error> {
        let find = |axis: &str| {
            let is_axis = |property: &Property| matches!(property, Property::Scalar { name, .. } if name == axis.as_bytes());
            self.properties.iter().position(is_axis).ok_or_else(|| {
                name.syntax(
                    Place::Line(self.line),
                    format!("a property '{axis}' of the element 'vertex'"),
                    "none",
                )
            })
        };
        Ok([find("x")?, find("y")?, find("z")?])
    }

    /// Offsets in a record and types of x, y and z, if no property is a list.
    pub(super) fn xyz(&self, name: Name) -> Result<[(usize, Scalar); 3], Error> {
        let axes = self.axes(name)?;
        let mut xyz = [(0, Scalar::F32); 3];
        let mut offset = 0;
        for (ix, property) in self.properties.iter().enumerate() {
            if let Property::Scalar { scalar, .. } = property {
                if let Some(axis) = axes.iter().position(|&axis| axis == ix) {
                    xyz[axis] = (offset, *scalar);
                }
                offset += scalar.size();
            }
        }
        Ok(xyz)
    }

    /// Which property lists the vertices of a primitive; `None` for elements that are skipped.
    pub(super) fn vertex_list(&self, name: Name) -> Result<Option<usize>, Error> {
        if matches!(self.kind, Kind::Vertices | Kind::Edges | Kind::Other) {
            return Ok(None);
        }
        let is_list = |property: &Property| matches!(property, Property::List { name, .. } if name == b"vertex_indices" || name == b"vertex_index");
        let place = Place::Line(self.line);
        let found = self.properties.iter().position(is_list).ok_or_else(|| {
            name.syntax(
                place,
                format!("a list 'vertex_indices' of the element '{}'", self.name),
                "none",
            )
        })?;
        if let Property::List { item, .. } = &self.properties[found]
            && item.is_float()
        {
            return Err(name.syntax(
                place,
                "an integer type for vertex indices",
                "a floating one",
            ));
        }
        Ok(Some(found))
    }
}

/// Where binary PLY, little-endian, with vertices, then triangles, and nothing else has its data:
/// all vertices have the same number of bytes, and so have all triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct PlyLayout {
    /// The offset of the first vertex in the file.
    pub start: u64,
    /// How many vertices follow each other there.
    pub n_vertices: u64,
    /// Bytes per vertex.
    pub vertex_stride: usize,
    /// The offsets of x, y and z in a vertex.
    pub xyz: [usize; 3],
    /// Whether these are f64, not f32.
    pub is_f64: bool,
    /// How many faces follow the vertices.
    pub n_faces: u64,
    /// Bytes per face, if it is a triangle.
    pub face_stride: usize,
    /// The offset in a face of the byte that holds its number of corners. Their vertices follow,
    /// 4 bytes each.
    pub corners: usize,
    /// Whether these are i32, not u32.
    pub is_signed: bool,
}

impl PlyLayout {
    /// Reads the header at the beginning of a file; `None` if it is not whole or not valid, or if
    /// the file can have another layout. Faces may have other numbers of corners.
    pub fn parse(head: &[u8]) -> Option<Self> {
        let name = Name("");
        let mut text = Text::new(name, head);
        let header = Header::read(name, &mut text).ok()?;
        let start = text.offset();
        // Where the bytes end in its last line, that may go on in the file.
        let is_whole = match head[..start].last() {
            Some(b'\r') => start < head.len(),
            last => last == Some(&b'\n'),
        };
        let [vertices, faces] = header.elements.as_slice() else {
            return None;
        };
        let list = faces.vertex_list(name).ok()??;
        let (before, rest) = faces.properties.split_at(list);
        let Property::List { count, item, .. } = rest[0] else {
            return None;
        };
        let xyz = vertices.xyz(name).ok()?;
        let [x, y, z] = xyz.map(|(_, scalar)| scalar);
        let is_known = is_whole
            && header.storage == Storage::Binary(Endian::Little)
            && vertices.kind == Kind::Vertices
            && faces.kind == Kind::Faces
            && x == y
            && y == z
            && matches!(x, Scalar::F32 | Scalar::F64)
            && count == Scalar::U8
            && matches!(item, Scalar::I32 | Scalar::U32);
        let corners = size_of_scalars(before)?;
        is_known.then_some(PlyLayout {
            start: start as u64,
            n_vertices: vertices.count,
            vertex_stride: vertices.stride()?,
            xyz: xyz.map(|(offset, _)| offset),
            is_f64: x == Scalar::F64,
            n_faces: faces.count,
            face_stride: corners + 1 + 3 * item.size() + size_of_scalars(&rest[1..])?,
            corners,
            is_signed: item == Scalar::I32,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layouts() {
        let read = |text: &str| PlyLayout::parse(text.as_bytes());
        let text = "ply\nformat binary_little_endian 1.0\ncomment x\nelement vertex 4\nproperty float x\n\
            property float y\nproperty float z\nproperty uchar red\nelement face 2\nproperty uchar green\n\
            property list uchar int vertex_indices\nproperty uchar blue\nend_header\n";
        let expected = PlyLayout {
            start: text.len() as u64,
            n_vertices: 4,
            vertex_stride: 13,
            xyz: [0, 4, 8],
            is_f64: false,
            n_faces: 2,
            face_stride: 15,
            corners: 1,
            is_signed: true,
        };
        assert_eq!(read(text), Some(expected));
        assert_eq!(read(text.trim_end()), None);
        let returns = text.replace('\n', "\r\n") + "x";
        assert_eq!(read(&returns).unwrap().start, returns.len() as u64 - 1);
        assert_eq!(read(returns.trim_end_matches(['\n', 'x'])), None);
        assert!(read(&text.replace("float", "double")).unwrap().is_f64);
        let unsigned = text.replace("int vertex", "uint vertex");
        assert!(!read(&unsigned).unwrap().is_signed);
        for (old, new) in [
            ("little", "big"),
            ("float x", "double x"),
            ("uchar int", "int int"),
            ("int vertex", "short vertex"),
            ("float z", "float w"),
            ("face 2", "edge 2"),
            ("uchar blue", "list uchar int blue"),
            (
                "element face 2\n",
                "element edge 1\nproperty int a\nelement face 2\n",
            ),
            ("end_header\n", ""),
        ] {
            assert_eq!(read(&text.replace(old, new)), None, "{new}");
        }
    }
}
