//! Outputs that are inputs too.

use std::path::{Path, PathBuf};

use crate::error::Error;

/// Fails where an output is one of the inputs, by whatever name or link: what is written has less in it than a mesh file may
/// have (normals, colours, attributes, groups), and the input would be gone.
pub fn check<'p>(
    outputs: impl IntoIterator<Item = (&'static str, &'p Path)>,
    inputs: &[PathBuf],
) -> Result<(), Error> {
    for (option, output) in outputs {
        let Some(output_id) = Id::of(output) else {
            continue;
        };
        if let Some(input) = inputs
            .iter()
            .find(|input| Id::of(input).is_some_and(|id| id == output_id))
        {
            return Err(Error::Usage(format!(
                "{option} {} is the input {}, which would be lost: choose another name",
                output.display(),
                input.display()
            )));
        }
    }
    Ok(())
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
