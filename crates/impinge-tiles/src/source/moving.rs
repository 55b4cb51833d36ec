//! The start and the end of a body in a step: two files with the same elements.

use std::path::{Path, PathBuf};

use impinge_io::Weld;

use super::Source;
use crate::chunk::{Chunk, Shape};
use crate::error::Error;

pub struct Moving {
    paths: [PathBuf; 2],
    start: Box<dyn Source>,
    end: Box<dyn Source>,
}

impl Moving {
    pub fn new(paths: [&Path; 2], sources: [Box<dyn Source>; 2]) -> Result<Self, Error> {
        let [start, end] = sources;
        let moving = Moving {
            paths: paths.map(Path::to_owned),
            start,
            end,
        };
        moving.same("corners per element", |source| {
            source.shape().corners as u64
        })?;
        moving.same("vertices", |source| source.n_vertices())?;
        moving.same("elements", |source| source.n_elements())?;
        Ok(moving)
    }

    fn same(&self, what: &str, number: impl Fn(&dyn Source) -> u64) -> Result<(), Error> {
        match (number(self.start.as_ref()), number(self.end.as_ref())) {
            (at_start, at_end) if at_start == at_end => Ok(()),
            (at_start, at_end) => Err(self.differ(format!(
                "{at_end} {what} at the end, {at_start} at the start"
            ))),
        }
    }

    fn differ(&self, what: String) -> Error {
        let [start, end] = self.paths.clone();
        Error::Ends { start, end, what }
    }
}

impl Source for Moving {
    fn reader(&self) -> String {
        format!("{},{}", self.start.reader(), self.end.reader())
    }

    /// In the wider precision of the two.
    fn shape(&self) -> Shape {
        let shape = self.start.shape();
        Shape {
            width: shape.width.max(self.end.shape().width),
            poses: 2,
            ..shape
        }
    }

    fn n_elements(&self) -> u64 {
        self.start.n_elements()
    }

    fn n_vertices(&self) -> u64 {
        self.start.n_vertices()
    }

    fn read(&self, first: u64, n: usize) -> Result<Option<Chunk>, Error> {
        let (Some(start), Some(end)) = (self.start.read(first, n)?, self.end.read(first, n)?)
        else {
            return Ok(None);
        };
        let corners = self.shape().corners;
        let elements = || {
            let at_start = start.vertices.chunks_exact(corners);
            at_start.zip(end.vertices.chunks_exact(corners))
        };
        if let Some(ix) = elements().position(|(a, b)| a != b) {
            let (a, b) = elements().nth(ix).unwrap_or_default();
            return Err(self.differ(format!(
                "element {} has the vertices {b:?} at the end, {a:?} at the start",
                first + ix as u64
            )));
        }
        let at_start = start.positions.chunks_exact(corners);
        let both = at_start.zip(end.positions.chunks_exact(corners));
        Ok(Some(Chunk {
            first,
            positions: both.flat_map(|(a, b)| [a, b].concat()).collect(),
            vertices: start.vertices,
        }))
    }

    /// Of the vertices that are at one position at both ends.
    fn weld(&self) -> Result<Weld, Error> {
        Ok(self.start.weld()?.and(&self.end.weld()?))
    }
}
