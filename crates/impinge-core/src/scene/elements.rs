//! The elements of bodies, given and derived: vertices, edges, boundary faces.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use crate::scene::index::ElementIx;
use crate::scene::words::words;

/// The kind of elements of a body, or of one of its parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum BodyKind {
    /// Points, one vertex index each.
    Points,
    /// Edges, two vertex indices each.
    Edges,
    /// Surface triangles, three vertex indices each.
    Triangles,
    /// Solid tetrahedra, four vertex indices each.
    Tetrahedra,
}

words!("kind", "points, edges, triangles or tetrahedra", BodyKind: [
    Points = "points", Edges = "edges", Triangles = "triangles", Tetrahedra = "tetrahedra"; 4
]);

impl BodyKind {
    /// How many corners an element of this kind has: 1 to 4.
    pub fn n_corners(self) -> usize {
        self as usize + 1
    }
}

/// The elements of a body, or of one part of it, as vertex indices.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Elements {
    /// `(n, 1)` vertex indices.
    Points(Vec<[u32; 1]>),
    /// `(n, 2)` vertex indices.
    Edges(Vec<[u32; 2]>),
    /// `(n, 3)` vertex indices.
    Triangles(Vec<[u32; 3]>),
    /// `(n, 4)` vertex indices.
    Tetrahedra(Vec<[u32; 4]>),
}

/// Runs the same code for every kind: `with_corners!(elements, |corners| …)`, where `corners` is a
/// `Vec<[u32; N]>` or a reference to one.
macro_rules! with_corners {
    ($elements:expr, |$corners:ident| $body:expr) => {
        match $elements {
            $crate::scene::elements::Elements::Points($corners) => $body,
            $crate::scene::elements::Elements::Edges($corners) => $body,
            $crate::scene::elements::Elements::Triangles($corners) => $body,
            $crate::scene::elements::Elements::Tetrahedra($corners) => $body,
        }
    };
}
pub(crate) use with_corners;

impl Elements {
    /// The number of elements.
    pub fn len(&self) -> usize {
        with_corners!(self, |corners| corners.len())
    }

    /// Whether there are no elements.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Points, edges, triangles or tetrahedra.
    pub fn kind(&self) -> BodyKind {
        match self {
            Elements::Points(_) => BodyKind::Points,
            Elements::Edges(_) => BodyKind::Edges,
            Elements::Triangles(_) => BodyKind::Triangles,
            Elements::Tetrahedra(_) => BodyKind::Tetrahedra,
        }
    }

    /// The vertex indices of one element, one to four of them.
    #[inline(always)]
    pub fn corners(&self, element: usize) -> &[u32] {
        with_corners!(self, |corners| &corners[element])
    }

    /// The same of an element of a part, whose elements these are; vertices are numbered as
    /// positions are.
    #[inline(always)]
    pub(crate) fn corners_in<'a>(&'a self, part: Part, element: &'a ElementIx) -> &'a [u32] {
        match part {
            Part::Vertices => element.as_corners(),
            _ => self.corners(element.index()),
        }
    }

    /// The vertex indices of one element; one with fewer than four corners repeats its last.
    #[inline(always)]
    pub(crate) fn four_corners(&self, element: usize) -> [u32; 4] {
        match self {
            Elements::Points(points) => {
                let [a] = points[element];
                [a; 4]
            }
            Elements::Edges(edges) => {
                let [a, b] = edges[element];
                [a, b, b, b]
            }
            Elements::Triangles(faces) => {
                let [a, b, c] = faces[element];
                [a, b, c, c]
            }
            Elements::Tetrahedra(tets) => tets[element],
        }
    }

    /// The first element with a vertex index that is not below `n_vertices`, and that index.
    pub(crate) fn first_bad_index(&self, n_vertices: usize) -> Option<(usize, u32)> {
        with_corners!(self, |elements| elements.iter().enumerate().find_map(
            |(element, corners)| {
                corners
                    .iter()
                    .find(|&&index| index as usize >= n_vertices)
                    .map(|&index| (element, index))
            }
        ))
    }

    pub(crate) fn bytes(&self) -> usize {
        with_corners!(self, |corners| size_of_val(&corners[..]))
    }
}

impl From<Vec<[u32; 1]>> for Elements {
    fn from(points: Vec<[u32; 1]>) -> Self {
        Elements::Points(points)
    }
}

impl From<Vec<[u32; 2]>> for Elements {
    fn from(edges: Vec<[u32; 2]>) -> Self {
        Elements::Edges(edges)
    }
}

impl From<Vec<[u32; 3]>> for Elements {
    fn from(faces: Vec<[u32; 3]>) -> Self {
        Elements::Triangles(faces)
    }
}

