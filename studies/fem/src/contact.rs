//! Contact: a penalty on the volume of the intersection of two tetrahedra.
//!
//! For each pair that the detector finds, the intersection, a polyhedron, is computed exactly (up
//! to rounding). With volume V, centroid c and a unit direction n, tetrahedron a is pushed by
//! `k V n` at c and tetrahedron b by the opposite force, distributed to corners by the barycentric
//! coordinates of c. Both forces act at one point, so linear and angular momentum are conserved.
//! Where bodies overlap by a depth d over an area A, the forces of all pairs sum to `k A d`: a
//! pressure `k d`, independent of the meshes.
//!
//! **Direction.** Each vertex has an outward direction. On the surface it is the area-weighted
//! normal of its faces; inside, it is the direction in which the depth at rest decreases. It is
//! interpolated in the deformed mesh (Hirota et al. 2001, Fisher & Lin 2001). n is b's direction at
//! c minus a's, normalised: it is smooth in c, also defined between edges, and does not depend on
//! which body comes first. If both directions cancel, a is pushed away from the centroid of b.
//!
//! **Stiffness.** As the bodies approach, V grows in proportion to the cross-section. The
//! cross-section is V divided by the larger of two lengths: the polyhedron's extent along n, and
//! the sum d of the two interpolated depths at c. With d, a stack of pairs through the overlap
//! shares one cross-section. The stiffness enters the implicit step, so that stiff contacts stay
//! stable.
//!
//! **Friction** is Coulomb's, with the normal force at the beginning of the step; at very small
//! speeds it grows linearly. It is implicit too.

use impinge::Pairs;
use impinge::contact::SolidOverlap;
use rayon::prelude::*;

use crate::elasticity::GRAIN;
use crate::element::{Mat3, Vec3};
use crate::error::Error;
use crate::lists::Lists;
use crate::mesh::Mesh;
use crate::rotation::cofactors;
use crate::settings::Settings;

/// Slip per step, as a share of an edge, at which friction reaches its full strength.
const FULL_FRICTION: f64 = 1e-3;

/// A sum of unit vectors shorter than this has no reliable direction.
const CANCELLED: f64 = 1e-6;

/// Two tetrahedra in contact.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Contact {
    /// Corners of a, then of b.
    pub vertices: [u32; 8],
    /// Barycentric coordinates of the point of contact: positive for a, negative for b.
    pub weights: [f64; 8],
    /// The force on a at the start of the step.
    pub force: Vec3,
    /// The coupling of velocities in the implicit step: h² stiffness + h friction.
    pub block: Mat3,
}

/// The term of the implicit step for a penalty along a direction and friction across it:
/// `h² k n nᵀ + h c (1 − n nᵀ)`.
fn implicit(normal: &Vec3, stiffness: f64, drag: f64, dt: f64) -> Mat3 {
    normal * (normal * (dt * dt * stiffness - dt * drag)).transpose()
        + Mat3::from_diagonal_element(dt * drag)
}

/// Coulomb's friction as a drag: force over slip speed.
fn drag(settings: &Settings, normal_force: f64, normal: &Vec3, velocity: &Vec3, edge: f64) -> f64 {
    let slip = (velocity - normal * normal.dot(velocity)).norm();
    settings.friction * normal_force / slip.max(FULL_FRICTION * edge / settings.dt)
}

/// Fills `outward` with the outward direction of each vertex, of length 1, or 0 if there is none.
pub(crate) fn outward_directions(mesh: &Mesh, positions: &[Vec3], outward: &mut Vec<Vec3>) {
    let face_normal = |&face: &u32| {
        let [a, b, c] = mesh.surface[face as usize].map(|corner| positions[corner as usize]);
        (b - a).cross(&(c - a))
    };
    let rise = |&entry: &u32| {
        let element = &mesh.elements[entry as usize / 4];
        let [a, b, c, d] = element.corners.map(|corner| mesh.depths[corner as usize]);
        let [p, q, r] = &element.gradients;
        let at_rest = p * (b - a) + q * (c - a) + r * (d - a);
        // The gradient in the deformed element, times its volume: finite even if the element is
        // flat.
        let f = element.deformation(positions);
        let cofactors = cofactors(&f);
        let det = f.column(0).dot(&cofactors.column(0));
        cofactors * at_rest * (element.volume * det.signum())
    };
    (0..mesh.n_vertices())
        .into_par_iter()
        .with_min_len(GRAIN)
        .map(|vertex| {
            let faces = mesh.faces_at.get(vertex);
            let direction: Vec3 = if faces.is_empty() {
                -mesh.tets_at.get(vertex).iter().map(rise).sum::<Vec3>()
            } else {
                faces.iter().map(face_normal).sum()
            };
            direction.try_normalize(0.0).unwrap_or_else(Vec3::zeros)
        })
        .collect_into_vec(outward);
}

