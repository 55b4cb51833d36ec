//! The command line and its help.

mod choices;
mod help;
mod near;
mod picture;
mod probe;
mod rows;
mod safe;
mod step;
#[cfg(feature = "view")]
mod view;

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use clap::{Args, Parser, Subcommand};
use impinge::{Backend, Detector, Method, Query, Scene, SharedVertex};

use crate::commands::{
    CHECK_EXAMPLES, CheckArgs, CheckWorkerArgs, FIX_EXAMPLES, FixArgs, TILES_EXAMPLES, TilesArgs,
};
use crate::error::Error;
use crate::values::PngFile;
use crate::values::{
    CurvesFile, FrameRange, FramesFile, MeshFile, RowsFile, at_least_one, body_length,
    body_numbers, bytes, distance, lambda, mesh_format, threads, two_bodies,
};

pub use choices::{
    BodiesArg, backend, hits, kind, method, precision, repair, shared_vertex, start, start_of_tiles,
};
pub use help::parse;
pub use near::NearArgs;
pub use picture::{PictureArgs, ShownArgs};
pub use probe::{CastArgs, OneMeshArgs, ProbeArgs};
pub use rows::RowsArgs;
pub use safe::SafeArgs;
pub use step::{StepArgs, StepHow};
#[cfg(feature = "view")]
pub use view::ViewArgs;

/// Exact collision detection for deforming meshes of triangles and tetrahedra.
#[derive(Debug, Parser)]
#[command(name = "impinge", version, propagate_version = true, after_help = EXAMPLES)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,
}

