//! A mesh as plain arrays, and the welding of its vertices.

/// Vertex positions in the precision of their file: binary `float` stays f32; text is read as f64,
/// so that no coordinate is silently rounded to f32.
#[derive(Debug, Clone, PartialEq)]
pub enum Positions {
    /// One `[x, y, z]` per vertex, in the file's unit of length.
    F32(Vec<[f32; 3]>),
    /// One `[x, y, z]` per vertex, in the file's unit of length.
    F64(Vec<[f64; 3]>),
}

impl Positions {
    /// How many vertices there are.
    pub fn len(&self) -> usize {
        match self {
            Positions::F32(p) => p.len(),
            Positions::F64(p) => p.len(),
        }
    }

    /// Whether there are no vertices.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The position of vertex `ix` in f64, which holds every f32 exactly; `None` if there is no
    /// such vertex.
    pub fn get(&self, ix: usize) -> Option<[f64; 3]> {
        match self {
            Positions::F32(p) => p.get(ix).map(|v| v.map(f64::from)),
            Positions::F64(p) => p.get(ix).copied(),
        }
    }

    /// All positions in f64, without loss.
    pub fn to_f64(&self) -> Vec<[f64; 3]> {
        match self {
            Positions::F32(p) => p.iter().map(|v| v.map(f64::from)).collect(),
            Positions::F64(p) => p.clone(),
        }
    }

    /// All positions in f32, each coordinate rounded to the nearest. Lossless for `F32`, and for
    /// `F64` if and only if [`narrow_if_exact`](Self::narrow_if_exact) would narrow.
    pub fn to_f32_rounded(&self) -> Vec<[f32; 3]> {
        match self {
            Positions::F32(p) => p.clone(),
            Positions::F64(p) => p.iter().map(|v| v.map(nearest_f32)).collect(),
        }
    }

    /// Converts `F64` to `F32` if every coordinate is exactly representable in f32. Returns whether
    /// the positions are f32 now.
    ///
    /// No coordinate changes its value, so no answer about the mesh changes; this halves the
    /// memory.
    pub fn narrow_if_exact(&mut self) -> bool {
        let Positions::F64(wide) = self else {
            return true;
        };
        let exact = |v: &[f64; 3]| v.iter().all(|&c| f64::from(nearest_f32(c)) == c);
        if !wide.iter().all(exact) {
            return false;
        }
        *self = Positions::F32(self.to_f32_rounded());
        true
    }
}

/// The f32 nearest to `value`. This is the only place where this crate rounds a coordinate.
fn nearest_f32(value: f64) -> f32 {
    value as f32
}

/// The elements of a mesh: vertex indices counted from 0, in the order of the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Elements {
    /// Three vertices per triangle.
    Triangles(Vec<[u32; 3]>),
    /// Four vertices per tetrahedron.
    Tetrahedra(Vec<[u32; 4]>),
}

impl Elements {
    /// How many elements there are.
    pub fn len(&self) -> usize {
        match self {
            Elements::Triangles(t) => t.len(),
            Elements::Tetrahedra(t) => t.len(),
        }
    }

    /// Whether there are no elements.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All vertex indices, element by element.
    pub fn indices(&self) -> &[u32] {
        match self {
            Elements::Triangles(t) => t.as_flattened(),
            Elements::Tetrahedra(t) => t.as_flattened(),
        }
    }

    pub(crate) fn indices_mut(&mut self) -> &mut [u32] {
        match self {
            Elements::Triangles(t) => t.as_flattened_mut(),
            Elements::Tetrahedra(t) => t.as_flattened_mut(),
        }
    }
}

/// One body: vertices and elements. Readers guarantee that every index is in range and every
/// coordinate is finite.
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    /// The positions of the vertices.
    pub positions: Positions,
    /// The vertices of each element.
    pub elements: Elements,
}

impl Mesh {
    /// How many vertices there are.
    pub fn n_vertices(&self) -> usize {
        self.positions.len()
    }

    /// How many elements there are.
    pub fn n_elements(&self) -> usize {
        self.elements.len()
    }
}

/// A map from vertices to welded vertices: vertices at the same position become one.
///
/// Keep it for reading a sequence: the frames have the vertices of the file, and
/// [`Weld::positions`] converts them to those of the welded mesh.
///
/// ```
/// use impinge_io::{Positions, Weld};
/// let positions = Positions::F32(vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [-0.0, 0.0, 0.0]]);
/// let weld = Weld::by_position(&positions);
/// assert_eq!(weld.n_welded(), 1);
/// assert_eq!(weld.map(), [0, 1, 0]);
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Weld(impinge_weld::Weld);

impl Weld {
    /// Welds vertices whose coordinates are all equal as numbers (-0.0 equals 0.0). Of equal
    /// vertices the first one stays, and the order of vertices is kept. NaN equals nothing, so a
    /// vertex with NaN is never welded.
    pub fn by_position(positions: &Positions) -> Self {
        Weld(match positions {
            Positions::F32(p) => impinge_weld::Weld::by_position(p),
            Positions::F64(p) => impinge_weld::Weld::by_position(p),
        })
    }

