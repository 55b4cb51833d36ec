//! Prints the launches of a frame by both methods of a device, and those of a step, one line each.
//!
//! `cargo run -p impinge-tests --example gpu_launches`

use impinge_core::{Backend, Detector, Error, Method, Query, Scene, Settings};
use impinge_scenes::surfaces;

fn main() -> Result<(), Error> {
    let mut scene = Scene::new();
    let ball = surfaces::ball(3000);
    for offset in [0.0, 0.9] {
        ball.translated([offset, 0.0, 0.0]).add_to(&mut scene)?;
    }
    for method in [Method::Clusters, Method::Cells] {
        let settings = Settings::new().method(method).backend(Backend::Gpu);
        let mut detector = Detector::new(settings)?;
        detector.detect(&scene, &Query::between_all())?;
        if let Some(recording) = detector.recording() {
            println!("{}\n{recording}", method.name());
        }
    }
    let mut detector = Detector::new(Backend::Gpu)?;
    detector.impacts(&scene, &Query::all())?;
    if let Some(recording) = detector.recording() {
        println!("a step\n{recording}");
    }
    Ok(())
}
