//! The simulation loop: detection, then a step of backward Euler.

use std::time::Instant;

use impinge::{BodyId, Detector, Pairs, Positions, Query, Scene, Stats};
use rayon::prelude::*;

use crate::contact::{Couplings, Now, numbered, outward_directions};
use crate::elasticity::{GRAIN, Turned, energy, forces, turn};
use crate::element::Vec3;
use crate::error::Error;
use crate::matrix::BlockMatrix;
use crate::mesh::Mesh;
use crate::settings::Settings;
use crate::solid::Solid;
use crate::solver::{Scratch, Solved, System};

/// Elastic solids in contact, moved by backward Euler.
///
/// A step solves `(M + h D + h² K) v' = M v + h f` for the new velocities, with the stiffness K and
/// all forces f at the beginning of the step: one round of Newton's method, as in Müller & Gross
/// 2004. D is Rayleigh damping. Then `x' = x + h v'`. Contacts add to K as described in
/// [`contact`](crate#contact).
///
/// Positions are f64 inside. The [`scene`](Simulation::scene), which detection uses and files
/// contain, holds them rounded to f32.
///
/// ```
/// use impinge::{Backend, Detector};
/// use impinge_fem::{Ground, Material, Settings, Simulation, Solid, scenes};
/// # fn main() -> Result<(), impinge_fem::Error> {
/// let block = scenes::block(2, 2, 2, 0.5, Material::default());
/// let above = block.clone().posed(|[x, y, z]| [x + 0.2, y + 1.1, z]);
/// let settings = Settings {
///     ground: Some(Ground { normal: [0.0, 1.0, 0.0], height: 0.0 }),
///     ..Settings::default()
/// };
/// let mut simulation = Simulation::new(&[block, above], settings)?;
/// let mut detector = Detector::new(Backend::Cpu)?;
/// for _ in 0..40 {
///     let report = simulation.step(&mut detector)?;
///     println!("{} pairs in {:.2} ms", report.n_pairs, report.detect_ms);
/// }
/// # Ok(()) }
/// ```
pub struct Simulation {
    mesh: Mesh,
    settings: Settings,
    pool: rayon::ThreadPool,
    scene: Scene,
    bodies: Vec<BodyId>,
    query: Query,
    step: u64,
    positions: Vec<Vec3>,
    velocities: Vec<Vec3>,
    matrix: BlockMatrix,
    scratch: StepScratch,
}

/// Scratch memory, reused from step to step.
#[derive(Default)]
struct StepScratch {
    turned: Vec<Turned>,
    forces: Vec<Vec3>,
    outward: Vec<Vec3>,
    pairs: Vec<[u32; 2]>,
    couplings: Couplings,
    solver: Scratch,
    rhs: Vec<Vec3>,
    next_velocities: Vec<Vec3>,
    next_positions: Vec<Vec3>,
}

/// Counts and times of a step.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct StepReport {
    /// Number of the step, from 0; it leads from state `step` to `step + 1`.
    pub step: u64,
    /// Pairs of tetrahedra that the detector found at the beginning of the step.
    pub n_pairs: usize,
    /// Those of them whose intersection has a volume, so that they push each other.
    pub n_contacts: usize,
    /// Colliding tetrahedra of each solid.
    pub n_colliding: Vec<usize>,
    /// Time of detection in milliseconds, as measured by the detector.
    pub detect_ms: f64,
    /// Time of computing intersections of pairs, in milliseconds.
    pub contact_ms: f64,
    /// Time of rotations, forces and matrix, in milliseconds.
    pub assemble_ms: f64,
    /// Time of the solver, in milliseconds.
    pub solve_ms: f64,
    /// Time of the whole step except detection, in milliseconds.
    pub advance_ms: f64,
    /// Iterations of the solver.
    pub n_iterations: usize,
    /// The residual that the solver reached, relative to the right side. It is above the tolerance
    /// if the solver ran out of iterations.
    pub residual: f64,
    /// Counts and times of the detection.
    pub detection: Stats,
}

