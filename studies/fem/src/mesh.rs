//! All solids as one mesh: rest quantities, the surface, and incidences. Computed once.

use std::collections::HashMap;
use std::ops::Range;

use impinge::contact::solid_depths;
use rayon::prelude::*;

use crate::element::{Element, Vec3};
use crate::error::Error;
use crate::lists::Lists;
use crate::solid::Solid;

/// A tetrahedron with a volume below this share of its longest edge cubed counts as flat: its
/// strains would be rounding errors.
const FLAT: f64 = 1e-9;

/// The ranges of a solid's vertices and tetrahedra in the arrays over all solids.
#[derive(Debug, Clone)]
pub(crate) struct Part {
    pub vertices: Range<usize>,
    pub tets: Range<usize>,
    /// Mean length of the surface's edges at rest: the length over which contact builds up.
    pub edge: f64,
    pub young: f64,
}

/// All solids at rest.
#[derive(Debug)]
pub(crate) struct Mesh {
    pub parts: Vec<Part>,
    pub elements: Vec<Element>,
    /// Lumped mass of each vertex: a quarter of the mass of each of its tetrahedra.
    pub masses: Vec<f64>,
    pub fixed: Vec<bool>,
    /// Surface triangles, seen from outside counter-clockwise at rest.
    pub surface: Vec<[u32; 3]>,
    /// A third of the rest area of a vertex's surface triangles; 0 inside.
    pub areas: Vec<f64>,
    /// The depth of a vertex below the surface at rest, along edges; 0 on the surface.
    pub depths: Vec<f64>,
    /// Each vertex's tetrahedra, as 4 · element + corner, ascending.
    pub tets_at: Lists,
    /// Each vertex's surface triangles, ascending.
    pub faces_at: Lists,
}

impl Mesh {
    pub fn new(solids: &[Solid]) -> Result<Self, Error> {
        let mut mesh = Mesh {
            parts: Vec::with_capacity(solids.len()),
            elements: Vec::new(),
            masses: Vec::new(),
            fixed: Vec::new(),
            surface: Vec::new(),
            areas: Vec::new(),
            depths: Vec::new(),
            tets_at: Lists::default(),
            faces_at: Lists::default(),
        };
        let mut rest = Vec::new();
        for (solid_ix, solid) in solids.iter().enumerate() {
            solid.check(solid_ix)?;
            mesh.add(solid_ix, solid, &mut rest)?;
        }
        let n_vertices = rest.len();
        let corners = |e: &Element| e.corners;
        mesh.tets_at = Lists::of_corners(n_vertices, mesh.elements.iter().map(corners));
        let faces_at = Lists::of_corners(n_vertices, mesh.surface.iter().copied());
        mesh.faces_at = faces_at.map(|entry| entry / 3);
        mesh.areas = vec![0.0; n_vertices];
        for face in &mesh.surface {
            let [a, b, c] = face.map(|corner| rest[corner as usize]);
            let third = (b - a).cross(&(c - a)).norm() / 6.0;
            face.iter()
                .for_each(|&corner| mesh.areas[corner as usize] += third);
        }
        let points: Vec<[f64; 3]> = rest.iter().map(|&point| point.into()).collect();
        let tetrahedra: Vec<[u32; 4]> = mesh.elements.iter().map(corners).collect();
        mesh.depths = solid_depths(&points, &tetrahedra, &mesh.surface)?;
        Ok(mesh)
    }

    pub fn n_vertices(&self) -> usize {
        self.masses.len()
    }

    /// The solid that holds a vertex, and the vertex's number in it.
    pub fn locate(&self, vertex: usize) -> (usize, usize) {
        let solid = self
            .parts
            .partition_point(|part| part.vertices.end <= vertex);
        (solid, vertex - self.parts[solid].vertices.start)
    }

