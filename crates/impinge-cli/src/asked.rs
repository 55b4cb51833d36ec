//! What an answer is about: its last line, and an object in JSON.

use impinge::{BodyId, Query, Scene, SharedVertex};

use crate::args::ThicknessArgs;
use crate::error::Error;
use crate::load::{Nouns, Vertices};
use crate::text::{counted, exactly, grouped};

/// Which pairs were asked for.
#[derive(Debug, Clone, Copy)]
pub struct Asked {
    /// Pairs of different bodies.
    pub between: bool,
    /// Pairs within each body.
    pub within: bool,
    /// The only two bodies whose pairs were asked for, by their numbers.
    pub only: Option<(usize, usize)>,
    pub shared_vertex: SharedVertex,
    pub question: Question,
    /// Whether the command has the option --self.
    pub has_self: bool,
    /// Whether pairs of bodies were left out by their numbers.
    pub excludes: bool,
    /// How near pairs that were left out are in the surface.
    pub rings: Option<u32>,
    /// How far pairs that were left out were apart at rest.
    pub rest: Option<f64>,
    /// Whether kinds of pairs were chosen.
    pub has_kinds: bool,
}

/// What was asked of the pairs: it decides which neighbours can be among them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Question {
    /// Whether they intersect.
    Pairs,
    /// Whether they are near, and besides whether they intersect.
    Near,
    /// Whether they touch during a step, and besides whether they intersect at its start.
    Step { start: bool },
    /// Whether their boxes overlap.
    Candidates,
}

impl Asked {
    /// The query, before anything is left out.
    pub fn query(self, bodies: &[BodyId]) -> Result<Query, Error> {
        let query = match (self.only, self.between, self.within) {
            (Some((a, b)), ..) => {
                Query::between(body("--between", bodies, a)?, body("--between", bodies, b)?)
            }
            (None, true, true) => Query::all(),
            (None, false, true) => Query::self_all(),
            (None, _, false) => Query::between_all(),
        };
        Ok(query.shared_vertex(self.shared_vertex))
    }

    /// `between 2 meshes, 12 vertices welded, neighbours resolved; not asked: self-collision (--self)`
    pub fn line(self, vertices: &[Vertices], nouns: &Nouns) -> String {
        self.line_of_thick(vertices, nouns, &ThicknessArgs::default())
    }

    /// The same, of bodies that may be thick:
    /// `between 2 meshes, thickness 0.5 of body 0, 12 vertices welded, …`
    pub fn line_of_thick(
        self,
        vertices: &[Vertices],
        nouns: &Nouns,
        thickness: &ThicknessArgs,
    ) -> String {
        let Nouns { one, many, file } = nouns;
        let n = grouped(vertices.len() as u64);
        let of = file.as_ref().map_or(String::new(), |file| {
            format!(" of {}", impinge_io::printable(file))
        });
        let whom = match (vertices.len(), self.between, self.within) {
            (n, ..) if n > 2 && self.only.is_some() => {
                let (a, b) = self.only.unwrap_or_default();
                format!("between {many} {a} and {b} of {n}{of}")
            }
            (1, _, true) => format!("within 1 {one}"),
            (1, _, false) => format!("1 {one}"),
            (_, true, false) => format!("between {n} {many}{of}"),
            (_, false, _) => format!("within each of {n} {many}{of}"),
            (_, true, true) => format!("between {n} {many}{of} and within each"),
        };
        let mut not_asked = Vec::new();
        if !self.within {
            let option = if self.has_self { " (--self)" } else { "" };
            not_asked.push(format!("self-collision{option}"));
        }
        if !self.between && vertices.len() > 1 {
            not_asked.push(format!("pairs of different {many} (impinge pairs --self)"));
        }
        if self.only.is_some() && vertices.len() > 2 {
            not_asked.push(format!("pairs of other {many}"));
        }
        if self.excludes {
            not_asked.push("what --exclude names".to_owned());
        }
        if let Some(n) = self.rings {
            not_asked.push(format!(
                "what is at most {} away in the surface",
                counted(n.into(), "edge")
            ));
        }
        if let Some(distance) = self.rest {
            let is_thick = thickness.of_bodies.iter().any(|(_, of)| *of > 0.0);
            let thick = if is_thick {
                ", plus its thickness,"
            } else {
                ""
            };
            not_asked.push(format!("what is at most {distance}{thick} apart at rest"));
        }
        if self.has_kinds {
            not_asked.push("other kinds of pairs (--kinds)".to_owned());
        }
        if self.question == (Question::Step { start: false }) {
            not_asked.push("whether the start intersects (--start verify)".to_owned());
        }
        let rest = match not_asked.is_empty() {
            true => String::new(),
            false => format!("; not asked: {}", not_asked.join(", ")),
        };
        let thick = thickness.of_bodies.iter().filter(|(_, of)| *of > 0.0);
        let thick = thick.map(|(body, of)| format!("{of} of body {body}"));
        let thick = match thick.collect::<Vec<_>>().join(", ") {
            none if none.is_empty() => none,
            each => format!(", thickness {each}"),
        };
        let (welded, neighbours) = (welded(vertices), self.neighbours());
        format!("{whom}{thick}, {welded}, {neighbours}{rest}")
    }

