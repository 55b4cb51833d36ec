//! Errors, with the code and the text that JavaScript sees.

/// Why a call from JavaScript failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An error of the library.
    #[error("{0}")]
    Library(#[from] impinge::Error),
    /// The library's own about a body that has another number there.
    #[error("body {number}, in the library's words: {error}")]
    Renumbered {
        /// The caller's number of the body.
        number: u32,
        /// The library's error.
        error: impinge::Error,
    },
    /// A number that no body has.
    #[error("there is no body {number}: {added} have been added, and {removed} of them removed")]
    NoBody {
        /// The number given.
        number: u32,
        /// Bodies added so far.
        added: usize,
        /// Bodies removed so far.
        removed: usize,
    },
    /// An array whose length is not a multiple of its row length.
    #[error("{what}: {len} numbers given, not a multiple of {row}")]
    Ragged {
        /// Which array.
        what: &'static str,
        /// Its length.
        len: usize,
        /// Numbers in a row.
        row: usize,
    },
    /// Kept pairs that were asked for of another scene, or are forgotten.
    #[error(
        "exclude: pairs given that are of another scene or disposed of, those of this scene allowed"
    )]
    PairsOfAnotherScene,
    /// A step that the other module has found.
    #[error("scene: a Scene of the module that has found the step is needed")]
    StepOfAnotherModule,
    /// Words that the package does not send.
    #[error("the package and its module do not fit together")]
    Foreign,
    /// An extension that is not that of a point cache.
    #[cfg(feature = "io")]
    #[error("the extension of a point cache: \"{0}\" given, \"pc2\" or \"mdd\" allowed")]
    PointCache(String),
    /// An error of the mesh reader.
    #[cfg(feature = "io")]
    #[error("{0}")]
    Mesh(#[from] impinge_io::Error),
}

impl Error {
    /// The code that callers tell errors apart by.
    pub fn code(&self) -> &'static str {
        match self {
            Error::Library(error) | Error::Renumbered { error, .. } => error.code(),
            _ => "invalid",
        }
    }
}
