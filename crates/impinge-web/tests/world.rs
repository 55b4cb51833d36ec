//! The logic behind the JavaScript classes, natively; and scenes with native answers for browsers and Node to reproduce.

use std::fmt::Write as _;
use std::path::Path;
use std::{fs, io};

use impinge::{Backend, Detector, Elements, Positions, Query, Scene, Settings, SharedVertex, Step};
use impinge_scenes::{Model, solids, soup, surfaces};
use impinge_web::{Asked, Error, StepOptions, World, welded};

fn world() -> Result<World, Error> {
    let settings = Settings {
        backend: Backend::Cpu,
        ..World::settings("clusters")?
    };
    World::new(Detector::with_settings(settings)?, "skip")
}

/// Without a clearance.
fn options(start: &str, toi: &str, separation: f64) -> Result<StepOptions, Error> {
    StepOptions::new(start, toi, [separation, 0.0, 0.2])
}

const TRIANGLE: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
const ACROSS: [f32; 9] = [0.25, 0.25, -1.0, 0.25, 0.25, 1.0, 2.0, 2.0, 0.0];

#[test]
fn pairs_are_those_of_the_bodies_asked_for_in_the_order_asked() -> Result<(), Error> {
    let mut world = world()?;
    let two = [TRIANGLE.map(|x| x + 8.0), TRIANGLE].concat();
    let a = world.add(&[0, 1, 2, 3, 4, 5], &two, 3)?;
    let b = world.add(&[0, 1, 2], &ACROSS, 3)?;
    assert_eq!(world.detect(Asked::Between(a, b))?.0, [1, 0]);
    assert_eq!(world.detect(Asked::Between(b, a))?.0, [0, 1]);
    assert!(world.detect(Asked::Within(a))?.0.is_empty());
    assert_eq!(world.detect(Asked::Everything)?.0, [a, 1, b, 0]);
    assert_eq!(Asked::of(&[], true)?, Asked::Everything);
    assert_eq!(Asked::of(&[], false)?, Asked::Different);
    assert_eq!(world.detect(Asked::Different)?.0, [a, 1, b, 0]);
    let upon = world.add(&[0, 1, 2, 3, 4, 5], &[TRIANGLE, ACROSS].concat(), 3)?;
    let all = world.detect(Asked::Everything)?.0;
    assert!(all.chunks(4).any(|row| row == [upon, 0, upon, 1]));
    let different = all.chunks(4).filter(|row| row[0] != row[2]);
    let different: Vec<u32> = different.flatten().copied().collect();
    assert_eq!(world.detect(Asked::Different)?.0, different);
    world.set_positions(b, &ACROSS.map(|x| x + 8.0))?;
    assert_eq!(world.detect(Asked::Between(a, b))?.0, [0, 0]);
    Ok(())
}

#[test]
fn numbers_of_bodies_are_not_used_again() -> Result<(), Error> {
    let mut world = world()?;
    let a = world.add(&[0, 1, 2], &TRIANGLE, 3)?;
    let b = world.add(&[0, 1, 2], &ACROSS, 3)?;
    world.remove(a)?;
    let c = world.add(&[0, 1, 2], &TRIANGLE, 3)?;
    assert_eq!((a, b, c), (0, 1, 2));
    assert_eq!(world.detect(Asked::Between(c, b))?.0, [0, 0]);
    // The library has the new body in the slot of the old one, and so before body 1.
    assert_eq!(world.detect(Asked::Everything)?.0, [c, 0, b, 0]);
    let error = world
        .detect(Asked::Within(a))
        .map(|_| ())
        .expect_err("removed");
    assert_eq!(
        error.to_string(),
        "there is no body 0: 3 have been added, and 1 of them removed"
    );
    let error = world.set_positions(c, &TRIANGLE[..3]).expect_err("too few");
    assert_eq!(
        error.to_string(),
        "body 2, in the library's words: body 0: 1 positions given, but it has 3 vertices"
    );
    let error = world.add(&[0, 1, 9], &TRIANGLE, 3).expect_err("index");
    assert_eq!(
        error.to_string(),
        "body 3, in the library's words: body 2: primitive 0 names vertex 9, but there are 3 vertices"
    );
    Ok(())
}

