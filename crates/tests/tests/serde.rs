//! What was written as JSON is read back: rows, settings, statistics and choices.

use impinge_core::{
    Backend, BodyId, Detector, Error, Impact, Method, NearPair, PairKind, Query, Recluster, Scene,
    Settings, Start, Stats,
};
use serde::Serialize;
use serde::de::DeserializeOwned;

type Failure = Box<dyn std::error::Error>;

/// Writes and reads a value.
fn again<T: Serialize + DeserializeOwned>(value: &T) -> serde_json::Result<T> {
    serde_json::from_str(&serde_json::to_string(value)?)
}

/// Two triangles, the first of which falls through the second.
fn falling() -> Result<(Scene, [BodyId; 2]), Error> {
    let triangle = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let at = |height: f32| triangle.map(|[x, y, _]| [x, y, height]);
    let mut scene = Scene::new();
    let a = scene.add_triangles(&[[0, 1, 2]], &at(0.3))?;
    let b = scene.add_triangles(&[[0, 1, 2]], &at(0.0))?;
    scene.set_end_positions(a, &at(-0.7))?;
    Ok((scene, [a, b]))
}

#[test]
fn choices_are_the_words_that_they_have_everywhere() -> Result<(), Failure> {
    for method in Method::ALL {
        assert_eq!(serde_json::to_value(method)?, method.name());
        assert_eq!(again(&method)?, method);
    }
    for kind in PairKind::ALL {
        assert_eq!(again(&kind)?, kind);
    }
    assert_eq!(again(&Start::Verify)?, Start::Verify);
    let refused = serde_json::from_str::<Backend>("\"tpu\"").unwrap_err();
    assert!(refused.to_string().contains("tpu"), "{refused}");
    Ok(())
}

#[test]
fn settings_come_back_and_unknown_ones_are_refused() -> Result<(), Failure> {
    let settings = Settings::new()
        .backend(Backend::Cpu)
        .recluster(Recluster::Never)
        .max_pairs(Some(7))
        .device(Some("a GPU".to_owned()));
    let read = again(&settings)?;
    assert_eq!(read, settings);
    let some: Settings = serde_json::from_str(r#"{ "threads": 3 }"#)?;
    assert_eq!((some.threads, some.method), (3, Method::Auto));
    assert!(serde_json::from_str::<Settings>(r#"{ "thread": 3 }"#).is_err());
    Ok(())
}

#[test]
fn rows_come_back_with_bodies_by_their_index() -> Result<(), Failure> {
    let (scene, [a, b]) = falling()?;
    let mut detector = Detector::new(Backend::Cpu)?;
    let impacts = detector.impacts(&scene, &Query::all())?;
    assert!(!impacts.is_empty());
    for impact in impacts.iter() {
        let read: Impact = again(impact)?;
        assert_eq!((read.kind, read.row()), (impact.kind, impact.row()));
        assert_eq!(read.toi.to_bits(), impact.toi.to_bits());
        assert_eq!(read.at_start, impact.at_start);
        // An id that was read names no body.
        assert_eq!(read.a.body.index(), impact.a.body.index());
        assert!(scene.body(read.a.body).is_err());
    }
    let near = detector.near(&scene, 0.5, &Query::all().closest_points())?;
    assert!(!near.is_empty());
    for pair in near.iter() {
        let read: NearPair = again(&pair)?;
        assert_eq!((read.kind, read.row()), (pair.kind, pair.row()));
        assert_eq!((read.features, read.closest), (pair.features, pair.closest));
    }
    let nearest = detector.distance(&scene, a, b)?.ok_or("no elements")?;
    let read = again(&nearest)?;
    assert_eq!(
        (read.distance, read.points),
        (nearest.distance, nearest.points)
    );
    Ok(())
}

#[test]
fn statistics_come_back_with_their_stages() -> Result<(), Failure> {
    let (scene, _) = falling()?;
    let mut detector = Detector::new(Backend::Cpu)?;
    detector.detect(&scene, &Query::all())?;
    let stats = detector.stats();
    assert!(!stats.stages.is_empty());
    let read: Stats = again(stats)?;
    assert_eq!((read.method, &read.stages), (stats.method, &stats.stages));
    assert_eq!(
        (read.n_candidates, read.total_ms),
        (stats.n_candidates, stats.total_ms)
    );
    // Stages that this version does not know come from others.
    let other: Stats = serde_json::from_str(r#"{ "stages": [{ "name": "later", "ms": 1.5 }] }"#)?;
    assert_eq!(other.stage_ms("later"), 1.5);
    Ok(())
}
