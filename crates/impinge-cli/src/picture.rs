//! Bodies as a picture.

use std::io::Write;
use std::path::Path;

use impinge::{BodyId, Pairs, Scene};
use impinge_io::AtomicFile;
use impinge_render::{Camera, Colors, Picture, Projection, Renderer, Surface};

use crate::args::PictureArgs;
use crate::error::Error;
use crate::palette;

/// Draws bodies as they are in the scene now, colliding primitives coloured, on the first adapter or on the one
/// whose name contains `device`.
pub fn write(
    path: &Path,
    args: &PictureArgs,
    device: Option<&str>,
    scene: &Scene,
    bodies: &[(BodyId, &str)],
    pairs: &Pairs,
) -> Result<(), Error> {
    let picture = Picture {
        surfaces: surfaces(scene, bodies, pairs)?,
        camera: Camera {
            azimuth: args.azimuth,
            elevation: args.elevation,
            up: args.up.into(),
            projection: if args.orthographic {
                Projection::Orthographic
            } else {
                Camera::default().projection
            },
        },
        size: args.size,
        see_through: args.see_through,
        ..Picture::default()
    };
    let mut renderer = match device {
        None => Renderer::new()?,
        Some(name) => Renderer::on_device_named(name)?,
    };
    let written = renderer.render(&picture)?.to_png();
    let png = written.map_err(|source| Error::Write {
        path: path.to_owned(),
        source,
    })?;
    let mut to = AtomicFile::create(path)?;
    to.write_all(&png).map_err(|source| Error::Write {
        path: path.to_owned(),
        source,
    })?;
    Ok(to.finish()?)
}

/// A surface a body, in the colours of the palette.
pub fn surfaces(
    scene: &Scene,
    bodies: &[(BodyId, &str)],
    pairs: &Pairs,
) -> Result<Vec<Surface>, Error> {
    let surface = |(ix, &(id, _)): (usize, &(BodyId, &str))| {
        let palette::BodyColors { colliding, other } = palette::body(ix);
        let body = scene.body(id)?;
        let colors = Colors { colliding, other };
        Ok(Surface::of_body(body, &pairs.colliding(id), colors)?)
    };
    bodies.iter().enumerate().map(surface).collect()
}