const EXAMPLES: &str = "\
Examples:
  impinge demo                                  a built-in scene: no files needed
  impinge pairs a.obj b.obj                     which elements of two meshes intersect
  impinge self cloth.ply                        where a mesh intersects itself
  impinge self part.stl --fail-on-hit           the same as a check: exit code 3 if it does
  impinge pairs a.obj b.obj --rows -            the pairs themselves, as CSV
  impinge near a.obj b.obj --distance 0.01      which elements are nearer than that
  impinge safe a.obj b.obj --most 0.01          how far each vertex may move
  impinge probe a.obj --points p.csv --signed   how far are points, and are they inside
  impinge cast a.obj --rays rays.csv            what rays hit
  impinge check parts/*.stl                     what is wrong with each mesh
  impinge fix part.stl --out mended.ply         mend what can be mended without moving a vertex
  impinge sequence body.ply run.pc2 --self      the pairs of every frame of an animation
  impinge step cloth_0.ply cloth_1.ply          does anything touch on the way, and when first

Exit codes: 0 done, 2 bad usage, 3 pairs or contacts were found and --fail-on-hit was given,
4 the start of a step already intersects, 130 stopped by Ctrl-C (128 and the signal's number), 1 any other error
(one line on stderr).
`impinge COMMAND --help` lists the options of a command, `impinge help COMMAND` also explains their values.
`impinge help detection`, `help rows` and `help picture` explain the options that many commands share.";

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run a built-in scene of deforming bodies and show its pairs and times
    #[command(after_help = DEMO_EXAMPLES)]
    Demo(DemoArgs),
    /// Find the pairs of elements that intersect, between different meshes
    // The library's word for this question.
    #[command(alias = "detect", after_help = PAIRS_EXAMPLES)]
    Pairs(PairsArgs),
    /// Find the pairs of elements that intersect, within each mesh
    #[command(name = "self", after_help = SELF_EXAMPLES)]
    Within(WithinArgs),
    /// Find the smallest distance between meshes, and where it is
    #[command(after_help = DISTANCE_EXAMPLES)]
    Distance(DistanceArgs),
    /// Find the elements that are within a distance of each other, and which of their features are
    /// nearest
    #[command(after_help = near::NEAR_EXAMPLES)]
    Near(NearArgs),
    /// Find how far each vertex may move, on any path, so that nothing touches
    #[command(
        after_help = safe::SAFE_EXAMPLES,
        mut_arg("rows", |rows| rows.help("Write a row per vertex (.csv, .jsonl, .npy or .parquet; \"-\" is standard output)"))
    )]
    Safe(SafeArgs),
    /// Find the elements of a mesh that are nearest to each of many points, which points are
    /// inside, and in which tetrahedra
    #[command(
        after_help = probe::PROBE_EXAMPLES,
        mut_arg("rows", |rows| rows.help("Write a row per element that is near enough (.csv, .jsonl, .npy or .parquet; \"-\" is standard output)"))
    )]
    Probe(ProbeArgs),
    /// Find what rays hit of a mesh
    #[command(
        after_help = probe::CAST_EXAMPLES,
        mut_arg("rows", |rows| rows.help("Write a row per hit (.csv, .jsonl, .npy or .parquet; \"-\" is standard output)"))
    )]
    Cast(CastArgs),
    /// Find the pairs in every frame of a deforming mesh
    #[command(
        after_help = SEQUENCE_EXAMPLES,
        mut_arg("precision", |precision| precision.requires("ccd")),
        mut_arg("kinds", |kinds| kinds.requires("ccd")),
        mut_arg("start", |start| start.requires("ccd")),
        mut_arg("separation", |separation| separation.requires("ccd")),
        mut_arg("clearance", |clearance| clearance.requires("ccd")),
        mut_arg("of_bodies", |thickness| thickness.requires("ccd"))
    )]
    Sequence(SequenceArgs),
    /// Find what touches while meshes move from one pose to another, and when first
    #[command(
        after_help = step::STEP_EXAMPLES,
        override_usage = "impinge step [OPTIONS] <START> <END> [<START> <END>]..."
    )]
    Step(StepArgs),
    /// Check meshes for self-intersections, degenerate faces, borders, …
    #[command(after_help = CHECK_EXAMPLES)]
    Check(CheckArgs),
    /// Mend a mesh without moving a vertex: weld, orient, split, close holes, …
    #[command(after_help = FIX_EXAMPLES)]
    Fix(FixArgs),
    /// Find the pairs of a scene that is larger than memory, tile by tile
    #[command(after_help = TILES_EXAMPLES)]
    Tiles(TilesArgs),
    /// Print one row for each path on standard input: a child process of `check`
    #[command(hide = true)]
    CheckWorker(CheckWorkerArgs),
    /// Draw meshes with colliding elements in red and blue
    #[command(after_help = RENDER_EXAMPLES)]
    Render(RenderArgs),
    /// Show meshes and what collides in them in a window, live; without a mesh, the built-in scene
    #[cfg(feature = "view")]
    #[command(after_help = view::VIEW_EXAMPLES)]
    View(ViewArgs),
    /// Show meshes and what collides in them in a window: not in this build, see --features view
    #[cfg(not(feature = "view"))]
    View(AbsentArgs),
    /// List GPUs and software drivers, for --device
    #[cfg(feature = "gpu")]
    Devices(DevicesArgs),
    /// List GPUs and software drivers: not in this build, see --features gpu
    #[cfg(not(feature = "gpu"))]
    Devices(AbsentArgs),
}

/// Arguments of a command that this build has not: any.
#[cfg(not(feature = "view"))]
#[derive(Debug, Clone, Args)]
#[command(disable_help_flag = true)]
pub struct AbsentArgs {
    #[arg(hide = true, trailing_var_arg = true, allow_hyphen_values = true)]
    _any: Vec<std::ffi::OsString>,
}

/// Arguments of `impinge devices`.
#[cfg(feature = "gpu")]
#[derive(Debug, Clone, Args)]
pub struct DevicesArgs {
    /// Print JSON and nothing else
    #[arg(long)]
    pub json: bool,
}

const RENDER_EXAMPLES: &str = "\
Examples:
  impinge render a.obj b.obj --png out.png
  impinge render a.ply b.msh --png out.png --size 1920x1080 --azimuth -60 --up z
  impinge render cow.off --png cow.png --see-through 1
  impinge pairs a.ply b.ply --png out.png           the answer and a picture";

const DEMO_EXAMPLES: &str = "\
Examples:
  impinge demo
  impinge demo --triangles 1000000 --frames 100
  impinge demo --threads 1 --out frame.ply

The written mesh and the picture show the frame with the most pairs. Colliding triangles have one colour per body.";

const PAIRS_EXAMPLES: &str = "\
Examples:
  impinge pairs a.obj b.obj
  impinge pairs a.stl b.ply c.msh --self --rows pairs.npy
  impinge pairs a.ply b.ply --rows -
  impinge pairs a.ply b.ply --json | jq .pairs
  impinge pairs a.ply b.ply --any --fail-on-hit
  impinge pairs a.ply b.ply --repeat 100 --threads 2
  impinge pairs a.ply b.ply c.ply --exclude 0,1 --out seen.glb
  impinge pairs a.ply b.ply c.ply --between 0,2
  impinge pairs a.ply b.ply --curves curves.obj --contacts contacts.csv
  impinge pairs a.ply b.ply --regions regions.csv   how deep, and the volume in common
  impinge pairs machine.glb                     the nodes of one file with each other
  impinge pairs a.glb b.obj --bodies nodes      each node of a.glb, and all of b.obj";

const DISTANCE_EXAMPLES: &str = "\
Examples:
  impinge distance a.obj b.ply
  impinge distance a.obj b.ply --json
  impinge distance a.obj b.ply --below 0.5      a check: exit code 3 if it is less
  impinge distance robot.glb --exclude 0,1      the two nearest of its nodes, but not 0 and 1

Of more than two bodies, those that are nearest to each other are told.
The distance is rounded down, and 0 if and only if the meshes touch, which is decided exactly, or are
nearer than the smallest 64-bit float. Meshes of triangles are surfaces: a mesh that lies completely
inside another one has a distance from it.";

const SELF_EXAMPLES: &str = "\
Examples:
  impinge self cow.off
  impinge self cow.off --rows pairs.csv --out seen.ply
  impinge self part.stl --fail-on-hit
  cat cow.off | impinge self - --format off --rows - --rows-format jsonl
  impinge self cow.off --no-weld --shared-vertex skip

Many files repeat a vertex for each face that uses it, so vertices at the same position are welded into one.
Neighbours (elements that share vertices) are reported only if they also meet elsewhere, as folded faces
do. --no-weld turns welding off; with --shared-vertex skip neighbours are never reported.";

const SEQUENCE_EXAMPLES: &str = "\
Examples:
  impinge sequence body.ply run.pc2
  impinge sequence body.ply run.pc2 --other floor.obj --self
  impinge sequence body.ply run.pc2 --moving hair.ply hair.pc2 --ccd
  impinge sequence body.obj frames_0001.obj --frames 10..20 --json
  impinge sequence body.obj 'frames_%04d.obj' --json | head
  impinge sequence body.ply run.pc2 --rows pairs.csv --out seen_%04d.ply
  impinge sequence body.ply run.pc2 --ccd       one line per step from a frame to the next

FRAMES is a .pc2 or .mdd file, the first of numbered mesh files, or a pattern of their names.
Without --other and --moving, the pairs within the body are found; with them, those between bodies, and with --self
both. The last line says which.";

/// Options of the detector.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Detection")]
pub struct DetectorArgs {
    /// The method that finds candidates; all methods give the same pairs
    #[arg(long, value_parser = method(), default_value_t = Method::Auto)]
    pub method: Method,
    /// Where detection runs
    #[arg(long, value_parser = backend(), default_value_t = Backend::Auto)]
    pub backend: Backend,
    /// A part of the GPU's name, to choose among several (`impinge devices` lists them)
    #[arg(long, value_name = "NAME")]
    pub device: Option<String>,
    /// CPU threads, 1 to 1024 [default: one per core]
    #[arg(long, value_name = "N", value_parser = threads)]
    pub threads: Option<NonZeroUsize>,
    /// Density coefficient of the grid of `--method cells`
    #[arg(long, value_name = "X", value_parser = lambda, default_value = "1")]
    pub lambda: f64,
    /// The most elements in a group of `--method cells`, 1 to 64
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=64), default_value = "64")]
    pub group_size: u32,
    /// Memory for the detector and the answer, such as 512M or 2GiB [default: no limit]
    #[arg(long, value_name = "BYTES", value_parser = bytes)]
    pub memory_budget: Option<u64>,
    /// End with an error as soon as more than N pairs are certain [default: any number]
    #[arg(long, value_name = "N")]
    pub max_pairs: Option<u64>,
    /// Show no progress bar
    #[arg(long)]
    pub no_progress: bool,
}

/// Options of reading meshes.
#[derive(Debug, Clone, Args)]
pub struct ReadArgs {
    /// Weld vertices at the same position, within each file; this is the default
    #[arg(long, overrides_with = "no_weld")]
    weld: bool,
    /// Do not weld vertices at the same position, except in STL files, where triangles share
    /// nothing else
    #[arg(long, overrides_with = "weld")]
    no_weld: bool,
    /// The format of a mesh on standard input, which is named "-": ply, off, stl, …
    #[arg(long, value_name = "EXT", value_parser = mesh_format)]
    pub format: Option<impinge_io::Format>,
    /// What becomes a body of its own [default: file; `pairs` of one file: nodes or groups]
    #[arg(long, value_enum, value_name = "WHAT")]
    pub bodies: Option<BodiesArg>,
}

impl ReadArgs {
    /// Whether to weld, if the options say so.
    pub fn weld(&self) -> Option<bool> {
        match (self.weld, self.no_weld) {
            (true, _) => Some(true),
            (_, true) => Some(false),
            _ => None,
        }
    }
}

/// Options of reading meshes and of the query.
#[derive(Debug, Clone, Args)]
pub struct AskArgs {
    /// Which neighbours are reported: pairs of elements of one body that share a vertex
    #[arg(long, value_parser = shared_vertex(), value_name = "RULE", default_value_t = SharedVertex::Resolve)]
    pub shared_vertex: SharedVertex,
    #[command(flatten)]
    pub read: ReadArgs,
    #[command(flatten)]
    pub exclude: ExcludeArgs,
    /// End with exit code 3 if anything is found
    #[arg(long)]
    pub fail_on_hit: bool,
    /// Also print the time of each stage, and where all pairs are found the bodies, counters and
    /// the hash
    #[arg(short, long)]
    pub verbose: bool,
    /// Print JSON and nothing else (see docs/cli.md)
    #[arg(long)]
    pub json: bool,
}

/// Pairs that are left out.
#[derive(Debug, Clone, Args)]
pub struct ExcludeArgs {
    /// Leave out the pairs of bodies A and B, numbered from 0 as given (A,A: the self-collision of
    /// A)
    #[arg(id = "exclude", long = "exclude", value_name = "A,B", value_parser = body_numbers, alias = "ignore")]
    pub bodies: Vec<(usize, usize)>,
    /// Leave out pairs of one body that are near each other in its surface: some vertices of the
    /// two are at most N edges apart, 0 to 16. Nothing is proven of them: they may pass through each
    /// other
    #[arg(id = "exclude_rings", long = "exclude-rings", value_name = "N", value_parser = clap::value_parser!(u32).range(..=16))]
    pub rings: Option<u32>,
}

/// Pairs that are left out because they are near at rest.
#[derive(Debug, Clone, Default, Args)]
pub struct RestArgs {
    /// Leave out pairs that are at most R apart, a length, besides their thickness, before anything
    /// moves: at the start of a step, in the mesh of a sequence. Nothing is proven of them: they may
    /// pass through each other
    #[arg(id = "exclude_rest", long = "exclude-rest", value_name = "R", value_parser = distance, allow_negative_numbers = true)]
    pub distance: Option<f64>,
}

impl RestArgs {
    /// The query without the pairs of its kinds that are near in a scene.
    pub fn leave_out(
        &self,
        query: Query,
        detector: &mut Detector,
        scene: &Scene,
    ) -> Result<Query, Error> {
        let Some(distance) = self.distance else {
            return Ok(query);
        };
        let near = detector.near(scene, distance, &query)?;
        Ok(query.exclude(&near))
    }
}

/// How thick bodies are.
#[derive(Debug, Clone, Default, Args)]
pub struct ThicknessArgs {
    /// The thickness T of body N, a length that adds to what its pairs are asked for or keep, and is
    /// taken from how far its vertices may move (twice within it) [default: 0]
    #[arg(long = "thickness", value_name = "N,T", value_parser = body_length)]
    pub of_bodies: Vec<(usize, f64)>,
}

/// Outputs of the answer for one set of meshes.
#[derive(Debug, Clone, Args)]
pub struct AnswerArgs {
    /// Only count the pairs: none of them is held, so there may be more than memory has room for
    #[arg(long, conflicts_with = "any")]
    pub count: bool,
    /// Only say whether there is any pair, and stop at the first one
    #[arg(long)]
    pub any: bool,
    /// Run N frames, rewriting positions before each, and show median times; with N above 1, the
    /// method auto is clusters
    #[arg(long, value_name = "N", default_value = "1", value_parser = at_least_one::<NonZeroUsize>)]
    pub repeat: NonZeroUsize,
    #[command(flatten)]
    pub rows: RowsArgs,
    /// Write where the triangles of each pair meet, one row per corner (.csv, .jsonl, .npy or
    /// .parquet)
    #[arg(long, value_name = "FILE")]
    pub contacts: Option<RowsFile>,
    /// Write the curves in which surfaces cross (.ply, .obj or .vtu)
    #[arg(long, value_name = "FILE")]
    pub curves: Option<CurvesFile>,
    /// Write where surfaces overlap and how deep, one row per region (.csv, .jsonl, .npy or
    /// .parquet)
    #[arg(long, value_name = "FILE")]
    pub regions: Option<RowsFile>,
    #[command(flatten)]
    pub shown: ShownArgs,
}

impl AnswerArgs {
    /// The output files without the rows, each with its option.
    pub fn outputs(&self) -> Vec<(&'static str, &Path)> {
        let contacts = self.contacts.as_ref();
        let contacts = contacts.map(|file| ("--contacts", file.path.as_path()));
        let curves = self.curves.as_ref();
        let curves = curves.map(|file| ("--curves", file.path.as_path()));
        let regions = self.regions.as_ref();
        let regions = regions.map(|file| ("--regions", file.path.as_path()));
        let all = [contacts, curves, regions].into_iter().flatten();
        all.chain(self.shown.outputs()).collect()
    }
}

/// Arguments of `impinge render`.
#[derive(Debug, Args)]
pub struct RenderArgs {
    /// Mesh files, one per body
    #[arg(value_name = "MESH", required = true)]
    pub meshes: Vec<PathBuf>,
    /// The picture (.png)
    #[arg(long, value_name = "FILE", required = true)]
    pub png: PngFile,
    /// Also find the pairs within each body; implied for one mesh
    #[arg(long = "self")]
    pub within: bool,
    #[command(flatten)]
    pub ask: AskArgs,
    #[command(flatten)]
    pub picture: PictureArgs,
    #[command(flatten)]
    pub detector: DetectorArgs,
}

#[derive(Debug, Args)]
pub struct PairsArgs {
    /// Mesh files, one per body; of one file alone, the nodes (glTF) or groups (OBJ) are the bodies
    #[arg(value_name = "MESH", required = true)]
    pub meshes: Vec<PathBuf>,
    /// Also find the pairs within each body
    #[arg(long = "self")]
    pub within: bool,
    /// Find only the pairs of bodies A and B, numbered from 0 as given
    #[arg(long, value_name = "A,B", value_parser = two_bodies, conflicts_with_all = ["within", "exclude"])]
    pub between: Option<(usize, usize)>,
    #[command(flatten)]
    pub ask: AskArgs,
    #[command(flatten)]
    pub answer: AnswerArgs,
    #[command(flatten)]
    pub detector: DetectorArgs,
}

#[derive(Debug, Args)]
pub struct DistanceArgs {
    /// Mesh files, one per body; of one file, its nodes or groups are the bodies
    #[arg(value_name = "MESH", required = true)]
    pub meshes: Vec<PathBuf>,
    /// What becomes a body of its own [default: file; of one file: nodes or groups]
    #[arg(long, value_enum, value_name = "WHAT")]
    pub bodies: Option<BodiesArg>,
    /// The format of a mesh on standard input, which is named "-": ply, off, stl, …
    #[arg(long, value_name = "EXT", value_parser = mesh_format)]
    pub format: Option<impinge_io::Format>,
    /// Leave out the pair of bodies A and B, numbered from 0 as given, such as neighbours in a
    /// joint
    #[arg(long, value_name = "A,B", value_parser = two_bodies)]
    pub exclude: Vec<(usize, usize)>,
    /// End with exit code 3 if the distance is less than D, which is decided exactly
    #[arg(long, value_name = "D", allow_negative_numbers = true, value_parser = distance)]
    pub below: Option<f64>,
    /// CPU threads, 1 to 1024 [default: one per core]
    #[arg(long, value_name = "N", value_parser = threads)]
    pub threads: Option<NonZeroUsize>,
    /// Print JSON and nothing else
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct WithinArgs {
    /// Mesh files, one per body
    #[arg(value_name = "MESH", required = true)]
    pub meshes: Vec<PathBuf>,
    #[command(flatten)]
    pub ask: AskArgs,
    #[command(flatten)]
    pub answer: AnswerArgs,
    #[command(flatten)]
    pub detector: DetectorArgs,
}

#[derive(Debug, Args)]
pub struct SequenceArgs {
    /// The mesh that deforms: body 0
    #[arg(value_name = "MESH")]
    pub mesh: PathBuf,
    /// Its positions, frame by frame: a point cache, the first of numbered files, a pattern
    /// ('run_%04d.obj', 'run_*.obj'), or a file for each frame (run/*.obj)
    #[arg(value_name = "FRAMES", required = true)]
    pub sequence: Vec<PathBuf>,
    /// A mesh that does not move: body 1, 2, …
    #[arg(long = "other", value_name = "MESH")]
    pub others: Vec<PathBuf>,
    /// Another mesh that moves, and as many frames of it, which belong to those above one by one:
    /// a body after those of --other
    #[arg(long, num_args = 2, value_names = ["MESH", "FRAMES"])]
    pub moving: Vec<PathBuf>,
    /// Also find the pairs within each body; implied without --other and --moving
    #[arg(long = "self")]
    pub within: bool,
    /// Frames from A up to, but not including, B, counted from 0; either may be omitted
    #[arg(long, value_name = "A..B", default_value = "..")]
    pub frames: FrameRange,
    #[command(flatten)]
    pub rows: RowsArgs,
    /// Write the meshes of each frame with colliding elements coloured (seen_%04d.ply, .glb or
    /// .vtu)
    #[arg(long, value_name = "FILE")]
    pub out: Option<FramesFile<MeshFile>>,
    /// Draw each frame (seen_%04d.png)
    #[arg(long, value_name = "FILE")]
    pub png: Option<FramesFile<PngFile>>,
    /// Find what touches on the way from each frame to the next, and when first; vertices move on
    /// straight lines
    #[arg(long, conflicts_with_all = ["out", "png"])]
    pub ccd: bool,
    #[command(flatten)]
    pub step: StepHow,
    #[command(flatten)]
    pub ask: AskArgs,
    #[command(flatten)]
    pub rest: RestArgs,
    // These come last: their headings would hold for what follows.
    #[command(flatten)]
    pub picture: PictureArgs,
    #[command(flatten)]
    pub detector: DetectorArgs,
}

#[derive(Debug, Args)]
pub struct DemoArgs {
    /// The number of triangles in all bodies together
    #[arg(long, value_name = "N", default_value = "60000", value_parser = clap::value_parser!(u32).range(1_000..=100_000_000))]
    pub triangles: u32,
    /// Frames to run
    #[arg(long, value_name = "N", default_value = "300", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub frames: u32,
    /// Where to write the coloured mesh (.ply, .glb or .vtu)
    #[arg(long, value_name = "FILE", default_value = "out/demo.glb")]
    pub out: MeshFile,
    /// Where to draw the picture (.png) [default: beside the mesh]
    #[arg(long, value_name = "FILE")]
    pub png: Option<PngFile>,
    #[command(flatten)]
    pub detector: DetectorArgs,
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_command_line_is_consistent() {
        super::help::command().debug_assert();
    }
}
