//! Elements listed by a vertex of theirs.

/// Of each vertex some elements, in the order in which they were named.
#[derive(Debug)]
pub struct ByVertex {
    /// The elements of vertex v are `elements[starts[v]..starts[v + 1]]`.
    starts: Vec<usize>,
    elements: Vec<u32>,
}

impl ByVertex {
    /// Lists elements, each after its vertex. Vertices must be below `n_vertices`.
    pub fn new(n_vertices: usize, named: impl Iterator<Item = (u32, u32)> + Clone) -> Self {
        let mut starts = vec![0usize; n_vertices + 1];
        for (vertex, _) in named.clone() {
            starts[vertex as usize + 1] += 1;
        }
        for ix in 1..starts.len() {
            starts[ix] += starts[ix - 1];
        }
        let mut next = starts.clone();
        let mut elements = vec![0; starts[n_vertices]];
        for (vertex, element) in named {
            let place = &mut next[vertex as usize];
            elements[*place] = element;
            *place += 1;
        }
        ByVertex { starts, elements }
    }

    /// Lists faces at each of their corners.
    pub fn of_faces(n_vertices: usize, faces: &[[u32; 3]]) -> Self {
        let named = (0u32..).zip(faces);
        let named = named.flat_map(|(face, corners)| corners.map(|vertex| (vertex, face)));
        ByVertex::new(n_vertices, named)
    }

    /// Those of a vertex.
    pub fn of(&self, vertex: u32) -> &[u32] {
        &self.elements[self.starts[vertex as usize]..self.starts[vertex as usize + 1]]
    }

    /// Those of each vertex.
    pub fn iter(&self) -> impl Iterator<Item = &[u32]> {
        let ends = self.starts.windows(2);
        ends.map(|run| &self.elements[run[0]..run[1]])
    }
}
