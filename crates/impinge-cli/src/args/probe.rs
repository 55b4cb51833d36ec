//! The command lines of `impinge probe` and `impinge cast`.

use std::num::{NonZeroU32, NonZeroUsize};
use std::path::PathBuf;

use clap::Args;
use impinge::Hit;

use super::{RowsArgs, hits};
use crate::values::{at_least_one, distance, mesh_format, threads};

pub const PROBE_EXAMPLES: &str = "\
Examples:
  impinge probe part.stl --points points.csv               how far are points from the surface?
  impinge probe part.stl --points scan.ply --signed        and are they inside, on the surface or outside?
  impinge probe part.stl --points points.npy --rows -      the nearest element and point of each, as CSV
  impinge probe part.stl --points points.npy --most 0.01   only points that are as near as that
  impinge probe part.stl --points points.npy --nearest 8   the eight nearest elements of each
  impinge probe solid.msh --points skin.obj --locate       which tetrahedron contains each point?

Which element is nearest, and whether a point is inside, is decided exactly. Distances are rounded down. --signed needs
a closed surface, which `impinge check` and `impinge fix` help with, or tetrahedra; --locate needs tetrahedra.";

pub const CAST_EXAMPLES: &str = "\
Examples:
  impinge cast part.stl --rays rays.csv                  what does each ray hit first?
  impinge cast part.stl --rays rays.npy --rows hits.npy  the hits themselves
  impinge cast part.stl --rays rays.csv --hits all       not only the first
  impinge cast part.stl --rays rays.csv --most 1         segments from the origin to origin + direction

A ray is six numbers: its origin and its direction, which need not have length 1. What it hits is decided exactly: a ray that
grazes an edge or a vertex hits. t counts in lengths of the direction and is rounded down. A direction of zero is the origin alone.";

#[derive(Debug, Args)]
pub struct ProbeArgs {
    /// A mesh file
    #[arg(value_name = "MESH")]
    pub mesh: PathBuf,
    /// The points: rows of three numbers (.csv, .txt, .xyz, .npy, or "-" for standard input), or the
    /// vertices of a mesh file
    #[arg(long, value_name = "FILE", required = true)]
    pub points: PathBuf,
    /// Also decide whether each point is inside, on the surface or outside; distances are then
    /// negative outside
    #[arg(long)]
    pub signed: bool,
    /// Also find which tetrahedron contains each point: the lowest, where several share the face,
    /// edge or vertex on which it is
    #[arg(long)]
    pub locate: bool,
    /// How many nearest elements are found of each point, nearest first, of several at the same
    /// distance the lowest
    #[arg(long, value_name = "K", default_value = "1", allow_negative_numbers = true, value_parser = at_least_one::<NonZeroU32>)]
    pub nearest: NonZeroU32,
    /// Leave out points that are farther than this from the mesh [default: none]
    #[arg(long, value_name = "D", allow_negative_numbers = true, value_parser = distance)]
    pub most: Option<f64>,
    #[command(flatten)]
    pub how: OneMeshArgs,
    #[command(flatten)]
    pub rows: RowsArgs,
}

#[derive(Debug, Args)]
pub struct CastArgs {
    /// A mesh file
    #[arg(value_name = "MESH")]
    pub mesh: PathBuf,
    /// The rays: rows of six numbers, origin and direction (.csv, .txt, .xyz, .npy, or "-" for
    /// standard input)
    #[arg(long, value_name = "FILE", required = true)]
    pub rays: PathBuf,
    /// What is found of each ray
    #[arg(long, value_parser = hits(), value_name = "WHICH", default_value_t = Hit::First)]
    pub hits: Hit,
    /// Rays end at origin + T direction: 1 makes them segments [default: they do not end]
    #[arg(long, value_name = "T", allow_negative_numbers = true, value_parser = distance)]
    pub most: Option<f64>,
    /// End with exit code 3 if a ray hits anything
    #[arg(long)]
    pub fail_on_hit: bool,
    #[command(flatten)]
    pub how: OneMeshArgs,
    #[command(flatten)]
    pub rows: RowsArgs,
}

/// How a mesh is read and asked about by points or rays.
#[derive(Debug, Args)]
pub struct OneMeshArgs {
    /// Do not weld vertices at the same position, except in STL files, where triangles share
    /// nothing else
    #[arg(long)]
    pub no_weld: bool,
    /// The format of a mesh on standard input, which is named "-": ply, off, stl, …
    #[arg(long, value_name = "EXT", value_parser = mesh_format)]
    pub format: Option<impinge_io::Format>,
    /// CPU threads, 1 to 1024 [default: one per core]
    #[arg(long, value_name = "N", value_parser = threads)]
    pub threads: Option<NonZeroUsize>,
    /// Print JSON and nothing else (see docs/cli.md)
    #[arg(long)]
    pub json: bool,
}