/// Energies in joule.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Energy {
    /// Kinetic energy.
    pub kinetic: f64,
    /// Elastic energy.
    pub elastic: f64,
    /// Potential energy of gravity, 0 at the origin.
    pub potential: f64,
}

impl Energy {
    /// The sum of all three, without contacts.
    pub fn total(self) -> f64 {
        self.kinetic + self.elastic + self.potential
    }
}

impl Simulation {
    /// Sets up solids in their initial state.
    ///
    /// # Errors
    /// A setting or material out of its range; a solid that is refused (index out of range, flat
    /// tetrahedron, unused vertex, position that is not finite in f32); threads that do not start.
    pub fn new(solids: &[Solid], settings: Settings) -> Result<Self, Error> {
        settings.check()?;
        let mesh = Mesh::new(solids)?;
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(settings.threads)
            .build()
            .map_err(|error| Error::Threads(error.to_string()))?;
        let mut scene = Scene::new();
        let bodies = solids
            .iter()
            .map(|solid| scene.add((solid.tets.clone(), rounded(&solid.positions))))
            .collect::<Result<_, _>>()?;
        let all = |of: fn(&Solid) -> &Vec<[f64; 3]>| -> Vec<Vec3> {
            solids.iter().flat_map(of).map(|&v| v.into()).collect()
        };
        let positions = all(|solid| &solid.positions);
        let mut velocities = all(|solid| &solid.velocities);
        for (velocity, _) in velocities.iter_mut().zip(&mesh.fixed).filter(|(_, f)| **f) {
            *velocity = Vec3::zeros();
        }
        Ok(Simulation {
            matrix: BlockMatrix::new(&mesh),
            query: if settings.self_contact {
                Query::all()
            } else {
                Query::between_all()
            },
            mesh,
            settings,
            pool,
            scene,
            bodies,
            step: 0,
            positions,
            velocities,
            scratch: StepScratch::default(),
        })
    }

    /// The number of steps made so far.
    pub fn n_steps(&self) -> u64 {
        self.step
    }

    /// The settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The solids as bodies for a detector: tetrahedra, and positions rounded to f32.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The solids' bodies in [`scene`](Simulation::scene), in the order given.
    pub fn bodies(&self) -> &[BodyId] {
        &self.bodies
    }

    /// The query for the detector: pairs of different solids, and with self-contact also pairs
    /// within one solid.
    pub fn query(&self) -> &Query {
        &self.query
    }

    /// Positions of all vertices, solid by solid, in metres.
    pub fn positions(&self) -> Vec<[f64; 3]> {
        self.positions.iter().map(|&v| v.into()).collect()
    }

    /// Velocities of all vertices, solid by solid, in m/s.
    pub fn velocities(&self) -> Vec<[f64; 3]> {
        self.velocities.iter().map(|&v| v.into()).collect()
    }

    /// Lumped masses of all vertices, solid by solid, in kg.
    pub fn masses(&self) -> &[f64] {
        &self.mesh.masses
    }

    /// Current elastic forces on all vertices, in newton.
    pub fn elastic_forces(&self) -> Vec<[f64; 3]> {
        let (mut turned, mut found) = (Vec::new(), Vec::new());
        self.pool.install(|| {
            turn(&self.mesh, &self.positions, &mut turned);
            forces(&self.mesh, &turned, &mut found);
        });
        found.into_iter().map(Into::into).collect()
    }

    /// Forces of the contacts of these pairs on all vertices, in newton, without the forces of the
    /// ground.
    ///
    /// # Errors
    /// [`Error::ForeignPair`] for pairs of another scene.
    pub fn contact_forces(&self, pairs: &Pairs) -> Result<Vec<[f64; 3]>, Error> {
        let (mut outward, mut couplings, mut tets) = (Vec::new(), Couplings::default(), Vec::new());
        numbered(&self.mesh, pairs, &mut tets)?;
        self.pool.install(|| {
            outward_directions(&self.mesh, &self.positions, &mut outward);
            self.now(&outward).contacts(&tets, &mut couplings.contacts);
        });
        couplings.index(self.mesh.n_vertices());
        Ok((0..self.mesh.n_vertices())
            .map(|vertex| couplings.force(vertex).into())
            .collect())
    }

