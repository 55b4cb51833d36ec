//! A body of a step with its vertices welded: those at one position at the start and at one
//! position at the end become one.
//!
//! Vertices are numbered in the answer, and the number of a welded vertex depends on all vertices
//! before it. So a body is welded as a whole before it is scattered, not tile by tile.

use super::Source;
use crate::chunk::{Chunk, Shape};
use crate::error::Error;

pub struct Welded {
    source: Box<dyn Source>,
    /// The welded vertex of each vertex of the source.
    map: Vec<u32>,
}

impl Welded {
    pub fn new(source: Box<dyn Source>) -> Result<Self, Error> {
        let map = source.weld()?.map().to_vec();
        Ok(Welded { source, map })
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
            *vertex = self.map[*vertex as usize];
        }
        Ok(chunk)
    }
}
