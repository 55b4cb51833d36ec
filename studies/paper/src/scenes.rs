//! The surface benchmarks: their meshes, and the motion of the two copies.

use std::path::Path;

use impinge::{BodyId, Elements, Scene};
use impinge_io::ReadOptions;
use impinge_scenes::deform::{Deform, Drift, Wave};
use impinge_scenes::{Model, surfaces};
use impinge_testing::data;

use crate::course::Course;
use crate::error::Error;
use crate::options::{Options, SceneName, Waving};

/// The drift of the second body, in widths of the first one's box: it starts at `from` along x and
/// ends at `to`. Chosen so that the average number of colliding triangles is close to the paper's,
/// because the paper does not say how its bodies meet.
#[derive(Debug, Clone, Copy)]
struct Approach {
    from: f32,
    to: f32,
}

/// A small offset along y and z, as a share of the width, so that the two copies are not exactly
/// aligned.
const ASIDE: [f32; 2] = [0.011, 0.007];

/// The fixed data of a benchmark.
struct Plan {
    file: Option<&'static str>,
    n_triangles: usize,
    approach: Approach,
}

fn plan(scene: SceneName) -> Plan {
    let (file, n_triangles, from, to) = match scene {
        SceneName::Bunny => (Some("meshes/bunny.ply"), 69_451, 0.86, 0.36),
        SceneName::Buddha => (Some("meshes/buddha.ply"), 100_000, 0.96, 0.6),
        SceneName::Dragon => (Some("meshes/dragon.ply"), 400_000, 0.82, 0.53),
        _ => (None, 15_000, 0.98, 0.58),
    };
    Plan {
        file,
        n_triangles,
        approach: Approach { from, to },
    }
}

/// Two copies of a mesh that wave and drift into each other.
pub(crate) struct Moving {
    name: SceneName,
    mesh: String,
    is_stand_in: bool,
    n_frames: usize,
    scene: Scene,
    bodies: [BodyId; 2],
    rest: Vec<[f32; 3]>,
    now: Vec<[f32; 3]>,
    waves: [Wave; 2],
    approach: Approach,
    from: [f32; 3],
    drift: Drift,
}

impl Moving {
    /// A surface benchmark with its mesh: the given one, else the shared one, else a stand-in.
    pub fn new(name: SceneName, options: &Options) -> Result<Self, Error> {
        let Plan {
            file,
            n_triangles,
            approach,
        } = plan(name);
        let (model, mesh, is_stand_in) = match (options.mesh(name), file) {
            (Some(path), _) => {
                let model = surfaces::unit_diagonal(load(path, name)?);
                (model, format!("`{}`", path.display()), false)
            }
            (None, None) => (
                surfaces::ball(n_triangles),
                "generated: a geodesic ball".to_owned(),
                false,
            ),
            (None, Some(file)) => match data::data_file(file) {
                Some(path) => (load(&path, name)?, format!("`{file}`"), false),
                None => (
                    surfaces::stand_in(n_triangles),
                    format!("**a generated stand-in**: a torus knot, because `{file}` is not here"),
                    true,
                ),
            },
        };
        let (low, high) = model.bounds().unwrap_or_default();
        let width = high[0] - low[0];
        let diagonal = (0..3)
            .map(|axis| (high[axis] - low[axis]).powi(2))
            .sum::<f32>()
            .sqrt();
        let at = |share: f32| [share, ASIDE[0], ASIDE[1]].map(|share| share * width);
        let mut scene = Scene::new();
        let mut add = || scene.add((model.elements.clone(), model.positions.clone()));
        let bodies = [add()?, add()?];
        Ok(Moving {
            name,
            mesh,
            is_stand_in,
            n_frames: options.n_frames(name),
            scene,
            bodies,
            now: model.positions.clone(),
            rest: model.positions,
            waves: waves(&options.waving, diagonal),
            approach,
            from: at(approach.from),
            drift: Drift {
                velocity: [(approach.to - approach.from) * width, 0.0, 0.0],
            },
        })
    }
}

impl Course for Moving {
    fn name(&self) -> SceneName {
        self.name
    }

    fn mesh(&self) -> &str {
        &self.mesh
    }

    fn motion(&self) -> String {
        let Approach { from, to } = self.approach;
        format!("the second body drifts from {from} to {to} widths beside the first one")
    }

    fn is_stand_in(&self) -> bool {
        self.is_stand_in
    }

    fn scene(&self) -> &Scene {
        &self.scene
    }

    fn bodies(&self) -> [BodyId; 2] {
        self.bodies
    }

    fn n_frames(&self) -> usize {
        self.n_frames
    }

    /// Time goes from 0 in the first frame to 1 in the last one.
    fn pose(&mut self, frame: usize) -> Result<(), Error> {
        let t = match self.n_frames {
            0 | 1 => 1.0,
            n => frame as f32 / (n - 1) as f32,
        };
        let [first, second] = self.waves;
        first.apply(&self.rest, t, &mut self.now);
        self.scene.set_positions(self.bodies[0], &self.now)?;
        let aside = (second, Fixed(self.from));
        (aside, self.drift).apply(&self.rest, t, &mut self.now);
        self.scene.set_positions(self.bodies[1], &self.now)?;
        Ok(())
    }
}

/// Moves all vertices by the same vector, at any time.
#[derive(Clone, Copy)]
struct Fixed([f32; 3]);

impl Deform for Fixed {
    fn at(&self, p: [f32; 3], _: f32) -> [f32; 3] {
        std::array::from_fn(|axis| p[axis] + self.0[axis])
    }
}

/// Crests travel along x in the first body and against x in the second one; vertices move along z.
fn waves(waving: &Waving, diagonal: f32) -> [Wave; 2] {
    let wave = |speed: f32| Wave {
        amplitude: waving.amplitude * diagonal,
        wave_length: waving.wave_length * diagonal,
        speed: speed * diagonal,
        travel: [1.0, 0.0, 0.0],
        displacement: [0.0, 0.0, 1.0],
    };
    [wave(waving.speed), wave(-waving.speed)]
}

fn load(path: &Path, scene: SceneName) -> Result<Model, Error> {
    let mesh = impinge_io::read(path, &ReadOptions::as_they_are())?;
    match mesh.elements {
        impinge_io::Elements::Triangles(faces) => Ok(Model {
            positions: mesh.positions.to_f32_rounded(),
            elements: Elements::Triangles(faces),
        }),
        impinge_io::Elements::Tetrahedra(_) => Err(Error::WrongKind {
            path: path.to_owned(),
            scene: scene.name(),
            needed: "triangles",
            found: "tetrahedra",
        }),
    }
}
