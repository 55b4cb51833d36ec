//! A cloth falls on a ball that breathes: in each frame which elements intersect and how near the
//! two are, then the step to the next frame as far as it is free. `examples/cloth-on-ball` has the
//! same program in other languages, and what all of them print.

use impinge::{Backend, Body, Detector, Positions, Query, Scene, read};

/// The positions, changed one by one.
fn changed(positions: &Positions, change: impl Fn([f64; 3]) -> [f64; 3]) -> Vec<[f64; 3]> {
    match positions {
        Positions::F64(rows) => rows.iter().copied().map(change).collect(),
        Positions::F32(_) => unreachable!("numbers in text are read in double precision"),
    }
}

fn fall(cloth: &Body) -> Vec<[f64; 3]> {
    changed(cloth.positions(), |[x, y, z]| [x, y, z - 0.03125])
}

fn breathe(ball: &Positions, frame: usize) -> Vec<[f64; 3]> {
    let size = [1.0, 1.015625, 1.03125, 1.015625][frame % 4];
    changed(ball, |position| position.map(|x| x * size))
}

fn main() -> Result<(), impinge::Error> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/cloth-on-ball");
    let mut scene = Scene::new();
    let cloth = scene.add(read(format!("{folder}/cloth.obj"))?)?;
    let ball = scene.add(read(format!("{folder}/ball.obj"))?)?;
    let rest = scene.body(ball)?.positions().clone();
    let mut detector = Detector::new(Backend::Cpu)?;
    let query = Query::all().clearance(1e-4);
    for frame in 0..10 {
        let pairs = detector.detect(&scene, &query)?;
        let nearest = detector.distance(&scene, cloth, ball)?;
        println!(
            "{frame}: {} pairs, {} in the cloth, {:.9} apart",
            pairs.between(cloth, ball).count(),
            pairs.self_of(cloth).count(),
            nearest.map_or(f64::INFINITY, |nearest| nearest.distance),
        );
        let end = fall(scene.body(cloth)?);
        scene.set_end_positions(cloth, end)?; // taken over, not copied
        scene.set_end_positions(ball, breathe(&rest, frame))?;
        detector.advance(&scene, &query)?.apply(&mut scene)?;
    }
    Ok(())
}