    /// Which pairs of one body that share a vertex are in the answer.
    fn neighbours(self) -> &'static str {
        match (self.question, self.shared_vertex) {
            (Question::Pairs, SharedVertex::Resolve) => "neighbours resolved",
            (Question::Near, SharedVertex::Resolve) => {
                "neighbours resolved where they intersect, else never near"
            }
            (Question::Step { start: true }, _) => {
                "neighbours resolved at the start, else left out"
            }
            _ => "neighbours left out",
        }
    }
}

/// The body that an option names by its number.
pub fn body(option: &str, bodies: &[BodyId], number: usize) -> Result<BodyId, Error> {
    bodies.get(number).copied().ok_or_else(|| {
        let given = match bodies.len() {
            1 => "1 body is given, numbered 0".to_owned(),
            n => format!("{n} bodies are given, numbered from 0"),
        };
        Error::Usage(format!("{option} names body {number}, but {given}"))
    })
}

/// Makes the bodies of a scene as thick as the program is told.
pub fn thicken(
    scene: &mut Scene,
    bodies: &[BodyId],
    thickness: &ThicknessArgs,
) -> Result<(), Error> {
    let all = &thickness.of_bodies;
    for (ix, &(number, thickness)) in all.iter().enumerate() {
        let id = body("--thickness", bodies, number)?;
        if all[..ix].iter().any(|&(before, _)| before == number) {
            let text = format!("--thickness names body {number} twice");
            return Err(Error::Usage(text));
        }
        scene.set_thickness(id, thickness)?;
    }
    Ok(())
}

/// A distance that pairs keep or are within, besides the thickness of their bodies; `None` if there
/// is neither.
pub fn kept(scene: &Scene, distance: f64) -> Option<String> {
    let is_thick = scene.bodies().any(|(_, body)| body.thickness() > 0.0);
    match (distance > 0.0, is_thick) {
        (false, false) => None,
        (true, false) => Some(exactly(distance)),
        (true, true) => Some(format!("{} and the thickness", exactly(distance))),
        (false, true) => Some("the thickness".to_owned()),
    }
}

/// How many vertices were welded, and how many were not though they coincide with another one.
pub fn welded(vertices: &[Vertices]) -> String {
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

    const ASKED: Asked = Asked {
        between: true,
        within: false,
        only: None,
        shared_vertex: SharedVertex::Resolve,
        question: Question::Pairs,
        has_self: true,
        excludes: false,
        rings: None,
        rest: None,
        has_kinds: false,
    };

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
                ..ASKED
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
            shared_vertex: SharedVertex::Skip,
            excludes: true,
            rings: Some(2),
            rest: Some(0.25),
            ..ASKED
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
            "between 2 nodes of a.glb, vertices as in the files, neighbours left out; not asked: self-collision (--self), what --exclude \
             names, what is at most 2 edges away in the surface, what is at most 0.25 apart at rest"
        );
        let three = [of(Some(0), Some(0)); 3];
        let only = Asked {
            only: Some((0, 2)),
            ..ASKED
        };
        assert_eq!(
            only.line(&three, &Nouns::default()),
            "between meshes 0 and 2 of 3, 0 vertices welded, neighbours resolved; not asked: self-collision (--self), pairs of other \
             meshes"
        );
    }

    /// No line says that neighbours are resolved and left out.
    #[test]
    fn neighbours_are_told_once() {
        let line = |question, has_kinds| {
            let asked = Asked {
                within: true,
                question,
                has_kinds,
                ..ASKED
            };
            asked.line(&[Vertices::default(); 2], &Nouns::default())
        };
        let whom = "between 2 meshes and within each, vertices as in the files, ";
        for (question, has_kinds, rest) in [
            (
                Question::Near,
                true,
                "neighbours resolved where they intersect, else never near; not asked: other kinds of pairs (--kinds)",
            ),
            (
                Question::Step { start: true },
                false,
                "neighbours resolved at the start, else left out",
            ),
            (
                Question::Step { start: false },
                false,
                "neighbours left out; not asked: whether the start intersects (--start verify)",
            ),
            (Question::Candidates, false, "neighbours left out"),
        ] {
            assert_eq!(line(question, has_kinds), format!("{whom}{rest}"));
        }
    }
}