    /// Welds only vertices that both weldings weld: given two poses of the same vertices, those
    /// that coincide in both.
    ///
    /// # Panics
    /// If the two weldings have different numbers of vertices.
    pub fn and(&self, other: &Weld) -> Self {
        Weld(self.0.and(&other.0))
    }

    /// How many vertices the welding removed.
    pub fn n_welded(&self) -> usize {
        self.0.n_welded()
    }

    /// For each vertex before the welding, its index after it.
    pub fn map(&self) -> &[u32] {
        self.0.map()
    }

    /// For each vertex after the welding, the first vertex before it that is at its position;
    /// ascending.
    pub fn firsts(&self) -> &[u32] {
        self.0.firsts()
    }

    /// Welds the mesh that this welding was computed from: its vertices, and the indices of its
    /// elements.
    pub fn apply(&self, mesh: &mut Mesh) {
        if self.n_welded() == 0 {
            return;
        }
        if let Some(positions) = self.positions(&mesh.positions) {
            mesh.positions = positions;
            for ix in mesh.elements.indices_mut() {
                *ix = self.0.index(*ix);
            }
        }
    }

    /// Two welded vertices that have different positions in `positions`; `None` if there are none,
    /// or if these are the positions of another number of vertices.
    ///
    /// In a frame of a sequence this means that the mesh comes apart at a welded vertex.
    pub fn torn(&self, positions: &Positions) -> Option<[u32; 2]> {
        match positions {
            Positions::F32(p) => self.0.torn(p),
            Positions::F64(p) => self.0.torn(p),
        }
    }

    /// The positions of the welded vertices, taken from those of all vertices (of any frame);
    /// `None` if their number differs.
    pub fn positions(&self, positions: &Positions) -> Option<Positions> {
        Some(match positions {
            Positions::F32(p) => Positions::F32(self.0.positions(p).ok()?),
            Positions::F64(p) => Positions::F64(self.0.positions(p).ok()?),
        })
    }
}

/// Welds the vertices of `mesh` that are at the same position (compared as numbers, exactly) and
/// returns how many it removed.
///
/// Elements keep their number and order, so their ids do not change; elements whose corners are
/// welded become degenerate and stay. To weld the frames of a sequence in the same way, see
/// [`Weld`].
pub fn weld(mesh: &mut Mesh) -> usize {
    let weld = Weld::by_position(&mesh.positions);
    weld.apply(mesh);
    weld.n_welded()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weld_keeps_first_occurrences_and_element_order() {
        let mut mesh = Mesh {
            positions: Positions::F64(vec![
                [1.0, 0.0, 0.0],
                [0.0, 0.0, 0.0],
                [1.0, -0.0, 0.0],
                [0.0, 2.0, 0.0],
                [0.0, 0.0, -0.0],
            ]),
            elements: Elements::Triangles(vec![[0, 1, 3], [2, 4, 3], [1, 4, 0]]),
        };
        assert_eq!(weld(&mut mesh), 2);
        assert_eq!(
            mesh.positions,
            Positions::F64(vec![[1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 2.0, 0.0]])
        );
        assert_eq!(
            mesh.elements,
            Elements::Triangles(vec![[0, 1, 2], [0, 1, 2], [1, 1, 0]])
        );
        assert_eq!(weld(&mut mesh), 0);
    }

    #[test]
    fn weld_applies_to_other_frames() {
        let weld = Weld::by_position(&Positions::F32(vec![[0.0; 3], [0.0; 3], [1.0; 3]]));
        let frame = Positions::F64(vec![[5.0; 3], [6.0; 3], [7.0; 3]]);
        assert_eq!(
            weld.positions(&frame),
            Some(Positions::F64(vec![[5.0; 3], [7.0; 3]]))
        );
        assert_eq!(weld.positions(&Positions::F32(vec![])), None);
    }

    #[test]
    fn narrowing_is_lossless_or_does_not_happen() {
        let mut exact = Positions::F64(vec![[0.5, -0.25, 1e30f32 as f64]]);
        assert!(exact.narrow_if_exact());
        assert_eq!(exact, Positions::F32(vec![[0.5, -0.25, 1e30]]));
        let mut inexact = Positions::F64(vec![[0.5, 0.1, 0.0]]);
        assert!(!inexact.narrow_if_exact());
        assert_eq!(inexact, Positions::F64(vec![[0.5, 0.1, 0.0]]));
        let mut huge = Positions::F64(vec![[1e300, 0.0, 0.0]]);
        assert!(!huge.narrow_if_exact());
        let mut tiny = Positions::F64(vec![[1e-60, 0.0, 0.0]]);
        assert!(!tiny.narrow_if_exact());
    }
}
