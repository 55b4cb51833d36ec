//! Options of coloured meshes and pictures.

use std::path::Path;

use clap::{Args, ValueEnum};

use crate::values::{MeshFile, PngFile, azimuth, elevation, part, size};

/// Where an answer is shown in colours.
#[derive(Debug, Clone, Args)]
pub struct ShownArgs {
    /// Write the meshes in the colours of the answer (.ply, .glb or .vtu)
    #[arg(long, value_name = "FILE")]
    pub out: Option<MeshFile>,
    /// Draw the meshes in the colours of the answer (.png)
    #[arg(long, value_name = "FILE")]
    pub png: Option<PngFile>,
    #[command(flatten)]
    pub picture: PictureArgs,
}

impl ShownArgs {
    /// The files, each with its option.
    pub fn outputs(&self) -> impl Iterator<Item = (&'static str, &Path)> {
        let out = self.out.as_ref().map(|file| ("--out", file.path.as_path()));
        let png = self.png.as_ref().map(|file| ("--png", file.path.as_path()));
        out.into_iter().chain(png)
    }

    /// Whether it is shown at all.
    pub fn any(&self) -> bool {
        self.outputs().next().is_some()
    }
}

/// Options of pictures.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Picture")]
pub struct PictureArgs {
    /// Width and height in pixels
    #[arg(long, value_name = "WxH", value_parser = size, default_value = "1280x960", requires = "png")]
    pub size: [u32; 2],
    /// Degrees around the up axis, counter-clockwise seen from above
    #[arg(
        long,
        value_name = "D",
        value_parser = azimuth,
        default_value = "-25",
        allow_negative_numbers = true,
        requires = "png"
    )]
    pub azimuth: f64,
    /// Degrees above the ground, -90 to 90
    #[arg(
        long,
        value_name = "D",
        value_parser = elevation,
        default_value = "20",
        allow_negative_numbers = true,
        requires = "png"
    )]
    pub elevation: f64,
    /// The axis that points up; at azimuth 0 the viewer is on the side of +z or of -y
    #[arg(long, value_enum, value_name = "AXIS", default_value_t = UpArg::Y, requires = "png")]
    pub up: UpArg,
    /// How visible hidden colliding elements are, from 0 (not at all) to 1 (as if nothing hid them)
    #[arg(long, value_name = "X", value_parser = part, default_value = "0.5", requires = "png")]
    pub see_through: f32,
    /// Draw without perspective
    #[arg(long, requires = "png")]
    pub orthographic: bool,
}

impl Default for PictureArgs {
    fn default() -> Self {
        PictureArgs {
            size: [1280, 960],
            azimuth: -25.0,
            elevation: 20.0,
            up: UpArg::Y,
            see_through: 0.5,
            orthographic: false,
        }
    }
}

/// [`impinge_render::UpAxis`] as an option.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum UpArg {
    Y,
    Z,
}

impl From<UpArg> for impinge_render::UpAxis {
    fn from(up: UpArg) -> Self {
        match up {
            UpArg::Y => impinge_render::UpAxis::Y,
            UpArg::Z => impinge_render::UpAxis::Z,
        }
    }
}
