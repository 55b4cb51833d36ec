//! Refuses outputs that are also inputs, or other outputs.

use std::cell::RefCell;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf, is_separator};

use impinge_io::printable;

use crate::error::Error;

/// The input files, and the outputs that were checked.
pub struct Inputs {
    inputs: Vec<(PathBuf, Id)>,
    outputs: RefCell<Vec<(String, PathBuf)>>,
}

impl Inputs {
    pub fn new<'p>(paths: impl IntoIterator<Item = &'p PathBuf>) -> Self {
        let known = |path: &PathBuf| Some((path.clone(), Id::of(path)?));
        Inputs {
            inputs: paths.into_iter().filter_map(known).collect(),
            outputs: RefCell::default(),
        }
    }

    /// Fails if an output is one of the inputs, or the same file as one that was checked before:
    /// one of them would be lost.
    pub fn check(&self, option: &str, output: &Path) -> Result<(), Error> {
        self.check_frame(option, output)?;
        // A device takes whatever comes.
        if output.exists() && Id::of(output).is_none() {
            return Ok(());
        }
        let (real, mut outputs) = (real(output), self.outputs.borrow_mut());
        if let Some((other, _)) = outputs.iter().find(|(_, path)| *path == real) {
            return Err(Error::Usage(format!(
                "{option} {} is also the file of {other}: choose another name",
                printable(output)
            )));
        }
        outputs.push((option.to_owned(), real));
        Ok(())
    }

    /// Fails if an output cannot be a file there, or is one of the inputs, under any name or link. Outputs contain less than a
    /// mesh file may contain (normals, colours, attributes, groups), and the input would be lost.
    pub fn check_frame(&self, option: &str, output: &Path) -> Result<(), Error> {
        check_folder(output)?;
        let Some(output_id) = Id::of(output) else {
            return Ok(());
        };
        match self.inputs.iter().find(|(_, id)| *id == output_id) {
            None => Ok(()),
            Some((input, _)) => Err(Error::Usage(format!(
                "{option} {} is the input {}, which would be lost: choose another name",
                printable(output),
                printable(input)
            ))),
        }
    }
}

/// Fails if an output is a folder, or its folder is missing: before the work, not after it.
fn check_folder(output: &Path) -> Result<(), Error> {
    let refuse = |kind, text: String| Error::Write {
        path: output.to_owned(),
        source: io::Error::new(kind, text),
    };
    let bytes = output.as_os_str().as_encoded_bytes();
    let ends_as_folder = bytes.last().is_some_and(|&byte| is_separator(byte.into()));
    if ends_as_folder || output.is_dir() {
        let text = "this is the name of a folder, not of a file".to_owned();
        return Err(refuse(ErrorKind::IsADirectory, text));
    }
    let folder = output.parent().unwrap_or(Path::new(""));
    if !folder.as_os_str().is_empty() && !folder.is_dir() {
        let text = format!("there is no folder {}", printable(folder));
        return Err(refuse(ErrorKind::NotFound, text));
    }
    Ok(())
}

/// The file that a name leads to, whether it exists or not.
fn real(path: &Path) -> PathBuf {
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new(".")).canonicalize();
    match (path.canonicalize(), folder, path.file_name()) {
        (Ok(real), ..) => real,
        (_, Ok(folder), Some(name)) => folder.join(name),
        _ => path.to_owned(),
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
