//! Facets: the edges of triangles, the faces of tetrahedra, and which elements meet at each.
//!
//! All facets of all elements are listed with their vertices in ascending order, and sorted, so
//! that equal facets are neighbours. One counting pass sorts by the smallest vertex; only short
//! runs remain to be sorted. Cost: linear in elements for meshes whose vertices have few
//! neighbours. Scratch: 20 bytes per facet, twice.

/// One facet of one element.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Facet {
    /// Its vertices, ascending; an edge repeats its second vertex.
    pub vertices: [u32; 3],
    /// The element.
    pub element: u32,
    /// Whether the element passes through the ascending vertices in an even permutation.
    pub is_even: bool,
}

/// Whether no vertex is named twice. Elements that name a vertex twice have no facets here.
pub fn is_simplex<const K: usize>(corners: &[u32; K]) -> bool {
    (1..K).all(|ix| !corners[..ix].contains(&corners[ix]))
}

/// All facets of all elements that name K different vertices, sorted.
pub fn facets<const K: usize>(elements: &[[u32; K]], n_vertices: usize) -> Vec<Facet> {
    let mut list = Vec::with_capacity(elements.len() * K);
    for (element, corners) in (0u32..).zip(elements) {
        if is_simplex(corners) {
            list.extend((0..K).map(|left_out| facet(corners, element, left_out)));
        }
    }
    sort_by_first(list, n_vertices)
}

/// The facet opposite the corner `left_out`.
fn facet<const K: usize>(corners: &[u32; K], element: u32, left_out: usize) -> Facet {
    let mut vertices = [u32::MAX; 3];
    let mut n = 0;
    // The boundary of a simplex: the sign alternates with the corner left out.
    let mut is_even = left_out.is_multiple_of(2);
    for (ix, &vertex) in corners.iter().enumerate() {
        if ix == left_out || n == vertices.len() {
            continue;
        }
        let mut place = n;
        while place > 0 && vertices[place - 1] > vertex {
            vertices[place] = vertices[place - 1];
            place -= 1;
            is_even = !is_even;
        }
        vertices[place] = vertex;
        n += 1;
    }
    if n == 2 {
        vertices[2] = vertices[1];
    }
    Facet {
        vertices,
        element,
        is_even,
    }
}

fn sort_by_first(list: Vec<Facet>, n_vertices: usize) -> Vec<Facet> {
    let mut starts = vec![0usize; n_vertices + 1];
    for facet in &list {
        starts[facet.vertices[0] as usize + 1] += 1;
    }
    for ix in 1..starts.len() {
        starts[ix] += starts[ix - 1];
    }
    let mut next = starts.clone();
    let mut sorted = list.clone();
    for facet in list {
        let place = &mut next[facet.vertices[0] as usize];
        sorted[*place] = facet;
        *place += 1;
    }
    for run in starts.windows(2) {
        sorted[run[0]..run[1]].sort_unstable();
    }
    sorted
}

/// Runs of equal facets.
pub fn groups(sorted: &[Facet]) -> impl Iterator<Item = &[Facet]> {
    sorted.chunk_by(|a, b| a.vertices == b.vertices)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_of_one_orientation_pass_their_edge_in_opposite_directions() {
        let list = facets(&[[0, 1, 2], [2, 1, 3]], 4);
        let shared: Vec<_> = groups(&list).filter(|group| group.len() == 2).collect();
        assert_eq!(shared.len(), 1);
        assert_eq!(shared[0][0].vertices, [1, 2, 2]);
        assert_ne!(shared[0][0].is_even, shared[0][1].is_even);
        let list = facets(&[[0, 1, 2], [1, 2, 3]], 4);
        let shared = groups(&list).find(|group| group.len() == 2).unwrap();
        assert_eq!(shared[0].is_even, shared[1].is_even);
    }

    #[test]
    fn rotations_keep_and_swaps_turn_facets() {
        let signs = |corners: [u32; 3]| -> Vec<bool> {
            facets(&[corners], 9).iter().map(|f| f.is_even).collect()
        };
        assert_eq!(signs([3, 5, 8]), signs([5, 8, 3]));
        assert_eq!(signs([3, 5, 8]), signs([8, 3, 5]));
        for (a, b) in signs([3, 5, 8]).into_iter().zip(signs([5, 3, 8])) {
            assert_ne!(a, b);
        }
    }

    #[test]
    fn tetrahedra_on_both_sides_of_a_face_agree() {
        // Both positively oriented: 4 lies on the other side of the face 1 2 3.
        let list = facets(&[[0, 1, 2, 3], [4, 1, 3, 2]], 5);
        let shared = groups(&list).find(|group| group.len() == 2).unwrap();
        assert_eq!(shared[0].vertices, [1, 2, 3]);
        assert_ne!(shared[0].is_even, shared[1].is_even);
    }

    #[test]
    fn collapsed_elements_have_no_facets() {
        assert!(facets(&[[0, 1, 1]], 2).is_empty());
    }
}
