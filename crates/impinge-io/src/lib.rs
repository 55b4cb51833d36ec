//! Mesh files for impinge: reads surfaces, tetrahedra and sequences of positions, writes coloured
//! meshes. Both sides are plain arrays; this crate knows nothing about collision detection.
//!
//! ```no_run
//! use impinge_io::{ColoredMesh, ReadOptions, read, write_ply};
//! # fn main() -> Result<(), impinge_io::Error> {
//! let bunny = read("bunny.ply".as_ref(), &ReadOptions::default())?;
//! let red = vec![[220, 40, 30]; bunny.n_elements()];
//! write_ply("red.ply".as_ref(), &[ColoredMesh {
//!     positions: &bunny.positions,
//!     elements: &bunny.elements,
//!     element_colors: Some(&red),
//!     colliding: None,
//!     name: "bunny",
//! }])?;
//! # Ok(())
//! # }
//! ```
//!
//! # What readers preserve
//! - **Values.** Binary `float` coordinates stay f32. Coordinates in text are read as f64,
//!   correctly rounded, whatever type a header declares; [`Positions::narrow_if_exact`] converts
//!   them to f32 if nothing is lost.
//! - **Order.** Vertices and elements keep the order of the file. A polygon of n corners becomes
//!   n - 2 triangles in its place: the fan around its first corner, which covers a convex polygon
//!   exactly. If the polygon is concave and its fan overlaps itself, as seen along its normal, or
//!   if it has more than 256 corners, its ears are clipped instead, in `O(n log n)`. A strip
//!   becomes its triangles.
//! - **Everything that can collide.** Points and lines are counted and skipped. If a file has
//!   tetrahedra, its triangles are skipped too, unless [`ReadOptions::prefer`] says otherwise; see
//!   [`Summary`]. Hexahedra, prisms, pyramids and curved (higher-order) cells are refused with an
//!   error: skipping them would lose collisions silently.
//!
//! # What readers refuse
//! Indices out of range, coordinates that are not finite, files that end early, and headers that
//! announce more than the file holds: each is an [`Error`] that names the file, the line or byte
//! offset, and both numbers. Memory is reserved by the content of a file, not by what its header
//! says.
//!
//! # Why the parsers are our own
//! Crates exist for most of these formats, but they cover only one version of a format, read
//! coordinates as f32, merge vertices, or report errors without a line. For XML, JSON, zlib and LZ4
//! we use crates.

#![warn(missing_debug_implementations)]

mod base64;
mod binary;
mod bodies;
mod budget;
mod collect;
mod encoding;
mod error;
mod files;
mod format;
mod formats;
mod mesh;
mod npy;
mod numbers;
mod options;
mod polygon;
mod read;
mod sequence;
mod table;
mod text;
mod write;

pub use bodies::NamedMesh;
pub use error::{Error, Location, Place, printable};
pub use format::Format;
pub use formats::ply::PlyLayout;
pub use mesh::{Elements, Mesh, Positions, Weld, weld};
pub use npy::{NpyHeader, npy_header};
pub use numbers::{read_points, read_rows, read_rows_bytes};
pub use options::{Prefer, ReadOptions, Summary, grouped};
pub use read::{
    read, read_bodies, read_bodies_bytes, read_bytes, read_bytes_with_summary, read_tetgen_bytes,
    read_with_summary,
};
pub use sequence::{Sequence, SequenceFormat, are_numbered};
pub use table::{Cell, Column, ELEMENTS, Holds, KIND, Table, TableFormat, impact_columns};
pub use write::{
    AtomicFile, ColoredMesh, Pc2Writer, Polylines, remove_temporary_files, write_glb, write_obj,
    write_plain_ply, write_ply, write_polylines_obj, write_polylines_ply, write_polylines_vtu,
    write_stl, write_vtu,
};
