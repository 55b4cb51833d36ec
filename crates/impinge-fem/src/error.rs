//! Everything that can go wrong, by name.

/// Why a simulation could not be set up, or a step not be made. A failed step leaves the
/// simulation as it was before.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A number lies outside its range. Check the material or the settings.
    #[error("{what}: {given} given, {allowed} allowed")]
    Setting {
        /// What it sets.
        what: &'static str,
        /// The value as given.
        given: f64,
        /// What is allowed.
        allowed: &'static str,
    },
    /// A tetrahedron names a vertex that does not exist. Check the index buffer's base.
    #[error(
        "solid {solid}: tetrahedron {tetrahedron} names vertex {index}, but there are {n_vertices} vertices"
    )]
    VertexIndexOutOfRange {
        /// Number of the solid, in the order given.
        solid: usize,
        /// Index of the tetrahedron within the solid.
        tetrahedron: usize,
        /// The vertex index it names.
        index: u32,
        /// How many vertices the solid has.
        n_vertices: usize,
    },
    /// A tetrahedron has no volume at rest, so strains in it are not defined. Mesh again.
    #[error("solid {solid}: tetrahedron {tetrahedron} is flat at rest (volume {volume:e})")]
    FlatTetrahedron {
        /// Number of the solid, in the order given.
        solid: usize,
        /// Index of the tetrahedron within the solid.
        tetrahedron: usize,
        /// Its volume at rest.
        volume: f64,
    },
    /// A vertex belongs to no tetrahedron and so has no mass. Drop it from the mesh, as
    /// [`Solid::without_unused_vertices`](crate::Solid::without_unused_vertices) does.
    #[error("solid {solid}: vertex {vertex} belongs to no tetrahedron")]
    UnusedVertex {
        /// Number of the solid, in the order given.
        solid: usize,
        /// Index of the vertex within the solid.
        vertex: usize,
    },
    /// A fixed vertex does not exist.
    #[error("solid {solid}: vertex {vertex} is to be fixed, but there are {n_vertices} vertices")]
    FixedOutOfRange {
        /// Number of the solid, in the order given.
        solid: usize,
        /// The vertex as given.
        vertex: u32,
        /// How many vertices the solid has.
        n_vertices: usize,
    },
    /// There is not one position (or velocity) a vertex.
    #[error("solid {solid}: {given} {what} given, but it has {expected} vertices")]
    WrongNumber {
        /// Number of the solid, in the order given.
        solid: usize,
        /// What was given: positions or velocities.
        what: &'static str,
        /// How many were given.
        given: usize,
        /// How many vertices the solid has.
        expected: usize,
    },
    /// A position or velocity is NaN or infinite. After a step: the time step is too long for
    /// the velocities, or the forces are too large.
    #[error("solid {solid}: vertex {vertex}: {what} ({}, {}, {}) is not finite", value[0], value[1], value[2])]
    NotFinite {
        /// Number of the solid, in the order given.
        solid: usize,
        /// Index of the vertex within the solid.
        vertex: usize,
        /// What is not finite.
        what: &'static str,
        /// The value.
        value: [f64; 3],
    },
    /// Pairs that name a tetrahedron which is not there: they come from another scene.
    #[error("no such pair of tetrahedra in this simulation: {row:?}")]
    ForeignPair {
        /// The row: body, tetrahedron, body, tetrahedron.
        row: [u32; 4],
    },
    /// More than 32-bit indices can name.
    #[error("{what}: {given} given, at most {limit} can be held")]
    TooMany {
        /// What there are too many of.
        what: &'static str,
        /// How many were given.
        given: usize,
        /// The most that can be held.
        limit: usize,
    },
    /// A saved state that is damaged or belongs to another simulation.
    #[error("saved state: {0}")]
    State(String),
    /// The threads of the pool could not be started.
    #[error("thread pool: {0}")]
    Threads(String),
    /// The detector refused, or was cancelled.
    #[error(transparent)]
    Detection(#[from] impinge::Error),
    /// A mesh file could not be read.
    #[error(transparent)]
    File(#[from] impinge_io::Error),
    /// A mesh file holds no tetrahedra.
    #[error("{0}: tetrahedra are needed, but it holds triangles")]
    NoTetrahedra(String),
}

/// Refuses a number outside its range.
pub(crate) fn check(
    what: &'static str,
    given: f64,
    ok: bool,
    allowed: &'static str,
) -> Result<(), Error> {
    if ok && given.is_finite() {
        return Ok(());
    }
    Err(Error::Setting {
        what,
        given,
        allowed,
    })
}