impl From<Vec<[u32; 4]>> for Elements {
    fn from(tets: Vec<[u32; 4]>) -> Self {
        Elements::Tetrahedra(tets)
    }
}

/// Which elements of a body a part holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Part {
    /// The elements that the body was given as.
    Given,
    /// The vertices that some element names; for tetrahedra, those that a boundary face names.
    /// Answers number them as positions are numbered.
    Vertices,
    /// The edges of the surface, or those that the body was given as.
    Edges,
    /// The faces of the surface: triangles as given, or the boundary of tetrahedra.
    Faces,
}

/// The elements that a body was given as, and the elements derived from them, each kind found when
/// first needed.
#[derive(Debug, Clone)]
pub(crate) struct Topology {
    given: Elements,
    vertices: OnceLock<Elements>,
    edges: OnceLock<Elements>,
    boundary: OnceLock<Elements>,
    /// The last ones that were asked for, with their number.
    rings: Arc<Mutex<Option<NumberedRings>>>,
}

/// Rings, and how many.
type NumberedRings = (u32, Arc<VertexRings>);

/// For each vertex, a sorted list of vertices: those at most some number of edges away, itself
/// included, or those that a caller listed.
#[derive(Debug)]
pub(crate) struct VertexRings {
    starts: Vec<usize>,
    vertices: Vec<u32>,
}

impl VertexRings {
    fn new(n_vertices: usize, n_rings: u32, elements: &Elements, edges: &Elements) -> Self {
        // All edges, also those inside of tetrahedra.
        let mut ends: Vec<[u32; 2]> = Vec::new();
        let mut add = |corners: &[u32]| {
            for (ix, &a) in corners.iter().enumerate() {
                ends.extend(corners[ix + 1..].iter().flat_map(|&b| [[a, b], [b, a]]));
            }
        };
        match elements {
            Elements::Tetrahedra(tetrahedra) => tetrahedra.iter().for_each(|of| add(of)),
            _ => (0..edges.len()).for_each(|ix| add(edges.corners(ix))),
        }
        ends.sort_unstable();
        ends.dedup();
        let next = VertexRings::of_pairs(n_vertices, &ends);
        let (mut starts, mut vertices) = (vec![0], Vec::new());
        // The last vertex from which each was reached.
        let mut reached = vec![u32::MAX; n_vertices];
        for vertex in 0..n_vertices as u32 {
            let first = vertices.len();
            vertices.push(vertex);
            reached[vertex as usize] = vertex;
            let mut ring = first;
            for _ in 0..n_rings {
                let end = vertices.len();
                for ix in ring..end {
                    for &to in next.of(vertices[ix]) {
                        if std::mem::replace(&mut reached[to as usize], vertex) != vertex {
                            vertices.push(to);
                        }
                    }
                }
                ring = end;
            }
            vertices[first..].sort_unstable();
            starts.push(vertices.len());
        }
        VertexRings { starts, vertices }
    }

    /// The second vertex of each pair, at the first one, of `n_vertices`. Pairs are sorted, and
    /// none is there twice.
    pub fn of_pairs(n_vertices: usize, pairs: &[[u32; 2]]) -> Self {
        let mut starts = vec![0; n_vertices + 1];
        for &[from, _] in pairs {
            starts[from as usize + 1] += 1;
        }
        for vertex in 0..n_vertices {
            starts[vertex + 1] += starts[vertex];
        }
        let vertices = pairs.iter().map(|&[_, to]| to).collect();
        VertexRings { starts, vertices }
    }

    /// Whether nothing is listed.
    pub fn is_empty(&self) -> bool {
        self.vertices.is_empty()
    }

    /// Whether any of some vertices is in the rings of a vertex.
    #[inline]
    pub fn reaches_any(&self, from: u32, to: &[u32]) -> bool {
        let rings = self.of(from);
        to.iter().any(|to| rings.binary_search(to).is_ok())
    }

    /// The list of a vertex.
    #[inline]
    pub fn of(&self, vertex: u32) -> &[u32] {
        let [start, end] = [0, 1].map(|next| self.starts[vertex as usize + next]);
        &self.vertices[start..end]
    }
}

impl Topology {
    pub fn new(given: Elements) -> Self {
        Topology {
            given,
            vertices: OnceLock::new(),
            edges: OnceLock::new(),
            boundary: OnceLock::new(),
            rings: Arc::default(),
        }
    }

