//! The options of the program.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::str::FromStr;

use clap::{Parser, ValueEnum};
use impinge_paper::{Backends, Error, Options, SceneName, Waving};

const EXAMPLES: &str = "\
Examples:
  impinge-paper --out out/paper
  impinge-paper --quick
  impinge-paper --scene bunny --backend cpu
  impinge-paper --scene dragon --mesh my_dragon.ply
  impinge-paper --mesh bunny=my_bunny.ply --mesh bunny-7k=my_bunny.msh

Scans are read from ../shared/data beside the repository, or from $IMPINGE_DATA. Without a scan or --mesh,
a generated mesh of the same size stands in, and the report says so.
The full run takes about a quarter of an hour on two cores.";

/// Repeat the measurements of the paper on two-level spatial hashing; the report has its numbers
/// beside ours.
#[derive(Debug, Parser)]
#[command(name = "impinge-paper", after_help = EXAMPLES)]
pub struct Args {
    /// The folder for the report: report.md, report.json and figures
    #[arg(long, value_name = "FOLDER", default_value = "out/paper")]
    pub out: PathBuf,
    /// A benchmark to run: ball, bunny, buddha, dragon (surfaces), bunny-7k, bunny-19k, dragon-8k,
    /// dragon-15k (solids) [default: all]
    #[arg(long = "scene", value_name = "NAME", value_parser = benchmark)]
    scenes: Vec<SceneName>,
    /// A mesh for a benchmark, instead of the scan; with one --scene the name may be omitted
    #[arg(long = "mesh", value_name = "[NAME=]FILE")]
    meshes: Vec<BenchmarkMesh>,
    /// A few frames of everything in less than two minutes: checks that all agree; times are not
    /// meaningful
    #[arg(long)]
    quick: bool,
    /// Frames of each surface benchmark and steps of each solid one [default: 100 and 240]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    frames: Option<u32>,
    /// λ of the grid to report beside the paper's 1 [default: the fastest]
    #[arg(long, value_name = "X", value_parser = lambda)]
    lambda: Option<f64>,
    /// CPU threads [default: one per core]
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroUsize>,
    /// Where to measure [default: cpu, and gpu if an adapter is found]
    #[arg(long, value_enum)]
    backend: Option<BackendArg>,
    /// A part of the GPU's name, to choose among several (`impinge devices` lists them)
    #[arg(long, value_name = "NAME")]
    device: Option<String>,
    /// How far waves move a vertex to either side, in box diagonals of a body
    #[arg(long, value_name = "X", default_value_t = Waving::default().amplitude)]
    amplitude: f32,
    /// Distance from crest to crest, in box diagonals
    #[arg(long, value_name = "X", default_value_t = Waving::default().wave_length)]
    wave_length: f32,
    /// How far crests travel in the whole run, in box diagonals
    #[arg(long, value_name = "X", default_value_t = Waving::default().speed)]
    wave_speed: f32,
    /// Show no progress bar
    #[arg(long)]
    pub no_progress: bool,
}

impl TryFrom<&Args> for Options {
    type Error = Error;

    fn try_from(args: &Args) -> Result<Self, Error> {
        let named = |mesh: &BenchmarkMesh| match (mesh.scene, &args.scenes[..]) {
            (Some(scene), _) | (None, &[scene]) => Ok((scene, mesh.path.clone())),
            _ => Err(Error::Options(format!(
                "--mesh {}: for which benchmark? Use --mesh NAME=FILE, or name one --scene",
                mesh.path.display()
            ))),
        };
        Ok(Options {
            scenes: args.scenes.clone(),
            meshes: args.meshes.iter().map(named).collect::<Result<_, _>>()?,
            is_quick: args.quick,
            n_frames: args.frames.map(|n| n as usize),
            lambda: args.lambda,
            n_threads: args.threads.map_or(0, Into::into),
            backends: args.backend.map_or(Backends::Found, Into::into),
            device: args.device.clone(),
            waving: Waving {
                amplitude: args.amplitude,
                wave_length: args.wave_length,
                speed: args.wave_speed,
            },
        })
    }
}

/// Where to measure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum BackendArg {
    /// The CPU
    Cpu,
    /// A GPU, or an error if there is none
    Gpu,
    /// Both
    Both,
}

impl From<BackendArg> for Backends {
    fn from(backend: BackendArg) -> Self {
        match backend {
            BackendArg::Cpu => Backends::Cpu,
            BackendArg::Gpu => Backends::Gpu,
            BackendArg::Both => Backends::Both,
        }
    }
}

/// A number above 0.
fn lambda(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("expected a number above 0".to_owned()),
    }
}

/// A benchmark of the paper by its name.
fn benchmark(text: &str) -> Result<SceneName, String> {
    SceneName::named(text).ok_or_else(|| {
        let names: Vec<&str> = SceneName::ALL.map(SceneName::name).into();
        format!("expected one of {}", names.join(", "))
    })
}

/// A mesh file and its benchmark.
#[derive(Debug, Clone, PartialEq, Eq)]
struct BenchmarkMesh {
    scene: Option<SceneName>,
    path: PathBuf,
}

impl FromStr for BenchmarkMesh {
    type Err = String;

    /// The text before the first `=` is a name only if it is the name of a benchmark.
    fn from_str(text: &str) -> Result<Self, String> {
        let named = text
            .split_once('=')
            .and_then(|(name, path)| Some((SceneName::named(name)?, path)));
        Ok(match named {
            Some((scene, path)) => BenchmarkMesh {
                scene: Some(scene),
                path: path.into(),
            },
            None => BenchmarkMesh {
                scene: None,
                path: text.into(),
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn meshes_may_name_their_benchmark() {
        let parsed = |text: &str| {
            let mesh: BenchmarkMesh = text.parse().unwrap();
            (mesh.scene, mesh.path.display().to_string())
        };
        let bunny = Some(SceneName::Bunny);
        assert_eq!(parsed("bunny=a=b.ply"), (bunny, "a=b.ply".to_owned()));
        assert_eq!(parsed("a=b.ply"), (None, "a=b.ply".to_owned()));
        assert_eq!(benchmark("dragon-8k"), Ok(SceneName::Dragon8k));
        assert!(benchmark("dragon-9k").unwrap_err().contains("dragon-8k"));
    }
}
