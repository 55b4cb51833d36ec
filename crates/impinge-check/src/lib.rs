//! Checks meshes for self-intersections, degenerate and duplicate elements, non-manifold places,
//! open borders, inconsistent orientation and closed pieces that are inside out, and counts their
//! pieces. Every count is exact: there is no tolerance anywhere.
//!
//! [`check_mesh`] checks one mesh in memory, [`check_file`] one file. For a dataset of many files
//! use
//! [`Pool`]: each mesh is checked in a child process that may be killed, so that one bad file costs one row and
//! not the run. [`RowStore`] keeps rows on disk, so that an interrupted run can continue where it
//! stopped. A [`Report`] says what is in many rows, as a table or for other programs. [`fix_mesh`]
//! mends what can be mended without moving a vertex.
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
mod assembly;
mod by_vertex;
mod copies;
mod facets;
mod file;
mod fix;
mod limits;
mod marks;
mod places;
mod pool;
pub mod report;
mod row;
mod shells;
mod store;
mod surface;
pub mod text;
mod union_find;
mod volume;
mod walls;
mod worker;

pub use analysis::{Checked, Options, check_mesh};
pub use assembly::{
    Assembly, AssemblyError, AssemblyOptions, PartKind, PartPair, Relation, check_assembly,
    check_assembly_with,
};
pub use file::check_file;
pub use fix::{FixError, FixOptions, Fixed, MOST_HOLE_EDGES, Repair, Repairs, fix_mesh};
pub use limits::{Limits, apply_limits};
pub use marks::{MarkRuns, Marks, Problem};
pub use places::Place;
pub use pool::{Pool, PoolError};
pub use report::{Failed, Finding, Report};
pub use row::{Counts, ErrorKind, Failure, Row};
pub use store::{RowStore, StoreError};
pub use worker::serve;
