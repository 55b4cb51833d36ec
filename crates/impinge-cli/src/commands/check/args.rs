//! The command line of `impinge check`.

use std::ffi::OsStr;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use clap::builder::{
    EnumValueParser, PossibleValue, TypedValueParser, ValueParser, ValueParserFactory,
};
use clap::error::ErrorKind;
use clap::{Arg, Args, Command, ValueEnum};
use impinge_check::Finding;

use crate::args::PictureArgs;
use crate::values::{HtmlFile, MeshFile, OfPath, PngFile, RowsFile, bytes, mesh_format, of_path};

/// Shown below the help.
pub const CHECK_EXAMPLES: &str = "\
Examples:
  impinge check part.stl
  impinge check *.obj --json | jq 'select(.self_intersections > 0) | .path'
  impinge check part.ply --fail-on self-intersections,boundary       exit code 3 in CI
  impinge check parts/*.stl --format sarif > meshes.sarif            for code scanning; also junit, github
  impinge check parts/*.stl --html report.html                       a page with pictures of what is wrong
  impinge check --list meshes.txt --rows meshes.parquet              a table for pandas, DuckDB, Excel
  impinge check part.stl --min-thickness 0.8 --fail-on thin           walls at most 0.8 thick
  impinge check --assembly robot.glb --touching ignore               which parts share space
  impinge check a.stl b.stl --clearance 0.2 --fail-on any            … or are nearer than that
  impinge check part.ply --out wrong.glb                             what is wrong, in colours
  impinge check --list meshes.txt --out rows --timeout 60 --memory 4G
  impinge check --list meshes.txt --out rows --rank $SLURM_ARRAY_TASK_ID --world-size 64

Every count is exact. Vertices at the same position are welded first, unless --no-weld is given.
Self-intersections are pairs that also meet outside their common vertices, edge or face;
degenerate faces have exactly zero area. For tetrahedra, faces are counted instead of edges.

Each mesh is checked in a child process. A mesh that can't be read, takes too long or runs out
of memory gets a row with its `error`, and the run continues. The exit code is 3 if a mesh has a
problem that --fail-on names, else 1 if a mesh could not be checked, else 0. Run the same command
again to continue an interrupted run in --out.";

#[derive(Debug, Args)]
pub struct CheckArgs {
    /// Mesh files; standard input is not read
    #[arg(value_name = "MESH", required_unless_present = "list")]
    pub meshes: Vec<PathBuf>,
    /// A file with one path per line (- for standard input); empty lines and lines that start with
    /// # are ignored
    #[arg(long, value_name = "FILE")]
    pub list: Option<PathBuf>,
    /// Print one line of JSON per mesh and nothing else
    #[arg(long)]
    pub json: bool,
    /// What is printed
    #[arg(long, value_parser = PrintedFormat, value_name = "FORMAT", conflicts_with = "json", default_value = "text")]
    pub format: Format,
    /// A folder for rows, in which an interrupted run can continue; or a mesh file that shows the
    /// problems (.glb, .ply, .vtu)
    #[arg(long, value_name = "DIR|MESH")]
    pub out: Option<Out>,
    /// Exit with code 3 if any mesh has one of these problems (comma-separated); a mesh that could
    /// not be checked always fails
    #[arg(long, value_name = "WHAT", value_enum, value_delimiter = ',')]
    pub fail_on: Vec<FailOn>,
    /// Do not weld vertices at the same position
    #[arg(long)]
    pub no_weld: bool,
    /// Count edges and vertices as the file has them, and weld only to find self-intersections: for
    /// meshes that `impinge fix` has split
    #[arg(long, conflicts_with = "no_weld")]
    pub keep_seams: bool,
    /// The most places of each problem that rows name, largest first
    #[arg(long, value_name = "N", default_value = "3")]
    pub places: usize,
    /// Name all faces of each place, not only the first few
    #[arg(long)]
    pub faces: bool,
    /// Find walls that are at most this thick, in the unit of the file: near faces of a closed
    /// piece that turn their backs to each other, with matter between them
    #[arg(long, value_name = "T", value_parser = length)]
    pub min_thickness: Option<f64>,
    /// Compare the parts of an assembly instead: the nodes of a glTF or 3MF file, the groups of an
    /// OBJ file, or whole files. Which share space, and which only touch, is decided exactly
    #[arg(long, conflicts_with_all = ["list", "format", "out", "no_weld", "keep_seams", "min_thickness", "summary", "png"])]
    pub assembly: bool,
    /// With --assembly, which this implies: also find parts that are at most this far from each
    /// other
    #[arg(long, value_name = "D", value_parser = crate::values::distance,
        conflicts_with_all = ["list", "format", "out", "no_weld", "keep_seams", "min_thickness", "summary", "png"])]
    pub clearance: Option<f64>,
    /// With --assembly: what becomes of parts that only touch
    #[arg(long, value_enum, value_name = "RULE", default_value_t = Touching::Report)]
    pub touching: Touching,
    /// Show no progress bar
    #[arg(long)]
    pub no_progress: bool,
    /// Seconds that one mesh may take [default: no limit]
    #[arg(long, value_name = "S", value_parser = seconds, help_heading = "Many meshes")]
    pub timeout: Option<f64>,
    /// Address space of each child process, such as 4G (Unix) [default: no limit]
    #[arg(long, value_name = "BYTES", value_parser = memory, help_heading = "Many meshes")]
    pub memory: Option<u64>,
    /// Child processes at a time [default: one per core]
    #[arg(long, value_name = "N", help_heading = "Many meshes")]
    pub jobs: Option<NonZeroUsize>,
    /// The rank of this process, from 0
    #[arg(
        long,
        value_name = "R",
        default_value = "0",
        help_heading = "Many meshes"
    )]
    pub rank: usize,
    /// How many processes share the list
    #[arg(
        long,
        value_name = "W",
        default_value = "1",
        help_heading = "Many meshes"
    )]
    pub world_size: NonZeroUsize,
    /// Meshes per file of rows; processes take batches in turn
    #[arg(
        long,
        value_name = "N",
        default_value = "64",
        help_heading = "Many meshes"
    )]
    pub batch: NonZeroUsize,
    /// Check meshes again that ended by a limit or a crash in an earlier run in --out
    #[arg(long, help_heading = "Many meshes")]
    pub retry: bool,
    /// Write a page with a table, and each mesh and place as a picture and to be turned (.html)
    #[arg(long, value_name = "FILE")]
    pub html: Option<HtmlFile>,
    /// Write a table with a row per mesh (.csv, .jsonl or .parquet)
    #[arg(long, value_name = "FILE", conflicts_with_all = ["assembly", "clearance"])]
    pub rows: Option<RowsFile>,
    /// Append a table in Markdown to this file, as for the summary of a workflow
    #[arg(long, value_name = "FILE")]
    pub summary: Option<PathBuf>,
    /// Draw the problems as a picture (.png)
    #[arg(long, value_name = "FILE")]
    pub png: Option<PngFile>,
    #[command(flatten)]
    pub picture: PictureArgs,
}

impl CheckArgs {
    /// The files that are written besides rows, and the options that name them.
    pub fn outputs(&self) -> impl Iterator<Item = (&'static str, &Path)> {
        let mesh = match &self.out {
            Some(Out::Mesh(file)) => Some(("--out", file.path.as_path())),
            _ => None,
        };
        let summary = self.summary.as_deref().map(|path| ("--summary", path));
        let html = self
            .html
            .as_ref()
            .map(|file| ("--html", file.path.as_path()));
        let png = self.png.as_ref().map(|file| ("--png", file.path.as_path()));
        [mesh, summary, html, png].into_iter().flatten()
    }

    /// Whether meshes are shown, for which their rows need marks.
    pub fn shows(&self) -> bool {
        let is_mesh = matches!(self.out, Some(Out::Mesh(_)));
        is_mesh || self.html.is_some() || self.png.is_some()
    }
}

#[derive(Debug, Args)]
pub struct CheckWorkerArgs {
    /// CPU threads
    #[arg(long, value_name = "N", default_value = "1")]
    pub threads: usize,
    /// Do not weld vertices at the same position
    #[arg(long)]
    pub no_weld: bool,
    /// Weld only to find self-intersections
    #[arg(long)]
    pub keep_seams: bool,
    /// Places of each problem
    #[arg(long, value_name = "N", default_value = "3")]
    pub places: usize,
    /// All faces of each place
    #[arg(long)]
    pub faces: bool,
    /// The thickness of walls to be found
    #[arg(long, value_name = "T")]
    pub min_thickness: Option<f64>,
    /// Say the problems of each element
    #[arg(long)]
    pub marks: bool,
    /// Address space
    #[arg(long, value_name = "BYTES")]
    pub memory: Option<u64>,
}

/// An output besides standard output.
#[derive(Debug, Clone)]
pub enum Out {
    /// A folder for rows.
    Folder(PathBuf),
    /// A file for the coloured meshes.
    Mesh(MeshFile),
}

impl ValueParserFactory for Out {
    type Parser = ValueParser;

    fn value_parser() -> ValueParser {
        of_path::<Self>()
    }
}

impl OfPath for Out {
    fn of_path(path: &Path) -> Result<Self, String> {
        if let Ok(file) = MeshFile::of_path(path) {
            return Ok(Out::Mesh(file));
        }
        if path.is_file() {
            return Err("expected a folder, or a mesh file (.glb, .ply, .vtu)".to_owned());
        }
        Ok(Out::Folder(path.to_owned()))
    }
}

/// What `impinge check` prints.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// A table
    Text,
    /// A SARIF 2.1.0 log, for code scanning
    Sarif,
    /// A JUnit report, for CI servers
    Junit,
    /// Commands that annotate a GitHub workflow
    Github,
}

/// Parses [`Format`], and tells apart the formats of meshes, which `--format` of other commands
/// takes.
#[derive(Clone)]
struct PrintedFormat;

impl TypedValueParser for PrintedFormat {
    type Value = Format;

    fn parse_ref(
        &self,
        command: &Command,
        arg: Option<&Arg>,
        value: &OsStr,
    ) -> Result<Format, clap::Error> {
        if let Some(text) = value.to_str().filter(|text| mesh_format(text).is_ok()) {
            let text = format!(
                "--format {text}: says what is printed: text, sarif, junit or github; check reads meshes from files only, \
                 not from standard input"
            );
            return Err(command.clone().error(ErrorKind::InvalidValue, text));
        }
        EnumValueParser::<Format>::new().parse_ref(command, arg, value)
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        let all = Format::value_variants().iter();
        Some(Box::new(all.filter_map(ValueEnum::to_possible_value)))
    }
}

/// What becomes of parts that only touch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Touching {
    /// They are reported
    Report,
    /// They are left out, also where --clearance asks how near parts are
    Ignore,
}

/// A problem that makes a run fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FailOn {
    /// A finding of a mesh.
    Mesh(Finding),
    /// Parts of an assembly that share space.
    Interpenetrating,
    /// Parts of an assembly that touch.
    Touching,
    /// Parts of an assembly that are near.
    Near,
    /// Any of these.
    Any,
}

impl FailOn {
    /// The findings of meshes that are named.
    pub fn findings(named: &[FailOn]) -> Vec<Finding> {
        let is_named = |&finding: &Finding| {
            named.contains(&FailOn::Any) || named.contains(&FailOn::Mesh(finding))
        };
        Finding::ALL.into_iter().filter(is_named).collect()
    }

    /// The name of the option's value.
    pub fn name(self) -> &'static str {
        match self {
            FailOn::Mesh(finding) => finding.name(),
            FailOn::Interpenetrating => "interpenetrating",
            FailOn::Touching => "touching",
            FailOn::Near => "near",
            FailOn::Any => "any",
        }
    }

    fn help(self) -> &'static str {
        match self {
            FailOn::Mesh(Finding::SelfIntersections) => {
                "Pairs that also meet outside their common vertices, edge or face"
            }
            FailOn::Mesh(Finding::Degenerate) => "Elements of zero area or volume",
            FailOn::Mesh(Finding::Duplicates) => "Elements with the vertices of an earlier one",
            FailOn::Mesh(Finding::NonManifold) => {
                "Edges of more than two triangles, vertices of several fans"
            }
            FailOn::Mesh(Finding::Orientation) => "Neighbours with opposite orientations",
            FailOn::Mesh(Finding::InsideOut) => {
                "Closed pieces whose faces point inward, or, around a cavity, outward"
            }
            FailOn::Mesh(Finding::Boundary) => "Edges of only one triangle",
            FailOn::Mesh(Finding::Thin) => "Walls that --min-thickness finds",
            FailOn::Mesh(Finding::Nan) => "Coordinates that are NaN or infinite",
            FailOn::Mesh(_) => "Meshes that could not be checked, whatever the reason",
            FailOn::Interpenetrating => "Parts of an assembly that share space",
            FailOn::Touching => "Parts of an assembly that touch",
            FailOn::Near => "Parts of an assembly within --clearance",
            FailOn::Any => "Any of these",
        }
    }
}

impl ValueEnum for FailOn {
    fn value_variants<'a>() -> &'a [Self] {
        const ALL: [FailOn; 14] = {
            let mut all = [FailOn::Any; 14];
            let mut ix = 0;
            while ix < Finding::ALL.len() {
                all[ix] = FailOn::Mesh(Finding::ALL[ix]);
                ix += 1;
            }
            all[ix] = FailOn::Interpenetrating;
            all[ix + 1] = FailOn::Touching;
            all[ix + 2] = FailOn::Near;
            all
        };
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(PossibleValue::new(self.name()).help(self.help()))
    }
}

fn length(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("expected a length above 0".to_owned()),
    }
}

fn memory(text: &str) -> Result<u64, String> {
    match bytes(text)? {
        0 => Err("expected a number of bytes above 0, such as 4G".to_owned()),
        memory => Ok(memory),
    }
}

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value <= 1e9 => Ok(value),
        _ => Err("expected a number of seconds above 0".to_owned()),
    }
}