#[test]
fn impacts_of_a_step() -> Result<(), Error> {
    let mut world = world()?;
    let gone = world.add(&[0, 1, 2], &TRIANGLE, 3)?;
    let a = world.add(&[0, 1, 2], &TRIANGLE, 3)?;
    let above = TRIANGLE.map(|x| f64::from(x) * 0.25);
    let lifted: Vec<f64> = above.chunks(3).flat_map(|p| [p[0], p[1], 1.0]).collect();
    let sunk: Vec<f64> = above.chunks(3).flat_map(|p| [p[0], p[1], -3.0]).collect();
    world.remove(gone)?;
    let b = world.add(&[0, 1, 2], &lifted, 3)?;
    let report = options("report", "f32", 0.0)?;
    assert!(world.impacts(Asked::Everything, report)?.0.kinds.is_empty());
    world.set_end_positions(b, &sunk)?;
    let (impacts, _) = world.impacts(Asked::Between(a, b), report)?;
    // The vertices of b meet the face of a. The library calls b body 0, so a pair has b first wherever kinds are alike.
    assert_eq!(impacts.rows[..4], [b, 0, a, 0]);
    assert!(impacts.times.iter().all(|&time| time == 0.25));
    assert!(impacts.at_start.iter().all(|&at_start| at_start == 0));
    let earliest = world.earliest(Asked::Everything, report)?;
    assert_eq!(
        (earliest.kinds, earliest.rows, earliest.times),
        (vec![0], vec![b, 0, a, 0], vec![0.25])
    );
    let near = options("skip", "f64", 0.5)?;
    assert_eq!(world.earliest(Asked::Everything, near)?.times, [0.125]);
    Ok(())
}

#[test]
fn steps_know_whether_their_start_intersects() -> Result<(), Error> {
    let mut world = world()?;
    world.add(&[0, 1, 2], &TRIANGLE, 3)?;
    let across = world.add(&[0, 1, 2], &ACROSS, 3)?;
    world.set_end_positions(across, &ACROSS)?;
    let verify = options("verify", "f32", 0.0)?;
    let report = options("report", "f32", 0.0)?;
    // An edge inside a face: no contact, but no free start.
    assert!(world.is_free(Asked::Everything, report)?);
    assert_eq!(world.start_intersects(), None);
    assert_eq!(world.advance(Asked::Everything, report)?.0.fraction, 1.0);
    assert!(!world.is_free(Asked::Everything, verify)?);
    assert_eq!(world.start_intersects(), Some(true));
    let (advance, first, moving) = world.advance(Asked::Everything, verify)?;
    assert_eq!(
        (advance.fraction, advance.start_intersects),
        (0.0, Some(true))
    );
    assert!(first.kinds.is_empty());
    assert_eq!(moving, [across]);
    assert!(world.impacts(Asked::Everything, verify)?.0.kinds.is_empty());
    assert_eq!(world.start_intersects(), Some(true));
    world.earliest(Asked::Within(across), verify)?;
    assert_eq!(world.start_intersects(), Some(false));
    Ok(())
}

