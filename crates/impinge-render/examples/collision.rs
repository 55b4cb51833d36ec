//! The picture of the README: a knot and a wavy ring, with colliding triangles in red and blue.
//!
//! `cargo run --release -p impinge-render --example collision -- docs/images/collision.png`

use impinge::{Backend, Detector, Query, Scene};
use impinge_render::{Camera, Colors, Picture, Surface, UpAxis};
use impinge_scenes::surfaces::{Knot, torus, torus_knot};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("give a file to write to")?;
    let knot = torus_knot(
        6_000,
        Knot {
            swelling: 0.0,
            ..Knot::default()
        },
    );
    let ring = torus(180, 22, 0.27, 0.042).mapped(|[x, y, z]| {
        let turn = y.atan2(x);
        [x, y, z + 0.09 + 0.05 * (5.0 * turn).sin()]
    });

    let mut scene = Scene::new();
    let (knot, ring) = (knot.add_to(&mut scene)?, ring.add_to(&mut scene)?);
    let mut detector = Detector::new(Backend::Auto)?;
    let pairs = detector.detect(&scene, &Query::between(knot, ring))?;

    let mut picture = Picture {
        camera: Camera {
            azimuth: 50.0,
            elevation: 55.0,
            up: UpAxis::Z,
            ..Camera::default()
        },
        size: [1000, 640],
        see_through: 0.25,
        background: [[255; 3]; 2],
        ..Picture::default()
    };
    for (body, colliding, other) in [
        (knot, [214, 39, 40], [206, 206, 206]),
        (ring, [27, 95, 217], [172, 178, 188]),
    ] {
        let colors = Colors { colliding, other };
        let surface = Surface::of_body(scene.body(body)?, &pairs.colliding(body), colors)?;
        picture.surfaces.push(surface);
    }
    picture.draw()?.write_png(&path)?;
    println!("{path}: {} pairs", pairs.len());
    Ok(())
}
