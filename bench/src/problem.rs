//! The problem that is measured: bodies, a query, and the poses of the frames.

use std::sync::Arc;

use impinge::{Backend, Detector, Elements, Method, Query, Scene, Settings, SharedVertex};
use impinge_scenes::deform::Deform;
use impinge_scenes::{BuiltScene, Model};

use crate::Failure;

/// The query about the bodies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ask {
    /// Pairs between the first and the second body.
    Between,
    /// Self-collision of the only body, without pairs that share a vertex.
    Within,
    /// Self-collision of the only body, and of pairs that share a vertex those that meet in more.
    Resolved,
    /// Pairs of different bodies.
    All,
}

/// One body.
#[derive(Debug, Clone)]
pub struct Body {
    /// Its elements.
    pub elements: Arc<Elements>,
    /// Its positions in each pose; all bodies have equally many poses.
    pub poses: Vec<Vec<[f32; 3]>>,
}

/// A scene to be measured.
#[derive(Debug, Clone)]
pub struct Problem {
    /// Its name in tables.
    pub name: String,
    /// The origin of the meshes, and a description of the poses.
    pub about: String,
    /// The bodies.
    pub bodies: Vec<Body>,
    /// The query.
    pub ask: Ask,
    /// The number of pairs in every pose, if it is the same in all poses and known.
    pub expected: Option<u64>,
}

impl Problem {
    /// A problem whose second pose is the mirror image of the first, x to -x. Changing a sign is
    /// exact, so both poses have the same pairs, and yet every vertex moves in every frame: nothing
    /// static can be exploited.
    pub fn mirrored(name: &str, models: Vec<Model>, ask: Ask) -> Problem {
        Problem::new(name, models, ask, |_, positions| {
            let mirror = positions.iter().map(|&[x, y, z]| [-x, y, z]).collect();
            vec![positions, mirror]
        })
    }

    /// A problem whose last body moves to and fro along x: `n_steps` steps of length `step` each
    /// way, around its place. The other bodies stay, but their positions are rewritten too. The
    /// pairs of the poses differ.
    pub fn passing(name: &str, models: Vec<Model>, ask: Ask, step: f32, n_steps: usize) -> Problem {
        let last = models.len().saturating_sub(1);
        let middle = n_steps as f32 / 2.0;
        Problem::new(name, models, ask, |ix, rest| {
            (0..2 * n_steps)
                .map(|pose| {
                    let n = pose.min(2 * n_steps - pose) as f32 - middle;
                    let offset = if ix == last { n * step } else { 0.0 };
                    rest.iter().map(|&[x, y, z]| [x + offset, y, z]).collect()
                })
                .collect()
        })
    }

    /// A problem whose poses are two moments of a motion. Their pairs differ.
    pub fn moving(
        name: &str,
        models: Vec<Model>,
        ask: Ask,
        motion: &impl Deform,
        times: [f32; 2],
    ) -> Problem {
        Problem::new(name, models, ask, |_, rest| {
            let pose = |t| {
                let mut now = rest.clone();
                motion.apply(&rest, t, &mut now);
                now
            };
            times.map(pose).to_vec()
        })
    }

    fn new(
        name: &str,
        models: Vec<Model>,
        ask: Ask,
        poses: impl Fn(usize, Vec<[f32; 3]>) -> Vec<Vec<[f32; 3]>>,
    ) -> Problem {
        let bodies = models
            .into_iter()
            .enumerate()
            .map(|(ix, model)| Body {
                poses: poses(ix, model.positions),
                elements: Arc::new(model.elements),
            })
            .collect();
        Problem {
            name: name.to_owned(),
            about: String::new(),
            bodies,
            ask,
            expected: None,
        }
    }

    /// Sets the description.
    pub fn about(mut self, about: impl Into<String>) -> Problem {
        self.about = about.into();
        self
    }

    /// Sets the expected number of pairs.
    pub fn expecting(mut self, n_pairs: Option<u64>) -> Problem {
        self.expected = n_pairs;
        self
    }

    /// Counts the pairs by the oracle, if their number is not known and the problem is small
    /// enough.
    pub fn by_oracle(self) -> Result<Problem, Failure> {
        const MAX_ELEMENTS: usize = 60_000;
        if self.expected.is_some() || self.n_elements() > MAX_ELEMENTS {
            return Ok(self);
        }
        let (scene, _, query) = self.scene()?;
        let mut oracle =
            Detector::new(Settings::new().method(Method::Naive).backend(Backend::Cpu))?;
        let n_pairs = oracle.detect(&scene, &query)?.len() as u64;
        let about = format!("{}; pairs counted by the oracle in this run", self.about);
        Ok(self.about(about).expecting(Some(n_pairs)))
    }

    /// How many poses there are.
    pub fn n_poses(&self) -> usize {
        self.bodies.first().map_or(1, |body| body.poses.len())
    }

    /// The number of elements in all bodies.
    pub fn n_elements(&self) -> usize {
        self.bodies.iter().map(|body| body.elements.len()).sum()
    }

    /// The library's scene and query for the problem.
    pub fn scene(&self) -> Result<(Scene, Vec<impinge::BodyId>, Query), Failure> {
        let mut scene = Scene::new();
        let ids = self
            .bodies
            .iter()
            .map(|body| scene.add((Elements::clone(&body.elements), body.poses[0].clone())))
            .collect::<Result<Vec<_>, _>>()?;
        let query = match (self.ask, &ids[..]) {
            (Ask::Between, [a, b]) => Query::between(*a, *b),
            (Ask::Within, [a]) => Query::self_of(*a).shared_vertex(SharedVertex::Skip),
            (Ask::Resolved, [a]) => Query::self_of(*a).shared_vertex(SharedVertex::Resolve),
            (Ask::All, _) => Query::between_all(),
            (ask, _) => return Err(format!("{ask:?} does not fit {} bodies", ids.len()).into()),
        };
        Ok((scene, ids, query))
    }
}

/// The models of a built scene, to be posed again.
pub fn models(built: BuiltScene) -> Result<Vec<Model>, Failure> {
    built
        .bodies
        .iter()
        .map(|&id| {
            let body = built.scene.body(id)?;
            match body.positions() {
                impinge::Positions::F32(positions) => Ok(Model {
                    positions: positions.to_vec(),
                    elements: body.elements().clone(),
                }),
                impinge::Positions::F64(_) => Err("scenes are built in single precision".into()),
            }
        })
        .collect()
}

/// A built scene as a problem: pairs between the bodies for two bodies, all pairs for more.
pub fn posed(built: BuiltScene, about: &str) -> Result<Problem, Failure> {
    let name = built.name.clone();
    let models = models(built)?;
    let ask = if models.len() == 2 {
        Ask::Between
    } else {
        Ask::All
    };
    Ok(Problem::mirrored(&name, models, ask).about(about))
}