#[test]
fn a_step_leaves_its_clearance() -> Result<(), Error> {
    let mut world = world()?;
    let gone = world.add(&[0, 1, 2], &TRIANGLE, 3)?;
    world.add(&[0, 1, 2], &TRIANGLE, 3)?;
    world.remove(gone)?;
    // A triangle of which one corner is far below the others, at height 1.
    let above = [0.25, 0.25, 1.0, 0.5, 0.25, 2.0, 0.25, 0.5, 2.0];
    let sunk = above.map(|x: f64| x - 2.0 * f64::from(u8::from(x >= 1.0)));
    let falling = world.add(&[0, 1, 2], &above, 3)?;
    world.set_end_positions(falling, &sunk)?;
    let half = StepOptions::new("report", "f64", [0.0, 0.5, 0.75])?;
    let share = StepOptions::new("report", "f64", [0.0, 10.0, 0.25])?;
    let time = |world: &mut World, options| {
        Ok::<_, Error>(world.earliest(Asked::Everything, options)?.times)
    };
    assert_eq!(time(&mut world, half)?, [0.25]);
    assert_eq!(time(&mut world, share)?, [0.375]);
    assert!(!world.is_free(Asked::Everything, half)?);
    let (advance, first, moving) = world.advance(Asked::Everything, half)?;
    assert!((0.249..=0.25).contains(&advance.fraction), "{advance:?}");
    assert_eq!((first.rows.len(), moving), (4, vec![falling]));
    let Positions::F64(reached) = &advance.positions[0].1 else {
        panic!("in the precision in which they are stored");
    };
    assert!((0.5..0.502).contains(&reached[0][2]), "{reached:?}");
    let whole = StepOptions::new("report", "f64", [0.0, 0.5, 1.0])?;
    let error = world.is_free(Asked::Everything, whole).expect_err("share");
    assert_eq!(
        error.to_string(),
        "clearance_share: 1 given, a number from 0 to less than 1 allowed"
    );
    Ok(())
}

#[test]
fn vertices_at_one_position_are_welded() -> Result<(), Error> {
    let seam = [TRIANGLE, TRIANGLE.map(|x| -x)].concat();
    assert_eq!(welded(&seam)?, [0, 1, 2, 0, 3, 4]);
    assert!(welded(&seam[1..]).is_err());
    Ok(())
}

#[test]
fn bad_input_is_refused_by_name() -> Result<(), Error> {
    let mut world = world()?;
    let a = world.add(&[0, 1, 2], &TRIANGLE, 3)?;
    let said = |result: Result<u32, Error>| result.expect_err("refused").to_string();
    assert_eq!(
        said(world.add(&[0, 1, 2, 0], &TRIANGLE, 3)),
        "index: 4 numbers given, not a multiple of 3"
    );
    assert_eq!(
        said(world.add(&[0, 1, 2], &TRIANGLE[..8], 3)),
        "positions: 8 numbers given, not a multiple of 3"
    );
    assert_eq!(
        said(world.add(&[0, 1, 2], &TRIANGLE, 4)),
        "index: 3 numbers given, not a multiple of 4"
    );
    let mut not_a_number = TRIANGLE;
    not_a_number[4] = f32::NAN;
    let error = world
        .set_positions(a, &not_a_number)
        .expect_err("not finite");
    assert!(
        error
            .to_string()
            .starts_with("body 0: vertex 1 has a non-finite"),
        "{error}"
    );
    assert!(World::settings("slabs").is_err());
    assert!(World::new(Detector::new(Backend::Cpu)?, "").is_err());
    assert_eq!(
        Asked::of(&[0, 1, 2], true).expect_err("three").to_string(),
        "bodies: 3 given, 0 (everything), 1 (within it) or 2 (between them) allowed"
    );
    assert_eq!(
        options("never", "f32", 0.0).expect_err("word").to_string(),
        "start: \"never\" given, \"report\", \"skip\" or \"verify\" allowed"
    );
    let negative = options("report", "f64", -1.0)?;
    assert_eq!(
        world
            .impacts(Asked::Everything, negative)
            .expect_err("separation")
            .to_string(),
        "separation: -1 given, a finite number that is not below 0 allowed"
    );
    // The refused calls changed nothing.
    assert!(world.detect(Asked::Within(a))?.0.is_empty());
    assert_eq!(world.size(a)?, (1, 3));
    Ok(())
}

/// Bodies and how self-collision is asked for.
fn scenes() -> Vec<(&'static str, Vec<Model>, SharedVertex)> {
    let ball = surfaces::ball(15_000);
    let moved = ball.translated([0.5, 0.25, 0.125]);
    let knot = surfaces::stand_in(4_000);
    let crossed = knot.translated([0.125, 0.25, 0.0625]);
    let solid = solids::solid_ball(3_000);
    let beside = solid.translated([0.75, 0.25, 0.0]);
    vec![
        ("two balls", vec![ball, moved], SharedVertex::Skip),
        ("two knots", vec![knot, crossed], SharedVertex::Resolve),
        ("two solids", vec![solid, beside], SharedVertex::Skip),
        (
            "a soup on a lattice",
            vec![soup::lattice_web(600, 6, 1)],
            SharedVertex::Resolve,
        ),
    ]
}

