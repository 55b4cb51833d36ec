//! Parts of reports that several commands print.

use impinge::{BodyId, Error, Pairs, Scene, Stats};
use serde_json::{Map, Value, json};

use super::{
    AskedOfStep, Body, CollidingBody, Counters, How, Region, Stages, ThickBody, Total, Unread,
};
use crate::asked::Asked;
use crate::detection::Times;
use crate::load::Vertices;
use crate::regions;
use crate::text::hash;

/// The most regions in a report; all regions are counted.
const MOST_REGIONS: usize = 100;

impl super::Pairs {
    /// Times are medians.
    pub fn new(
        (asked, scene): (Asked, &Scene),
        bodies: &[(BodyId, &str)],
        vertices: &[Vertices],
        pairs: &Pairs,
        regions: Option<&[regions::Region]>,
        times: &Times,
    ) -> Result<Self, Error> {
        let described = bodies.iter().zip(vertices);
        let described = described.map(|(&(id, name), vertices)| {
            Ok(CollidingBody {
                body: Body::new(scene, id, name, vertices)?,
                colliding: pairs.colliding(id).len(),
            })
        });
        let most = regions.unwrap_or_default().iter().take(MOST_REGIONS);
        Ok(super::Pairs {
            frame: None,
            pairs: pairs.len(),
            hash: hash(pairs),
            how: How::new(pairs.stats(), Stages::new(times)),
            asked: super::Asked::new(asked),
            bodies: described.collect::<Result<_, Error>>()?,
            n_regions: regions.map(<[_]>::len),
            regions: most.map(Region::new).collect(),
            contacts: None,
            unread: Vec::new(),
        })
    }
}

impl super::Asked {
    pub fn new(asked: Asked) -> Self {
        super::Asked {
            between: asked.between,
            within: asked.within,
            shared_vertex: asked.shared_vertex.name(),
        }
    }
}

impl AskedOfStep {
    pub fn new(asked: Asked) -> Self {
        AskedOfStep {
            between: asked.between,
            within: asked.within,
        }
    }
}

impl Region {
    fn new(region: &regions::Region) -> Self {
        Region {
            bodies: region.bodies,
            pairs: region.n_pairs,
            center: region.center(),
            size: region.size(),
            first: region.first,
        }
    }
}

impl Body {
    pub fn new(scene: &Scene, id: BodyId, name: &str, vertices: &Vertices) -> Result<Self, Error> {
        let body = scene.body(id)?;
        Ok(Body {
            name: name.to_owned(),
            kind: body.kind().name(),
            elements: body.n_elements(),
            vertices: body.n_vertices(),
            welded: vertices.n_welded,
            coincident: vertices.n_coincident,
        })
    }
}

impl ThickBody {
    pub fn new(scene: &Scene, id: BodyId, name: &str, vertices: &Vertices) -> Result<Self, Error> {
        Ok(ThickBody {
            body: Body::new(scene, id, name, vertices)?,
            thickness: scene.body(id)?.thickness(),
        })
    }
}

impl<T> How<T> {
    pub fn new(stats: &Stats, ms: T) -> Self {
        How {
            backend: stats.backend.as_str().to_owned(),
            method: stats.method,
            ms,
            stats: Counters::new(stats),
        }
    }
}

impl Total {
    pub fn new(ms: f64) -> Self {
        Total { total: rounded(ms) }
    }
}

impl Stages {
    /// Medians, if the question was asked more than once.
    pub fn new(times: &Times) -> Self {
        let stages = times
            .stages_ms()
            .map(|(name, ms)| (name.to_owned(), Value::from(rounded(ms))));
        Stages {
            stages: stages.collect::<Map<_, _>>(),
            total: rounded(times.total_ms(50)),
        }
    }
}

impl Unread {
    /// The files that could not be read.
    pub fn all(unread: &[(usize, String)], names: &[String]) -> Vec<Self> {
        let each = unread.iter().map(|(body, error)| Unread {
            body: *body,
            name: names[*body].clone(),
            error: error.clone(),
        });
        each.collect()
    }
}

/// Milliseconds, rounded to whole nanoseconds, which is the resolution of the clock.
fn rounded(ms: f64) -> f64 {
    (ms * 1e6).round() / 1e6
}

impl Counters {
    /// Every counter of the statistics under its own name.
    pub fn new(stats: &Stats) -> Self {
        let counts = stats.counts().map(|(name, n)| (name.to_owned(), n.into()));
        let mut all: Map<_, _> = counts.collect();
        all.shift_insert(1, "grid".to_owned(), json!(stats.grid));
        Counters(all.into())
    }
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
        let Counters(counters) = Counters::new(&stats);
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
