//! The output of every reader: positions, triangles, tetrahedra, and the counts of fanned polygons
//! and skipped cells.

use std::ops::Range;

use crate::bodies::{NamedMesh, PartName, Parts};
use crate::error::{Error, Name, Place, shown};
use crate::mesh::{Elements, Mesh, Positions};
use crate::options::{Prefer, ReadOptions, Summary};
use crate::polygon::mend;
use crate::text::Line;

/// A mesh being read.
#[derive(Debug)]
pub(crate) struct Collector<'a> {
    pub name: Name<'a>,
    pub positions: Positions,
    pub triangles: Vec<[u32; 3]>,
    pub tetrahedra: Vec<[u32; 4]>,
    /// The triangles of polygons of more than three corners. If the fan is no good, they are
    /// replaced in the end: some formats name vertices before their positions.
    fans: Vec<Range<usize>>,
    pub n_lines: u64,
    pub n_points: u64,
    /// Meshes that are moved by what is not applied.
    pub n_at_rest: u64,
    /// Nodes with a mesh outside the scene that is read.
    pub n_out_of_scene: u64,
    n_bytes_beyond: u64,
    n_unknown_lines: u64,
    first_unknown_line: Option<(u64, String)>,
    pub unit: Option<&'static str>,
    /// The corners of the current polygon or strip; its memory is reused.
    pub corners: Vec<u32>,
    /// Which triangles belong to which node or group.
    parts: Parts,
}

impl<'a> Collector<'a> {
    pub(crate) fn new(name: Name<'a>) -> Self {
        Collector {
            name,
            positions: Positions::F64(Vec::new()),
            triangles: Vec::new(),
            tetrahedra: Vec::new(),
            fans: Vec::new(),
            n_lines: 0,
            n_points: 0,
            n_at_rest: 0,
            n_out_of_scene: 0,
            n_bytes_beyond: 0,
            n_unknown_lines: 0,
            first_unknown_line: None,
            unit: None,
            corners: Vec::new(),
            parts: Parts::default(),
        }
    }

    /// The triangles that are added from now on belong to the part of this name, until another one
    /// begins. With `is_new`, a part of the same name that began before is another one. Its
    /// vertices are counted from `base` on.
    pub(crate) fn begin_part(&mut self, name: PartName<'_>, is_new: bool, base: usize) {
        // A file of more vertices is refused.
        let base = u32::try_from(base).unwrap_or(u32::MAX);
        self.parts.begin(name, is_new, base, self.triangles.len());
    }

    pub(crate) fn n_vertices(&self) -> u64 {
        self.positions.len() as u64
    }

    /// Converts `index` of a file that counts from `first` to a vertex index.
    pub(crate) fn vertex(&self, index: i64, first: i64, place: Place) -> Result<u32, Error> {
        vertex_ix(self.name, index, first, self.n_vertices(), place)
    }

    /// Adds the face in [`corners`](Self::corners): a polygon, unless it has the one corner of a
    /// point or the two of a line.
    pub(crate) fn face(&mut self, place: Place) -> Result<(), Error> {
        match self.corners.len() {
            1 => self.n_points += 1,
            2 => self.n_lines += 1,
            _ => self.polygon(place)?,
        }
        Ok(())
    }

    /// Adds the polygon in [`corners`](Self::corners) as a fan around its first corner.
    pub(crate) fn polygon(&mut self, place: Place) -> Result<(), Error> {
        let [_, rest @ ..] = self.corners.as_slice() else {
            return Err(self
                .name
                .count(place, "corners of a polygon, or more", 3, 0));
        };
        if rest.len() < 2 {
            return Err(self.name.count(
                place,
                "corners of a polygon, or more",
                3,
                self.corners.len() as u64,
            ));
        }
        if rest.len() > 2 {
            let first = self.triangles.len();
            self.fans.push(first..first + rest.len() - 1);
        }
        let corner = self.corners[0];
        self.triangles
            .extend(rest.windows(2).map(|edge| [corner, edge[0], edge[1]]));
        Ok(())
    }

    /// Adds the strip in [`corners`](Self::corners): each corner forms a triangle with the two
    /// before it; every other triangle is flipped.
    pub(crate) fn strip(&mut self) {
        self.triangles
            .extend(self.corners.windows(3).enumerate().map(|(ix, t)| {
                if ix % 2 == 0 {
                    [t[0], t[1], t[2]]
                } else {
                    [t[1], t[0], t[2]]
                }
            }));
    }

    /// Counts what follows the data that the header announces, unless it is white space and zeros
    /// alone, with which some programs fill files up.
    pub(crate) fn beyond(&mut self, rest: &[u8]) {
        let fills = |byte: &u8| byte.is_ascii_whitespace() || *byte == 0;
        if !rest.iter().all(fills) {
            self.n_bytes_beyond = rest.len() as u64;
        }
    }

