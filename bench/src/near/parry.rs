//! parry3d as a peer, in single precision: its `Bvh`, refitted in each frame, and its distances of
//! a point and a triangle, and of two segments. It has no query for pairs within a distance, but
//! has the parts for one.

use parry3d::bounding_volume::Aabb;
use parry3d::math::{Pose, Vector};
use parry3d::partitioning::{Bvh, BvhBuildStrategy, BvhWorkspace};
use parry3d::query::PointQuery;
use parry3d::query::details::distance_segment_segment;
use parry3d::shape::{Segment, Triangle};
use rayon::prelude::*;

use super::{Mesh, Peer, Row};
use crate::Failure;

/// Vertices, or pairs of edges, per task.
const TASK: usize = 1024;
/// parry takes edges for parallel whose cross product has a square below 1.2e-7, whatever their
/// lengths. A tenth of the pairs of edges of a mesh of unit size is lost by that. So it gets larger
/// coordinates; powers of two round nothing.
const SCALE: f32 = 1024.0;

/// The elements of a mesh in a tree.
struct Elements<const N: usize> {
    positions: Vec<[f32; 3]>,
    corners: Vec<[u32; N]>,
    bvh: Bvh,
    rows: Vec<Row>,
}

impl<const N: usize> Elements<N> {
    fn new(positions: &[[f32; 3]], corners: &[[u32; N]]) -> Self {
        let mut elements = Elements {
            positions: vec![[0.0; 3]; positions.len()],
            corners: corners.to_vec(),
            bvh: Bvh::new(),
            rows: Vec::new(),
        };
        elements.write(positions);
        let boxes: Vec<Aabb> = (0..corners.len())
            .map(|ix| elements.bounds(ix, 0.0))
            .collect();
        elements.bvh = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
        elements
    }

    fn write(&mut self, positions: &[[f32; 3]]) {
        for (to, position) in self.positions.iter_mut().zip(positions) {
            *to = position.map(|x| SCALE * x);
        }
    }

    fn points(&self, ix: usize) -> [Vector; N] {
        self.corners[ix].map(|corner| Vector::from(self.positions[corner as usize]))
    }

    /// The box of an element, which reaches a little further.
    fn bounds(&self, ix: usize, margin: f32) -> Aabb {
        let [first, rest @ ..] = &self.points(ix)[..] else {
            unreachable!("elements have corners")
        };
        let (mut min, mut max) = (*first, *first);
        for point in rest {
            (min, max) = (min.min(*point), max.max(*point));
        }
        Aabb::new(min - Vector::splat(margin), max + Vector::splat(margin))
    }

    fn refit(&mut self, margin: f32) {
        for ix in 0..self.corners.len() {
            let bounds = self.bounds(ix, margin);
            self.bvh.insert_or_update_partially(bounds, ix as u32, 0.0);
        }
        self.bvh.refit_without_opt();
    }
}

/// Vertices and faces.
pub struct Points(Elements<3>);

impl Points {
    pub fn new(mesh: &Mesh<'_>) -> Self {
        Points(Elements::new(mesh.positions, mesh.faces))
    }
}

impl Peer for Points {
    fn name(&self) -> String {
        "parry3d, `Bvh::intersect_aabb`".to_owned()
    }

    fn write(&mut self, positions: &[[f32; 3]]) {
        self.0.write(positions);
    }

    fn find(&mut self, distance: f64) -> Result<&[Row], Failure> {
        let distance = SCALE * distance as f32;
        self.0.refit(0.0);
        let faces = &self.0;
        let tasks = faces.positions.par_chunks(TASK).enumerate();
        let lists: Vec<Vec<Row>> = tasks
            .map(|(task, positions)| {
                let mut rows = Vec::new();
                for (vertex, &position) in (task * TASK..).zip(positions) {
                    let (vertex, point) = (vertex as u32, Vector::from(position));
                    let reach = Vector::splat(distance);
                    let bounds = Aabb::new(point - reach, point + reach);
                    for face in faces.bvh.intersect_aabb(&bounds) {
                        if faces.corners[face as usize].contains(&vertex) {
                            continue;
                        }
                        let [a, b, c] = faces.points(face as usize);
                        let triangle = Triangle::new(a, b, c);
                        if triangle.distance_to_local_point(point, true) <= distance {
                            rows.push([vertex, face]);
                        }
                    }
                }
                rows
            })
            .collect();
        self.0.rows.clear();
        self.0.rows.extend(lists.into_iter().flatten());
        Ok(&self.0.rows)
    }
}

/// Edges and edges.
pub struct Edges {
    edges: Elements<2>,
    workspace: BvhWorkspace,
    candidates: Vec<Row>,
}

impl Edges {
    pub fn new(mesh: &Mesh<'_>) -> Self {
        Edges {
            edges: Elements::new(mesh.positions, mesh.edges),
            workspace: BvhWorkspace::default(),
            candidates: Vec::new(),
        }
    }
}

impl Peer for Edges {
    fn name(&self) -> String {
        "parry3d, `Bvh::traverse_bvtt_single_tree`".to_owned()
    }

    fn write(&mut self, positions: &[[f32; 3]]) {
        self.edges.write(positions);
    }

    fn find(&mut self, distance: f64) -> Result<&[Row], Failure> {
        let Edges {
            edges,
            workspace,
            candidates,
        } = self;
        let distance = SCALE * distance as f32;
        edges.refit(0.5 * distance * (1.0 + 1e-5));
        candidates.clear();
        let corners = &edges.corners;
        (edges.bvh).traverse_bvtt_single_tree::<false>(workspace, &mut |a: u32, b: u32| {
            let [of_a, of_b] = [a, b].map(|ix| corners[ix as usize]);
            if !of_a.iter().any(|corner| of_b.contains(corner)) {
                candidates.push([a.min(b), a.max(b)]);
            }
        });
        let lists: Vec<Vec<Row>> = candidates
            .par_chunks(TASK)
            .map(|candidates| {
                let is_near = |row: &&Row| {
                    let [a, b] = row.map(|ix| {
                        let [p, q] = edges.points(ix as usize);
                        Segment::new(p, q)
                    });
                    distance_segment_segment(&Pose::IDENTITY, &a, &b) <= distance
                };
                candidates.iter().filter(is_near).copied().collect()
            })
            .collect();
        edges.rows.clear();
        edges.rows.extend(lists.into_iter().flatten());
        Ok(&edges.rows)
    }
}