/// The state at the start of a step that contact needs.
pub(crate) struct Now<'a> {
    pub mesh: &'a Mesh,
    pub settings: &'a Settings,
    pub positions: &'a [Vec3],
    pub velocities: &'a [Vec3],
    pub outward: &'a [Vec3],
}

impl Now<'_> {
    /// The contacts of pairs of tetrahedra, numbered over all solids, in their order.
    pub fn contacts(&self, pairs: &[[u32; 2]], contacts: &mut Vec<Contact>) {
        contacts.clear();
        contacts.par_extend(
            pairs
                .par_iter()
                .with_min_len(64)
                .map_init(SolidOverlap::new, |overlap, &pair| {
                    self.contact(overlap, pair)
                })
                .flatten_iter(),
        );
    }

    fn contact(&self, overlap: &mut SolidOverlap, pair: [u32; 2]) -> Option<Contact> {
        let elements = pair.map(|tet| &self.mesh.elements[tet as usize]);
        let corners = elements.map(|e| e.corners.map(|corner| self.positions[corner as usize]));
        let points = corners.map(|corners| corners.map(Into::into));
        overlap.cut(&points[0], &points[1]);
        let (volume, at) = overlap.volume()?;
        let at = Vec3::from(at);
        let weights = [
            barycentric(&corners[0], &at)?,
            barycentric(&corners[1], &at)?,
        ];
        let mean = |body: usize, of: &dyn Fn(usize) -> Vec3| -> Vec3 {
            elements[body]
                .corners
                .iter()
                .zip(weights[body])
                .map(|(&corner, weight)| of(corner as usize) * weight)
                .sum()
        };
        let outward = |vertex: usize| self.outward[vertex];
        let centre = |body: usize| corners[body].iter().sum::<Vec3>() / 4.0;
        let normal = (mean(1, &outward) - mean(0, &outward))
            .try_normalize(CANCELLED)
            .or_else(|| (centre(0) - centre(1)).try_normalize(0.0))?;
        let depth: f64 = elements
            .iter()
            .zip(weights)
            .flat_map(|(element, weights)| element.corners.into_iter().zip(weights))
            .map(|(corner, weight)| self.mesh.depths[corner as usize] * weight)
            .sum();
        let (hardness, edge) = self.hardness(pair);
        let force = hardness * volume;
        let stiffness = force / overlap.extent(&normal.into()).max(depth);
        if !(force.is_finite() && stiffness.is_finite()) {
            return None;
        }
        let velocity = |vertex: usize| self.velocities[vertex];
        let slip = mean(0, &velocity) - mean(1, &velocity);
        let drag = drag(self.settings, force, &normal, &slip, edge);
        let both = |a: [f64; 4], b: [f64; 4]| {
            std::array::from_fn(|k| if k < 4 { a[k] } else { -b[k - 4] })
        };
        Some(Contact {
            vertices: std::array::from_fn(|k| elements[k / 4].corners[k % 4]),
            weights: both(weights[0], weights[1]),
            force: normal * force,
            block: implicit(&normal, stiffness, drag, self.settings.dt),
        })
    }

    /// Pressure per depth between two elements in Pa/m (the harmonic mean of the materials' moduli
    /// over the mean edge), and the mean length of their edges.
    fn hardness(&self, pair: [u32; 2]) -> (f64, f64) {
        let [a, b] = pair.map(|tet| {
            let parts = &self.mesh.parts;
            &parts[parts.partition_point(|part| part.tets.end <= tet as usize)]
        });
        let edge = 0.5 * (a.edge + b.edge);
        let young = 2.0 * a.young * b.young / (a.young + b.young);
        (self.settings.contact_stiffness * young / edge, edge)
    }

    /// Calls `add` with the ground's force on each surface vertex below the ground's surface, and
    /// its term of the implicit step.
    pub fn ground(&self, mut add: impl FnMut(usize, Vec3, Mat3)) {
        let Some(ground) = self.settings.ground else {
            return;
        };
        let normal = Vec3::from(ground.normal).normalize();
        for part in &self.mesh.parts {
            let hardness = self.settings.contact_stiffness * part.young / part.edge;
            for vertex in part.vertices.clone() {
                let depth = ground.height - normal.dot(&self.positions[vertex]);
                let stiffness = hardness * self.mesh.areas[vertex];
                if depth <= 0.0 || stiffness == 0.0 {
                    continue;
                }
                let force = stiffness * depth;
                let velocity = &self.velocities[vertex];
                let drag = drag(self.settings, force, &normal, velocity, part.edge);
                let block = implicit(&normal, stiffness, drag, self.settings.dt);
                add(vertex, normal * force, block);
            }
        }
    }
}

