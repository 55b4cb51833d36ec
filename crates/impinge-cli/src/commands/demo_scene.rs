//! The scene of `impinge demo`: three bodies that deform and drift into each other.
//!
//! A worm bends into a ring until its head runs into its tail, a rippling knot sinks through the
//! ring, and a bumpy, twisting ball comes in from the side. All positions are functions of the rest
//! pose and of the time, which is 0 at the first frame and 1 at the last.

use std::f32::consts::TAU;

use impinge::{BodyId, Error, Scene};
use impinge_scenes::Model;
use impinge_scenes::deform::{Deform, Drift, Twist, Wave};
use impinge_scenes::surfaces::{ball, bumpy_ball, stand_in};

/// Length of the straight worm.
const WORM_LENGTH: f32 = 3.0;

/// A body, its rest pose and its motion.
struct Actor {
    id: BodyId,
    name: &'static str,
    rest: Vec<[f32; 3]>,
    motion: Box<dyn Motion + Send>,
}

/// A [`Deform`] behind a pointer, called once per frame, not once per vertex.
trait Motion {
    fn pose(&self, rest: &[[f32; 3]], t: f32, now: &mut [[f32; 3]]);
}

impl<D: Deform> Motion for D {
    fn pose(&self, rest: &[[f32; 3]], t: f32, now: &mut [[f32; 3]]) {
        self.apply(rest, t, now);
    }
}

/// The bodies and their motions.
pub struct DemoScene {
    scene: Scene,
    actors: Vec<Actor>,
}

impl DemoScene {
    /// About `n_triangles` triangles in three bodies.
    pub fn new(n_triangles: usize) -> Result<Self, Error> {
        let n = n_triangles / 3;
        let mut demo = DemoScene {
            scene: Scene::new(),
            actors: Vec::new(),
        };
        let worm = ball(n).mapped(|[x, y, z]| [x * WORM_LENGTH, y * 0.3, z * 0.3]);
        demo.add("worm", worm, Bend)?;
        let ripple = Wave {
            speed: 1.0,
            ..Wave::default()
        };
        let sink = Drift {
            velocity: [0.0, 0.0, -0.7],
        };
        let knot = stand_in(n).mapped(|p| p.map(|x| x * 1.1));
        demo.add("knot", knot, ((ripple, Place([0.05, 0.25, 0.7])), sink))?;
        let twist = Twist { axis: 0, rate: 6.0 };
        let approach = Drift {
            velocity: [-2.1, 0.0, 0.0],
        };
        let bumpy = bumpy_ball(n, 0.3).scaled(0.7);
        demo.add("ball", bumpy, ((twist, Place([2.2, 0.45, 0.1])), approach))?;
        Ok(demo)
    }

    fn add(
        &mut self,
        name: &'static str,
        model: Model,
        deform: impl Deform + Send + 'static,
    ) -> Result<(), Error> {
        let Model {
            positions,
            elements,
        } = model;
        let rest = positions.clone();
        let id = self.scene.add((elements, positions))?;
        self.actors.push(Actor {
            id,
            name,
            rest,
            motion: Box::new(deform),
        });
        Ok(())
    }

    /// Sets all positions to those of a frame.
    pub fn pose(&mut self, frame: u32, n_frames: u32) -> Result<(), Error> {
        let t = frame as f32 / n_frames.saturating_sub(1).max(1) as f32;
        for actor in &self.actors {
            let now = self.scene.positions_mut::<f32>(actor.id)?;
            actor.motion.pose(&actor.rest, t, now);
        }
        Ok(())
    }

    /// The bodies in their last pose.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The bodies and their names.
    pub fn bodies(&self) -> Vec<(BodyId, &str)> {
        self.actors
            .iter()
            .map(|actor| (actor.id, actor.name))
            .collect()
    }

    /// The number of triangles in all bodies.
    pub fn n_triangles(&self) -> usize {
        self.scene.bodies().map(|(_, body)| body.n_elements()).sum()
    }
}

/// Moves all vertices by a vector, whatever the time.
struct Place([f32; 3]);

impl Deform for Place {
    fn at(&self, p: [f32; 3], _t: f32) -> [f32; 3] {
        std::array::from_fn(|axis| p[axis] + self.0[axis])
    }
}

/// Bends the x axis into an arc of the same length in the plane of x and y, from almost straight at
/// time 0 to more than a full turn at time 1, so that both ends run into each other.
struct Bend;

impl Deform for Bend {
    fn at(&self, [x, y, z]: [f32; 3], t: f32) -> [f32; 3] {
        let turns = 0.05 + 1.1 * t;
        let curvature = turns * TAU / WORM_LENGTH;
        let radius = curvature.recip();
        let (sin, cos) = (curvature * x).sin_cos();
        [(radius - y) * sin, radius - (radius - y) * cos, z]
    }
}
