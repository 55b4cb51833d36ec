//! Points and rays: every decision held against rational arithmetic.

mod cast;
mod closest;
mod inside;
mod oracle;

use impinge_core::{Backend, BodyId, Detector, Elements, InstructionSet, Scene, Settings};
use impinge_scenes::surfaces;

/// The surface of each body, element by element.
fn elements(scene: &Scene) -> Vec<(BodyId, u32, Vec<[f64; 3]>)> {
    let mut all = Vec::new();
    for (id, body) in scene.bodies() {
        let elements = match body.faces().is_empty() {
            false => body.faces(),
            true => body.elements(),
        };
        for element in 0..elements.len() {
            let corners = elements.corners(element).iter();
            let points = corners.map(|&vertex| body.positions().point(vertex as usize));
            all.push((id, element as u32, points.collect()));
        }
    }
    all
}

/// Detectors of all instruction sets and two numbers of threads, which stand beside them.
fn detectors() -> impl Iterator<Item = (usize, Detector)> {
    InstructionSet::ALL.into_iter().flat_map(|instruction_set| {
        [1, 4].map(|threads| {
            let settings = Settings::new().instruction_set(instruction_set);
            let settings = settings.threads(threads).backend(Backend::Cpu);
            (threads, Detector::new(settings).unwrap())
        })
    })
}

/// However short the last question was: one point takes so little time that helpers would come too
/// late, ten thousand are worth waking them.
#[test]
fn many_points_wake_helpers() {
    let mut scene = Scene::new();
    let ball = surfaces::icosphere(3);
    let Elements::Triangles(faces) = &ball.elements else {
        unreachable!()
    };
    let body = scene.add_triangles(faces, &ball.positions).unwrap();
    let settings = Settings::new().backend(Backend::Cpu).threads(2);
    let mut detector = Detector::new(settings).unwrap();
    let points = vec![[0.1f32, 0.2, 0.3]; 10_000];
    for _ in 0..3 {
        detector.contains(&scene, body, &points[..1]).unwrap();
        // Helpers that are awake stay so for a millisecond.
        std::thread::sleep(std::time::Duration::from_millis(5));
        detector.contains(&scene, body, &points).unwrap();
        assert!(detector.stats().ways.wakes);
    }
}
