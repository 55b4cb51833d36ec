//! `impinge distance`: the smallest distance between two meshes.

use std::io::Write;
use std::time::Instant;

use impinge::proximity::Nearest;
use impinge::{Backend, BodyId, CancelToken, Control, Detector, Elements, Query, Scene};
use impinge_io::printable;
use serde_json::json;

use crate::args::DistanceArgs;
use crate::error::Error;
use crate::load::{Bodies, Loading};
use crate::output::out;

/// `impinge distance`.
pub fn distance(args: &DistanceArgs, cancel: &CancelToken) -> Result<(), Error> {
    let loading = Loading::as_they_are(!args.json, cancel);
    let paths = [args.a.clone(), args.b.clone()];
    let Bodies {
        scene, ids, names, ..
    } = Bodies::read(&paths, loading)?;
    let start = Instant::now();
    let mut detector = Detector::new(Backend::Cpu)?;
    let control = Control::new().cancel(cancel);
    let nearest = detector.distance_with(&scene, ids[0], ids[1], &control)?;
    let ms = start.elapsed().as_secs_f64() * 1e3;
    let Some(Nearest {
        distance,
        primitives: [a, b],
        points,
        ..
    }) = nearest
    else {
        return Err(Error::Usage(
            "a mesh without primitives has no distance".to_owned(),
        ));
    };
    // Primitives that touch have no nearest points, but points in common.
    let points = match points {
        None if distance == 0.0 => {
            shared_point(&mut detector, &scene, [ids[0], ids[1]], [a, b])?.map(|point| [point; 2])
        }
        points => points,
    };
    let mut to = out();
    if args.json {
        let object = json!({
            "distance": distance,
            "primitives": [a, b],
            "points": points,
            "ms": ms,
        });
        writeln!(to, "{object}")?;
        return Ok(());
    }
    writeln!(to, "distance {distance}")?;
    for (side, primitive) in [a, b].into_iter().enumerate() {
        let name = printable(&names[side]);
        match points.map(|points| points[side]) {
            Some([x, y, z]) => writeln!(to, "primitive {primitive} of {name} at {x} {y} {z}")?,
            None => writeln!(to, "primitive {primitive} of {name}")?,
        }
    }
    Ok(())
}

/// A point that two primitives share: rounded where their surfaces cross, else a corner of the inner one of two tetrahedra.
fn shared_point(
    detector: &mut Detector,
    scene: &Scene,
    ids: [BodyId; 2],
    primitives: [u32; 2],
) -> Result<Option<[f64; 3]>, Error> {
    let mut corners: [Vec<[f64; 3]>; 2] = Default::default();
    for side in 0..2 {
        let body = scene.body(ids[side])?;
        let vertices = body.elements().corners(primitives[side] as usize);
        let points = vertices
            .iter()
            .map(|&vertex| body.positions().point(vertex as usize));
        corners[side] = points.collect();
    }
    let pairs = |detector: &mut Detector, elements: [Elements; 2]| {
        let mut scene = Scene::new();
        let [a, b] = elements;
        let a = scene.add(a, corners[0].clone())?;
        let b = scene.add(b, corners[1].clone())?;
        let pairs = detector.detect(&scene, &Query::between(a, b))?.clone();
        Ok::<_, Error>((scene, pairs))
    };
    let n = corners.each_ref().map(Vec::len);
    let (small, crossing) = pairs(detector, n.map(faces))?;
    if !crossing.is_empty() {
        return Ok(detector
            .contacts(&small, &crossing)?
            .points()
            .first()
            .copied());
    }
    // A corner as a triangle, and the whole of the other one.
    let corner = Elements::Triangles(vec![[0; 3]]);
    let is_b_inside = n[0] == 4 && {
        let (_, inside) = pairs(detector, [Elements::Tetrahedra(vec![[0, 1, 2, 3]]), corner])?;
        !inside.is_empty()
    };
    Ok(corners[usize::from(is_b_inside)].first().copied())
}

/// The faces of a triangle or of a tetrahedron.
fn faces(n_corners: usize) -> Elements {
    Elements::Triangles(match n_corners {
        4 => vec![[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]],
        _ => vec![[0, 1, 2]],
    })
}
