//! Where one body's edges and vertices meet the other body's surface.

use super::regions::WHAT;
use super::{Contacts, Feature};
use crate::scene::error::Error;
use crate::scene::index::VertexIx;
use crate::search::sink::grow;

/// The two vertices of an edge, lower first where it is a name.
pub(super) type EdgeVertices = [VertexIx; 2];

/// The points of contact on the edges and vertices of one body.
pub(super) struct Crossings<'a> {
    contacts: &'a Contacts,
    pub body: u32,
    /// Edges with the points on them, sorted.
    pub on_edges: Vec<(EdgeVertices, u32)>,
    /// Vertices on the other surface with the points there, sorted.
    pub on_vertices: Vec<(VertexIx, u32)>,
    /// Whether any edge at a vertex is crossed.
    is_touched: Vec<bool>,
}

impl<'a> Crossings<'a> {
    pub fn new(contacts: &'a Contacts, bodies: [u32; 2], side: usize) -> Result<Self, Error> {
        let names = contacts.names();
        let first = names.partition_point(|name| name.bodies < bodies);
        let end = names.partition_point(|name| name.bodies <= bodies);
        let mut crossings = Crossings {
            contacts,
            body: bodies[side],
            on_edges: Vec::new(),
            on_vertices: Vec::new(),
            is_touched: Vec::new(),
        };
        for (point, name) in (0u32..).zip(names).skip(first).take(end - first) {
            match name.features[side] {
                Feature::Edge(edge) => {
                    grow(&mut crossings.on_edges, 1, WHAT)?;
                    crossings.on_edges.push((edge.map(VertexIx::new), point));
                }
                Feature::Vertex(vertex) => {
                    grow(&mut crossings.on_vertices, 1, WHAT)?;
                    crossings.on_vertices.push((VertexIx::new(vertex), point));
                }
                Feature::Face(_) => {}
            }
        }
        crossings.on_edges.sort_unstable();
        crossings.on_vertices.sort_unstable();
        for (edge, _) in &crossings.on_edges {
            let n = edge[1].index() + 1;
            if crossings.is_touched.len() < n {
                crossings.is_touched.resize(n, false);
            }
            for vertex in edge {
                crossings.is_touched[vertex.index()] = true;
            }
        }
        Ok(crossings)
    }

    pub fn lowest(&self, vertex: VertexIx) -> VertexIx {
        self.contacts.lowest(self.body, vertex)
    }

    pub fn is_on(&self, vertex: VertexIx) -> bool {
        self.point_on(vertex).is_some()
    }

    /// The first of the points at a vertex on the other surface.
    pub fn point_on(&self, vertex: VertexIx) -> Option<u32> {
        if self.on_vertices.is_empty() {
            return None;
        }
        let lowest = self.lowest(vertex);
        let first = self.on_vertices.partition_point(|held| held.0 < lowest);
        let found = self.on_vertices.get(first).filter(|held| held.0 == lowest);
        found.map(|held| held.1)
    }

    pub fn is_touched(&self, vertex: VertexIx) -> bool {
        self.is_touched_by_name(self.lowest(vertex))
    }

    /// The same of a vertex that is the lowest one at its position, as in names.
    fn is_touched_by_name(&self, lowest: VertexIx) -> bool {
        self.is_touched.get(lowest.index()) == Some(&true)
    }

    pub fn name(&self, edge: EdgeVertices) -> EdgeVertices {
        let mut name = edge.map(|vertex| self.lowest(vertex));
        name.sort_unstable();
        name
    }

    pub fn is_crossed(&self, edge: EdgeVertices) -> bool {
        let [low, high] = self.name(edge);
        if !(self.is_touched_by_name(low) && self.is_touched_by_name(high)) {
            return false;
        }
        let first = self
            .on_edges
            .partition_point(|(held, _)| *held < [low, high]);
        self.on_edges
            .get(first)
            .is_some_and(|(held, _)| *held == [low, high])
    }
}
