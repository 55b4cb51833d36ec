//! Refuses outputs that are also inputs.

use std::path::{Path, PathBuf};

use impinge_io::printable;

use crate::error::Error;

/// The input files.
pub struct Inputs(Vec<(PathBuf, Id)>);

impl Inputs {
    pub fn new<'p>(paths: impl IntoIterator<Item = &'p PathBuf>) -> Self {
        let known = |path: &PathBuf| Some((path.clone(), Id::of(path)?));
        Inputs(paths.into_iter().filter_map(known).collect())
    }

    /// Fails if an output is one of the inputs, under any name or link. Outputs contain less than a
    /// mesh file may contain (normals, colours, attributes, groups), and the input would be lost.
    pub fn check(&self, option: &str, output: &Path) -> Result<(), Error> {
        let Some(output_id) = Id::of(output) else {
            return Ok(());
        };
        match self.0.iter().find(|(_, id)| *id == output_id) {
            None => Ok(()),
            Some((input, _)) => Err(Error::Usage(format!(
                "{option} {} is the input {}, which would be lost: choose another name",
                printable(output),
                printable(input)
            ))),
        }
    }
}

/// Identifies a regular file, whatever its name.
#[derive(PartialEq, Eq)]
struct Id {
    #[cfg(unix)]
    device_and_number: (u64, u64),
    #[cfg(not(unix))]
    real: PathBuf,
}

impl Id {
    /// `None` if there is no such file, or if it is a device or a pipe.
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
