//! The command line of `impinge safe`.

use std::path::PathBuf;

use clap::Args;

use super::{AskArgs, DetectorArgs, RowsArgs, ShownArgs, ThicknessArgs};
use crate::values::distance;

pub const SAFE_EXAMPLES: &str = "\
Examples:
  impinge safe cloth.ply --most 0.01                      how far may each vertex move, 0.01 at most?
  impinge safe cloth.ply floor.obj --most 0.01 --fixed 1  the floor stays, so the cloth has all of the room
  impinge safe a.ply b.ply --most 0.1 --rows bounds.npy   the bound of each vertex
  impinge safe a.ply --most 0.1 --png safe.png            a picture: red where nothing may move, grey where all may
  impinge safe a.ply --most 0.1 --fail-on-hit             exit code 3 if elements touch or intersect

If each vertex moves by at most its bound, on any path, nothing touches that does not touch now. Bounds are rounded down.
Elements of one body that share a vertex are left out.";

#[derive(Debug, Args)]
pub struct SafeArgs {
    /// Mesh files, one per body
    #[arg(value_name = "MESH", required = true)]
    pub meshes: Vec<PathBuf>,
    /// The largest bound, in the unit of the meshes: pairs more than twice as far apart play no
    /// part
    #[arg(long, value_name = "D", required = true, allow_negative_numbers = true, value_parser = distance)]
    pub most: f64,
    /// A body that does not move, numbered from 0 as given: its vertices get 0, and leave all of
    /// the room to others
    #[arg(long, value_name = "N")]
    pub fixed: Vec<usize>,
    /// Leave out the pairs within each body
    #[arg(long)]
    pub no_self: bool,
    #[command(flatten)]
    pub thickness: ThicknessArgs,
    #[command(flatten)]
    pub ask: AskArgs,
    #[command(flatten)]
    pub rows: RowsArgs,
    #[command(flatten)]
    pub shown: ShownArgs,
    #[command(flatten)]
    pub detector: DetectorArgs,
}
