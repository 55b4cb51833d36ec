//! The answer as a JSON object.

use impinge::{BodyId, Error, PairKind, Pairs, Scene, Stats};
use serde_json::{Map, Value, json};

use crate::asked::Asked;
use crate::detection::Times;
use crate::load::Vertices;
use crate::regions::Region;
use crate::text::hash;

/// The most regions in the object; all regions are counted.
const MOST_REGIONS: usize = 100;

/// The object that `docs/answer.schema.json` describes, times as medians.
pub fn answer(
    (asked, scene): (Asked, &Scene),
    bodies: &[(BodyId, &str)],
    vertices: &[Vertices],
    pairs: &Pairs,
    regions: Option<&[Region]>,
    times: &Times,
) -> Result<Map<String, Value>, Error> {
    let described: Vec<Value> = bodies
        .iter()
        .zip(vertices)
        .map(|(&(id, name), vertices)| {
            let mut object = body(scene, id, name, vertices)?;
            object["colliding"] = pairs.colliding(id).len().into();
            Ok(object)
        })
        .collect::<Result<_, Error>>()?;
    let mut object = Map::new();
    object.insert("pairs".into(), pairs.len().into());
    object.insert("hash".into(), hash(pairs).into());
    add_how(&mut object, pairs.stats(), ms(times));
    object.insert("asked".into(), asked.json());
    object.insert("bodies".into(), described.into());
    object.insert("n_regions".into(), regions.map(<[_]>::len).into());
    let most = regions.unwrap_or_default().iter().take(MOST_REGIONS);
    let described: Vec<Value> = most
        .map(|region| {
            json!({
                "bodies": region.bodies,
                "pairs": region.n_pairs,
                "center": region.center(),
                "size": region.size(),
                "first": region.first,
            })
        })
        .collect();
    object.insert("regions".into(), described.into());
    Ok(object)
}

/// The object of an answer that holds no pairs: what was found, and how.
pub fn without_pairs(
    asked: Asked,
    (name, found): (&str, Value),
    stats: &Stats,
) -> Map<String, Value> {
    let mut object = Map::new();
    object.insert(name.into(), found);
    object.insert("asked".into(), asked.json());
    let ms = json!({ "total": rounded(stats.total_ms) });
    add_how(&mut object, stats, ms);
    object
}

/// What every answer says of a body.
pub fn body(scene: &Scene, id: BodyId, name: &str, vertices: &Vertices) -> Result<Value, Error> {
    let body = scene.body(id)?;
    Ok(json!({
        "name": name,
        "kind": body.kind().name(),
        "elements": body.n_primitives(),
        "vertices": body.n_vertices(),
        "welded": vertices.n_welded,
        "coincident": vertices.n_coincident,
    }))
}

/// Adds how an answer was found: backend, method, times and counters.
pub fn add_how(object: &mut Map<String, Value>, stats: &Stats, ms: Value) {
    object.insert("backend".into(), stats.backend.as_str().into());
    object.insert("method".into(), stats.method.into());
    object.insert("ms".into(), ms);
    object.insert("stats".into(), counters(stats));
}

/// Times of the stages, and the total time: medians, if the question was asked more than once.
pub fn ms(times: &Times) -> Value {
    let stages = times
        .stages_ms()
        .map(|(name, ms)| (name.to_owned(), Value::from(rounded(ms))));
    let stages: Map<String, Value> = stages.collect();
    json!({ "total": rounded(times.total_ms(50)), "stages": stages })
}

/// How many pairs of each kind there are.
pub fn kinds<const N: usize>(kinds: [(PairKind, u64); N]) -> Value {
    let counts = kinds.map(|(kind, n)| (kind.name().to_owned(), n.into()));
    Value::Object(counts.into_iter().collect())
}

/// Adds the files that could not be read, if there are any.
pub fn add_unread(object: &mut Map<String, Value>, unread: &[(usize, String)], names: &[String]) {
    if unread.is_empty() {
        return;
    }
    let described = unread
        .iter()
        .map(|(body, why)| json!({ "body": body, "name": names[*body], "error": why }));
    object.insert("unread".into(), described.collect());
}

/// Milliseconds, rounded to whole nanoseconds, which is the resolution of the clock.
pub fn rounded(ms: f64) -> f64 {
    (ms * 1e6).round() / 1e6
}

/// Every counter of the statistics under its own name.
pub fn counters(stats: &Stats) -> Value {
    json!({
        "n_threads": stats.n_threads,
        "grid": stats.grid,
        "n_subdivided": stats.n_subdivided,
        "n_entries": stats.n_entries,
        "n_clusters": stats.n_clusters,
        "n_culled": stats.n_culled,
        "n_work_items": stats.n_work_items,
        "n_candidates": stats.n_candidates,
        "n_unsure": stats.n_unsure,
        "n_clustered": stats.n_clustered,
        "n_reclustered": stats.n_reclustered,
        "n_batches": stats.n_batches,
        "n_pieces": stats.n_pieces,
        "n_reruns": stats.n_reruns,
        "bytes_held": stats.bytes_held,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The names of the fields, from the derived `Debug` of a value whose own values hold no colon.
    fn fields(stats: &Stats) -> Vec<String> {
        let text = format!("{stats:?}");
        let parts: Vec<&str> = text.split(": ").collect();
        parts[..parts.len() - 1]
            .iter()
            .filter_map(|part| part.rsplit([' ', '{']).next())
            // They are for tests of the library.
            .take_while(|&field| field != "ways")
            .map(str::to_owned)
            .collect()
    }

    #[test]
    fn no_counter_is_left_out() {
        let stats = Stats::default();
        let counters = counters(&stats);
        let elsewhere = ["backend", "method", "stages", "total_ms"];
        let expected: Vec<String> = fields(&stats)
            .into_iter()
            .filter(|field| !elsewhere.contains(&field.as_str()))
            .collect();
        let found: Vec<&String> = counters.as_object().unwrap().keys().collect();
        assert!(expected.len() > 10);
        assert_eq!(found, expected.iter().collect::<Vec<_>>());
    }
}
