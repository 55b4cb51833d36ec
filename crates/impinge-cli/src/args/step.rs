//! The command line of `impinge step` and of `impinge sequence --ccd`.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use clap::Args;
use impinge::{PairKind, Precision, Query, Start};

use super::{
    DetectorArgs, ExcludeArgs, RestArgs, RowsArgs, ShownArgs, ThicknessArgs, kind, precision, start,
};
use crate::asked::Question;
use crate::detection::of_kinds;
use crate::values::{ReachedFile, at_least_one, distance, two_bodies};

pub const STEP_EXAMPLES: &str = "\
Examples:
  impinge step cloth_0.ply cloth_1.ply                may the cloth move from one pose to the other?
  impinge step a_0.obj a_1.obj b_0.obj b_1.obj        two bodies, each at the start and at the end
  impinge step cloth_0.ply cloth_1.ply --earliest     only the first contact, which is faster
  impinge step cloth_0.ply cloth_1.ply --fail-on-hit  the same as a check: exit code 3 if anything touches
  impinge step cloth_0.ply cloth_1.ply --clearance 1e-4 --earliest
                                                      how far a solver can go that needs some distance
  impinge step a_0.obj a_1.obj b_0.obj b_1.obj --clearance 1e-4 --advance a.obj b.obj
                                                      go as far as it is free: each body there
  impinge step cloth_0.ply cloth_1.ply --truncate cloth.ply
                                                      go on where it is free: each vertex stops for itself
  impinge step cloth_0.ply cloth_1.ply --rows impacts.csv --out impacts.glb
  impinge step cloth_0.ply cloth_1.ply --candidates boxes.npy --inflation 0.001

Every vertex moves on a straight line from time 0 to time 1. The two files of a body must have the same elements.
Times are exact first times, rounded down: nothing touches earlier.";

#[derive(Debug, Args)]
pub struct StepArgs {
    /// Mesh files in pairs: a body at the start of the step, and the same body at its end
    #[arg(value_names = ["START", "END"], required = true, num_args = 2..)]
    pub meshes: Vec<PathBuf>,
    /// Find only the first contact
    #[arg(long, conflicts_with_all = ["rows", "out", "candidates", "png"])]
    pub earliest: bool,
    /// Find how far the step can be taken, and write each body there: one file per body, in their
    /// order (.ply or .obj)
    #[arg(long, value_name = "OUT", num_args = 1.., conflicts_with_all = ["earliest", "rows", "out", "candidates", "png", "repeat"])]
    pub advance: Vec<ReachedFile>,
    /// Find how far each vertex can go for itself, and write each body there: one file per body, in
    /// their order (.ply or .obj)
    #[arg(long, value_name = "OUT", num_args = 1.., conflicts_with_all = ["advance", "earliest", "rows", "out", "candidates", "png", "repeat"])]
    pub truncate: Vec<ReachedFile>,
    /// Leave out the pairs within each body
    #[arg(long)]
    pub no_self: bool,
    /// Find only the pairs of bodies A and B, numbered from 0 as given
    #[arg(long, value_name = "A,B", value_parser = two_bodies, conflicts_with_all = ["no_self", "exclude"])]
    pub between: Option<(usize, usize)>,
    #[command(flatten)]
    pub how: StepHow,
    /// Weld vertices that are at the same position both at the start and at the end, within each
    /// body; this is the default
    #[arg(long, overrides_with = "no_weld")]
    pub weld: bool,
    /// Do not weld such vertices, except in STL files, where triangles share nothing else
    #[arg(long, overrides_with = "weld")]
    pub no_weld: bool,
    #[command(flatten)]
    pub exclude: ExcludeArgs,
    #[command(flatten)]
    pub rest: RestArgs,
    /// End with exit code 3 unless the step is free (4 if the start intersects, with or without
    /// this option)
    #[arg(long, conflicts_with = "candidates")]
    pub fail_on_hit: bool,
    /// Print JSON and nothing else (see docs/cli.md)
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub rows: RowsArgs,
    /// Write the pairs whose boxes over the whole step overlap (.csv, .jsonl, .npy or .parquet; "-"
    /// is standard output, as CSV), and find no impacts
    #[arg(long, value_name = "FILE", group = "rows_file", conflicts_with_all = ["out", "repeat", "separation", "clearance", "png"])]
    pub candidates: Option<PathBuf>,
    /// How far the boxes of --candidates are inflated on all sides, a length
    #[arg(long, value_name = "R", default_value = "0", requires = "candidates", allow_negative_numbers = true, value_parser = distance)]
    pub inflation: f64,
    /// Ask N times, rewriting positions at both ends before each, and show median times
    #[arg(long, value_name = "N", default_value = "1", value_parser = at_least_one::<NonZeroUsize>)]
    pub repeat: NonZeroUsize,
    #[command(flatten)]
    pub shown: ShownArgs,
    #[command(flatten)]
    pub detector: DetectorArgs,
}

impl StepHow {
    /// The query with these options.
    pub fn of(&self, query: Query) -> Query {
        of_kinds(query, &self.kinds)
            .start(self.start)
            .precision(self.precision)
            .separation(self.separation)
            .clearance(self.clearance)
    }

    /// What is asked of a step.
    pub fn question(&self) -> Question {
        Question::Step {
            start: self.start == Start::Verify,
        }
    }
}

impl StepArgs {
    /// The output files without the rows, each with its option.
    pub fn outputs(&self) -> Vec<(&'static str, &Path)> {
        let (option, reached) = self.reached();
        let reached = reached.iter().map(|file| (option, file.path.as_path()));
        self.shown.outputs().chain(reached).collect()
    }

    /// The files for the bodies where the step ends, and the option that names them.
    pub fn reached(&self) -> (&'static str, &[ReachedFile]) {
        match self.advance.is_empty() {
            true => ("--truncate", &self.truncate),
            false => ("--advance", &self.advance),
        }
    }
}

/// Options of reporting impacts.
#[derive(Debug, Clone, Args)]
pub struct StepHow {
    /// Which pairs: vertex-face, edge-edge, edge-vertex, vertex-vertex; of --candidates also
    /// edge-face, face-face [default: vf,ee]
    #[arg(long, value_parser = kind(), value_name = "KIND", value_delimiter = ',')]
    pub kinds: Vec<PairKind>,
    /// The precision to which times are rounded down
    #[arg(long, value_parser = precision(), value_name = "P", default_value_t = Precision::F32, alias = "toi")]
    pub precision: Precision,
    /// Pairs that touch at the start: reported with the time 0, or ignored; and whether the start
    /// is asked for intersections
    #[arg(long, value_parser = start(), value_name = "RULE", default_value_t = Start::Verify)]
    pub start: Start,
    /// The distance that elements must keep: report the first time at which they are as near as
    /// that; with a thickness the sum of both is rounded up
    #[arg(long, value_name = "D", default_value = "0", allow_negative_numbers = true, value_parser = distance)]
    pub separation: f64,
    /// What the step leaves: every pair keeps C, but of pairs that are near at the start a fifth of
    /// their distance, rounded up to 24 bits; report the first time at which one is as near as that
    #[arg(long, value_name = "C", default_value = "0", allow_negative_numbers = true, value_parser = distance)]
    pub clearance: f64,
    #[command(flatten)]
    pub thickness: ThicknessArgs,
}
