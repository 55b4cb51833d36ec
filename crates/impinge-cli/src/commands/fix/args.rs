//! The command line of `impinge fix`.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::Args;
use impinge_check::{MOST_HOLE_EDGES, Repair};

use crate::args::{RowsArgs, repair};
use crate::commands::check::FailOn;
use crate::values::{MendedFile, mesh_format, threads};

/// Shown below the help.
pub const FIX_EXAMPLES: &str = "\
Examples:
  impinge fix part.stl --out mended.ply
  impinge fix part.obj --out mended.obj --close-holes 8
  impinge fix part.obj --out mended.obj --only weld,orient,outward
  impinge fix part.ply --out mended.ply --skip duplicates --json
  impinge fix part.ply --out mended.ply --rows left.csv --fail-on any

No vertex is moved: each vertex of the result has the bits of a vertex of the file. What cannot be mended this way, above all
self-intersections, is counted and stays; --rows lists their pairs, by the faces of the result. Edges and vertices that were split
are at one position: `impinge check --keep-seams` sees them apart, other readers that weld join them again.";

#[derive(Debug, Args)]
pub struct FixArgs {
    /// A mesh file with triangles
    #[arg(value_name = "MESH")]
    pub mesh: PathBuf,
    /// The mended mesh (.ply, .obj or .stl)
    #[arg(long, value_name = "FILE")]
    pub out: MendedFile,
    /// Replace the file if it exists
    #[arg(long)]
    pub force: bool,
    /// Mend only this (comma-separated) [default: everything]
    #[arg(long, value_name = "WHAT", value_parser = repair(), value_delimiter = ',')]
    pub only: Vec<Repair>,
    /// Mend everything but this (comma-separated)
    #[arg(
        long,
        value_name = "WHAT",
        value_parser = repair(),
        value_delimiter = ',',
        conflicts_with = "only"
    )]
    pub skip: Vec<Repair>,
    /// Close holes of up to N edges, 3 to 256 [default: none]
    #[arg(long, value_name = "N", value_parser = hole_edges)]
    pub close_holes: Option<usize>,
    /// The format of a mesh on standard input, which is named "-": ply, off, stl, …
    #[arg(long, value_name = "EXT", value_parser = mesh_format)]
    pub format: Option<impinge_io::Format>,
    /// Exit with code 3 if the result still has one of these problems (comma-separated)
    #[arg(long, value_name = "WHAT", value_enum, value_delimiter = ',')]
    pub fail_on: Vec<FailOn>,
    /// CPU threads, 1 to 1024 [default: one per core]
    #[arg(long, value_name = "N", value_parser = threads)]
    pub threads: Option<NonZeroUsize>,
    /// Print JSON and nothing else
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub rows: RowsArgs,
}

impl FixArgs {
    /// The repairs that are asked for, in the order in which they run.
    pub fn repairs(&self) -> Vec<Repair> {
        let asks = |repair: &Repair| {
            let chosen = self.only.is_empty() || self.only.contains(repair);
            let has_limit = *repair != Repair::CloseHoles || self.close_holes.is_some();
            chosen && has_limit && !self.skip.contains(repair)
        };
        Repair::ALL.into_iter().filter(asks).collect()
    }
}

fn hole_edges(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(n) if (3..=MOST_HOLE_EDGES).contains(&n) => Ok(n),
        _ => Err(format!(
            "expected a number of edges from 3 to {MOST_HOLE_EDGES}"
        )),
    }
}
