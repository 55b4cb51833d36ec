//! The command line of `impinge tiles`.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::{Args, Subcommand};

use impinge::{Method, Precision, SharedVertex, Start};

use crate::args::{method, precision, shared_vertex, start_of_tiles};
use crate::values::{bytes, count, distance, threads};

/// Shown below the help.
pub const TILES_EXAMPLES: &str = "\
Examples:
  impinge tiles plan big scan.ply --cap 2M
  impinge tiles scatter big
  impinge tiles run big --self
  impinge tiles merge big --json                                     pairs and hash of the whole
  impinge tiles run big --rank $SLURM_ARRAY_TASK_ID --world-size 64  one of 64 processes
  impinge tiles plan big a0.ply a1.ply b0.ply b1.ply --step          bodies that move: start, end, ...

Space is cut into tiles of about --cap elements each. Steps communicate only through the folder.
Many processes, on any machine that sees the folder, may run a step. A killed step can be run again
and gives the same bytes. The answer is the same as for the whole scene in one process.

Binary PLY of triangles, binary STL and .npy arrays (n, 3, 3) or (n, 4, 3) are read in chunks.
Other formats are read whole, one file at a time.";

#[derive(Debug, Args)]
pub struct TilesArgs {
    #[command(subcommand)]
    pub command: TilesCommand,
}

#[derive(Debug, Subcommand)]
pub enum TilesCommand {
    /// Read the meshes once and decide where to cut
    Plan(PlanArgs),
    /// Write the elements of each tile
    Scatter(ScatterArgs),
    /// Find the pairs of tiles
    Run(RunArgs),
    /// Merge the pairs of all tiles into one sorted answer
    Merge(MergeArgs),
}

/// The share of the work of this process.
#[derive(Debug, Clone, Args)]
pub struct ShareArgs {
    /// The rank of this process, from 0
    #[arg(long, value_name = "R", default_value = "0")]
    pub rank: usize,
    /// How many processes share the work
    #[arg(long, value_name = "W", default_value = "1")]
    pub world_size: NonZeroUsize,
}

#[derive(Debug, Args)]
pub struct PlanArgs {
    /// A folder for the plan and all later files
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// Mesh files, one per body; with --step two per body, its start and its end
    #[arg(value_name = "MESH", required = true)]
    pub meshes: Vec<PathBuf>,
    /// Plan a step: tiles then find what touches while bodies move from start to end, and when
    /// first
    #[arg(long)]
    pub step: bool,
    /// Of a step: the distance that elements must keep; tiles find the first time at which they are
    /// as near as that
    #[arg(long, value_name = "D", default_value = "0", requires = "step", allow_negative_numbers = true, value_parser = distance)]
    pub separation: f64,
    /// About how many elements a tile may hold, such as 500k or 2M: about 300 bytes each
    #[arg(long, value_name = "N", value_parser = count, default_value = "2M")]
    pub cap: u64,
    /// The number of elements that a thread scatters at a time: about 200 bytes each
    #[arg(long, value_name = "N", value_parser = count, default_value = "500k")]
    pub chunk: u64,
    /// Weld vertices at the same position, within each file; with --step, both at the start and at
    /// the end. This is the default
    #[arg(long, overrides_with = "no_weld")]
    pub weld: bool,
    /// Do not weld vertices at the same position
    #[arg(long, overrides_with = "weld")]
    pub no_weld: bool,
    /// Replace another plan in this folder, and all files made by it
    #[arg(long)]
    pub replace: bool,
    /// Print JSON and nothing else
    #[arg(long)]
    pub json: bool,
    /// Show no progress bar
    #[arg(long)]
    pub no_progress: bool,
}

#[derive(Debug, Args)]
pub struct ScatterArgs {
    /// The folder of the plan
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    #[command(flatten)]
    pub share: ShareArgs,
    /// CPU threads, 1 to 1024 [default: one per core]
    #[arg(long, value_name = "N", value_parser = threads)]
    pub threads: Option<NonZeroUsize>,
    /// Print JSON and nothing else
    #[arg(long)]
    pub json: bool,
    /// Show no progress bar
    #[arg(long)]
    pub no_progress: bool,
}

#[derive(Debug, Args)]
pub struct RunArgs {
    /// The folder of the plan
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// Run one tile instead of this process's share
    #[arg(long, value_name = "I")]
    pub tile: Option<u32>,
    #[command(flatten)]
    pub share: ShareArgs,
    /// Find only pairs within each file [default: within and between]
    #[arg(long = "self", conflicts_with = "between")]
    pub within: bool,
    /// Find only pairs between files
    #[arg(long)]
    pub between: bool,
    /// Which neighbours are reported: pairs of elements of one body that share a vertex
    #[arg(long, value_parser = shared_vertex(), value_name = "RULE", default_value_t = SharedVertex::Resolve)]
    pub shared_vertex: SharedVertex,
    /// Of a step: the precision to which times are rounded down
    #[arg(long, value_parser = precision(), value_name = "P", default_value_t = Precision::F32, alias = "toi")]
    pub precision: Precision,
    /// Of a step: pairs that touch at the start are reported with the time 0, or ignored
    #[arg(long, value_parser = start_of_tiles(), value_name = "RULE", default_value_t = Start::Report)]
    pub start: Start,
    /// The method that finds candidates; all methods give the same pairs
    #[arg(long, value_parser = method(), default_value_t = Method::Auto)]
    pub method: Method,
    /// CPU threads, 1 to 1024 [default: one per core]
    #[arg(long, value_name = "N", value_parser = threads)]
    pub threads: Option<NonZeroUsize>,
    /// Memory for the detector without the answer, such as 512M [default: no limit]
    #[arg(long, value_name = "BYTES", value_parser = bytes)]
    pub memory_budget: Option<u64>,
    /// Run tiles again that already have a result for this query
    #[arg(long)]
    pub again: bool,
    /// Print one line of JSON per tile and nothing else
    #[arg(long)]
    pub json: bool,
    /// Show no progress bar
    #[arg(long)]
    pub no_progress: bool,
}

#[derive(Debug, Args)]
pub struct MergeArgs {
    /// The folder of the plan
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// Print JSON and nothing else
    #[arg(long)]
    pub json: bool,
}