    /// The vertices at most `n_rings` edges away from each vertex. Those asked for last are kept.
    pub fn rings(&self, n_vertices: usize, n_rings: u32) -> Arc<VertexRings> {
        let mut held = self.rings.lock().unwrap_or_else(PoisonError::into_inner);
        match &*held {
            Some((n, rings)) if *n == n_rings => Arc::clone(rings),
            _ => {
                let rings =
                    VertexRings::new(n_vertices, n_rings, &self.given, self.part(Part::Edges));
                let rings = Arc::new(rings);
                *held = Some((n_rings, Arc::clone(&rings)));
                rings
            }
        }
    }

    pub fn given(&self) -> &Elements {
        &self.given
    }

    /// One name for equal parts: the faces of a body given as triangles, or the edges of one given
    /// as edges, are `Given`.
    pub fn canonical(&self, part: Part) -> Part {
        match (part, self.given.kind()) {
            (Part::Faces, BodyKind::Triangles) | (Part::Edges, BodyKind::Edges) => Part::Given,
            _ => part,
        }
    }

    /// The elements of a part; empty if the body has none, as points have no edges.
    pub fn part(&self, part: Part) -> &Elements {
        match self.canonical(part) {
            Part::Given => &self.given,
            Part::Vertices => self.vertices.get_or_init(|| self.find_vertices()),
            Part::Edges => self.edges.get_or_init(|| self.find_edges()),
            Part::Faces => self.boundary.get_or_init(|| self.find_boundary()),
        }
    }

    /// The boundary of tetrahedra, else the given elements.
    fn surface(&self) -> &Elements {
        match self.given.kind() {
            BodyKind::Tetrahedra => self.part(Part::Faces),
            _ => &self.given,
        }
    }

    fn find_vertices(&self) -> Elements {
        let named = with_corners!(self.surface(), |corners| corners.as_flattened());
        let n = named.iter().max().map_or(0, |&last| last as usize + 1);
        let mut takes_part = vec![false; n];
        for &vertex in named {
            takes_part[vertex as usize] = true;
        }
        let vertices = (0u32..).zip(takes_part).filter(|&(_, takes)| takes);
        Elements::Points(vertices.map(|(vertex, _)| [vertex]).collect())
    }

    /// Unique pairs `[low, high]` in the order of `(high, low)`, as `igl::edges` numbers them. The
    /// same vertex twice is not an edge.
    fn find_edges(&self) -> Elements {
        let mut keys: Vec<u64> = match self.surface() {
            Elements::Triangles(faces) => faces
                .iter()
                .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
                .filter(|(a, b)| a != b)
                .map(|(a, b)| u64::from(a.max(b)) << 32 | u64::from(a.min(b)))
                .collect(),
            _ => Vec::new(),
        };
        keys.sort_unstable();
        keys.dedup();
        Elements::Edges(
            keys.into_iter()
                .map(|key| [key as u32, (key >> 32) as u32])
                .collect(),
        )
    }

    /// All faces except those between two different tetrahedra, each once, in the order of the
    /// first tetrahedron that has it and of the opposite corner. A face points outward if that
    /// tetrahedron is oriented positively. A face that more than two tetrahedra share counts as
    /// surface, and so does one shared by two tetrahedra with the same vertices: nothing may pass
    /// through it unseen.
    fn find_boundary(&self) -> Elements {
        let Elements::Tetrahedra(tets) = &self.given else {
            return Elements::Triangles(Vec::new());
        };
        // The face opposite a corner. The number of a side is four times that of its tetrahedron,
        // and that of the corner.
        let face = |side: usize| {
            let [a, b, c, d] = tets[side / 4];
            match side % 4 {
                0 => [b, c, d],
                1 => [a, d, c],
                2 => [a, b, d],
                _ => [a, c, b],
            }
        };
        let sorted = |side: usize| {
            let mut face = face(side);
            face.sort_unstable();
            (face, side)
        };
        let mut sides: Vec<([u32; 3], usize)> = (0..4 * tets.len()).map(sorted).collect();
        sides.sort_unstable();
        let shared = sides.chunk_by(|a, b| a.0 == b.0).filter(|shared| {
            let opposite = |ix: usize| tets[shared[ix].1 / 4][shared[ix].1 % 4];
            is_boundary(shared.len(), opposite)
        });
        let mut firsts: Vec<usize> = shared.map(|shared| shared[0].1).collect();
        firsts.sort_unstable();
        let boundary = firsts.into_iter().map(face).collect();
        Elements::Triangles(boundary)
    }

    pub fn bytes(&self) -> usize {
        let found = [&self.vertices, &self.edges, &self.boundary];
        let found = found.into_iter().filter_map(OnceLock::get);
        self.given.bytes() + found.map(Elements::bytes).sum::<usize>()
    }
}

