//! A body of a step with its vertices welded: those at one position at the start and at one
//! position at the end become one.
//!
//! The answer numbers vertices, a welded one as the first at its position in the file. So a body is
//! welded as a whole before it is scattered, not tile by tile.

use super::Source;
use crate::chunk::{Chunk, Shape};
use crate::error::Error;

pub struct Welded {
    source: Box<dyn Source>,
    /// The first vertex of the source at the position of each.
    firsts: Vec<u32>,
}

impl Welded {
    pub fn new(source: Box<dyn Source>) -> Result<Self, Error> {
        let weld = source.weld()?;
        let first = |&welded: &u32| weld.firsts()[welded as usize];
        let firsts = weld.map().iter().map(first).collect();
        Ok(Welded { source, firsts })
    }
}

impl Source for Welded {
    fn reader(&self) -> String {
        self.source.reader()
    }

    fn shape(&self) -> Shape {
        self.source.shape()
    }

    fn n_elements(&self) -> u64 {
        self.source.n_elements()
    }

    fn n_vertices(&self) -> u64 {
        self.source.n_vertices()
    }

    fn read(&self, first: u64, n: usize) -> Result<Option<Chunk>, Error> {
        let mut chunk = self.source.read(first, n)?;
        for vertex in chunk.iter_mut().flat_map(|chunk| &mut chunk.vertices) {
            *vertex = self.firsts[*vertex as usize];
        }
        Ok(chunk)
    }
}
