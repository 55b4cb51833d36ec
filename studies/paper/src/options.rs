//! Options of a run.

use std::path::PathBuf;

use serde::Serialize;

use crate::error::Error;

/// A benchmark of the paper: surfaces of table 1, solids of table 2.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum SceneName {
    /// Two balls of 15,000 triangles.
    Ball,
    /// Two bunnies of 69,451 triangles.
    Bunny,
    /// Two buddhas of 100,000 triangles.
    Buddha,
    /// Two dragons of 400,000 triangles.
    Dragon,
    /// Two bunnies of 7,356 tetrahedra.
    Bunny7k,
    /// Two bunnies of 19,379 tetrahedra.
    Bunny19k,
    /// Two dragons of 8,408 tetrahedra.
    Dragon8k,
    /// Two dragons of 15,047 tetrahedra.
    Dragon15k,
}

impl SceneName {
    /// All benchmarks, in the order of the paper.
    pub const ALL: [SceneName; 8] = [
        SceneName::Ball,
        SceneName::Bunny,
        SceneName::Buddha,
        SceneName::Dragon,
        SceneName::Bunny7k,
        SceneName::Bunny19k,
        SceneName::Dragon8k,
        SceneName::Dragon15k,
    ];

    /// The name on the command line: `"ball"`, `"bunny-7k"` and so on.
    pub fn name(self) -> &'static str {
        match self {
            SceneName::Ball => "ball",
            SceneName::Bunny => "bunny",
            SceneName::Buddha => "buddha",
            SceneName::Dragon => "dragon",
            SceneName::Bunny7k => "bunny-7k",
            SceneName::Bunny19k => "bunny-19k",
            SceneName::Dragon8k => "dragon-8k",
            SceneName::Dragon15k => "dragon-15k",
        }
    }

    /// The scene of this name.
    pub fn named(name: &str) -> Option<Self> {
        SceneName::ALL
            .into_iter()
            .find(|scene| scene.name() == name)
    }

    /// Whether its bodies are solids of tetrahedra.
    pub fn is_volume(self) -> bool {
        self.solid().is_some()
    }

    /// The scene of finite elements behind a volume benchmark.
    pub(crate) fn solid(self) -> Option<impinge_fem::scenes::SceneName> {
        use impinge_fem::scenes::SceneName as Solid;
        match self {
            SceneName::Bunny7k => Some(Solid::Bunny7k),
            SceneName::Bunny19k => Some(Solid::Bunny19k),
            SceneName::Dragon8k => Some(Solid::Dragon8k),
            SceneName::Dragon15k => Some(Solid::Dragon15k),
            _ => None,
        }
    }
}

/// Where detection runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Backends {
    /// The CPU, and a GPU if there is one; a software driver suffices.
    #[default]
    Found,
    /// Only the CPU.
    Cpu,
    /// Only a GPU; an error if there is none.
    Gpu,
    /// Both; an error if there is no GPU.
    Both,
}

/// How surfaces wave: a travelling sine displacement. Lengths are shares of the box diagonal of a
/// body.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Waving {
    /// How far a vertex moves to either side.
    pub amplitude: f32,
    /// The distance from crest to crest, above 0.
    pub wave_length: f32,
    /// How far crests travel in the whole run.
    pub speed: f32,
}

impl Default for Waving {
    fn default() -> Self {
        Waving {
            amplitude: 0.02,
            wave_length: 0.25,
            speed: 0.5,
        }
    }
}

/// Options of a run.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// The benchmarks to run; an empty list means all.
    pub scenes: Vec<SceneName>,
    /// Meshes for benchmarks, used instead of scans.
    pub meshes: Vec<(SceneName, PathBuf)>,
    /// Few frames of each benchmark, to check that all agree. Times are not meaningful.
    pub is_quick: bool,
    /// Frames of each surface benchmark and steps of each volume benchmark.
    pub n_frames: Option<usize>,
    /// The λ to report beside the paper's, instead of the fastest one.
    pub lambda: Option<f64>,
    /// CPU threads; 0 means one per core.
    pub n_threads: usize,
    /// Where detection runs.
    pub backends: Backends,
    /// A part of the GPU's name, to choose among several.
    pub device: Option<String>,
    /// How surfaces wave.
    pub waving: Waving,
}

impl Options {
    /// Whether to run a benchmark.
    pub(crate) fn wants(&self, scene: SceneName) -> bool {
        self.scenes.is_empty() || self.scenes.contains(&scene)
    }

    /// The mesh file given for a benchmark.
    pub(crate) fn mesh(&self, scene: SceneName) -> Option<&PathBuf> {
        let given = self.meshes.iter().rev().find(|(name, _)| *name == scene);
        given.map(|(_, path)| path)
    }

    /// Frames of a benchmark.
    pub(crate) fn n_frames(&self, scene: SceneName) -> usize {
        self.n_frames
            .unwrap_or(match (self.is_quick, scene.is_volume()) {
                (false, false) => 100,
                (false, true) => 240,
                (true, false) => 5,
                (true, true) => 20,
            })
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        let refuse = |what: &str| Err(Error::Options(what.to_owned()));
        if self.n_frames == Some(0) {
            return refuse("at least one frame is needed");
        }
        let Waving {
            amplitude,
            wave_length,
            speed,
        } = self.waving;
        if !(amplitude >= 0.0 && amplitude.is_finite()) {
            return refuse("the amplitude of the wave must be a number, 0 or more");
        }
        if !(wave_length > 0.0 && wave_length.is_finite()) {
            return refuse("the wave length must be a number above 0");
        }
        if !speed.is_finite() {
            return refuse("the speed of the wave must be a finite number");
        }
        if let Some((scene, _)) = self.meshes.iter().find(|(scene, _)| !self.wants(*scene)) {
            return Err(Error::Options(format!(
                "a mesh is given for {}, which is not among the scenes",
                scene.name()
            )));
        }
        Ok(())
    }
}