    /// Counts a line whose first word is not known.
    pub(crate) fn unknown(&mut self, line: Line<'_>) {
        self.n_unknown_lines += 1;
        let first = &mut self.first_unknown_line;
        first.get_or_insert_with(|| (line.number, shown(line.bytes)));
    }

    /// All triangles so far belong to no part.
    pub(crate) fn forget_parts(&mut self) {
        self.parts = Parts::default();
    }

    /// As [`finish`](Self::finish), every part of the file as a mesh of its own.
    pub(crate) fn finish_bodies(
        mut self,
        options: &ReadOptions,
    ) -> Result<(Vec<NamedMesh>, Summary), Error> {
        let parts = std::mem::take(&mut self.parts);
        let whole = ReadOptions {
            weld: false,
            ..options.clone()
        };
        let (mesh, mut summary) = self.finish(&whole)?;
        let mut bodies = parts.split(mesh);
        if options.weld {
            let welded = bodies.iter_mut().map(NamedMesh::weld);
            summary.n_welded = welded.sum::<usize>() as u64;
        }
        Ok((bodies, summary))
    }

    /// Chooses the elements that the options ask for, checks that there are some, and welds if
    /// the options say so.
    pub(crate) fn finish(mut self, options: &ReadOptions) -> Result<(Mesh, Summary), Error> {
        let n_polygons_fanned = self.fans.len() as u64;
        for fan in std::mem::take(&mut self.fans) {
            let position = |corner: u32| self.positions.get(corner as usize).unwrap_or_default();
            mend(&mut self.triangles[fan], position);
        }
        let (n_triangles, n_tetrahedra) =
            (self.triangles.len() as u64, self.tetrahedra.len() as u64);
        let (wanted, tetrahedra) = match options.prefer {
            Prefer::Volume => ("triangles or tetrahedra", n_tetrahedra > 0),
            Prefer::Triangles => ("triangles", false),
            Prefer::Tetrahedra => ("tetrahedra", true),
        };
        let elements = if tetrahedra {
            Elements::Tetrahedra(self.tetrahedra)
        } else {
            Elements::Triangles(self.triangles)
        };
        if elements.is_empty() {
            return Err(Error::NoElements {
                file: self.name.0.to_owned(),
                wanted,
                n_vertices: self.positions.len() as u64,
                n_triangles,
                n_tetrahedra,
                n_lines: self.n_lines,
                n_points: self.n_points,
            });
        }
        let mut mesh = Mesh {
            positions: self.positions,
            elements,
        };
        let n_welded = if options.weld {
            crate::weld(&mut mesh)
        } else {
            0
        };
        let summary = Summary {
            n_polygons_fanned,
            n_lines_skipped: self.n_lines,
            n_points_skipped: self.n_points,
            n_triangles_skipped: if tetrahedra { n_triangles } else { 0 },
            n_tetrahedra_skipped: if tetrahedra { 0 } else { n_tetrahedra },
            n_welded: n_welded as u64,
            n_at_rest: self.n_at_rest,
            n_out_of_scene: self.n_out_of_scene,
            n_parts_joined: self.parts.len() as u64,
            n_bytes_beyond: self.n_bytes_beyond,
            n_unknown_lines: self.n_unknown_lines,
            first_unknown_line: self.first_unknown_line,
            unit: self.unit,
        };
        Ok((mesh, summary))
    }
}

/// Converts `index` of a file that counts from `first` to a vertex index below `n_vertices`.
pub(crate) fn vertex_ix(
    name: Name,
    index: i64,
    first: i64,
    n_vertices: u64,
    place: Place,
) -> Result<u32, Error> {
    index
        .checked_sub(first)
        .and_then(|ix| u32::try_from(ix).ok())
        .filter(|&ix| u64::from(ix) < n_vertices)
        .ok_or_else(|| Error::Index {
            at: name.at(place),
            index,
            first,
            n_vertices,
        })
}

/// Checks that a number of vertices can be indexed by u32.
pub(crate) fn check_n_vertices(name: Name, place: Place, n_vertices: u64) -> Result<(), Error> {
    if n_vertices > u64::from(u32::MAX) {
        return Err(name.too_large(place, "number of vertices", u64::from(u32::MAX), n_vertices));
    }
    Ok(())
}

/// Checks that a position is finite.
pub(crate) fn finite(
    name: Name,
    place: Place,
    vertex: usize,
    position: [f64; 3],
) -> Result<[f64; 3], Error> {
    match position.iter().find(|c| !c.is_finite()) {
        None => Ok(position),
        Some(&value) => Err(Error::NotFinite {
            at: name.at(place),
            vertex: vertex as u64,
            value,
        }),
    }
}
