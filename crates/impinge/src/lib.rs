//! Exact, real-time collision detection for deforming meshes.
//!
//! Bodies have fixed topology and positions that change every frame. A [`Detector`] finds
//! which of their elements intersect, between bodies and within one body.
//!
//! * **Closed sets.** Touching counts, coplanar overlap counts, a degenerate triangle is the
//!   segment or the point that it is.
//! * **Exact.** A pair is reported if and only if the two elements share a point when the given
//!   coordinates are read as real numbers. There is no tolerance anywhere.
//! * **The same bytes everywhere.** The answer is sorted and depends on the input alone: not on
//!   method, backend, threads or memory.
//! * **Continuous detection.** [`Detector::impacts`] finds which vertices, edges and faces touch
//!   while bodies move from their positions to their [end positions](Scene::set_end_positions), and
//!   the first time of each pair, exact and rounded down. For solvers, [`Detector::earliest`] finds
//!   the first contact of a step, [`Detector::is_free`] decides whether there is any, and
//!   [`Detector::advance`] finds how far a step can be taken.
//! * **Proximity.** [`Detector::near`] finds which vertices, edges and faces are within a distance
//!   of each other, exactly, and which of their features are nearest. [`NearPairs::stencils`] has
//!   their distances with gradients and Hessians, for barriers and other potentials.
//!   [`Detector::distance`] finds the smallest distance of two bodies.
//!
//! ```toml
//! [dependencies]
//! impinge = "0.2"                                            # reads OBJ, PLY, STL, OFF, glTF, MSH, VTK and others
//! # impinge = { version = "0.2", features = ["gpu"] }        # and the GPU backend
//! # impinge = { version = "0.2", features = ["serde"] }      # rows, settings, statistics and choices with serde
//! # impinge = { version = "0.2", default-features = false }  # no files, and the fewest packages
//! ```
//!
//! A whole program: which triangles of two meshes intersect.
//!
//! ```
//! # #[cfg(feature = "io")]
//! use impinge::{Backend, Detector, Query, Scene, read};
//!
//! # #[cfg(not(feature = "io"))] fn main() {}
//! # #[cfg(feature = "io")]
//! fn main() -> Result<(), impinge::Error> {
//!     let mut scene = Scene::new();
//!     let a = scene.add(read("examples/data/tetrahedron.obj")?)?;
//!     let b = scene.add(read("examples/data/square.obj")?)?;
//!     let mut detector = Detector::new(Backend::Auto)?; // a GPU where there is one, else the CPU
//!     let pairs = detector.detect(&scene, &Query::between(a, b))?;
//!     for [i, j] in pairs.between(a, b) {
//!         println!("triangle {i} of a meets triangle {j} of b");
//!     }
//! #   assert_eq!(pairs.between(a, b).collect::<Vec<_>>(), [[1, 0], [1, 1], [2, 0], [2, 1], [3, 0], [3, 1]]);
//!     Ok(())
//! }
//! ```
//!
//! # Steps of a solver
//!
//! A solver wishes for positions, and takes the step as far as nothing touches. Each stored state
//! is then reached from the one before on straight lines without contact, rounding included. So
//! surfaces that do not intersect at first never do.
//!
//! ```
//! use impinge::{Backend, Detector, Query, Scene};
//! # fn main() -> Result<(), impinge::Error> {
//! let mut scene = Scene::new();
//! scene.add_triangles(&[[0, 1, 2]], &[[-4.0, -4.0, 0.0], [4.0, -4.0, 0.0], [0.0, 4.0, 0.0f32]])?;
//! let strand = scene.add_edges(&[[0, 1]], &[[0.0, 0.0, 1.0], [0.5, 0.0, 1.0f32]])?; // hair; points are bodies too
//! let mut detector = Detector::new(Backend::Cpu)?;
//! let mut height = 1.0;
//! for _ in 0..3 {
//!     let wished = height - 0.75f32;
//!     scene.set_end_positions(strand, &[[0.0, 0.0, wished], [0.5, 0.0, wished]])?;
//!     let advance = detector.advance(&scene, &Query::all())?;
//!     advance.apply(&mut scene)?;
//!     height = scene.body(strand)?.positions().point(0)[2] as f32;
//! }
//! assert!(0.0 < height && height < 1e-6);
//! # Ok(()) }
//! ```
//!
//! This holds if the start is free of intersections: bodies that already pass through each other
//! need not touch on the way. [`Start::Verify`] asks that, too. And neighbours must share their
//! vertices: the two sides of a seam, along which vertices are repeated, touch for ever. [`Weld`]
//! makes one vertex of those at the same position.
//!
//! ```
//! use impinge::{Backend, Detector, Query, Scene, Start, Weld};
//! # fn main() -> Result<(), impinge::Error> {
//! // Two triangles of a renderer: the vertices of their common edge are there twice.
//! let positions = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
//! let faces = [[0, 1, 2], [3, 4, 5]];
//! let weld = Weld::by_position(&positions);
//! let mut scene = Scene::new();
//! let cloth = scene.add_triangles(&weld.apply(&faces), &weld.positions(&positions)?)?;
//! let wished = positions.map(|[x, y, z]| [x, y, z - 1.0]);
//! scene.set_end_positions(cloth, &weld.positions(&wished)?)?; // every frame is welded alike
//! let step = Query::all().start(Start::Verify);
//! let advance = Detector::new(Backend::Cpu)?.advance(&scene, &step)?;
//! assert_eq!((advance.fraction, advance.start_intersects), (1.0, Some(false)));
//! # Ok(()) }
//! ```
//!
//! [`Detector::impacts`] has all pairs that touch, for solvers that resolve contacts;
//! [`Detector::candidates`] the pairs whose boxes overlap, for a test of one's own.
//!
//! # Positions of other libraries
//!
//! Positions are `&[[f32; 3]]` or `&[[f64; 3]]`. The vectors of glam and nalgebra have this layout,
//! and with their feature `bytemuck` a slice of them is cast without a copy; one vector at a time
//! goes by `to_array` and `into`.
//!
//! ```
//! # #[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
//! # #[repr(C)]
//! # struct Vec3 { x: f32, y: f32, z: f32 }
//! # fn main() -> Result<(), impinge::Error> {
//! # let corner = |x, y, z| Vec3 { x, y, z };
//! # let mut scene = impinge::Scene::new();
//! // glam::Vec3, glam::DVec3, nalgebra::Point3<f32>, nalgebra::Vector3<f64> …: Cargo.toml has glam = { features = ["bytemuck"] },
//! // or nalgebra = { features = ["bytemuck"] }.
//! let vertices: Vec<Vec3> = vec![corner(0.0, 0.0, 0.0), corner(1.0, 0.0, 0.0), corner(0.0, 1.0, 0.0)];
//! let positions: &[[f32; 3]] = bytemuck::cast_slice(&vertices);
//! let body = scene.add_triangles(&[[0, 1, 2]], positions)?;
//! # assert_eq!(scene.body(body)?.n_vertices(), 3);
//! # Ok(()) }
//! ```
//!
//! `glam::Vec3A` is padded to 16 bytes:
//! `vertices.iter().map(|v| v.to_array()).collect::<Vec<_>>()`. A rigid body needs no new vertices
//! at all: [`Scene::set_transform`] takes rows of `f64`, which are
//! `matrix.transpose().to_cols_array_2d()` of a `glam::DMat4`, and `matrix.transpose().into()` of a
//! `nalgebra::Matrix4<f64>`.
//!
//! This crate is the stable interface of the engine in `impinge-core`.