fn numbers<T: std::fmt::Display>(numbers: impl IntoIterator<Item = T>) -> String {
    let mut text = String::from("[");
    for (ix, number) in numbers.into_iter().enumerate() {
        let comma = if ix > 0 { "," } else { "" };
        // Writing to a string cannot fail.
        let _ = write!(text, "{comma}{number}");
    }
    text + "]"
}

/// Where bodies are at the end of the step. Not an affine motion, so that bodies meet themselves too.
fn end_of(ix: usize, position: [f32; 3]) -> [f32; 3] {
    let sign = if ix.is_multiple_of(2) { 0.25 } else { -0.25 };
    let [x, y, z] = position;
    [x + sign, y - sign * x, z + sign * x * y]
}

/// `web/test` reads `target/tmp/web-scenes.json` and expects the answers of this run.
#[test]
fn scenes_are_written_for_browsers_with_the_native_answer() -> Result<(), Box<dyn std::error::Error>>
{
    let mut written = Vec::new();
    let mut n_of_neighbours = 0;
    for (name, models, rule) in scenes() {
        let mut scene = Scene::new();
        let mut bodies = Vec::new();
        for (ix, model) in models.iter().enumerate() {
            let id = model.add_to(&mut scene)?;
            let body = scene.body(id)?;
            let Positions::F32(positions) = body.positions() else {
                return Err(io::Error::other("models are in single precision").into());
            };
            let (corners, index) = match body.elements() {
                Elements::Triangles(faces) => (3, numbers(faces.as_flattened())),
                Elements::Tetrahedra(tets) => (4, numbers(tets.as_flattened())),
                _ => return Err(io::Error::other("models are triangles or tetrahedra").into()),
            };
            let end: Vec<[f32; 3]> = positions.iter().map(|&p| end_of(ix, p)).collect();
            // Every f32 is written so that it is read as the same f32.
            let (start, finish) = (
                numbers(positions.as_flattened()),
                numbers(end.as_flattened()),
            );
            bodies.push(format!(
                "{{\"corners\":{corners},\"index\":{index},\"positions\":{start},\"end\":{finish}}}"
            ));
            scene.set_end_positions(id, &end)?;
        }
        let mut detector = Detector::new(Backend::Cpu)?;
        let query = Query::everything().shared_vertex(rule);
        let skip = query.clone().shared_vertex(SharedVertex::Skip);
        let skipped = detector.detect(&scene, &skip)?.len();
        let pairs = detector.detect(&scene, &query)?;
        assert!(!pairs.is_empty(), "{name} has no pair");
        let (n_pairs, hash) = (pairs.len(), pairs.hash());
        n_of_neighbours += n_pairs - skipped.min(n_pairs);
        let step = Step::new(query);
        let impacts = detector.impacts(&scene, &step)?;
        let first = impacts
            .iter()
            .find(|impact| !impact.at_start)
            .ok_or("nothing starts to touch")?;
        let (kind, time) = (first.kind.name(), first.toi);
        let (n_impacts, impacts_hash) = (impacts.len(), impacts.hash());
        let rule = match rule {
            SharedVertex::Skip => "skip",
            SharedVertex::Resolve => "resolve",
        };
        let bodies = bodies.join(",");
        written.push(format!(
            "{{\"name\":\"{name}\",\"sharedVertex\":\"{rule}\",\"pairs\":{n_pairs},\"hash\":\"{hash:016x}\",\
             \"impacts\":{n_impacts},\"impactsHash\":\"{impacts_hash:016x}\",\
             \"first\":{{\"kind\":\"{kind}\",\"time\":{time}}},\"bodies\":[{bodies}]}}"
        ));
    }
    assert!(n_of_neighbours > 0, "both rules have the same answers");
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("web-scenes.json");
    fs::write(file, format!("[{}]", written.join(",\n")))?;
    Ok(())
}
