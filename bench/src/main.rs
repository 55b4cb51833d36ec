//! Benchmarks of impinge. Peers run in the same process, on the same frames, and take turns.
//!
//! ```text
//! cargo run --release -p impinge-bench --features embree,parry -- two-body --scene dragon
//! ```
//!
//! Before each frame all positions are rewritten, off the clock, in the memory that each contestant
//! reads. A frame is timed from there to pairs in memory. Exact contestants must find the
//! expected number of pairs and the same pairs as each other; peers' counts are printed with their
//! difference. Peers run with the setting that is fastest on the problem, found before the
//! contest, and need not sort their answer.

mod c;
mod commands;
mod distance;
#[cfg(feature = "embree")]
mod embree;
mod files;
mod gpu;
mod measure;
mod near;
mod once;
mod ours;
#[cfg(feature = "parry")]
mod parry;
#[cfg_attr(not(any(feature = "embree", feature = "parry")), allow(dead_code))]
mod plain;
mod problem;
mod report;
mod resident;
mod runner;
mod solver_sizes;
mod step_sizes;
mod steps;
mod surfaces;
#[cfg_attr(not(any(feature = "embree", feature = "parry")), allow(dead_code))]
mod tune;

use std::path::PathBuf;
use std::process::ExitCode;

use impinge::{Affinity, Backend, InstructionSet, Method, Settings};

/// Anything that ends a run.
pub type Failure = Box<dyn std::error::Error + Send + Sync>;

const HELP: &str = "\
Benchmarks of impinge, peers measured in the same run.

usage: impinge-bench COMMAND [options]

commands:
  two-body      two copies of a mesh: --scene ball15k|ball|bunny|buddha|dragon, two parts of a machine: parts;
                or all but ball15k
  motion        the same, the second copy passing by at four speeds: --scene (default dragon)
  self          self-collision of one mesh: --scene ball|bunny|buddha|dragon|cow|camelhead
                (default dragon)
  tets          two solids of tetrahedra
  bodies        1,000, 10,000 and 100,000 bodies of 12 triangles
  sizes         10^4 to 10^7 triangles in two waving bodies
  adversarial   scenes that break methods which are only fast on average, as ratios to a plain one
  regular       self-collision of flat and regular surfaces, as ratios to a rough one
  steps         contacts of moving cloth: all, the earliest, any, how far a step can be taken, pairs of boxes;
                --scene cloth-ball|cloth-funnel
  step-sizes    the same questions about two layers of cloth of 10^3 to 10^6 faces: time and memory against size
  solver-sizes  safe distances, neighbours and truncation of these layers: time against size
  distance      the smallest distance of two bodies: --scene dragon|bunny
  near          elements within a distance, of a mesh with itself: --scene cloth-ball|rumba
  once          the first frame of a new detector, by each method: --scene ball|bunny|buddha|dragon
  gpu           the scenes of two-body and self on a GPU: stages on the device beside a lower bound
  resident      what stays on a GPU: pairs, steps, safe distances, beside the CPU
  device        prints the name of the GPU in a form for --record

options:
  --scene NAME       one scene only (two-body, motion, self, adversarial)
  --frames N         timed frames of each contestant (default 40; fewer for large scenes)
  --turn N           frames of one contestant in a row (default 10); with 1 all caches are cold
  --size N           adversarial, regular: elements (default 1,000,000 and 80,000); sizes, step-sizes, bodies:
                     the largest size
  --threads N        threads of impinge (default: all)
  --affinity NAME   where its helper threads run: auto (default), inherited; in a contest also both, which take turns
  --backend NAME     cpu (default), gpu or auto
  --device NAME      part of a GPU's name, to choose among several
  --instruction-set NAME  the widest that impinge may use on the CPU: portable, avx2 or avx512 (default)
  --no-cells         without impinge's other method, Cells
  --no-peers         without Embree and parry
  --c-library FILE   two-body: also through impinge.h, of this shared library (target/library/libimpinge_c.so)
  --json FILE        figures for machines
  --record NAME      also writes bench/record/NAME/COMMAND.md and .json; NAME is <machine>-<date>
  --help             this text

