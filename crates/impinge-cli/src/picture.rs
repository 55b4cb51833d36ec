//! Draws bodies as a picture.

use std::io::Write;
use std::path::Path;

use impinge::contact::{Contacts, Curves};
use impinge::{Backend, Body, BodyId, Detector, Elements, Pairs, Part, Scene, Settings};
use impinge_io::AtomicFile;
#[cfg(feature = "gpu")]
use impinge_render::Renderer;
use impinge_render::{Camera, Colors, Face, Image, Normals, Picture, Projection, Surface};

use crate::args::PictureArgs;
use crate::error::Error;
use crate::palette;

/// Draws pictures, all with the same options.
pub struct Drawer<'a> {
    args: &'a PictureArgs,
    /// Without one, pictures are drawn on the CPU.
    #[cfg(feature = "gpu")]
    renderer: Option<Renderer>,
    /// For contacts.
    detector: Detector,
}

impl<'a> Drawer<'a> {
    /// Opens the adapter whose name contains `device`; without a name, a GPU if there may be one.
    /// Pictures are drawn on the CPU rather than by a software driver: that is faster, and needs no
    /// driver. Contacts are found on so many threads; 0 for one per core.
    pub fn new(args: &'a PictureArgs, device: Option<&str>, threads: usize) -> Result<Self, Error> {
        #[cfg(not(feature = "gpu"))]
        if device.is_some() {
            return Err(Error::NotBuilt("the GPU backend", "gpu", ""));
        }
        #[cfg(feature = "gpu")]
        let renderer = match device {
            Some(name) => Some(Renderer::on_device_named(name)?),
            None if !crate::detection::may_have_gpu() => None,
            None => match Renderer::new() {
                Ok(renderer) => Some(renderer),
                Err(impinge_render::Error::NoAdapter { .. }) => None,
                Err(error) => return Err(error.into()),
            },
        };
        let detector = Detector::new(Settings::new().backend(Backend::Cpu).threads(threads))?;
        Ok(Drawer {
            args,
            #[cfg(feature = "gpu")]
            renderer,
            detector,
        })
    }

    /// Draws bodies in their current pose, with colliding elements coloured.
    pub fn write(
        &mut self,
        path: &Path,
        scene: &Scene,
        bodies: &[(BodyId, &str)],
        pairs: &Pairs,
    ) -> Result<(), Error> {
        let mut surfaces = surfaces(scene, bodies, pairs)?;
        let contacts = self.detector.contacts(scene, pairs)?;
        surfaces.push(tubes(&contacts, &contacts.curves()?, diagonal(&surfaces)));
        self.draw(path, surfaces)
    }

    /// Draws surfaces.
    pub fn draw(&mut self, path: &Path, surfaces: Vec<Surface>) -> Result<(), Error> {
        let picture = self.picture(surfaces);
        let failed = |source| Error::Write {
            path: path.to_owned(),
            source,
        };
        let png = self.image(&picture)?.to_png().map_err(failed)?;
        let mut to = AtomicFile::create(path)?;
        to.write_all(&png).map_err(failed)?;
        Ok(to.finish()?)
    }

    fn image(&mut self, picture: &Picture) -> Result<Image, Error> {
        #[cfg(feature = "gpu")]
        if let Some(renderer) = &mut self.renderer {
            return Ok(renderer.render(picture)?);
        }
        Ok(picture.draw()?)
    }

    fn picture(&self, surfaces: Vec<Surface>) -> Picture {
        let args = self.args;
        Picture {
            surfaces,
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
        }
    }
}

/// The lowest and the highest coordinates of points.
pub fn bounds<'a>(points: impl IntoIterator<Item = &'a [f64; 3]>) -> [[f64; 3]; 2] {
    let mut bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    for point in points {
        for k in 0..3 {
            bounds[0][k] = bounds[0][k].min(point[k]);
            bounds[1][k] = bounds[1][k].max(point[k]);
        }
    }
    bounds
}

/// The length of the diagonal of the box of all vertices.
pub fn diagonal(surfaces: &[Surface]) -> f64 {
    let [low, high] = bounds(surfaces.iter().flat_map(|surface| &surface.positions));
    let [x, y, z] = [0, 1, 2].map(|k| high[k] - low[k]);
    x.hypot(y).hypot(z)
}

/// The colour of the curves in which surfaces cross.
const CURVE: [u8; 3] = [20, 20, 20];

/// Curves as thin tubes, about two pixels wide in a picture of a thousand.
fn tubes(contacts: &Contacts, curves: &Curves, diagonal: f64) -> Surface {
    let segments: Vec<[[f64; 3]; 2]> = (0..curves.len())
        .flat_map(|curve| curves.segments(curve))
        .map(|ends| ends.map(|point| contacts.points()[point as usize]))
        .collect();
    Surface::of_segments(&segments, diagonal / 1000.0, CURVE)
}

/// The surface of a body. `color`: of a face, by its corners, and whether it shows through.
pub fn surface(body: &Body, color: impl Fn(&[u32; 3]) -> ([u8; 3], bool)) -> Surface {
    let faces = match body.part(Part::Faces) {
        Elements::Triangles(faces) => faces.as_slice(),
        _ => &[],
    };
    let face = |&corners: &[u32; 3]| {
        let (color, shows_through) = color(&corners);
        Face {
            corners,
            color,
            shows_through,
        }
    };
    let positions = body.positions();
    Surface {
        positions: (0..body.n_vertices())
            .map(|vertex| positions.point(vertex))
            .collect(),
        faces: faces.iter().map(face).collect(),
        normals: match body.elements() {
            Elements::Tetrahedra(_) => Normals::Flat,
            _ => Normals::Smooth,
        },
    }
}

/// One surface per body, in the colours of the palette.
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