    /// The current energies.
    pub fn energy(&self) -> Energy {
        let gravity = Vec3::from(self.settings.gravity);
        let (mut kinetic, mut potential) = (0.0, 0.0);
        for ((mass, v), x) in self
            .mesh
            .masses
            .iter()
            .zip(&self.velocities)
            .zip(&self.positions)
        {
            kinetic += 0.5 * mass * v.norm_squared();
            potential -= mass * gravity.dot(x);
        }
        Energy {
            kinetic,
            elastic: energy(&self.mesh, &self.positions),
            potential,
        }
    }

    /// Momentum of all solids in kg m/s.
    pub fn momentum(&self) -> [f64; 3] {
        let masses = self.mesh.masses.iter();
        let sum: Vec3 = masses.zip(&self.velocities).map(|(m, v)| v * *m).sum();
        sum.into()
    }

    /// Makes one step: detects, then advances.
    ///
    /// # Errors
    /// As [`detect`](Simulation::detect) and [`advance`](Simulation::advance).
    pub fn step(&mut self, detector: &mut Detector) -> Result<StepReport, Error> {
        let pairs = self.detect(detector)?;
        self.advance(&pairs)
    }

    /// Finds the pairs of tetrahedra that intersect now: the first half of a step. Use it to see
    /// the pairs together with the positions at which they were found.
    ///
    /// # Errors
    /// As [`Detector::detect`].
    pub fn detect(&self, detector: &mut Detector) -> Result<Pairs, Error> {
        Ok(detector.detect(&self.scene, &self.query)?)
    }

    /// Advances by one time step, with contacts from the pairs found by this simulation's
    /// [`detect`](Simulation::detect): the second half of a step.
    ///
    /// # Errors
    /// [`Error::ForeignPair`]; [`Error::NotFinite`] if the motion diverges. The simulation is then
    /// unchanged.
    pub fn advance(&mut self, pairs: &Pairs) -> Result<StepReport, Error> {
        let start = Instant::now();
        let mut scratch = std::mem::take(&mut self.scratch);
        let result = numbered(&self.mesh, pairs, &mut scratch.pairs).and_then(|()| {
            let pool = &self.pool;
            let (matrix, mesh) = (&mut self.matrix, &self.mesh);
            let state = (&self.positions[..], &self.velocities[..]);
            let solved =
                pool.install(|| integrate(mesh, &self.settings, state, matrix, &mut scratch));
            self.accept(&scratch)?;
            Ok(solved)
        });
        let n_contacts = scratch.couplings.contacts.len();
        self.scratch = scratch;
        let (solved, [contact_ms, assemble_ms, solve_ms]) = result?;
        self.step += 1;
        Ok(StepReport {
            step: self.step - 1,
            n_pairs: pairs.len(),
            n_contacts,
            n_colliding: self
                .bodies
                .iter()
                .map(|&body| pairs.colliding(body).len())
                .collect(),
            detect_ms: pairs.stats().total_ms,
            contact_ms,
            assemble_ms,
            solve_ms,
            advance_ms: ms_since(start),
            n_iterations: solved.n_iterations,
            residual: solved.residual,
            detection: pairs.stats().clone(),
        })
    }

    /// Accepts the new positions and velocities if all of them are finite.
    fn accept(&mut self, scratch: &StepScratch) -> Result<(), Error> {
        let StepScratch {
            next_positions,
            next_velocities,
            ..
        } = scratch;
        let bad = |v: &Vec3| v.iter().any(|&x| !to_f32(x).is_finite());
        for (what, vectors) in [("velocity", next_velocities), ("position", next_positions)] {
            if let Some(at) = vectors.iter().position(bad) {
                let (solid, vertex) = self.mesh.locate(at);
                return Err(Error::NotFinite {
                    solid,
                    vertex,
                    what,
                    value: vectors[at].into(),
                });
            }
        }
        self.positions.copy_from_slice(next_positions);
        self.velocities.copy_from_slice(next_velocities);
        self.show()
    }

