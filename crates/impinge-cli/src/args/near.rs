//! The command line of `impinge near`.

use std::path::PathBuf;

use clap::Args;
use impinge::PairKind;

use super::{AskArgs, DetectorArgs, RowsArgs, ShownArgs, ThicknessArgs, kind};
use crate::values::{distance, two_bodies};

pub const NEAR_EXAMPLES: &str = "\
Examples:
  impinge near a.obj b.obj --distance 0.01                which elements are within 0.01 of each other?
  impinge near cloth.ply --distance 0.002                 of one mesh: parts that do not share a vertex
  impinge near a.ply b.ply --distance 0.01 --rows -       the pairs themselves, as CSV
  impinge near a.stl b.stl --distance 0.5 --png near.png  where it is narrow, red to yellow
  impinge near a.stl b.stl --distance 0.5 --fail-on-hit   a check of clearance: exit code 3 if it is less
  impinge near a.ply b.ply --distance 1 --kinds ff        pairs of faces
  impinge near cloth.ply b.ply --distance 0 --thickness 0,0.01
                                                          the cloth is 0.01 thick

Whether a distance is at most D is decided exactly; --distance is read as a double-precision number. An edge and a face (ef) are
reported if they meet, whatever D: else their vertices and edges say that they are near. The program also asks whether anything
intersects, such as equal faces or a body inside tetrahedra; with --fail-on-hit both count.";

#[derive(Debug, Args)]
pub struct NearArgs {
    /// Mesh files, one per body; one alone is compared with itself
    #[arg(value_name = "MESH", required = true)]
    pub meshes: Vec<PathBuf>,
    /// The distance, in the unit of the meshes: 0 or more
    #[arg(long, value_name = "D", required = true, allow_negative_numbers = true, value_parser = distance)]
    pub distance: f64,
    /// Also find the pairs within each body
    #[arg(long = "self")]
    pub within: bool,
    /// Which pairs: vertex-face, edge-edge, edge-vertex, vertex-vertex, edge-face, face-face
    /// [default: vf,ee,ef]
    #[arg(long, value_parser = kind(), value_name = "KIND", value_delimiter = ',')]
    pub kinds: Vec<PairKind>,
    /// Find only the pairs of bodies A and B, numbered from 0 as given
    #[arg(long, value_name = "A,B", value_parser = two_bodies, conflicts_with_all = ["within", "exclude"])]
    pub between: Option<(usize, usize)>,
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