/// Barycentric coordinates of a point inside a tetrahedron of any orientation: 0 or more, sum 1.
/// `None` if the tetrahedron is too flat.
fn barycentric(tet: &[Vec3; 4], at: &Vec3) -> Option<[f64; 4]> {
    let [a, b, c, d] = tet.map(|corner| corner - at);
    let volume = |p: &Vec3, q: &Vec3, r: &Vec3| p.cross(q).dot(r);
    // The weight of a corner is the volume of the tetrahedron in which the point replaces that
    // corner.
    let weights = [
        volume(&b, &c, &d),
        -volume(&a, &c, &d),
        volume(&a, &b, &d),
        -volume(&a, &b, &c),
    ];
    let sign = weights.iter().sum::<f64>().signum();
    // Rounding may put a point on a face a little outside.
    let weights = weights.map(|weight| (weight * sign).max(0.0));
    let sum: f64 = weights.iter().sum();
    (sum > 0.0).then(|| weights.map(|weight| weight / sum))
}

/// The pairs of an answer, with tetrahedra numbered consecutively over all solids.
pub(crate) fn numbered(mesh: &Mesh, pairs: &Pairs, out: &mut Vec<[u32; 2]>) -> Result<(), Error> {
    out.clear();
    for [body_a, a, body_b, b] in pairs.rows() {
        let number = |body: u32, tet: u32| {
            let tets = &mesh.parts.get(body as usize)?.tets;
            let global = tets.start + tet as usize;
            // Element numbers fit: the mesh was checked to have fewer than 2^28.
            tets.contains(&global).then_some(global as u32)
        };
        match (number(body_a, a), number(body_b, b)) {
            (Some(a), Some(b)) => out.push([a, b]),
            _ => {
                return Err(Error::ForeignPair {
                    row: [body_a, a, body_b, b],
                });
            }
        }
    }
    // Eight corners of each contact are numbered in 32 bits.
    let limit = u32::MAX as usize / 8;
    if out.len() > limit {
        return Err(Error::TooMany {
            what: "colliding pairs",
            given: out.len(),
            limit,
        });
    }
    Ok(())
}

/// The contacts as a part of the system matrix: blocks between any two of a contact's eight
/// vertices, applied without storing them.
#[derive(Debug, Default)]
pub(crate) struct Couplings {
    pub contacts: Vec<Contact>,
    /// Each vertex's contacts, as 8 · contact + corner.
    at: Lists,
    /// The weight of each entry of `at`: read once per iteration of the solver, in order.
    weights: Vec<f64>,
}

impl Couplings {
    /// Finds each vertex's contacts.
    pub fn index(&mut self, n_vertices: usize) {
        let corners = self.contacts.iter().map(|contact| contact.vertices);
        self.at.rebuild(n_vertices, corners);
        self.at
            .entries()
            .par_iter()
            .with_min_len(GRAIN)
            .map(|&entry| self.contacts[entry as usize / 8].weights[entry as usize % 8])
            .collect_into_vec(&mut self.weights);
    }

    /// The reaction of each contact to velocities `x`.
    pub fn react(&self, x: &[Vec3], out: &mut Vec<Vec3>) {
        self.contacts
            .par_iter()
            .with_min_len(GRAIN)
            .map(|contact| {
                let relative: Vec3 = contact
                    .vertices
                    .iter()
                    .zip(contact.weights)
                    .map(|(&vertex, weight)| x[vertex as usize] * weight)
                    .sum();
                contact.block * relative
            })
            .collect_into_vec(out);
    }

    /// Adds a row of the product to `sum`, from the reactions of the contacts.
    #[inline]
    pub fn add_row(&self, row: usize, reactions: &[Vec3], sum: Vec3) -> Vec3 {
        let weights = &self.weights[self.at.range(row)];
        self.at
            .get(row)
            .iter()
            .zip(weights)
            .fold(sum, |sum, (&entry, &weight)| {
                sum + reactions[entry as usize / 8] * weight
            })
    }

    /// The force on a vertex at the start of the step.
    pub fn force(&self, vertex: usize) -> Vec3 {
        self.at
            .get(vertex)
            .iter()
            .map(|&entry| {
                let contact = &self.contacts[entry as usize / 8];
                contact.force * contact.weights[entry as usize % 8]
            })
            .sum()
    }

    /// The block on the diagonal of a row.
    pub fn diagonal(&self, row: usize) -> Mat3 {
        self.at
            .get(row)
            .iter()
            .map(|&entry| {
                let contact = &self.contacts[entry as usize / 8];
                contact.block * contact.weights[entry as usize % 8].powi(2)
            })
            .sum()
    }
}
