//! Asks the library, and keeps its answer.

use std::time::Instant;

use impinge::{Detector, Method, PairKind, Pairs, Query, Scene, Settings};
use impinge_render::wgpu;

use crate::options::{Backend, Question};
use crate::stage::Stage;

/// More pairs than this are an error, not an answer: no window can show them.
const MAX_PAIRS: u64 = 20_000_000;

/// The oracle compares every box with every box: beyond this number of elements it would stop the
/// window.
pub(crate) const MAX_NAIVE: usize = 40_000;

/// The answer for one frame.
pub(crate) struct Answer {
    pub pairs: Pairs,
    /// The colliding elements of each body.
    pub colliding: Vec<Vec<u32>>,
    pub ms: f64,
    /// Method, backend and threads, for the user.
    pub how: String,
}

/// A detector for the last question.
#[derive(Default)]
pub(crate) struct Finder {
    detector: Option<((Method, Backend), Detector)>,
}

impl Finder {
    /// Finds the pairs of a scene.
    pub fn find(
        &mut self,
        stage: &Stage,
        question: &Question,
        device: &(wgpu::Device, wgpu::Queue),
    ) -> Result<Answer, String> {
        self.find_on(stage, question, Some(device))
    }

    /// The same on the CPU, whatever the question says.
    pub fn find_on_cpu(&mut self, stage: &Stage, question: &Question) -> Result<Answer, String> {
        self.find_on(stage, question, None)
    }

    /// The detector, if it answers on the device of the window.
    pub fn on_device(&mut self) -> Option<&mut Detector> {
        let ((_, backend), detector) = self.detector.as_mut()?;
        (*backend == Backend::Gpu).then_some(detector)
    }

    fn find_on(
        &mut self,
        stage: &Stage,
        question: &Question,
        device: Option<&(wgpu::Device, wgpu::Queue)>,
    ) -> Result<Answer, String> {
        let scene = stage.scene();
        let n_elements: usize = scene.bodies().map(|(_, body)| body.n_elements()).sum();
        if question.method == Method::Naive && n_elements > MAX_NAIVE {
            return Err(format!(
                "the method naive is for at most {MAX_NAIVE} elements, there are {n_elements}"
            ));
        }
        let started = Instant::now();
        let detector = self.detector(question, device)?;
        let pairs = detector.detect(scene, &question.query()).map_err(|error| {
            // A detector whose device is lost finds nothing again.
            self.detector = None;
            error.to_string()
        })?;
        let ms = started.elapsed().as_secs_f64() * 1e3;
        let stats = pairs.stats();
        Ok(Answer {
            colliding: stage
                .content
                .bodies
                .iter()
                .map(|shown| pairs.colliding(shown.id))
                .collect(),
            how: format!("{} on {}", stats.method, stats.backend),
            ms,
            pairs,
        })
    }

    fn detector(
        &mut self,
        question: &Question,
        device: Option<&(wgpu::Device, wgpu::Queue)>,
    ) -> Result<&mut Detector, String> {
        let key = (question.method, question.backend);
        let detector = match self.detector.take() {
            Some((held, detector)) if held == key => detector,
            _ => {
                let settings = Settings::new()
                    .method(question.method)
                    .max_pairs(Some(MAX_PAIRS))
                    .backend(impinge::Backend::Cpu);
                let settings = match (question.backend, device) {
                    (Backend::Gpu, Some((device, queue))) => {
                        settings.on_device(device.clone(), queue.clone())
                    }
                    _ => settings,
                };
                Detector::new(settings).map_err(|error| error.to_string())?
            }
        };
        Ok(&mut self.detector.insert((key, detector)).1)
    }
}

/// A detector on one thread of the CPU: for work beside the window.
pub(crate) fn quiet_detector() -> Result<Detector, impinge::Error> {
    Detector::new(
        Settings::new()
            .backend(impinge::Backend::Cpu)
            .threads(1)
            .max_pairs(Some(MAX_PAIRS)),
    )
}

/// The intersection curves as segments.
pub(crate) fn curves(scene: &Scene, pairs: &Pairs) -> Result<Vec<[[f64; 3]; 2]>, String> {
    let mut detector = quiet_detector().map_err(|error| error.to_string())?;
    let contacts = detector.contacts(scene, pairs);
    let contacts = contacts.map_err(|error| error.to_string())?;
    let curves = contacts.curves().map_err(|error| error.to_string())?;
    let segments = (0..curves.len()).flat_map(|curve| curves.segments(curve));
    Ok(segments
        .map(|ends| ends.map(|point| contacts.points()[point as usize]))
        .collect())
}

/// The distance of a point from the nearest other body, and which that is; `None` if there is no
/// other.
pub(crate) fn nearest(
    detector: &mut Detector,
    stage: &Stage,
    body: usize,
    point: [f64; 3],
) -> Result<Option<(usize, f64)>, String> {
    let bodies = &stage.content.bodies;
    let others = bodies.iter().map(|shown| shown.id);
    let others = others.filter(|&id| stage.id(body) != Some(id));
    let query = Query::across(others);
    let closest = detector
        .closest(stage.scene(), &[point], f64::INFINITY, &query)
        .map_err(|error| error.to_string())?;
    let nearest = closest.iter().next().flatten();
    Ok(nearest.and_then(|found| {
        let body = bodies
            .iter()
            .position(|shown| shown.id == found.element.body)?;
        Some((body, found.distance))
    }))
}

/// The faces of each body that are within a distance of another one's, as elements of triangle
/// bodies; pairs of faces that intersect are among them. Also the number of pairs.
pub(crate) fn near(
    stage: &Stage,
    question: &Question,
    distance: f64,
) -> Result<(Vec<Vec<u32>>, usize), String> {
    let query = question.query().kinds([PairKind::FaceFace]);
    let mut detector = quiet_detector().map_err(|error| error.to_string())?;
    let pairs = detector
        .near(stage.scene(), distance, &query)
        .map_err(|error| error.to_string())?;
    let near = stage.content.bodies.iter().map(|shown| {
        let elements = pairs
            .iter()
            .flat_map(|pair| [pair.a, pair.b])
            .filter(|element| element.body == shown.id);
        let mut faces: Vec<u32> = elements.map(|element| element.element).collect();
        faces.sort_unstable();
        faces.dedup();
        let is_tetrahedra = stage
            .scene()
            .body(shown.id)
            .is_ok_and(|body| body.kind() == impinge::BodyKind::Tetrahedra);
        // Boundary faces of tetrahedra have numbers of their own; such bodies keep their colours.
        match is_tetrahedra {
            true => Vec::new(),
            false => faces,
        }
    });
    Ok((near.collect(), pairs.len()))
}
