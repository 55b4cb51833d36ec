//! A mesh as plain data, and the arithmetic that generators share.

use impinge::{BodyId, Elements, Error, Scene};

/// The most elements that a generator makes; larger requests are reduced to it, so that vertex
/// indices fit in 32 bits.
pub const MAX_ELEMENTS: usize = 1 << 30;

/// A mesh: positions and elements.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// `(v, 3)` vertex positions.
    pub positions: Vec<[f32; 3]>,
    /// Triangles or tetrahedra as vertex indices.
    pub elements: Elements,
}

impl Model {
    /// How many elements it has.
    pub fn n_elements(&self) -> usize {
        self.elements.len()
    }

    /// How many vertices it has.
    pub fn n_vertices(&self) -> usize {
        self.positions.len()
    }

    /// Smallest and largest coordinates; `None` if there are no vertices.
    pub fn bounds(&self) -> Option<([f32; 3], [f32; 3])> {
        let &first = self.positions.first()?;
        Some(self.positions.iter().fold((first, first), |(min, max), p| {
            (
                std::array::from_fn(|axis| min[axis].min(p[axis])),
                std::array::from_fn(|axis| max[axis].max(p[axis])),
            )
        }))
    }

    /// The same mesh, moved: one f32 addition per coordinate.
    pub fn translated(&self, offset: [f32; 3]) -> Model {
        self.mapped(|p| add(p, offset))
    }

    /// The same mesh, scaled about the origin: one f32 product per coordinate, exact for powers of
    /// two.
    pub fn scaled(&self, factor: f32) -> Model {
        self.mapped(|p| p.map(|x| x * factor))
    }

    /// The same mesh with every position mapped.
    pub fn mapped(&self, map: impl Fn([f32; 3]) -> [f32; 3]) -> Model {
        Model {
            positions: self.positions.iter().map(|&p| map(p)).collect(),
            elements: self.elements.clone(),
        }
    }

    /// The positions in double precision, without rounding.
    pub fn positions_f64(&self) -> Vec<[f64; 3]> {
        self.positions.iter().map(|p| p.map(f64::from)).collect()
    }

    /// Adds the mesh to a scene as a body.
    ///
    /// # Errors
    /// As [`Scene::add`].
    pub fn add_to(&self, scene: &mut Scene) -> Result<BodyId, Error> {
        scene.add((self.elements.clone(), self.positions.clone()))
    }
}

/// Triangles under construction.
#[derive(Debug, Clone, Default)]
pub(crate) struct Mesh {
    pub positions: Vec<[f32; 3]>,
    pub faces: Vec<[u32; 3]>,
}

impl Mesh {
    /// Adds a triangle with vertices of its own.
    pub fn push(&mut self, corners: [[f32; 3]; 3]) {
        let first = index(self.positions.len());
        self.positions.extend(corners);
        self.faces.push([first, first + 1, first + 2]);
    }

    pub fn append(&mut self, other: &Mesh) {
        let first = index(self.positions.len());
        self.positions.extend(&other.positions);
        self.faces.extend(
            other
                .faces
                .iter()
                .map(|face| face.map(|corner| corner + first)),
        );
    }

    /// Splits evenly spread faces, each at a new vertex, until there are `n_faces` faces (or one
    /// less: a split adds two faces, and a closed surface stays closed). The new vertex is the
    /// face's centroid, mapped by `place`.
    pub fn split_to(&mut self, n_faces: usize, place: impl Fn([f32; 3]) -> [f32; 3]) {
        while self.faces.len() + 2 <= n_faces {
            let n_old = self.faces.len();
            let n_splits = ((n_faces - n_old) / 2).min(n_old);
            for split in 0..n_splits {
                let [a, b, c] = self.faces[split * n_old / n_splits];
                let corners = [a, b, c].map(|corner| self.positions[corner as usize]);
                let centroid = std::array::from_fn(|axis| {
                    (corners[0][axis] + corners[1][axis] + corners[2][axis]) / 3.0
                });
                let middle = index(self.positions.len());
                self.positions.push(place(centroid));
                self.faces[split * n_old / n_splits] = [a, b, middle];
                self.faces.push([b, c, middle]);
                self.faces.push([c, a, middle]);
            }
        }
    }

    pub fn model(self) -> Model {
        Model {
            positions: self.positions,
            elements: Elements::Triangles(self.faces),
        }
    }
}

/// A vertex index. Generators stay below [`MAX_ELEMENTS`], which needs fewer than 2^32 vertices.
pub(crate) fn index(vertex: usize) -> u32 {
    u32::try_from(vertex).expect("generators are limited to MAX_ELEMENTS")
}

/// Rounds a position to nearest in f32. Generators leave double precision only here.
pub(crate) fn to_f32(p: [f64; 3]) -> [f32; 3] {
    p.map(|x| x as f32)
}

/// A count as a real number: counts here are far below 2^53, so this is exact.
pub(crate) fn real(count: usize) -> f64 {
    count as f64
}

/// A real number rounded to a count; negative and NaN give 0.
pub(crate) fn count(x: f64) -> usize {
    x.round() as usize
}

pub(crate) fn add(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|axis| a[axis] + b[axis])
}

pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

pub(crate) fn normalised(a: [f64; 3]) -> [f64; 3] {
    let length = a.iter().map(|x| x * x).sum::<f64>().sqrt();
    a.map(|x| x / length)
}
