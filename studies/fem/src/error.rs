//! Errors of simulations.

/// Why a simulation could not be set up, or why a step failed. A failed step leaves the
/// simulation unchanged.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A number is outside its range. Check the material or the settings.
    #[error("{what}: {given} given, {allowed} allowed")]
    Setting {
        /// The name of the number.
        what: &'static str,
        /// The value as given.
        given: f64,
        /// The allowed range.
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
    /// A tetrahedron has no volume at rest, so its strain is undefined. Mesh again.
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
    /// The number of positions or velocities is not the number of vertices.
    #[error("solid {solid}: {given} {what} given, but it has {expected} vertices")]
    WrongNumber {
        /// Number of the solid, in the order given.
        solid: usize,
        /// The kind of vectors: positions or velocities.
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
        /// The kind of vector: position or velocity.
        what: &'static str,
        /// The value.
        value: [f64; 3],
    },
    /// A pair names a tetrahedron that does not exist: the pairs come from another scene.
    #[error("no such pair of tetrahedra in this simulation: {row:?}")]
    ForeignPair {
        /// The row: body, tetrahedron, body, tetrahedron.
        row: [u32; 4],
    },
    /// More elements than 32-bit indices can number.
    #[error("{what}: {given} given, at most {limit} can be held")]
    TooMany {
        /// The kind of elements.
        what: &'static str,
        /// How many were given.
        given: usize,
        /// The most that can be held.
        limit: usize,
    },
    /// The folder for files could not be made.
    #[error("{path}: cannot be made: {source}")]
    Folder {
        /// Its path.
        path: String,
        /// The system's error.
        source: std::io::Error,
    },
    /// The threads of the pool could not be started.
    #[error("thread pool: {0}")]
    Threads(String),
    /// The detector returned an error, or was cancelled.
    #[error(transparent)]
    Detection(#[from] impinge::Error),
    /// A mesh file could not be read.
    #[error(transparent)]
    File(#[from] impinge_io::Error),
    /// A mesh file holds no tetrahedra.
    #[error("{0}: tetrahedra are needed, but the file holds triangles")]
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
