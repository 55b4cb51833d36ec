//! What is wrong with a mesh: self-intersections, degenerate and duplicate primitives, non-manifold places, open
//! borders, inconsistent orientation, pieces. Every count is exact: there is no tolerance anywhere.
//!
//! [`check_mesh`] looks at one mesh in memory, [`check_file`] at one file. A dataset of many files goes through
//! [`Pool`]: each mesh is checked in a child process that may be killed, so that one bad file costs one row and
//! not the run. [`RowStore`] keeps rows on disk, and a run that was interrupted goes on where it stopped.
//!
//! ```
//! use impinge_check::{Options, check_mesh};
//! use impinge_io::{Elements, Mesh, Positions};
//! # fn main() -> Result<(), impinge::Error> {
//! // Two triangles that share an edge, and a third one through both.
//! let mesh = Mesh {
//!     positions: Positions::F32(vec![
//!         [0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 2.0, 0.0], [0.0, 2.0, 0.0],
//!         [0.5, 1.0, -1.0], [1.5, 1.0, -1.0], [1.0, 1.0, 1.0],
//!     ]),
//!     elements: Elements::Triangles(vec![[0, 1, 2], [0, 2, 3], [4, 5, 6]]),
//! };
//! let counts = check_mesh(mesh, &Options::default())?.counts;
//! assert_eq!(counts.self_intersections, 2);
//! assert_eq!((counts.boundary_facets, counts.components), (7, 2));
//! # Ok(()) }
//! ```

mod analysis;
mod facets;
mod file;
mod limits;
mod marks;
mod pool;
mod row;
mod store;
mod union_find;
mod worker;

pub use analysis::{Checked, Options, check_mesh};
pub use file::{check_file, check_file_marked};
pub use limits::{Limits, apply_limits};
pub use marks::{Marks, Problem};
pub use pool::{Pool, PoolError};
pub use row::{Counts, ErrorKind, Failure, Row};
pub use store::{RowStore, StoreError};
pub use worker::serve;
