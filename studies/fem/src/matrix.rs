//! The system matrix: 3×3 blocks for every two vertices that share a tetrahedron, in compressed
//! rows.

use rayon::prelude::*;

use crate::elasticity::{GRAIN, Turned};
use crate::element::{Mat3, Vec3};
use crate::lists::Lists;
use crate::mesh::Mesh;

/// The matrix is symmetric, but all blocks are stored, so that one thread sums each row in a fixed
/// order.
#[derive(Debug)]
pub(crate) struct BlockMatrix {
    /// Columns of each row, ascending.
    columns: Lists,
    /// The blocks, row after row.
    blocks: Vec<Mat3>,
    /// The index of the diagonal block of each row.
    diagonal: Vec<u32>,
    /// For each block, the pairs of corners that contribute to it: 16 · element + 4 · row's corner
    /// + column's corner, ascending.
    contributions: Lists,
}

impl BlockMatrix {
    /// The matrix with its pattern, which never changes; blocks are 0.
    pub fn new(mesh: &Mesh) -> Self {
        let mut columns = Lists::default();
        let mut contributions = Lists::default();
        let mut diagonal = Vec::with_capacity(mesh.n_vertices());
        let mut row: Vec<(u32, u32)> = Vec::new();
        for vertex in 0..mesh.n_vertices() {
            row.clear();
            for &entry in mesh.tets_at.get(vertex) {
                let corners = mesh.elements[entry as usize / 4].corners;
                row.extend(
                    (0u32..)
                        .zip(corners)
                        .map(|(k, column)| (column, 4 * entry + k)),
                );
            }
            row.sort_unstable();
            let first = columns.entries().len();
            let groups = || row.chunk_by(|a, b| a.0 == b.0);
            columns.push(groups().map(|group| group[0].0));
            groups().for_each(|group| contributions.push(group.iter().map(|&(_, c)| c)));
            let here = groups().position(|group| group[0].0 as usize == vertex);
            diagonal.push((first + here.unwrap_or(0)) as u32);
        }
        BlockMatrix {
            blocks: vec![Mat3::zeros(); columns.entries().len()],
            columns,
            diagonal,
            contributions,
        }
    }

    /// Sets the matrix to `factor` times the stiffness.
    pub fn assemble(&mut self, turned: &[Turned], factor: f64) {
        let contributions = &self.contributions;
        self.blocks
            .par_iter_mut()
            .with_min_len(GRAIN)
            .enumerate()
            .for_each(|(block_ix, block)| {
                let sum = contributions
                    .get(block_ix)
                    .iter()
                    .fold(Mat3::zeros(), |sum, &c| {
                        let c = c as usize;
                        sum + turned[c / 16].stiffness(c / 4 % 4, c % 4)
                    });
                *block = sum * factor;
            });
    }

    /// The block on the diagonal of a row.
    pub fn diagonal(&self, row: usize) -> &Mat3 {
        &self.blocks[self.diagonal[row] as usize]
    }

    /// The same block, mutable.
    pub fn diagonal_mut(&mut self, row: usize) -> &mut Mat3 {
        &mut self.blocks[self.diagonal[row] as usize]
    }

    /// A row of the product with `x`.
    #[inline]
    pub fn row_times(&self, row: usize, x: &[Vec3]) -> Vec3 {
        let range = self.columns.range(row);
        self.columns.entries()[range.clone()]
            .iter()
            .zip(&self.blocks[range])
            .fold(Vec3::zeros(), |sum, (&column, block)| {
                sum + block * x[column as usize]
            })
    }
}
