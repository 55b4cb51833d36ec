use std::io;
use std::path::PathBuf;

/// An error of drawing. It names the surface, the index, and both numbers.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A position holds NaN or an infinity.
    #[error("surface {surface}: vertex {vertex} has a non-finite position ({}, {}, {})", value[0], value[1], value[2])]
    NonFinitePosition {
        /// Index of the surface within the picture.
        surface: usize,
        /// Index of the vertex within the surface.
        vertex: usize,
        /// The position as given.
        value: [f64; 3],
    },
    /// A face names a vertex that does not exist.
    #[error(
        "surface {surface}: face {face} names vertex {index}, but there are {n_vertices} vertices"
    )]
    VertexIndexOutOfRange {
        /// Index of the surface within the picture.
        surface: usize,
        /// Index of the face within the surface.
        face: usize,
        /// The vertex index it names.
        index: u32,
        /// How many vertices the surface has.
        n_vertices: usize,
    },
    /// A colliding element that the body does not have: the pairs belong to another body.
    #[error("element {element} collides, but the body has {n_elements} elements")]
    ElementOutOfRange {
        /// The element as given.
        element: u32,
        /// How many elements the body has.
        n_elements: usize,
    },
    /// A number that no body of a [`Live`](crate::Live) has.
    #[error("body {body} was named, but there are {n_bodies} bodies")]
    NoSuchBody {
        /// The number as given.
        body: usize,
        /// How many bodies there are.
        n_bodies: usize,
    },
    /// Another number of positions than the body has vertices.
    #[error("body {body}: {given} positions were given, it has {expected} vertices")]
    WrongNumberOfPositions {
        /// The body's number in its [`Live`](crate::Live).
        body: usize,
        /// How many were given.
        given: usize,
        /// How many vertices it has.
        expected: usize,
    },
    /// A picture without pixels, or larger than the device can draw.
    #[error("a picture of {} x {} pixels was requested, {allowed} is possible", given[0], given[1])]
    Size {
        /// Width and height as requested.
        given: [u32; 2],
        /// The possible sizes.
        allowed: String,
    },
    /// A setting lies outside its range.
    #[error("{setting}: {given} given, {allowed} allowed")]
    Setting {
        /// The setting's name.
        setting: &'static str,
        /// The value as given.
        given: f64,
        /// The allowed range.
        allowed: &'static str,
    },
    /// No adapter matches the request; the text lists those found.
    #[error("no GPU adapter to draw with: {found}")]
    NoAdapter {
        /// The requested name and the adapters found.
        found: String,
    },
    /// An error of the GPU: out of memory, a lost device, a shader that does not compile.
    #[error("GPU: {what}")]
    Gpu {
        /// The driver's message.
        what: String,
    },
    /// An image file could not be written.
    #[error("{}: cannot write: {source}", .path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
}
