//! The command line of `impinge view`.

use std::num::NonZeroU32;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use impinge::{Method, SharedVertex};

use super::picture::UpArg;
use super::{BodiesArg, method, shared_vertex};
use crate::values::{PngFile, azimuth, body_matrix, elevation, lambda, point, size};

pub const VIEW_EXAMPLES: &str = "\
Examples:
  impinge view                                  the built-in scene
  impinge view a.obj b.ply                      two meshes: drag one of them
  impinge view scene.glb --bodies nodes         each node of a file is a body
  impinge view cloth.ply run.pc2                a sequence
  impinge view cloth.ply run.pc2 body.ply       with a mesh that does not move
  impinge view run/cloth_*.obj                  three or more numbered meshes: a sequence
  impinge view cloth.obj 'run/cloth_%04d.obj'   the same, the files named by a pattern

Space plays, N goes to the next frame with a collision, J flies from place to place, C shows only what collides. The
timeline shows the number of pairs of every frame. Click a triangle for its number, drag a body to move it, with
Shift to turn it; drag beside the bodies to turn the view. The panel at the side lists all keys.";

#[derive(Debug, Clone, Args)]
pub struct ViewArgs {
    /// Mesh files, one per body; or a mesh and its frames (a .pc2 or .mdd file, a pattern, or
    /// numbered files)
    #[arg(value_name = "MESH")]
    pub meshes: Vec<PathBuf>,
    /// Read the files after the first one as its frames, whatever their names
    #[arg(long, conflicts_with = "bodies")]
    pub sequence: bool,
    /// What becomes a body of its own, whatever the names of files [default: file, of numbered
    /// files the frames of one]
    #[arg(long, value_enum, value_name = "WHAT")]
    pub bodies: Option<BodiesArg>,
    /// Begin with self-collision; implied for one mesh
    #[arg(long = "self")]
    pub within: bool,
    /// Which neighbours are reported: pairs of elements of one body that share a vertex
    #[arg(long, value_parser = shared_vertex(), value_name = "RULE", default_value_t = SharedVertex::Resolve)]
    pub shared_vertex: SharedVertex,
    /// Do not weld vertices at the same position, except in STL files
    #[arg(long)]
    pub no_weld: bool,
    /// The method that finds candidates; all methods give the same pairs
    #[arg(long, value_parser = method(), default_value_t = Method::Clusters)]
    pub method: Method,
    /// Where detection runs
    #[arg(long, value_enum, default_value_t = WhereArg::Cpu)]
    pub backend: WhereArg,
    /// The number of triangles of the built-in scene
    #[arg(long, value_name = "N", default_value = "60000", value_parser = clap::value_parser!(u32).range(1_000..=100_000_000))]
    pub triangles: u32,
    /// The frame to begin with, counted from 0 [default: the first one with a collision; for --png
    /// 0]
    #[arg(long, value_name = "N")]
    pub frame: Option<usize>,
    /// Do not play at the beginning
    #[arg(long)]
    pub paused: bool,
    /// Move a body, by its number and three rows of a matrix: B:xx,xy,xz,dx,yx,yy,yz,dy,zx,zy,zz,dz
    #[arg(long = "move", value_name = "MATRIX", value_parser = body_matrix, allow_hyphen_values = true)]
    pub moves: Vec<(usize, [[f64; 4]; 4])>,
    /// Width and height of the window, or of the picture in pixels
    #[arg(long, value_name = "WxH", value_parser = size, default_value = "1280x800")]
    pub size: [u32; 2],
    /// Degrees around the up axis, counter-clockwise seen from above
    #[arg(long, value_name = "D", value_parser = azimuth, default_value = "-25", allow_negative_numbers = true)]
    pub azimuth: f64,
    /// Degrees above the ground, -90 to 90
    #[arg(long, value_name = "D", value_parser = elevation, default_value = "20", allow_negative_numbers = true)]
    pub elevation: f64,
    /// The axis that points up; at azimuth 0 the viewer is on the side of +z or of -y
    #[arg(long, value_enum, value_name = "AXIS", default_value_t = UpArg::Y)]
    pub up: UpArg,
    /// Draw without perspective
    #[arg(long)]
    pub orthographic: bool,
    /// The point in the middle of the view; by default everything is seen
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true, requires = "eye_distance")]
    pub target: Option<[f64; 3]>,
    /// The distance from which that point is seen, in the unit of the meshes
    #[arg(long, value_name = "D", value_parser = lambda, requires = "target")]
    pub eye_distance: Option<f64>,
    /// What is drawn
    #[arg(long, value_enum, default_value_t = ShowArg::Everything)]
    pub show: ShowArg,
    /// Draw the curves in which surfaces cross
    #[arg(long)]
    pub curves: bool,
    /// Save this picture and open no window
    #[arg(long, value_name = "FILE")]
    pub png: Option<PngFile>,
    /// Show N frames as fast as possible, print how many there were per second, and close the
    /// window
    #[arg(long, value_name = "N", hide = true)]
    pub measure: Option<NonZeroU32>,
}

/// [`impinge_view::Shows`] as an option.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ShowArg {
    /// All faces
    Everything,
    /// The faces that collide
    Colliding,
    /// The curves in which surfaces cross, and no faces
    Curves,
}

impl From<ShowArg> for impinge_view::Shows {
    fn from(show: ShowArg) -> Self {
        match show {
            ShowArg::Everything => impinge_view::Shows::Everything,
            ShowArg::Colliding => impinge_view::Shows::Colliding,
            ShowArg::Curves => impinge_view::Shows::Curves,
        }
    }
}

/// [`impinge_view::Backend`] as an option.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum WhereArg {
    /// The CPU
    Cpu,
    /// The GPU that draws the window
    Gpu,
}

impl From<WhereArg> for impinge_view::Backend {
    fn from(backend: WhereArg) -> Self {
        match backend {
            WhereArg::Cpu => impinge_view::Backend::Cpu,
            WhereArg::Gpu => impinge_view::Backend::Gpu,
        }
    }
}