Embree needs --features embree, parry needs --features parry.";

/// The options of the command line.
#[derive(Debug, Clone)]
pub struct Options {
    scene: Option<String>,
    frames: Option<usize>,
    turn: usize,
    size: Option<usize>,
    threads: usize,
    /// At least one. The further ones are compared with the first.
    affinities: Vec<Affinity>,
    backend: Backend,
    device: Option<String>,
    instruction_set: InstructionSet,
    cells: bool,
    peers: bool,
    c_library: Option<PathBuf>,
    json: Option<PathBuf>,
    record: Option<String>,
}

impl Options {
    /// The settings that the options name.
    pub fn settings(&self, method: Method) -> Settings {
        Settings::new()
            .method(method)
            .backend(self.backend)
            .device(self.device.clone())
            .threads(self.threads)
            .affinity(self.affinities[0])
            .instruction_set(self.instruction_set)
    }
}

fn parse() -> Result<Option<(String, Options)>, lexopt::Error> {
    use lexopt::prelude::*;
    let mut options = Options {
        scene: None,
        frames: None,
        turn: 10,
        size: None,
        threads: 0,
        affinities: vec![Affinity::Auto],
        backend: Backend::Cpu,
        device: None,
        instruction_set: InstructionSet::default(),
        cells: true,
        peers: true,
        c_library: None,
        json: None,
        record: None,
    };
    let mut command = None;
    let mut parser = lexopt::Parser::from_env();
    while let Some(argument) = parser.next()? {
        match argument {
            Long("help") | Short('h') => return Ok(None),
            Long("scene") => options.scene = Some(parser.value()?.string()?),
            Long("frames") => options.frames = Some(parser.value()?.parse()?),
            Long("turn") => options.turn = parser.value()?.parse()?,
            Long("size") => options.size = Some(parser.value()?.parse()?),
            Long("threads") => options.threads = parser.value()?.parse()?,
            Long("affinity") => {
                options.affinities = parser.value()?.parse_with(|name| match name {
                    "auto" => Ok(vec![Affinity::Auto]),
                    "inherited" => Ok(vec![Affinity::Inherited]),
                    "both" => Ok(vec![Affinity::Auto, Affinity::Inherited]),
                    _ => Err("auto, inherited or both"),
                })?;
            }
            Long("backend") => {
                options.backend = parser.value()?.parse_with(|name| match name {
                    "cpu" => Ok(Backend::Cpu),
                    "gpu" => Ok(Backend::Gpu),
                    "auto" => Ok(Backend::Auto),
                    _ => Err("cpu, gpu or auto"),
                })?;
            }
            Long("device") => options.device = Some(parser.value()?.string()?),
            Long("instruction-set") => options.instruction_set = parser.value()?.parse()?,
            Long("no-cells") => options.cells = false,
            Long("no-peers") => options.peers = false,
            Long("c-library") => options.c_library = Some(parser.value()?.into()),
            Long("json") => options.json = Some(parser.value()?.into()),
            Long("record") => options.record = Some(parser.value()?.string()?),
            Value(name) if command.is_none() => command = Some(name.string()?),
            other => return Err(other.unexpected()),
        }
    }
    Ok(command.map(|command| (command, options)))
}

fn main() -> ExitCode {
    match parse() {
        Ok(None) => {
            println!("{HELP}");
            ExitCode::SUCCESS
        }
        Ok(Some((command, options))) => match commands::run(&command, &options) {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => {
                eprintln!("impinge-bench: {error}");
                ExitCode::FAILURE
            }
        },
        Err(error) => {
            eprintln!("impinge-bench: {error}; --help lists what there is");
            ExitCode::from(2)
        }
    }
}
