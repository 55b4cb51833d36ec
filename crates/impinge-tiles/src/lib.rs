//! Scenes larger than memory, or than one machine: exact collision detection tile by tile.
//!
//! Space is cut by a kd-tree into half-open cells that fill it. An element goes to each cell that
//! its box touches; a pair belongs to the cell that holds the larger of the two lower corners, axis
//! by axis. So every pair is found, and no pair twice (the proof is in `cells.rs`). The hash of the
//! whole answer is the sum of the tiles' hashes.
//!
//! Four steps work on one folder and share nothing but its files. Each step may run on any machine
//! that sees the folder, in any number of processes. Run a killed step again: it ends with the same
//! bytes.
//!
//! | step | reads | writes |
//! |---|---|---|
//! | [`Plan::make`] | the meshes | `plan.json`: files, cuts, units of work |
//! | [`Plan::scatter`] | the meshes, unit by unit | `parts/unit-*.bin`: elements by tile |
//! | [`Plan::run`] | one tile of every part | `results/tile-*.npy` (rows) and `results/tile-*.json` |
//! | [`Plan::merge`] | all results | `rows.npy` (sorted) and `answer.json` |
//!
//! With [`PlanOptions::step`] the scene moves: a body is two files, its start and its end, boxes
//! are those over the whole step, and the answer is the first contacts ([`impinge::Impacts`]).
//! Edges are numbered within their whole body, which no tile sees. So rows name an edge by its
//! vertices, and each tile also lists the edges whose own lower corner it holds. That is each edge
//! of the body once, so merging these lists numbers them.
//!
//! Binary PLY of triangles, binary STL and `.npy` arrays `(n, 3, 3)` or `(n, 4, 3)` are read in
//! chunks; any other mesh file is read whole. The positions of an indexed file (12 or 24 bytes per
//! vertex) stay in memory while it is scattered.

mod cells;
mod chunk;
mod cuts;
mod disk;
mod error;
mod hash;
mod merge;
mod npy;
mod parts;
mod plan;
mod run;
mod scatter;
mod source;
mod step;

#[cfg(test)]
mod tests;

pub use cells::Cells;
pub use error::Error;
pub use merge::{Merged, MergedStep};
pub use plan::{File, Plan, PlanOptions};
pub use run::{Ask, RunOptions, TileResult};
pub use scatter::{ScatterOptions, Scattered};