    fn add(&mut self, solid_ix: usize, solid: &Solid, rest: &mut Vec<Vec3>) -> Result<(), Error> {
        let (first_vertex, first_tet) = (rest.len(), self.elements.len());
        rest.extend(solid.rest.iter().map(|&p| Vec3::from(p)));
        // 16 · element + 4 · corner + corner names a block's contribution in 32 bits.
        for (what, given, limit) in [
            ("vertices", rest.len(), u32::MAX as usize),
            ("tetrahedra", first_tet + solid.tets.len(), 1 << 28),
        ] {
            if given > limit {
                return Err(Error::TooMany { what, given, limit });
            }
        }
        let offset = first_vertex as u32;
        let lame = solid.material.lame();
        let rest = &rest[..];
        let elements = solid.tets.par_iter().enumerate().map(|(tet_ix, tet)| {
            element(tet.map(|corner| corner + offset), rest, lame).map_err(|volume| {
                Error::FlatTetrahedron {
                    solid: solid_ix,
                    tetrahedron: tet_ix,
                    volume,
                }
            })
        });
        let elements: Vec<Element> = elements.collect::<Result<_, _>>()?;
        self.masses.resize(rest.len(), 0.0);
        self.fixed.resize(rest.len(), false);
        for element in &elements {
            for corner in element.corners {
                self.masses[corner as usize] += solid.material.density * element.volume / 4.0;
            }
        }
        for &vertex in &solid.fixed {
            self.fixed[first_vertex + vertex as usize] = true;
        }
        let faces = surface(&elements, rest);
        let edges: f64 = faces
            .iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
            .map(|edge| {
                let [a, b] = edge.map(|v| rest[v as usize]);
                (a - b).norm()
            })
            .sum();
        self.parts.push(Part {
            vertices: first_vertex..rest.len(),
            tets: first_tet..first_tet + elements.len(),
            edge: edges / (3 * faces.len()).max(1) as f64,
            young: solid.material.young,
        });
        self.surface.extend(faces);
        self.elements.extend(elements);
        Ok(())
    }
}

/// A rest element; for a flat one, its volume as the error.
fn element(corners: [u32; 4], rest: &[Vec3], lame: (f64, f64)) -> Result<Element, f64> {
    let [a, b, c, d] = corners.map(|corner| rest[corner as usize]);
    let edges = [b - a, c - a, d - a];
    let det = edges[0].cross(&edges[1]).dot(&edges[2]);
    let longest = edges.iter().map(Vec3::norm_squared).fold(0.0, f64::max);
    let is_thick = det.abs() > FLAT * longest * longest.sqrt();
    if !(is_thick && det.is_normal()) {
        return Err(det.abs() / 6.0);
    }
    // The gradients are the rows of the inverse of the matrix of edges, whatever its orientation.
    let gradients = [
        edges[1].cross(&edges[2]) / det,
        edges[2].cross(&edges[0]) / det,
        edges[0].cross(&edges[1]) / det,
    ];
    Ok(Element {
        corners,
        volume: det.abs() / 6.0,
        gradients,
        lame,
    })
}

/// Faces of only one tetrahedron, oriented outwards, in the order of the tetrahedra.
fn surface(elements: &[Element], rest: &[Vec3]) -> Vec<[u32; 3]> {
    const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];
    let key = |face: [u32; 3]| {
        let mut key = face;
        key.sort_unstable();
        key
    };
    let faces = || {
        elements.iter().flat_map(|element| {
            (0..4).map(|apex| {
                let face = FACES[apex].map(|k| element.corners[k]);
                (face, element.corners[apex])
            })
        })
    };
    let mut n_owners: HashMap<[u32; 3], u32> = HashMap::with_capacity(2 * elements.len());
    for (face, _) in faces() {
        *n_owners.entry(key(face)).or_default() += 1;
    }
    faces()
        .filter(|&(face, _)| n_owners[&key(face)] == 1)
        .map(|([a, b, c], apex)| {
            let [p, q, r, s] = [a, b, c, apex].map(|v| rest[v as usize]);
            if (q - p).cross(&(r - p)).dot(&(s - p)) > 0.0 {
                [a, c, b]
            } else {
                [a, b, c]
            }
        })
        .collect()
}
