//! What can go wrong, and what to check then.

use crate::scene::ids::BodyId;

/// A number as messages show it: with an exponent where it would have many digits without.
pub(crate) fn shown(x: f64) -> String {
    match x == 0.0 || (1e-5..1e16).contains(&x.abs()) {
        true => x.to_string(),
        false => format!("{x:e}"),
    }
}

/// All errors. Each names the body, the index, and both numbers where it has them.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A position holds NaN or an infinity. Check the step that produced this vertex.
    #[error("body {body}: vertex {vertex} has a non-finite position ({}, {}, {})", shown(value[0]), shown(value[1]), shown(value[2]))]
    NonFinitePosition {
        /// The body, or the one that was about to be added.
        body: BodyId,
        /// Index of the vertex within the body.
        vertex: usize,
        /// The position as given.
        value: [f64; 3],
    },
    /// A point or direction that was asked about holds NaN or an infinity. Check where it comes
    /// from.
    #[error("{what}: row {row} is not finite ({}, {}, {})", shown(value[0]), shown(value[1]), shown(value[2]))]
    NonFinitePoint {
        /// Which array: `"points"`, `"origins"`, `"directions"` or `"rest"`.
        what: &'static str,
        /// The row of the array.
        row: usize,
        /// The row as given.
        value: [f64; 3],
    },
    /// An element names a vertex that does not exist. Check the index buffer's base.
    #[error(
        "body {body}: element {element} names vertex {index}, but there are {n_vertices} vertices"
    )]
    VertexIndexOutOfRange {
        /// The body, or the one that was about to be added.
        body: BodyId,
        /// Index of the element within the body.
        element: usize,
        /// The vertex index it names.
        index: u32,
        /// How many vertices the body has.
        n_vertices: usize,
    },
    /// The number of new positions is not the body's number of vertices. Only re-meshing changes
    /// topology.
    #[error("body {body}: {given} positions given, but it has {expected} vertices")]
    WrongNumberOfPositions {
        /// The body.
        body: BodyId,
        /// How many positions were given.
        given: usize,
        /// How many vertices the body has.
        expected: usize,
    },
    /// Positions were requested in a precision in which the body does not store them.
    #[error("body {body}: positions are stored as {stored}, not as {asked}")]
    WrongPrecision {
        /// The body.
        body: BodyId,
        /// The stored precision: `"f32"` or `"f64"`.
        stored: &'static str,
        /// The requested precision.
        asked: &'static str,
    },
    /// What is given per vertex has another length than the body has vertices.
    #[error("body {body}: {given} {what} given, but there are {n_vertices} vertices")]
    PerVertex {
        /// The body.
        body: BodyId,
        /// What was given: `"groups"`, `"pinned"`.
        what: &'static str,
        /// How many were given.
        given: usize,
        /// How many vertices the body has.
        n_vertices: usize,
    },
    /// What is given per vertex, edge or face has another length than the body has of these.
    #[error("body {body}: {given} {what} given, but there are {n} {elements}")]
    PerElement {
        /// The body.
        body: BodyId,
        /// What was given: `"thicknesses"`, `"rows of edges"`.
        what: &'static str,
        /// How many were given.
        given: usize,
        /// How many elements the body has.
        n: usize,
        /// Which elements: `"vertices"`, `"edges"` or `"faces"`.
        elements: &'static str,
    },
    /// A row of a caller's edges is no edge of the body, or the same as another. Check whose edges
    /// they are.
    #[error("body {body}: row {row} of edges has vertices {} and {}, {why}", vertices[0], vertices[1])]
    Edge {
        /// The body.
        body: BodyId,
        /// The row.
        row: usize,
        /// Its vertices.
        vertices: [u32; 2],
        /// What is wrong with them: there is no such edge, or which row has it too.
        why: String,
    },
    /// An element is to have a thickness that is negative or not finite.
    #[error(
        "body {body}: a thickness of {} is given as number {element} of its {elements}, where a finite number that is not below 0 is allowed",
        shown(*given)
    )]
    Thickness {
        /// The body.
        body: BodyId,
        /// Which elements: `"vertices"`, `"edges"` or `"faces"`.
        elements: &'static str,
        /// The index of the element.
        element: usize,
        /// The thickness as given.
        given: f64,
    },
    /// Lists of vertices to be left out do not fit their bodies.
    #[error("exclude: lists for the vertices of body {}, of vertices of body {}: {given}", bodies[0], bodies[1])]
    Lists {
        /// The body whose vertices have lists, and that whose vertices are listed.
        bodies: [BodyId; 2],
        /// What does not fit, with both numbers.
        given: String,
    },
    /// The id names no body of this scene: the body was removed, and a later one may have its slot,
    /// or it belongs to another scene. Only a scene and its clones share ids.
    #[error(
        "there is no such body {body} among the {n_bodies} of this scene: it was removed (a later body may have its number), or is another scene's (clones keep ids)"
    )]
    UnknownBody {
        /// The id as given.
        body: BodyId,
        /// How many bodies the scene has.
        n_bodies: usize,
    },
    /// A question about two bodies names one body twice. Name two different ones; to find
    /// self-collision of a body, ask with [`Query::self_of`](crate::Query::self_of).
    #[error(
        "body {body} is named twice, where two different bodies are needed: self-collision is a query of its own"
    )]
    SameBody {
        /// The body named twice.
        body: BodyId,
    },
    /// Pairs from before a body was re-meshed, or pairs with edges from before these were
    /// [set](crate::Scene::set_edges): its elements have other numbers now. Ask again.
    #[error(
        "body {body}: the pairs were found before it was re-meshed or its edges were set, and name other elements"
    )]
    Remeshed {
        /// The body.
        body: BodyId,
    },
    /// A step or contacts that were found before a body was moved or re-meshed: nothing is known of
    /// it now. Ask again.
    #[error(
        "body {body}: this was found for other positions than it has now, so nothing is known of it; ask again"
    )]
    Moved {
        /// The body.
        body: BodyId,
    },
    /// A step that was found before a body was added: nothing is known of it. Ask again.
    #[error("body {body}: it was added after this was found, so nothing is known of it; ask again")]
    Added {
        /// The body.
        body: BodyId,
    },
    /// A surface with a border, or with faces whose orientations disagree. Weld vertices, fill
    /// holes, orient faces.
    #[error(
        "body {body}: the surface is not closed: the edge of vertices {} and {} has {n_forward} faces along it and {n_backward} against it; weld vertices, close holes or turn faces round first",
        edge[0], edge[1]
    )]
    NotClosed {
        /// The body.
        body: BodyId,
        /// An edge by its vertices.
        edge: [u32; 2],
        /// How many faces run from its first vertex to its second.
        n_forward: usize,
        /// How many faces run the other way.
        n_backward: usize,
    },
    /// Elements of one body touch at the start of a step at vertices that are at one position but
    /// not shared, as along the seams of a mesh that was not welded. No part of such a step could
    /// ever be taken. Weld the mesh ([`Weld`](crate::Weld)), or skip what touches at the start
    /// ([`Start::Skip`](crate::Start::Skip)).
    #[error(
        "body {body}: vertices {} and {} are at one position but not shared, so what they belong to touches at the start, and no \
         step can be taken: weld the mesh ({n_coincident} of its vertices lie at positions of others), or skip pairs that touch at \
         the start",
        vertices[0], vertices[1]
    )]
    Seam {
        /// The body.
        body: BodyId,
        /// Two vertices at one position, of elements that touch.
        vertices: [u32; 2],
        /// How many vertices of the body lie at positions of others: as many as welding would
        /// remove.
        n_coincident: usize,
    },
    /// A body of the other kind is needed here.
    #[error("body {body} is made of {kind}, where {expected} are needed")]
    WrongKind {
        /// The body.
        body: BodyId,
        /// The kind of its elements.
        kind: &'static str,
        /// The kind that is needed.
        expected: &'static str,
    },
    /// More elements or vertices than 32-bit indices can name.
    #[error("{what}: {given} given, at most {limit} can be held")]
    TooMany {
        /// What there are too many of.
        what: &'static str,
        /// How many were given.
        given: u64,
        /// The most that can be held.
        limit: u64,
    },
    /// A setting lies outside its range.
    #[error("{setting}: {given} given, {allowed} allowed")]
    Setting {
        /// The setting's name.
        setting: &'static str,
        /// The value as given.
        given: String,
        /// What is allowed.
        allowed: &'static str,
    },
    /// Even one batch at a time does not fit the memory budget. Raise the budget.
    #[error("the memory budget is {budget} bytes, but {needed} bytes are needed for {what}")]
    MemoryBudget {
        /// What needs the memory.
        what: &'static str,
        /// Bytes needed.
        needed: u64,
        /// Bytes allowed.
        budget: u64,
    },
    /// More pairs than [`Settings::max_pairs`](crate::Settings::max_pairs) allows.
    #[error("{found} pairs and more were found, and at most {limit} are allowed")]
    TooManyPairs {
        /// How many were certain by then; this number may differ from run to run.
        found: u64,
        /// The most that are allowed.
        limit: u64,
    },
    /// There is no memory for the answer. Ask for parts of the scene, limit the pairs or count
    /// them.
    #[error("out of memory: {needed} bytes more are needed with {n} {what} found")]
    OutOfMemory {
        /// What the memory was for.
        what: &'static str,
        /// How many were found by then.
        n: u64,
        /// Bytes that could not be had.
        needed: u64,
    },
    /// The caller cancelled the run; the detector stays usable.
    #[error("cancelled")]
    Cancelled,
    /// No GPU adapter fits the request; the text lists the adapters found.
    #[error("no GPU adapter: {found}")]
    NoAdapter {
        /// What was requested and what is available.
        found: String,
    },
    /// The GPU refused: out of memory, a lost device, a shader that does not compile.
    #[error("GPU: {what}")]
    Gpu {
        /// The driver's message.
        what: String,
    },
    /// Not as many positions as were welded. Weld each mesh by its own map.
    #[error(transparent)]
    Weld(#[from] impinge_weld::WrongNumber),
    /// The threads of the pool could not be started.
    #[error("thread pool: {0}")]
    Threads(String),
    /// A file could not be read: which, where in it, and why.
    #[error("{0}")]
    File(String),
}

impl Error {
    /// What kind of error it is, by the name that it has in every language: `invalid`,
    /// `out_of_memory`, `budget`, `too_many_pairs`, `cancelled`, `device` or `internal`. The
    /// detector stays usable after all but `internal`.
    pub fn code(&self) -> &'static str {
        match self {
            Error::OutOfMemory { .. } => "out_of_memory",
            Error::MemoryBudget { .. } => "budget",
            Error::TooManyPairs { .. } => "too_many_pairs",
            Error::Cancelled => "cancelled",
            Error::NoAdapter { .. } | Error::Gpu { .. } => "device",
            Error::Threads(_) => "internal",
            _ => "invalid",
        }
    }
}
