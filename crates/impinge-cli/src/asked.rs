//! What an answer is about: its last line, and an object in JSON.

use impinge::{Query, SharedVertex};
use serde_json::{Value, json};

use crate::load::{Nouns, Vertices};
use crate::text::{counted, grouped};

/// Which pairs of primitives were asked for.
#[derive(Debug, Clone, Copy)]
pub struct Asked {
    /// Pairs of different bodies.
    pub between: bool,
    /// Pairs within each body.
    pub within: bool,
    pub shared_vertex: SharedVertex,
    /// Whether pairs of bodies were left out by their numbers.
    pub ignores: bool,
}

impl Asked {
    /// The query, before bodies are left out.
    pub fn query(self) -> Query {
        match (self.between, self.within) {
            (true, true) => Query::everything(),
            (false, true) => Query::all_within(),
            (_, false) => Query::all(),
        }
        .shared_vertex(self.shared_vertex)
    }

    /// `between 2 meshes, 12 vertices welded, neighbours resolved; not asked: self-collision (--self)`
    pub fn line(self, vertices: &[Vertices], nouns: &Nouns) -> String {
        let Nouns { one, many, file } = nouns;
        let n = grouped(vertices.len() as u64);
        let of = file.as_ref().map_or(String::new(), |file| {
            format!(" of {}", impinge_io::printable(file))
        });
        let whom = match (vertices.len(), self.between, self.within) {
            (1, _, true) => format!("within 1 {one}"),
            (1, _, false) => format!("1 {one}"),
            (_, true, false) => format!("between {n} {many}{of}"),
            (_, false, _) => format!("within each of {n} {many}{of}"),
            (_, true, true) => format!("between {n} {many}{of} and within each"),
        };
        let rule = match self.shared_vertex {
            SharedVertex::Resolve => "neighbours resolved",
            SharedVertex::Skip => "neighbours skipped",
        };
        let mut not_asked = Vec::new();
        if !self.within {
            not_asked.push("self-collision (--self)".to_owned());
        }
        if !self.between && vertices.len() > 1 {
            not_asked.push(format!("pairs of different {many} (impinge pairs --self)"));
        }
        if self.ignores {
            not_asked.push("what --ignore names".to_owned());
        }
        let rest = match not_asked.is_empty() {
            true => String::new(),
            false => format!("; not asked: {}", not_asked.join(", ")),
        };
        format!("{whom}, {}, {rule}{rest}", welded(vertices))
    }

    /// The same as an object.
    pub fn json(self) -> Value {
        json!({
            "between": self.between,
            "self": self.within,
            "shared_vertex": match self.shared_vertex {
                SharedVertex::Resolve => "resolve",
                SharedVertex::Skip => "skip",
            },
        })
    }
}

/// How many vertices were welded, and how many were not though they coincide with another one.
fn welded(vertices: &[Vertices]) -> String {
    let n_welded: usize = vertices.iter().map(|of| of.n_welded).sum();
    let n_apart: usize = vertices.iter().filter_map(|of| of.n_coincident).sum();
    let welded = counted(n_welded as u64, "vertex").replace("vertexs", "vertices") + " welded";
    let apart = format!("{} not welded (--no-weld)", grouped(n_apart as u64));
    let welds = vertices.iter().any(|of| of.welds);
    match (welds, n_apart) {
        (true, 0) => welded,
        (true, _) => format!("{welded}, {apart}"),
        (false, 0) => "vertices as in the files".to_owned(),
        (false, _) => format!("coinciding vertices: {apart}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_say_what_was_asked_and_what_was_not() {
        let of = |n_welded: Option<usize>, n_coincident| Vertices {
            welds: n_welded.is_some(),
            n_welded: n_welded.unwrap_or(0),
            n_coincident,
        };
        let line = |between, within, vertices: &[Vertices]| {
            let asked = Asked {
                between,
                within,
                shared_vertex: SharedVertex::Resolve,
                ignores: false,
            };
            asked.line(vertices, &Nouns::default())
        };
        let two = [of(Some(12), Some(0)), of(Some(0), Some(0))];
        assert_eq!(
            line(true, false, &two),
            "between 2 meshes, 12 vertices welded, neighbours resolved; not asked: self-collision (--self)"
        );
        assert_eq!(
            line(true, true, &two),
            "between 2 meshes and within each, 12 vertices welded, neighbours resolved"
        );
        assert_eq!(
            line(false, true, &two),
            "within each of 2 meshes, 12 vertices welded, neighbours resolved; not asked: pairs of different meshes \
             (impinge pairs --self)"
        );
        assert_eq!(
            line(false, true, &[of(Some(1), Some(0))]),
            "within 1 mesh, 1 vertex welded, neighbours resolved"
        );
        assert_eq!(
            line(false, true, &[of(None, Some(3))]),
            "within 1 mesh, coinciding vertices: 3 not welded (--no-weld), neighbours resolved"
        );
        let skipped = Asked {
            between: true,
            within: false,
            shared_vertex: SharedVertex::Skip,
            ignores: true,
        };
        assert_eq!(
            skipped.line(
                &[of(None, None), of(None, None)],
                &Nouns {
                    one: "node",
                    many: "nodes",
                    file: Some("a.glb".to_owned()),
                }
            ),
            "between 2 nodes of a.glb, vertices as in the files, neighbours skipped; not asked: self-collision (--self), what --ignore \
             names"
        );
    }
}