    /// The positions of a body as the scene holds them: in f32.
    ///
    /// # Errors
    /// Another simulation's body.
    pub fn shown(&self, body: BodyId) -> Result<&[[f32; 3]], Error> {
        match self.scene.body(body)?.positions() {
            Positions::F32(positions) => Ok(positions),
            Positions::F64(_) => unreachable!("solids are added in f32"),
        }
    }

    /// Copies the positions to the scene.
    fn show(&mut self) -> Result<(), Error> {
        for (&body, part) in self.bodies.iter().zip(&self.mesh.parts) {
            let shown = self.scene.positions_mut::<f32>(body)?;
            for (shown, x) in shown.iter_mut().zip(&self.positions[part.vertices.clone()]) {
                *shown = [x.x, x.y, x.z].map(to_f32);
            }
        }
        Ok(())
    }

    fn now<'a>(&'a self, outward: &'a [Vec3]) -> Now<'a> {
        Now {
            mesh: &self.mesh,
            settings: &self.settings,
            positions: &self.positions,
            velocities: &self.velocities,
            outward,
        }
    }
}

/// Sets up the system and solves it. Returns the times of contacts, assembly and solver.
fn integrate(
    mesh: &Mesh,
    settings: &Settings,
    (positions, velocities): (&[Vec3], &[Vec3]),
    matrix: &mut BlockMatrix,
    scratch: &mut StepScratch,
) -> (Solved, [f64; 3]) {
    let StepScratch {
        turned,
        forces: force,
        outward,
        pairs,
        couplings,
        solver,
        rhs,
        next_velocities,
        next_positions,
    } = scratch;
    let dt = settings.dt;
    let n_vertices = mesh.n_vertices();

    let start = Instant::now();
    if pairs.is_empty() {
        couplings.contacts.clear();
        outward.clear();
    } else {
        outward_directions(mesh, positions, outward);
    }
    let now = Now {
        mesh,
        settings,
        positions,
        velocities,
        outward,
    };
    now.contacts(pairs, &mut couplings.contacts);
    couplings.index(n_vertices);
    let contact_ms = ms_since(start);

    let start = Instant::now();
    turn(mesh, positions, turned);
    forces(mesh, turned, force);
    matrix.assemble(turned, dt * (dt + settings.damping.stiffness));
    let gravity = Vec3::from(settings.gravity);
    force
        .par_iter_mut()
        .zip(&mesh.masses)
        .enumerate()
        .with_min_len(GRAIN)
        .for_each(|(vertex, (force, mass))| *force += gravity * *mass + couplings.force(vertex));
    for (vertex, mass) in mesh.masses.iter().enumerate() {
        let damped = mass * (1.0 + dt * settings.damping.mass);
        let block = matrix.diagonal_mut(vertex);
        (0..3).for_each(|k| block[(k, k)] += damped);
    }
    now.ground(|vertex, push, block| {
        force[vertex] += push;
        *matrix.diagonal_mut(vertex) += block;
    });
    (force.par_iter(), &mesh.masses, velocities)
        .into_par_iter()
        .with_min_len(GRAIN)
        .map(|(force, mass, v)| v * *mass + force * dt)
        .collect_into_vec(rhs);
    let assemble_ms = ms_since(start);

    let start = Instant::now();
    let system = System {
        matrix,
        couplings,
        fixed: &mesh.fixed,
    };
    next_velocities.clear();
    next_velocities.extend_from_slice(velocities);
    let solved = system.solve(
        rhs,
        next_velocities,
        settings.tolerance,
        settings.max_iterations,
        solver,
    );
    next_positions.clear();
    next_positions.extend(
        positions
            .iter()
            .zip(&*next_velocities)
            .map(|(x, v)| x + v * dt),
    );
    (solved, [contact_ms, assemble_ms, ms_since(start)])
}

fn ms_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

/// The f32 nearest to a coordinate. The simulation leaves double precision only here.
fn to_f32(x: f64) -> f32 {
    x as f32
}

fn rounded(positions: &[[f64; 3]]) -> Vec<[f32; 3]> {
    positions.iter().map(|p| p.map(to_f32)).collect()
}
