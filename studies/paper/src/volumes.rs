//! The volume benchmarks of table 2 and figure 6: solids of finite elements, one dropped on the
//! other.
//!
//! The simulation runs first, and its positions are recorded for every step. Then all contestants
//! find the pairs of the same steps.

use impinge::{BodyId, Detector, Scene};
use impinge_fem::Simulation;
use impinge_fem::scenes::{drop_scene, drop_scene_of};

use crate::control::Control;
use crate::course::Course;
use crate::error::Error;
use crate::finders::Place;
use crate::options::{Options, SceneName};
use crate::report::Moment;
use crate::samples::Samples;

/// A simulation that has been run.
pub(crate) struct Recorded {
    name: SceneName,
    mesh: String,
    is_stand_in: bool,
    scene: Scene,
    bodies: [BodyId; 2],
    /// For each step, the positions of each body, in f32 as the detector got them.
    frames: Vec<[Vec<[f32; 3]>; 2]>,
    /// The time of a step without detection, in milliseconds.
    pub simulation_ms: Samples,
}

impl Recorded {
    /// Simulates a volume benchmark; `None` for the name of a surface.
    pub fn new(
        name: SceneName,
        options: &Options,
        control: &Control<'_>,
    ) -> Result<Option<Self>, Error> {
        let Some(solid) = name.solid() else {
            return Ok(None);
        };
        let given = options.mesh(name);
        let dropped = match given {
            Some(path) => drop_scene_of(path)?,
            None => drop_scene(solid)?,
        };
        let mut settings = dropped.settings.clone();
        settings.threads = options.n_threads;
        let mut simulation = Simulation::new(&dropped.solids, settings)?;
        let &[lower, upper] = simulation.bodies() else {
            return Ok(None);
        };
        let place = Place::Cpu {
            n_threads: options.n_threads,
        };
        let mut detector = Detector::new(place.settings())?;
        let what = format!("{}, simulation", name.name());
        let n_frames = options.n_frames(name);
        let mut frames = Vec::with_capacity(n_frames);
        let mut times = Vec::with_capacity(n_frames);
        detector.set_control(impinge::Control::new().cancel(control.cancel));
        for frame in 0..n_frames {
            control.go_on()?;
            let shown = |body| simulation.shown(body).map(<[_]>::to_vec);
            frames.push([shown(lower)?, shown(upper)?]);
            let pairs = simulation.detect(&mut detector)?;
            times.push(simulation.advance(&pairs)?.advance_ms);
            control.report(&what, frame + 1, n_frames);
        }
        Ok(Some(Recorded {
            name,
            mesh: match given {
                Some(path) => format!("`{}`", path.display()),
                None if dropped.is_stand_in => {
                    format!("**a generated stand-in**: {}", dropped.label)
                }
                None => dropped.label,
            },
            is_stand_in: dropped.is_stand_in,
            scene: simulation.scene().clone(),
            bodies: [lower, upper],
            frames,
            simulation_ms: Samples::of(times),
        }))
    }
}

impl Course for Recorded {
    fn name(&self) -> SceneName {
        self.name
    }

    fn mesh(&self) -> &str {
        &self.mesh
    }

    fn motion(&self) -> String {
        "one dropped on the other".to_owned()
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
        self.frames.len()
    }

    /// The first step with a third of the largest number of pairs: at the maximum, bodies are
    /// crushed beyond recognition.
    fn picture_frame(&self, moments: &[Moment]) -> usize {
        let most = moments.iter().map(|moment| moment.n_pairs).max();
        let enough = |moment: &Moment| 3 * moment.n_pairs >= most.unwrap_or(0);
        let first = moments.iter().find(|moment| enough(moment));
        first.map_or(0, |moment| moment.frame)
    }

    fn pose(&mut self, frame: usize) -> Result<(), Error> {
        for (positions, body) in self.frames[frame].iter().zip(self.bodies) {
            self.scene.set_positions(body, positions)?;
        }
        Ok(())
    }
}
