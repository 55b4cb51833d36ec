//! Outputs that are inputs too.

use std::path::{Path, PathBuf};

use crate::error::Error;

/// The files that are read.
pub struct Inputs(Vec<(PathBuf, Id)>);

impl Inputs {
    pub fn new<'p>(paths: impl IntoIterator<Item = &'p PathBuf>) -> Self {
        let known = |path: &PathBuf| Some((path.clone(), Id::of(path)?));
        Inputs(paths.into_iter().filter_map(known).collect())
    }

    /// Fails where an output is one of them, by whatever name or link: what is written has less in it than a mesh file may
    /// have (normals, colours, attributes, groups), and the input would be gone.
    pub fn check(&self, option: &str, output: &Path) -> Result<(), Error> {
        let Some(output_id) = Id::of(output) else {
            return Ok(());
        };
        match self.0.iter().find(|(_, id)| *id == output_id) {
            None => Ok(()),
            Some((input, _)) => Err(Error::Usage(format!(
                "{option} {} is the input {}, which would be lost: choose another name",
                output.display(),
                input.display()
            ))),
        }
    }
}

/// What tells a regular file from all others, however it is named.
#[derive(PartialEq, Eq)]
struct Id {
    #[cfg(unix)]
    device_and_number: (u64, u64),
    #[cfg(not(unix))]
    real: PathBuf,
}

impl Id {
    /// `None` where there is no such file, or it is a device or a pipe.
    fn of(path: &Path) -> Option<Id> {
        let metadata = std::fs::metadata(path).ok()?;
        if !metadata.is_file() {
            return None;
        }
        #[cfg(unix)]
        {
            use std::os::unix::fs::MetadataExt;
            Some(Id {
                device_and_number: (metadata.dev(), metadata.ino()),
            })
        }
        #[cfg(not(unix))]
        {
            Some(Id {
                real: std::fs::canonicalize(path).ok()?,
            })
        }
    }
}
