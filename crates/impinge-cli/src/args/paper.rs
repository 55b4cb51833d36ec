//! `impinge bench paper`: what may be said.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};
use impinge_paper::{Backends, SceneName, Waving};

use crate::values::{BenchmarkMesh, benchmark, lambda};

const PAPER_EXAMPLES: &str = "\
Examples:
  impinge bench paper --out out/paper
  impinge bench paper --quick
  impinge bench paper --scene bunny --backend cpu
  impinge bench paper --scene dragon --mesh my_dragon.ply
  impinge bench paper --mesh bunny=my_bunny.ply --mesh bunny-7k=my_bunny.msh

Scans are looked for in ../shared/data beside the repository, or $IMPINGE_DATA. Where there is neither
a scan nor --mesh, generated meshes of the same size stand in, and the report says so.
The full run takes about a quarter of an hour on two cores.";

#[derive(Debug, Args)]
pub struct BenchArgs {
    #[command(subcommand)]
    pub command: BenchCommand,
}

/// What may be measured.
#[derive(Debug, Subcommand)]
pub enum BenchCommand {
    /// Everything that the paper on two-level spatial hashing shows, its numbers beside ours
    #[command(after_help = PAPER_EXAMPLES)]
    Paper(PaperArgs),
}

#[derive(Debug, Args)]
pub struct PaperArgs {
    /// The folder for the report: report.md, report.html, report.json and figures
    #[arg(long, value_name = "FOLDER", default_value = "out/paper")]
    pub out: PathBuf,
    /// A benchmark to run: ball, bunny, buddha, dragon (surfaces), bunny-7k, bunny-19k, dragon-8k, dragon-15k (solids) [default: all]
    #[arg(long = "scene", value_name = "NAME", value_parser = benchmark)]
    pub scenes: Vec<SceneName>,
    /// A mesh for a benchmark, in place of what is at hand; with one --scene its name may be left out
    #[arg(long = "mesh", value_name = "[NAME=]FILE")]
    pub meshes: Vec<BenchmarkMesh>,
    /// A few frames of everything in less than two minutes: to see that all agree, not how fast
    #[arg(long)]
    pub quick: bool,
    /// Frames of each surface benchmark and steps of each solid one [default: 100 and 240]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub frames: Option<u32>,
    /// λ of the grid to report beside the paper's 1 [default: what measures best]
    #[arg(long, value_name = "X", value_parser = lambda)]
    pub lambda: Option<f64>,
    /// CPU threads [default: one a core]
    #[arg(long, value_name = "N")]
    pub threads: Option<NonZeroUsize>,
    /// Where to measure [default: cpu, and gpu where an adapter is found]
    #[arg(long, value_enum)]
    pub backend: Option<PaperBackendArg>,
    /// A part of the GPU's name, to choose among several (`impinge devices` lists them)
    #[arg(long, value_name = "NAME")]
    pub device: Option<String>,
    /// How far waves move a vertex to either side, in box diagonals of a body
    #[arg(long, value_name = "X", default_value_t = Waving::default().amplitude)]
    pub amplitude: f32,
    /// From crest to crest, in box diagonals
    #[arg(long, value_name = "X", default_value_t = Waving::default().wave_length)]
    pub wave_length: f32,
    /// How far crests travel in the whole run, in box diagonals
    #[arg(long, value_name = "X", default_value_t = Waving::default().speed)]
    pub wave_speed: f32,
    /// Show no progress bar
    #[arg(long)]
    pub no_progress: bool,
}

/// Where `bench paper` measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum PaperBackendArg {
    /// The CPU
    Cpu,
    /// A GPU, or an error where there is none
    Gpu,
    /// Both
    Both,
}

impl From<PaperBackendArg> for Backends {
    fn from(backend: PaperBackendArg) -> Self {
        match backend {
            PaperBackendArg::Cpu => Backends::Cpu,
            PaperBackendArg::Gpu => Backends::Gpu,
            PaperBackendArg::Both => Backends::Both,
        }
    }
}
