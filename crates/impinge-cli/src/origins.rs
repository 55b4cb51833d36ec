//! Vertices by the numbers that files have for them. A body of the scene has fewer vertices than its
//! file where some were welded, or where it is a part of the file.

use std::sync::Arc;

use impinge::contact::Feature;
use impinge::{Impact, Impacts, NearPairs, PairKind, Part, hash_impact_rows};
use impinge_io::Weld;

/// Which vertices of its file the vertices of a body are.
#[derive(Debug, Default)]
pub struct Origin {
    /// The number in the file of each vertex that was read, ascending; `None` if these are all.
    read: Option<Vec<u32>>,
    /// How they were welded, if any were.
    weld: Option<Arc<Weld>>,
}

impl Origin {
    pub fn new(read: Option<Vec<u32>>, weld: Option<&Arc<Weld>>) -> Self {
        Origin {
            read,
            weld: weld.filter(|weld| weld.n_welded() > 0).cloned(),
        }
    }

    /// The number in the file of a vertex of the body: of welded ones, that of the first.
    pub fn vertex(&self, vertex: u32) -> u32 {
        let firsts = self.weld.as_ref().map(|weld| weld.firsts());
        let first = firsts.and_then(|firsts| firsts.get(vertex as usize).copied());
        self.in_file(first.unwrap_or(vertex))
    }

    /// The number in the file of each vertex of the body; `None` if they are the same.
    #[cfg(feature = "view")]
    pub fn numbers(&self) -> Option<Arc<[u32]>> {
        let numbers = match (&self.weld, &self.read) {
            (Some(weld), _) => weld
                .firsts()
                .iter()
                .map(|&first| self.in_file(first))
                .collect(),
            (None, Some(read)) => read.as_slice().into(),
            (None, None) => return None,
        };
        Some(numbers)
    }

    /// The vertex of the body for each vertex that was read; `None` if they are the same.
    pub fn map(&self) -> Option<&[u32]> {
        self.weld.as_ref().map(|weld| weld.map())
    }

    /// All vertices that were read: the number in the file, and the vertex of the body, which has
    /// `n`.
    pub fn vertices(&self, n: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        let map = self.map();
        let read = 0..map.map_or(n, <[u32]>::len);
        read.map(move |ix| {
            let vertex = map.map_or(ix, |map| map[ix] as usize);
            (self.in_file(ix as u32) as usize, vertex)
        })
    }

    fn in_file(&self, read: u32) -> u32 {
        let all = self.read.as_ref();
        let number = all.and_then(|all| all.get(read as usize).copied());
        number.unwrap_or(read)
    }
}

/// The origin of each body, in their order. Bodies beyond the last have the vertices of their
/// files.
#[derive(Debug, Default)]
pub struct Origins(Vec<Origin>);

impl Origins {
    pub fn push(&mut self, origin: Origin) {
        self.0.push(origin);
    }

    pub fn of(&self, body: usize) -> Option<&Origin> {
        self.0.get(body)
    }

    /// The number in its file of a vertex of a body.
    pub fn vertex(&self, body: u32, vertex: u32) -> u32 {
        let origin = self.of(body as usize);
        origin.map_or(vertex, |origin| origin.vertex(vertex))
    }

    /// A row of elements of this kind, its vertices by their numbers in the files. The order of
    /// rows stays: it is that of first vertices.
    pub fn row(&self, kind: PairKind, [body_a, a, body_b, b]: [u32; 4]) -> [u32; 4] {
        let named = |part, body, element| match part {
            Part::Vertices => self.vertex(body, element),
            _ => element,
        };
        let [of_a, of_b] = kind.parts();
        [
            body_a,
            named(of_a, body_a, a),
            body_b,
            named(of_b, body_b, b),
        ]
    }

    pub fn impact(&self, mut impact: Impact) -> Impact {
        let [_, a, _, b] = self.row(impact.kind, impact.row());
        (impact.a.element, impact.b.element) = (a, b);
        impact
    }

    /// Where a point of contact lies in an element of a body.
    pub fn feature(&self, body: u32, feature: Feature) -> Feature {
        match feature {
            Feature::Vertex(vertex) => Feature::Vertex(self.vertex(body, vertex)),
            Feature::Edge(ends) => Feature::Edge(ends.map(|end| self.vertex(body, end))),
            face => face,
        }
    }

    /// [`Impacts::hash`] of the rows that are written.
    pub fn hash_of_impacts(&self, impacts: &Impacts) -> u64 {
        hash_impact_rows(
            impacts
                .iter()
                .map(|impact| (impact.kind, self.row(impact.kind, impact.row()), impact.toi)),
        )
    }

    /// [`NearPairs::hash`] of the rows that are written.
    pub fn hash_of_near(&self, near: &NearPairs) -> u64 {
        near.iter().fold(0, |sum: u64, pair| {
            sum.wrapping_add(pair.hash_as(self.row(pair.kind, pair.row())))
        })
    }
}

#[cfg(test)]
mod tests {
    use impinge_io::Positions;

    use super::*;

    #[test]
    fn welded_parts_have_the_numbers_of_the_file() {
        let (a, b) = ([0.0; 3], [1.0; 3]);
        let weld = Arc::new(Weld::by_position(&Positions::F32(vec![a, a, b, a])));
        let origin = Origin::new(Some(vec![2, 3, 5, 9]), Some(&weld));
        assert_eq!([0, 1].map(|vertex| origin.vertex(vertex)), [2, 5]);
        #[cfg(feature = "view")]
        assert_eq!(origin.numbers().as_deref(), Some(&[2, 5][..]));
        let all: Vec<_> = origin.vertices(2).collect();
        assert_eq!(all, [(2, 0), (3, 0), (5, 1), (9, 0)]);
        let mut origins = Origins::default();
        origins.push(Origin::default());
        origins.push(origin);
        let row = |kind| origins.row(kind, [0, 1, 1, 1]);
        assert_eq!(row(PairKind::VertexVertex), [0, 1, 1, 5]);
        assert_eq!(row(PairKind::EdgeVertex), [0, 1, 1, 5]);
        assert_eq!(row(PairKind::VertexFace), [0, 1, 1, 1]);
        assert_eq!(row(PairKind::EdgeEdge), [0, 1, 1, 1]);
    }
}
