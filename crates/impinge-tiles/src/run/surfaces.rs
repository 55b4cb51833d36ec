//! The surfaces of a tile of a step, scenes of some of their faces, and names for the elements of
//! such a scene.
//!
//! A tile has only some of a body's elements, so its surface may have faces, edges and vertices
//! that the body's surface has not: the inner faces of tetrahedra whose other side is elsewhere.
//! Their boxes, inflated by the separation as in `cells.rs`, do not touch the tile's cell, because
//! an element that has such an element would touch it too and be here. So no pair that the tile
//! owns has one of them.

use std::ops::Range;

use impinge::{BodyId, Elements, Impact, Part, Positions, Scene};

use super::ranges::within;
use crate::cells::{Bounds, owner_point};
use crate::chunk::bounds;
use crate::step::{BOUNDARY, EDGES, Element, Name};

type Point = [f64; 3];

/// The surface of one file.
pub struct Surface {
    file: u32,
    /// Bytes per coordinate.
    width: usize,
    /// The numbers of its vertices in the file, ascending.
    vertices: Vec<u32>,
    /// Where they are at the start and at the end.
    positions: Vec<[[f64; 3]; 2]>,
    faces: Vec<[u32; 3]>,
    /// The names of the faces.
    names: Vec<Name>,
    /// Whether faces need numbers: the file has tetrahedra.
    is_boundary: bool,
}

impl Surface {
    /// Without faces. `vertices` are ascending numbers, `positions` at the start and the end.
    pub fn new(
        file: usize,
        width: usize,
        vertices: Vec<u32>,
        positions: Vec<[[f64; 3]; 2]>,
    ) -> Self {
        Surface {
            file: file as u32,
            width,
            vertices,
            positions,
            faces: Vec::new(),
            names: Vec::new(),
            is_boundary: false,
        }
    }

    pub fn of_triangles(
        mut self,
        triangles: &[[u32; 3]],
        numbers: impl Iterator<Item = u32>,
    ) -> Self {
        self.faces = triangles.to_vec();
        self.names = numbers.map(|number| [number, 0]).collect();
        self
    }

    /// The faces that no two tetrahedra share, as [`Part::Faces`] of a body.
    pub fn of_tetrahedra(
        mut self,
        tetrahedra: &[[u32; 4]],
        numbers: Vec<u32>,
    ) -> Result<Self, impinge::Error> {
        let mut scene = Scene::new();
        let all: Vec<u32> = (0..self.vertices.len() as u32).collect();
        let id = scene.add((tetrahedra.to_vec(), self.at(0, &all)))?;
        let body = scene.body(id)?;
        let Elements::Triangles(faces) = body.part(Part::Faces) else {
            unreachable!("faces are triangles");
        };
        // Faces are in the order of the first tetrahedron that has them, then of the opposite
        // corner.
        let sides = tetrahedra.iter().zip(numbers).flat_map(|(&tet, number)| {
            let [a, b, c, d] = tet;
            let sides = [[b, c, d], [a, d, c], [a, b, d], [a, c, b]];
            (0..)
                .zip(sides)
                .map(move |(corner, side)| ([number, corner], side))
        });
        for (name, side) in sides {
            if faces.get(self.names.len()) == Some(&side) {
                self.names.push(name);
            }
        }
        self.faces = faces.clone();
        self.is_boundary = true;
        Ok(self)
    }

    /// Positions of some vertices at the start (0) or the end (1), in the precision of the file.
    fn at(&self, pose: usize, vertices: &[u32]) -> Positions {
        let points = vertices.iter().map(|&v| self.positions[v as usize][pose]);
        match self.width {
            4 => {
                let narrow = points.map(|point| point.map(|x| x as f32));
                Positions::F32(narrow.collect())
            }
            _ => Positions::F64(points.collect()),
        }
    }

    /// The lower corner of the box of some vertices over the step.
    fn low<const N: usize>(&self, vertices: [u32; N]) -> [f64; 3] {
        let ends = vertices.map(|v| self.positions[v as usize]);
        let (low, _): Bounds = bounds(ends.as_flattened());
        low
    }
}

/// All surfaces of a tile, by file. Their faces are numbered from 0, one surface after the other.
pub struct Surfaces(pub Vec<Surface>);

impl Surfaces {
    pub fn n_faces(&self) -> usize {
        self.0.iter().map(|surface| surface.faces.len()).sum()
    }

