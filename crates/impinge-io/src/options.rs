//! How a mesh is read, and what a reader tells of it.

/// Which primitives to take from a file that has triangles and tetrahedra.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Prefer {
    /// The tetrahedra if there are any, else the triangles: a volume's file often repeats its surface.
    #[default]
    Volume,
    /// The triangles; a file without is an error.
    Triangles,
    /// The tetrahedra; a file without is an error.
    Tetrahedra,
}

/// How to read a mesh.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReadOptions {
    /// Whether vertices at the same position become one; see [`weld`](crate::weld). Off by default.
    pub weld: bool,
    /// Which primitives to take where there are both kinds.
    pub prefer: Prefer,
    /// The most bytes that data may take which is larger in memory than in the file by its nature: compressed arrays,
    /// and glTF meshes placed many times. 4 GiB by default. Compressed arrays may not take more than 200 times the bytes of
    /// their file either, or 64 MiB where that is more.
    pub max_expanded_bytes: u64,
    /// The most bytes that a file may have; a longer one is refused before it is read. 16 GiB by default.
    pub max_file_bytes: u64,
}

impl Default for ReadOptions {
    fn default() -> Self {
        ReadOptions {
            weld: false,
            prefer: Prefer::Volume,
            max_expanded_bytes: 4 << 30,
            max_file_bytes: 16 << 30,
        }
    }
}

/// What a reader did to a file's cells, so that nothing is left out unseen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub struct Summary {
    /// Polygons of four corners or more, each of which became several triangles. Where it is 0, primitive ids are the file's.
    pub n_polygons_fanned: u64,
    /// Lines left out.
    pub n_lines_skipped: u64,
    /// Point cells left out.
    pub n_points_skipped: u64,
    /// Triangles left out beside tetrahedra.
    pub n_triangles_skipped: u64,
    /// Tetrahedra left out because triangles were asked for.
    pub n_tetrahedra_skipped: u64,
    /// Vertices that went away in welding.
    pub n_welded: u64,
}