/// Whether a face that `n` tetrahedra have is on their boundary, by the corner opposite it of each:
/// it is not if it lies between two different ones.
pub(crate) fn is_boundary(n: usize, opposite: impl Fn(usize) -> u32) -> bool {
    n != 2 || opposite(0) == opposite(1)
}

/// The elements of a body by part: as found, or with edges as the caller numbers them.
#[derive(Debug, Clone)]
pub(crate) struct Parts {
    topology: Arc<Topology>,
    /// The edges of the caller, if there are any.
    pub own_edges: Option<Arc<Elements>>,
}

impl Parts {
    pub fn new(given: Elements) -> Self {
        Parts {
            topology: Arc::new(Topology::new(given)),
            own_edges: None,
        }
    }

    /// The elements of a part.
    pub fn part(&self, part: Part) -> &Elements {
        match (part, &self.own_edges) {
            (Part::Edges, Some(edges)) => edges,
            _ => self.topology.part(part),
        }
    }

    /// The edges in the order of the library.
    pub fn found_edges(&self) -> &Elements {
        self.topology.part(Part::Edges)
    }

    pub fn bytes(&self) -> usize {
        let own = self.own_edges.as_ref();
        self.topology.bytes() + own.map_or(0, |edges| edges.bytes())
    }
}

impl std::ops::Deref for Parts {
    type Target = Topology;
    fn deref(&self) -> &Topology {
        &self.topology
    }
}

/// Finds edges, none of which is there twice, by their vertices.
pub(crate) struct EdgeFinder<'a> {
    edges: &'a [[u32; 2]],
    /// By higher and lower vertex: the order of the library's own numbers.
    sorted: Vec<u32>,
}

/// Where an edge is among sorted ones, whatever its direction.
fn place(&[a, b]: &[u32; 2]) -> [u32; 2] {
    [a.max(b), a.min(b)]
}

impl<'a> EdgeFinder<'a> {
    pub fn new(edges: &'a Elements) -> Self {
        let edges = match edges {
            Elements::Edges(edges) => &edges[..],
            _ => &[],
        };
        let mut sorted: Vec<u32> = (0..edges.len() as u32).collect();
        sorted.sort_unstable_by_key(|&ix| place(&edges[ix as usize]));
        EdgeFinder { edges, sorted }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.edges.len()
    }

    /// The number of the edge between two vertices.
    pub fn find(&self, ends: [u32; 2]) -> Option<usize> {
        let of = |&ix: &u32| place(&self.edges[ix as usize]);
        let found = self.sorted.binary_search_by_key(&place(&ends), of);
        found.ok().map(|at| self.sorted[at] as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_are_numbered_by_their_higher_vertex() {
        let faces = Elements::from(vec![[2, 0, 1], [1, 3, 2], [5, 5, 0]]);
        let topology = Topology::new(faces);
        let expected = vec![[0, 1], [0, 2], [1, 2], [1, 3], [2, 3], [0, 5]];
        assert_eq!(*topology.part(Part::Edges), Elements::from(expected));
        let vertices = vec![[0], [1], [2], [3], [5]];
        assert_eq!(*topology.part(Part::Vertices), Elements::from(vertices));
        assert_eq!(topology.part(Part::Faces), topology.given());
    }

    #[test]
    fn what_lies_inside_tetrahedra_takes_no_part() {
        // One vertex inside a tetrahedron, joined to its four sides; another vertex that no element
        // names.
        let tets = vec![[5, 1, 2, 3], [0, 5, 2, 3], [0, 1, 5, 3], [0, 1, 2, 5]];
        let topology = Topology::new(Elements::from(tets));
        let vertices = vec![[0], [1], [2], [3]];
        assert_eq!(*topology.part(Part::Vertices), Elements::from(vertices));
        assert_eq!(topology.part(Part::Faces).len(), 4);
        assert_eq!(topology.part(Part::Edges).len(), 6);
        for ix in 0..4 {
            assert!(!topology.part(Part::Faces).corners(ix).contains(&5));
        }
    }

    #[test]
    fn edges_and_points_have_what_they_were_given_as() {
        let edges = Topology::new(Elements::from(vec![[3, 1], [1, 0]]));
        assert_eq!(edges.part(Part::Edges), edges.given());
        assert_eq!(edges.part(Part::Vertices).len(), 3);
        assert!(edges.part(Part::Faces).is_empty());
        let points = Topology::new(Elements::from(vec![[4], [2], [4]]));
        let vertices = vec![[2], [4]];
        assert_eq!(*points.part(Part::Vertices), Elements::from(vertices));
        assert!(points.part(Part::Edges).is_empty());
    }
}