    /// A scene of the faces in `ranges` (ascending), with one moving body per surface that has any.
    pub fn scene(&self, ranges: &[Range<usize>]) -> Result<SurfaceScene<'_>, impinge::Error> {
        let mut made = SurfaceScene {
            scene: Scene::new(),
            bodies: Vec::new(),
        };
        let mut first = 0;
        for surface in &self.0 {
            let whole = first..first + surface.faces.len();
            first = whole.end;
            let faces: Vec<u32> = within(ranges, &whole)
                .flatten()
                .map(|face| (face - whole.start) as u32)
                .collect();
            if !faces.is_empty() {
                made.add(surface, faces)?;
            }
        }
        Ok(made)
    }
}

/// A scene of some faces of the surfaces.
pub struct SurfaceScene<'a> {
    pub scene: Scene,
    bodies: Vec<OfSurface<'a>>,
}

struct OfSurface<'a> {
    id: BodyId,
    surface: &'a Surface,
    /// The body's vertices as numbers within the surface, ascending, so that edges are in the same
    /// order.
    vertices: Vec<u32>,
    /// Its faces as numbers within the surface.
    faces: Vec<u32>,
}

impl<'a> SurfaceScene<'a> {
    fn add(&mut self, surface: &'a Surface, faces: Vec<u32>) -> Result<(), impinge::Error> {
        let corners = || faces.iter().map(|&face| surface.faces[face as usize]);
        let mut vertices: Vec<u32> = corners().flatten().collect();
        vertices.sort_unstable();
        vertices.dedup();
        let mut place = vec![0; surface.vertices.len()];
        for (ix, &vertex) in (0..).zip(&vertices) {
            place[vertex as usize] = ix;
        }
        let triangles: Vec<[u32; 3]> = corners()
            .map(|corners| corners.map(|v| place[v as usize]))
            .collect();
        let [start, end] = [0, 1].map(|pose| surface.at(pose, &vertices));
        let id = self.scene.add((triangles, start))?;
        self.scene.set_end_positions(id, end)?;
        self.bodies.push(OfSurface {
            id,
            surface,
            vertices,
            faces,
        });
        Ok(())
    }

    /// The elements of an impact, and the point that decides to which tile it belongs.
    pub fn named(&self, impact: &Impact) -> Result<([Element; 2], Point), impinge::Error> {
        let named = |part, element: impinge::Element| {
            let body = &self.bodies[element.body.index()];
            self.element(body, part, element.element as usize)
        };
        let [part_a, part_b] = impact.kind.parts();
        let (a, low_a) = named(part_a, impact.a)?;
        let (b, low_b) = named(part_b, impact.b)?;
        Ok(([a, b], owner_point(&low_a, &low_b)))
    }

    /// The elements whose lower corner `is_mine` accepts, of those that merging must number: body,
    /// part, name; ascending.
    pub fn to_number(
        &self,
        is_mine: impl Fn(Point) -> bool,
    ) -> Result<Vec<[u32; 4]>, impinge::Error> {
        let mut all = Vec::new();
        for body in &self.bodies {
            let faces = body.surface.is_boundary.then_some((Part::Faces, BOUNDARY));
            for (part, kind) in [Some((Part::Edges, EDGES)), faces].into_iter().flatten() {
                for number in 0..self.scene.body(body.id)?.part(part).len() {
                    let ((file, [first, second]), low) = self.element(body, part, number)?;
                    if is_mine(low) {
                        all.push([file, kind, first, second]);
                    }
                }
            }
        }
        Ok(all)
    }

    /// The file and name of an element, and the lower corner of its box over the step.
    fn element(
        &self,
        body: &OfSurface<'_>,
        part: Part,
        number: usize,
    ) -> Result<(Element, Point), impinge::Error> {
        let OfSurface {
            id,
            surface,
            vertices,
            faces,
        } = body;
        let (name, low) = match part {
            Part::Vertices => {
                let vertex = vertices[number];
                (
                    [surface.vertices[vertex as usize], 0],
                    surface.low([vertex]),
                )
            }
            Part::Edges => {
                let edges = self.scene.body(*id)?.part(Part::Edges);
                let ends = edges.corners(number);
                let edge = [ends[1], ends[0]].map(|v| vertices[v as usize]);
                (
                    edge.map(|v| surface.vertices[v as usize]),
                    surface.low(edge),
                )
            }
            Part::Faces | Part::Given => {
                let face = faces[number] as usize;
                (surface.names[face], surface.low(surface.faces[face]))
            }
        };
        Ok(((surface.file, name), low))
    }
}
