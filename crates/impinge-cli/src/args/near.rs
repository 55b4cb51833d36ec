//! The command line of `impinge near`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use impinge::PairKind;

use super::{DetectorArgs, ReadArgs};
use crate::values::{RowsFile, RowsFormat, body_numbers, distance};

pub const NEAR_EXAMPLES: &str = "\
Examples:
  impinge near a.obj b.obj --distance 0.01                which elements are within 0.01 of each other?
  impinge near cloth.ply --distance 0.002                 of one mesh: parts that do not share a vertex
  impinge near a.ply b.ply --distance 0.01 --pairs -      the pairs themselves, as CSV
  impinge near a.stl b.stl --distance 0.5 --fail-on-hit   a check of clearance: exit code 3 if it is less
  impinge near a.ply b.ply --distance 1 --kinds ff        pairs of faces

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
    /// Which pairs: vertex-face, edge-edge, edge-vertex, vertex-vertex, edge-face, face-face [default: vf,ee,ef]
    #[arg(long, value_enum, value_name = "KIND", value_delimiter = ',')]
    pub kinds: Vec<KindArg>,
    #[command(flatten)]
    pub read: ReadArgs,
    /// Ignore the pairs of bodies A and B, numbered from 0 as given (A,A: the pairs within A)
    #[arg(long, value_name = "A,B", value_parser = body_numbers)]
    pub ignore: Vec<(usize, usize)>,
    /// End with exit code 3 if anything is found
    #[arg(long)]
    pub fail_on_hit: bool,
    /// Print JSON and nothing else (see docs/cli.md)
    #[arg(long)]
    pub json: bool,
    /// Write the pairs (.csv, .jsonl or .npy; "-" is standard output, as CSV unless --pairs-format says otherwise)
    #[arg(long, value_name = "FILE")]
    pub pairs: Option<RowsFile>,
    /// The format of the pairs, whatever the name of the file
    #[arg(long, value_enum, value_name = "FORMAT", requires = "pairs")]
    pub pairs_format: Option<RowsFormat>,
    #[command(flatten)]
    pub detector: DetectorArgs,
}

impl NearArgs {
    /// The file of the pairs, with the requested format.
    pub fn rows(&self) -> Option<RowsFile> {
        let file = self.pairs.clone()?;
        let format = self.pairs_format.unwrap_or(file.format);
        Some(RowsFile { format, ..file })
    }

    /// The output file, with its option.
    pub fn output(&self) -> Option<(&'static str, &Path)> {
        let file = self.pairs.as_ref().filter(|file| !file.is_stdout())?;
        Some(("--pairs", &file.path))
    }
}

/// [`PairKind`] as an option.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum KindArg {
    /// A vertex and a face
    Vf,
    /// Two edges
    Ee,
    /// An edge and a vertex
    Ev,
    /// Two vertices
    Vv,
    /// An edge and a face
    Ef,
    /// Two faces
    Ff,
}

impl From<KindArg> for PairKind {
    fn from(kind: KindArg) -> Self {
        match kind {
            KindArg::Vf => PairKind::VertexFace,
            KindArg::Ee => PairKind::EdgeEdge,
            KindArg::Ev => PairKind::EdgeVertex,
            KindArg::Vv => PairKind::VertexVertex,
            KindArg::Ef => PairKind::EdgeFace,
            KindArg::Ff => PairKind::FaceFace,
        }
    }
}
