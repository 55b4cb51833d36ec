//! How answers print: in a line or two, however long they are.

use std::fmt::Debug;

use impinge_core::{Backend, Detector, Query, Scene, Settings};
use impinge_scenes::surfaces;

/// More than any answer needs, and far less than a list of what these hold.
const MOST: usize = 1200;

fn check(answer: &dyn Debug) {
    let (line, lines) = (format!("{answer:?}"), format!("{answer:#?}"));
    assert!(!line.contains('\n') && line.len() < MOST, "{line}");
    assert!(lines.lines().count() < 80, "{lines}");
}

#[test]
fn answers_print_short() {
    let ball = surfaces::ball(4_000);
    let mut scene = Scene::new();
    let a = ball.add_to(&mut scene).unwrap();
    let other = ball.translated([0.3, 0.2, 0.1]);
    let b = other.add_to(&mut scene).unwrap();
    let end = other.translated([0.2, 0.0, 0.0]);
    scene.set_end_positions(b, &end.positions).unwrap();
    let mut detector = Detector::new(Settings::new().backend(Backend::Cpu)).unwrap();
    let query = Query::between(a, b);
    let pairs = detector.detect(&scene, &query).unwrap().clone();
    assert!(pairs.len() > 100);
    check(&pairs);
    let contacts = detector.contacts(&scene, &pairs).unwrap();
    check(&contacts);
    check(&contacts.curves().unwrap());
    let penetration = detector.penetration(&scene, &contacts, a, b).unwrap();
    assert!(penetration.inside[0].len() > 100);
    check(&penetration);
    let step = query.clone();
    let impacts = detector.impacts(&scene, &step).unwrap();
    assert!(impacts.len() > 100);
    check(&impacts);
    check(&detector.earliest(&scene, &step).unwrap());
    let near = query.clone().closest_points();
    let near = detector.near(&scene, 0.01, &near).unwrap();
    assert!(near.len() > 100);
    check(&near);
    check(&detector.distance(&scene, a, b).unwrap());
    let far = other.translated([5.0, 0.0, 0.0]);
    scene.set_positions(b, &far.positions).unwrap();
    scene.set_end_positions(b, &end.positions).unwrap();
    let advance = detector.advance(&scene, &step).unwrap();
    assert_eq!(advance.iter().len(), 1);
    check(&advance);
    let candidates = detector.candidates(&scene, 0.0, &query);
    let candidates = candidates.unwrap();
    assert!(candidates.len() > 100);
    check(&candidates);
    check(&detector.stats());
}
