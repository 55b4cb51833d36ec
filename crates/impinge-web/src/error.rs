//! Errors, with the text that JavaScript sees.

/// Why a call from JavaScript failed. Its text is that of the `Error` thrown there.
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
    /// More bodies than a question can name.
    #[error("bodies: {given} given, 0 (everything), 1 (within it) or 2 (between them) allowed")]
    Bodies {
        /// How many were given.
        given: usize,
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
    /// An unknown word for a setting.
    #[error("{what}: \"{given}\" given, {allowed} allowed")]
    Word {
        /// Which setting.
        what: &'static str,
        /// The word given.
        given: String,
        /// The known words.
        allowed: &'static str,
    },
    /// An error of the mesh reader.
    #[cfg(feature = "io")]
    #[error("{0}")]
    Mesh(#[from] impinge_io::Error),
}
