//! The caller's own numbers of the edges of a body: the names of edges in answers.

use std::collections::HashMap;

use impinge::{Body, BodyKind, Elements, PairKind, Part};

use crate::arrays::collect;
use crate::status::Failure;

/// The numbers of the edges of one body.
#[derive(Default)]
pub struct EdgeNumbers {
    /// The rows of the caller.
    pub rows: Vec<[u32; 2]>,
    /// By the library's number: the caller's, and whether the caller's row names the vertices the
    /// other way round.
    to_own: Vec<(u32, bool)>,
}

impl EdgeNumbers {
    /// Finds each edge of a body among the caller's rows.
    pub fn new(number: u32, body: &Body, rows: Vec<[u32; 2]>) -> Result<Self, Failure> {
        if body.kind() == BodyKind::Edges {
            return Err(Failure::invalid(format!(
                "edges: body {number} was given as edges, which have the numbers of their rows already"
            )));
        }
        let no_edges = Vec::new();
        let edges = match body.part(Part::Edges) {
            Elements::Edges(edges) => edges,
            _ => &no_edges,
        };
        let mut row_of = HashMap::new();
        row_of
            .try_reserve(rows.len())
            .map_err(|_| Failure::out_of_memory("edges", rows.len()))?;
        for (ix, &row) in (0u32..).zip(&rows) {
            if let Some(first) = row_of.insert(sorted(row), ix) {
                return Err(Failure::invalid(format!(
                    "edges: row {ix} has vertices {} and {} of body {number}, as row {first} has",
                    row[0], row[1]
                )));
            }
        }
        let mut to_own = collect((0..edges.len()).map(|_| (0, false)), "edges")?;
        for (own, (ix, &edge)) in to_own.iter_mut().zip(edges.iter().enumerate()) {
            let Some(&row) = row_of.get(&sorted(edge)) else {
                return Err(Failure::invalid(format!(
                    "edges: the edge of vertices {} and {} of body {number} ({ix} of {}) is not among the {} rows",
                    edge[0],
                    edge[1],
                    edges.len(),
                    rows.len()
                )));
            };
            *own = (row, rows[row as usize] != edge);
        }
        Ok(EdgeNumbers { rows, to_own })
    }

    /// Numbers of the caller's rows in the order of the library's edges.
    pub fn in_own_order(&self, number: u32, of_rows: &[f64]) -> Result<Vec<f64>, Failure> {
        if of_rows.len() != self.rows.len() {
            return Err(Failure::invalid(format!(
                "body {number}: {} thicknesses given, but there are {} rows of edges",
                of_rows.len(),
                self.rows.len()
            )));
        }
        let own = self.to_own.iter().map(|&(row, _)| of_rows[row as usize]);
        collect(own, "thickness")
    }

    /// The caller's number of an edge.
    pub fn own(&self, edge: u32) -> u32 {
        self.to_own[edge as usize].0
    }
}

fn sorted([a, b]: [u32; 2]) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

/// A row in the caller's numbers.
pub struct Named {
    pub row: [u32; 4],
    /// Whether the first element comes second now: both are edges of one body.
    pub is_swapped: bool,
    /// Whether the edge `a`, and the edge `b`, as they come now, go the other way.
    pub is_reversed: [bool; 2],
}

/// The numbers of edges of all bodies of a scene, by body. `None`: the library's own.
pub type AllEdgeNumbers<'a> = &'a dyn Fn(u32) -> Option<&'a EdgeNumbers>;

/// Names a row of a kind of pairs.
pub fn name(numbers: AllEdgeNumbers<'_>, kind: PairKind, row: [u32; 4]) -> Named {
    let [body_a, a, body_b, b] = row;
    let are_edges = kind.parts().map(|part| part == Part::Edges);
    let own = |is_edge: bool, body: u32, element: u32| match is_edge.then(|| numbers(body)) {
        Some(Some(numbers)) => numbers.to_own[element as usize],
        _ => (element, false),
    };
    let (a, is_a_reversed) = own(are_edges[0], body_a, a);
    let (b, is_b_reversed) = own(are_edges[1], body_b, b);
    // Of two elements of one body and kind the lower one comes first.
    let is_swapped = are_edges == [true; 2] && body_a == body_b && b < a;
    match is_swapped {
        true => Named {
            row: [body_b, b, body_a, a],
            is_swapped,
            is_reversed: [is_b_reversed, is_a_reversed],
        },
        false => Named {
            row: [body_a, a, body_b, b],
            is_swapped,
            is_reversed: [is_a_reversed, is_b_reversed],
        },
    }
}
