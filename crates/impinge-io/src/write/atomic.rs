//! A file that appears under its name only when it is complete.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use crate::error::Error;

/// Bytes go to a file beside the target, which [`finish`](Self::finish) renames; dropping without it removes that file.
/// A target that exists and is not a plain file (a device, a pipe) is written directly.
#[derive(Debug)]
pub(super) struct AtomicFile {
    /// What the caller named, for messages.
    path: PathBuf,
    /// What is written, and what it becomes; the same where the target is no plain file.
    written: PathBuf,
    target: PathBuf,
    /// `None` once it is closed.
    file: Option<BufWriter<File>>,
    is_finished: bool,
}

impl AtomicFile {
    pub(super) fn create(path: &Path) -> Result<Self, Error> {
        let error = |source| Error::io(path, "create", source);
        let (written, target, file) = match fs::metadata(path) {
            Ok(metadata) if !metadata.is_file() => {
                let file = OpenOptions::new().write(true).open(path).map_err(error)?;
                (path.to_owned(), path.to_owned(), file)
            }
            found => {
                // A link keeps being one: what it points to is replaced.
                let target = if found.is_ok() {
                    fs::canonicalize(path).map_err(error)?
                } else {
                    path.to_owned()
                };
                let (written, file) = create_beside(&target).map_err(error)?;
                (written, target, file)
            }
        };
        Ok(AtomicFile {
            path: path.to_owned(),
            written,
            target,
            file: Some(BufWriter::with_capacity(1 << 16, file)),
            is_finished: false,
        })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Writes all of `bytes`.
    pub(super) fn put(&mut self, bytes: &[u8]) -> Result<(), Error> {
        let written = self
            .file
            .as_mut()
            .map_or(Ok(()), |file| file.write_all(bytes));
        written.map_err(|source| Error::io(&self.path, "write", source))
    }

    /// Overwrites bytes at `offset`; what follows goes to the end again.
    pub(super) fn patch(&mut self, offset: u64, bytes: &[u8]) -> Result<(), Error> {
        let patched = self.file.as_mut().map_or(Ok(()), |file| {
            file.seek(SeekFrom::Start(offset))?;
            file.write_all(bytes)?;
            file.seek(SeekFrom::End(0)).map(|_| ())
        });
        patched.map_err(|source| Error::io(&self.path, "write", source))
    }

    /// Gives the file its name.
    pub(super) fn finish(mut self) -> Result<(), Error> {
        // Until the rename has succeeded, dropping removes what was written.
        if let Some(file) = self.file.take() {
            file.into_inner()
                .map_err(|error| Error::io(&self.path, "write", error.into_error()))?;
        }
        if self.written != self.target {
            fs::rename(&self.written, &self.target)
                .map_err(|source| Error::io(&self.path, "rename the complete file to", source))?;
        }
        self.is_finished = true;
        Ok(())
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if let Some(file) = self.file.take() {
            // What is buffered need not be written any more.
            drop(file.into_parts());
        }
        if !self.is_finished && self.written != self.target {
            // There is nobody left to tell of a failure; the file's name says what it is.
            let _ = fs::remove_file(&self.written);
        }
    }
}

/// Creates a new file in the folder of `target`.
fn create_beside(target: &Path) -> io::Result<(PathBuf, File)> {
    static SERIAL: AtomicU32 = AtomicU32::new(0);
    let name = target
        .file_name()
        .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "no file name"))?;
    loop {
        let serial = SERIAL.fetch_add(1, Ordering::Relaxed);
        let written = target.with_file_name(format!(
            ".{}.{}-{serial}.part",
            name.to_string_lossy(),
            std::process::id()
        ));
        match OpenOptions::new()
            .write(true)
            .create_new(true)
            .open(&written)
        {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            other => return other.map(|file| (written, file)),
        }
    }
}
