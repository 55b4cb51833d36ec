//! Reads the bodies of a step: one file for the start of each body and one for its end.

use std::path::Path;
use std::sync::Arc;

use impinge::{BodyId, CancelToken, Scene};
use impinge_io::{Elements, Format, Mesh, ReadOptions, Weld, printable, read_with_summary};

use crate::args::StepArgs;
use crate::error::Error;
use crate::load::{STDIN, Vertices, tell, tell_coincident, to_elements, to_positions};
use crate::origins::{Origin, Origins};
use crate::watch::go_on;

/// A scene whose bodies have end positions, and the files of the bodies.
#[derive(Debug, Default)]
pub struct Moving {
    pub scene: Scene,
    pub ids: Vec<BodyId>,
    /// The files of each body's start and end.
    pub names: Vec<[String; 2]>,
    /// The elements before welding, if bodies are to be written.
    pub given: Vec<Elements>,
    /// Vertices that share their position with another one at both ends.
    pub vertices: Vec<Vertices>,
    pub origins: Origins,
}

impl Moving {
    /// An error of the library, with the file of the body that it is about.
    pub fn named(&self, error: impinge::Error) -> Error {
        match error {
            impinge::Error::Seam {
                body,
                vertices,
                n_coincident,
            } => {
                let mut named = self.ids.iter().zip(&self.names);
                let name = named.find(|(id, _)| **id == body);
                let number = body.index() as u32;
                Error::Seam {
                    name: name.map_or_else(|| body.to_string(), |(_, [start, _])| start.clone()),
                    vertices: vertices.map(|vertex| self.origins.vertex(number, vertex)),
                    n_coincident,
                }
            }
            error => error.into(),
        }
    }

    /// How many vertices have an end position.
    pub fn vertices_that_move(&self) -> usize {
        let bodies = self.scene.bodies();
        bodies.map(|(_, body)| body.n_vertices()).sum()
    }

    /// Reads files in pairs.
    pub fn read(args: &StepArgs, cancel: &CancelToken) -> Result<Self, Error> {
        let (pairs, rest) = args.meshes.as_chunks::<2>();
        if let [alone] = rest {
            return Err(Error::Usage(format!(
                "a body is two files, its start and its end: {} has no end ({} files are given)",
                printable(alone),
                args.meshes.len()
            )));
        }
        let mut bodies = Moving::default();
        for [start, end] in pairs {
            go_on(cancel)?;
            bodies.add(start, end, args)?;
        }
        Ok(bodies)
    }

    /// Writes the positions at both ends again, so that a detector can't reuse anything made from
    /// them.
    pub fn rewrite(&mut self) -> Result<(), Error> {
        for &id in &self.ids {
            let body = self.scene.body(id)?;
            let (start, end) = (body.positions().clone(), body.end_positions().cloned());
            self.scene.set_positions(id, &start)?;
            if let Some(end) = end {
                self.scene.set_end_positions(id, end)?;
            }
        }
        Ok(())
    }

    fn add(&mut self, start: &Path, end: &Path, args: &StepArgs) -> Result<(), Error> {
        if [start, end].contains(&Path::new(STDIN)) {
            let text = "`step` reads files: none can come from standard input";
            return Err(Error::Usage(text.to_owned()));
        }
        let names = [start, end].map(|path| path.display().to_string());
        let (mut at_start, summary) = read_with_summary(start, &ReadOptions::as_they_are())?;
        let (mut at_end, _) = read_with_summary(end, &ReadOptions::as_they_are())?;
        same_elements(&names, &at_start, &at_end)?;
        if !args.reached().1.is_empty() {
            self.given.push(at_start.elements.clone());
        }
        let mut origin = Origin::default();
        let mut vertices = Vertices::default();
        // Triangles of an STL file share nothing except positions.
        let welds = args.weld
            || !args.no_weld
            || (!args.no_self && Format::from_path(start)? == Format::Stl);
        if welds || !args.no_self {
            let weld =
                Weld::by_position(&at_start.positions).and(&Weld::by_position(&at_end.positions));
            if welds {
                weld.apply(&mut at_start);
                weld.apply(&mut at_end);
                vertices = Vertices {
                    welds,
                    n_welded: weld.n_welded(),
                    n_coincident: Some(0),
                };
                origin = Origin::new(None, Some(&Arc::new(weld)));
            } else {
                vertices.n_coincident = Some(weld.n_welded());
            }
        }
        tell(&names[0], &summary.notes());
        if !args.json {
            tell_coincident(&names[0], vertices);
        }
        // No coordinate changes its value; this halves the memory if all coordinates fit in f32.
        at_start.positions.narrow_if_exact();
        at_end.positions.narrow_if_exact();
        let refused = |name: &str| {
            let what = name.to_owned();
            move |source| Error::Refused { what, source }
        };
        let (elements, positions) = (
            to_elements(at_start.elements),
            to_positions(at_start.positions),
        );
        let id = self
            .scene
            .add((elements, positions))
            .map_err(refused(&names[0]))?;
        self.scene
            .set_end_positions(id, to_positions(at_end.positions))
            .map_err(refused(&names[1]))?;
        self.ids.push(id);
        self.names.push(names);
        self.vertices.push(vertices);
        self.origins.push(origin);
        Ok(())
    }
}

/// Fails if the two files of a body differ in anything except positions.
fn same_elements(names: &[String; 2], start: &Mesh, end: &Mesh) -> Result<(), Error> {
    let [name, other] = names;
    let differ = |what: String| {
        let message = format!(
            "{}: the end of the step must have the elements of {}: {what}",
            printable(other),
            printable(name)
        );
        Err(Error::Ends(message))
    };
    if start.n_vertices() != end.n_vertices() {
        return differ(format!(
            "{} vertices at the end, {} at the start",
            end.n_vertices(),
            start.n_vertices()
        ));
    }
    if start.n_elements() != end.n_elements() {
        return differ(format!(
            "{} elements at the end, {} at the start",
            end.n_elements(),
            start.n_elements()
        ));
    }
    if start.elements == end.elements {
        return Ok(());
    }
    let (a, b) = (start.elements.indices(), end.elements.indices());
    if a.len() != b.len() {
        return differ("triangles in one file, tetrahedra in the other".to_owned());
    }
    let n_corners = (a.len() / start.n_elements().max(1)).max(1);
    match a
        .chunks(n_corners)
        .zip(b.chunks(n_corners))
        .position(|(a, b)| a != b)
    {
        Some(ix) => {
            let of = |corners: &[u32]| format!("{:?}", &corners[ix * n_corners..][..n_corners]);
            differ(format!(
                "element {ix} has the vertices {} at the end, {} at the start",
                of(b),
                of(a)
            ))
        }
        None => Ok(()),
    }
}
