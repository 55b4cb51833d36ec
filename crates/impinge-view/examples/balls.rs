//! Two balls that wave and drift through each other.
//!
//! `cargo run --release --example balls [triangles per ball] [frames to measure]`

use std::error::Error;
use std::sync::Arc;

use impinge::{BodyId, Positions, Scene};
use impinge_render::Colors;
use impinge_scenes::deform::{Deform, Drift, Wave};
use impinge_scenes::surfaces::ball;
use impinge_view::{Content, Frames, Options, Shown, show};

const N_FRAMES: usize = 240;

struct Drifting {
    bodies: [BodyId; 2],
    rest: [Vec<[f32; 3]>; 2],
}

impl Frames for Drifting {
    fn n_frames(&self) -> usize {
        N_FRAMES
    }

    fn read(&self, frame_ix: usize) -> Result<Vec<(BodyId, Positions)>, String> {
        let t = frame_ix as f32 / N_FRAMES as f32;
        let wave = Wave {
            speed: 1.0,
            ..Wave::default()
        };
        let drift = Drift {
            velocity: [-2.4, 0.0, 0.0],
        };
        let pose = |rest: &Vec<[f32; 3]>, deform: &dyn Fn([f32; 3]) -> [f32; 3]| -> Positions {
            let moved: Vec<[f32; 3]> = rest.iter().map(|&point| deform(point)).collect();
            moved.into()
        };
        let still = pose(&self.rest[0], &|point| wave.at(point, t));
        let drifting = pose(&self.rest[1], &|point| (wave, drift).at(point, t));
        Ok(vec![(self.bodies[0], still), (self.bodies[1], drifting)])
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut numbers = std::env::args().skip(1);
    let n_triangles = numbers.next().map_or(Ok(15_000), |word| word.parse())?;
    let measure = numbers.next().map(|word| word.parse()).transpose()?;
    let options = Options {
        within: Some(true),
        size: [1100, 720],
        measure,
        ..Options::default()
    };
    show(move || content(n_triangles), options)?;
    Ok(())
}

fn content(n_triangles: usize) -> Result<Content, String> {
    let mut scene = Scene::new();
    let models = [
        ball(n_triangles),
        ball(n_triangles).translated([1.2, 0.2, 0.1]),
    ];
    let colors = [[214, 39, 40], [27, 95, 217]].map(|colliding| Colors {
        colliding,
        other: [200; 3],
    });
    let mut bodies = Vec::new();
    for (model, colors) in models.iter().zip(colors) {
        let id = model
            .add_to(&mut scene)
            .map_err(|error| error.to_string())?;
        bodies.push(Shown {
            id,
            name: format!("ball {}", bodies.len()),
            colors,
            vertices: None,
        });
    }
    let frames = Drifting {
        bodies: [bodies[0].id, bodies[1].id],
        rest: models.map(|model| model.positions),
    };
    Ok(Content {
        scene,
        bodies,
        frames: Some(Arc::new(frames)),
        missing: None,
    })
}
