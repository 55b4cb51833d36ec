//! probe
#![allow(dead_code, missing_docs)]
mod contest;
mod control;
mod error;
mod finders;
mod machine;
mod options;
pub mod published;
mod report;
mod samples;
mod scenes;
pub use control::{Control, Progress};
pub use error::Error;
pub use options::*;

#[test]
fn probe() {
    let o = Options::default();
    for name in [SceneName::Ball, SceneName::Bunny, SceneName::Buddha, SceneName::Dragon] {
        let mut m = scenes::Moving::new(name, &o).unwrap();
        println!("{} {}", m.mesh, m.is_stand_in);
        let mut d = impinge::Detector::new(impinge::Backend::Cpu).unwrap();
        let mut c = impinge::Detector::with_settings(impinge::Settings{method: impinge::Method::Cells, backend: impinge::Backend::Cpu, ..Default::default()}).unwrap();
        let mut sum = 0;
        for f in 0..=35 {
            m.pose(f, 36).unwrap();
            let p = d.detect(&m.scene, &m.query).unwrap();
            let ct: usize = m.bodies.iter().map(|&b| p.colliding(b).len()).sum();
            sum += ct;
            let s = c.detect(&m.scene, &m.query).unwrap().stats().clone();
            print!("{:.2}: {ct} mean {} cells {:?} sub {}; ", 1.0 - 0.02*f as f32, sum/(f+1), s.grid.map(|g| g.iter().product::<u32>()), s.n_subdivided);
        }
        println!();
    }
}
