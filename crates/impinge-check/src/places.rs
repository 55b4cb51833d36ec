//! Where the problems of a mesh are.

use serde::{Deserialize, Serialize};

use impinge_io::{Elements, Mesh};

use crate::marks::{Marks, Problem};
use crate::union_find::UnionFind;

/// Elements that a place names unless all are asked for.
const NAMED: usize = 8;

/// One place with a problem: elements that have it and hang together by common vertices, or a
/// vertex of several fans.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Place {
    /// The problem.
    pub problem: Problem,
    /// The vertex of several fans, numbered as in the mesh before welding, of welded ones the
    /// first, so no index into the mesh that was [checked](crate::Checked::mesh); then the elements
    /// are those around it.
    pub vertex: Option<u32>,
    /// The middle of the element that is nearest to the middle of the place, or the vertex;
    /// rounded.
    pub point: [f64; 3],
    /// The diagonal of the box around the elements, rounded.
    pub size: f64,
    /// How many elements there are.
    pub n_elements: u64,
    /// Their numbers, ascending: the first few, or all if [`Options::faces`](crate::Options::faces)
    /// asks for them.
    pub elements: Vec<u32>,
}

/// The largest places of each problem, at most `most` of each. `fans`: the vertices of several
/// fans.
pub fn places(
    mesh: &Mesh,
    marks: &[Marks],
    fans: &[u32],
    most: usize,
    names_all: bool,
) -> Vec<Place> {
    if most == 0 {
        return Vec::new();
    }
    let found =
        Problem::ALL.into_iter().flat_map(|problem| {
            let marked: Vec<u32> = (0u32..)
                .zip(marks)
                .filter(|(_, marks)| marks.has(problem))
                .map(|(element, _)| element)
                .collect();
            let mut sets = connected(mesh, &marked);
            sets.sort_by_key(|set| std::cmp::Reverse(set.len()));
            sets.truncate(most);
            let of_elements = sets
                .into_iter()
                .map(|set| place(mesh, problem, None, set, names_all));
            let mut found: Vec<Place> = of_elements.collect();
            if problem == Problem::NonManifold {
                found.extend(around(mesh, &fans[..fans.len().min(most)]).into_iter().map(
                    |(vertex, elements)| place(mesh, problem, Some(vertex), elements, names_all),
                ));
            }
            found
        });
    found.collect()
}

fn corners(mesh: &Mesh, element: u32) -> &[u32] {
    match &mesh.elements {
        Elements::Triangles(triangles) => &triangles[element as usize],
        Elements::Tetrahedra(tets) => &tets[element as usize],
    }
}

/// Sets of elements that hang together by common vertices, each ascending.
fn connected(mesh: &Mesh, marked: &[u32]) -> Vec<Vec<u32>> {
    if marked.is_empty() {
        return Vec::new();
    }
    let mut sets = UnionFind::new(mesh.n_vertices() as u32);
    for &element in marked {
        let corners = corners(mesh, element);
        for &vertex in &corners[1..] {
            sets.join(corners[0], vertex);
        }
    }
    let mut by_root: Vec<(u32, u32)> = marked
        .iter()
        .map(|&element| (sets.root(corners(mesh, element)[0]), element))
        .collect();
    by_root.sort_unstable();
    by_root
        .chunk_by(|a, b| a.0 == b.0)
        .map(|set| set.iter().map(|&(_, element)| element).collect())
        .collect()
}

/// The elements around each of a few vertices.
fn around(mesh: &Mesh, vertices: &[u32]) -> Vec<(u32, Vec<u32>)> {
    let mut found: Vec<(u32, Vec<u32>)> = vertices.iter().map(|&v| (v, Vec::new())).collect();
    if found.is_empty() {
        return found;
    }
    for element in 0..mesh.n_elements() as u32 {
        for vertex in corners(mesh, element) {
            if let Ok(place) = vertices.binary_search(vertex) {
                found[place].1.push(element);
            }
        }
    }
    found
}

fn place(
    mesh: &Mesh,
    problem: Problem,
    vertex: Option<u32>,
    elements: Vec<u32>,
    names_all: bool,
) -> Place {
    let at = |vertex: u32| mesh.positions.get(vertex as usize).unwrap_or_default();
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for point in elements
        .iter()
        .flat_map(|&element| corners(mesh, element))
        .map(|&v| at(v))
    {
        for axis in 0..3 {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
    }
    // Halves first, so that nothing overflows.
    let middle = [0, 1, 2].map(|axis| 0.5 * low[axis] + 0.5 * high[axis]);
    let center = |element: u32| {
        let corners = corners(mesh, element);
        let n = corners.len() as f64;
        [0, 1, 2].map(|axis| corners.iter().map(|&v| at(v)[axis] / n).sum::<f64>())
    };
    let distance = |p: [f64; 3]| -> f64 {
        [0, 1, 2]
            .map(|axis| (p[axis] - middle[axis]).powi(2))
            .iter()
            .sum()
    };
    let nearest = elements
        .iter()
        .copied()
        .min_by(|&a, &b| distance(center(a)).total_cmp(&distance(center(b))));
    let size = [0, 1, 2].map(|axis| high[axis] - low[axis]);
    let size = size[0].hypot(size[1]).hypot(size[2]);
    let n_elements = elements.len() as u64;
    let mut elements = elements;
    let point = match (vertex, nearest) {
        (Some(vertex), _) => at(vertex),
        (None, Some(element)) => center(element),
        (None, None) => [0.0; 3],
    };
    if !names_all {
        elements.truncate(NAMED);
    }
    Place {
        problem,
        vertex,
        point,
        size: size.min(f64::MAX),
        n_elements,
        elements,
    }
}