#![warn(missing_debug_implementations)]

#[cfg(feature = "io")]
mod read;

#[cfg(feature = "io")]
pub use read::read;

pub use impinge_core::exact::Feature;
pub use impinge_core::proximity::Nearest;
/// The GPU interface of [`Settings::on_device`] and [`Gpu`].
#[cfg(feature = "gpu")]
pub use impinge_core::wgpu;
pub use impinge_core::{
    Advance, Affinity, Backend, Body, BodyId, BodyKind, Bounds, CancelToken, Candidates, Changes,
    Clearance, Closest, ClosestElement, ClosestPoints, Control, Csr, Detector, Element,
    ElementVertices, Elements, Error, Exclusion, Filter, Gradient, Hessian, Hit, Hits, Impact,
    Impacts, InstructionSet, Mesh, Method, NearIter, NearPair, NearPairs, Neighbours, NewPositions,
    PairFilter, PairKind, PairKinds, Pairs, Part, Place, Positions, Precision, Progress, Query,
    RayHit, Real, Recluster, SafeDistances, Scene, Settings, SharedVertex, Stage, Start, Stats,
    Stencil, StencilIter, Stencils, Thickness, Truncation, Weld, WrongNumber, hash_impact_rows,
    hash_rows, project_psd, project_psd_all,
};
#[cfg(feature = "gpu")]
pub use impinge_core::{
    DeviceInfo, Gpu, ResidentPairs, ResidentPart, ResidentSafe, ResidentStep, ResidentVertices,
    devices, devices_async,
};
#[doc(hidden)]
pub use impinge_core::{StartOfBody, StepStart, own_pool};
pub use impinge_core::{contact, exact, proximity};

// The types that users hold are `Send` and `Sync`.
const _: () = {
    const fn threads_may_share<T: Send + Sync>() {}
    threads_may_share::<Detector>();
    threads_may_share::<Scene>();
    threads_may_share::<Pairs>();
    threads_may_share::<Query>();
    threads_may_share::<Impacts>();
    threads_may_share::<NearPairs>();
    threads_may_share::<SafeDistances>();
    threads_may_share::<Neighbours>();
    threads_may_share::<Truncation>();
    threads_may_share::<Stencils>();
};
