//! Files that get their name only when they are complete.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::error::Error;

/// A file that gets its name only when it is complete.
///
/// Bytes go to a temporary file beside the target, and [`finish`](Self::finish) renames it.
/// Dropping it without `finish` removes the temporary file, and an older file of that name stays as
/// it was. A link stays a link: its target is replaced. A target that exists and is not a regular
/// file (a device, a pipe) is written directly.
///
/// ```
/// use impinge_io::AtomicFile;
/// use std::io::Write;
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("rows.csv");
/// let mut file = AtomicFile::create(&path)?;
/// file.write_all(b"a,b\n")?;
/// assert!(!path.exists());
/// file.finish()?;
/// assert_eq!(std::fs::read(&path)?, b"a,b\n");
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct AtomicFile {
    /// The path as the caller gave it, for messages.
    path: PathBuf,
    /// The file being written, and its final path; both are the same if the target is not a regular
    /// file.
    written: PathBuf,
    target: PathBuf,
    /// `None` once it is closed.
    file: Option<BufWriter<File>>,
    is_finished: bool,
}

/// Temporary files that exist now.
static PARTS: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn parts() -> MutexGuard<'static, Vec<PathBuf>> {
    PARTS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes the temporary files of all outputs being written. For a program that must end at once,
/// for example after a second Ctrl-C. Any thread may call it.
pub fn remove_temporary_files() {
    for part in parts().drain(..) {
        // A failure can't be reported any more; the name of the file shows that it is temporary.
        let _ = fs::remove_file(part);
    }
}

impl AtomicFile {
    /// Starts a file that will become `path`.
    ///
    /// # Errors
    /// [`Error::Io`] if no file can be created in that folder.
    pub fn create(path: &Path) -> Result<Self, Error> {
        let error = |source| Error::io(path, "create", source);
        let (written, target, file) = match fs::metadata(path) {
            Ok(metadata) if !metadata.is_file() => {
                let file = OpenOptions::new().write(true).open(path).map_err(error)?;
                (path.to_owned(), path.to_owned(), file)
            }
            found => {
                // A link stays a link: its target is replaced.
                let target = if found.is_ok() {
                    fs::canonicalize(path).map_err(error)?
                } else {
                    path.to_owned()
                };
                let (written, file) = create_beside(&target).map_err(error)?;
                if let Ok(replaced) = found {
                    // Keeps the permissions of the replaced file. If they can't be set, the default
                    // ones are acceptable.
                    let _ = file.set_permissions(replaced.permissions());
                }
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

    /// The path that the file will have, as the caller named it.
    pub fn path(&self) -> &Path {
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

    /// Overwrites bytes at `offset`; later writes append to the end again.
    ///
    /// # Errors
    /// [`Error::Io`], for example where the target is a pipe.
    pub fn patch(&mut self, offset: u64, bytes: &[u8]) -> Result<(), Error> {
        let patched = self.file.as_mut().map_or(Ok(()), |file| {
            file.seek(SeekFrom::Start(offset))?;
            file.write_all(bytes)?;
            file.seek(SeekFrom::End(0)).map(|_| ())
        });
        patched.map_err(|source| Error::io(&self.path, "write", source))
    }

    /// Waits until all bytes written so far are on the disk, so that they survive a loss of power.
    ///
    /// # Errors
    /// The system's error.
    pub fn sync(&mut self) -> io::Result<()> {
        self.file.as_mut().map_or(Ok(()), |file| {
            file.flush()?;
            file.get_ref().sync_all()
        })
    }

    /// Gives the file its name.
    ///
    /// # Errors
    /// [`Error::Io`]; then the new file is removed, and an older one stays as it was.
    pub fn finish(mut self) -> Result<(), Error> {
        // Until the rename has succeeded, dropping removes what was written.
        if let Some(file) = self.file.take() {
            file.into_inner()
                .map_err(|error| Error::io(&self.path, "write", error.into_error()))?;
        }
        if self.written != self.target {
            // Locked while renaming, so that no other thread removes the file in between.
            let mut parts = parts();
            fs::rename(&self.written, &self.target)
                .map_err(|source| Error::io(&self.path, "rename the complete file to", source))?;
            parts.retain(|part| *part != self.written);
        }
        self.is_finished = true;
        Ok(())
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if let Some(file) = self.file.take() {
            // Buffered bytes need not be written any more.
            drop(file.into_parts());
        }
        if !self.is_finished && self.written != self.target {
            // A failure can't be reported any more; the name of the file shows that it is
            // temporary.
            let _ = fs::remove_file(&self.written);
            parts().retain(|part| *part != self.written);
        }
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match &mut self.file {
            Some(file) => file.write(bytes),
            None => Ok(bytes.len()),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.as_mut().map_or(Ok(()), BufWriter::flush)
    }
}

/// The most bytes of a file's name that its temporary file has in its own.
const MOST_OF_NAME: usize = 64;

/// Creates a new file in the folder of `target`.
fn create_beside(target: &Path) -> io::Result<(PathBuf, File)> {
    static SERIAL: AtomicU32 = AtomicU32::new(0);
    let name = target
        .file_name()
        .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "no file name"))?
        .to_string_lossy();
    // A name may be as long as the file system allows; that of the temporary file stays below.
    let mut end = name.len().min(MOST_OF_NAME);
    while !name.is_char_boundary(end) {
        end -= 1;
    }
    let name = &name[..end];
    loop {
        let serial = SERIAL.fetch_add(1, Ordering::Relaxed);
        let written =
            target.with_file_name(format!(".{name}.{}-{serial}.part", std::process::id()));
        let mut parts = parts();
        match OpenOptions::new()
            .write(true)
            .create_new(true)
            .open(&written)
        {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error),
            Ok(file) => {
                parts.push(written.clone());
                return Ok((written, file));
            }
        }
    }
}
