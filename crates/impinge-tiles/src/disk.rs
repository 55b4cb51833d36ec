//! Files that exist whole or not at all.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;

use crate::error::Error;

/// Writes a temporary file and renames it, so that readers see either the old file or the new one. A process that is
/// killed leaves a `.part` file behind. No step reads it, and the next process with the same process id replaces it.
pub fn replace(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), Error> {
    let attempt = || {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let part = path.with_file_name(format!(".{name}.{}.part", std::process::id()));
        step()?;
        let mut to = BufWriter::with_capacity(1 << 18, Stepped(File::create(&part)?));
        write(&mut to)?;
        to.flush()?;
        step()?;
        to.get_ref().0.sync_data()?;
        step()?;
        fs::rename(&part, path)
    };
    attempt().map_err(|source| Error::io(path, "write", source))?;
    step().map_err(|source| Error::io(path, "write", source))
}

/// Creates a folder, unless it exists.
pub fn folder(path: &Path) -> Result<(), Error> {
    fs::create_dir_all(path).map_err(|source| Error::io(path, "create the folder", source))
}

/// A file in which every write is a step at which a test may stop.
struct Stepped(File);

impl Write for Stepped {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if step().is_err() {
            // Like a process that is killed in the middle of a write: half of the bytes are on the disk.
            self.0.write_all(&bytes[..bytes.len() / 2])?;
            return Err(io::Error::other("stopped by a test"));
        }
        self.0.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

#[cfg(not(test))]
fn step() -> io::Result<()> {
    Ok(())
}

#[cfg(test)]
thread_local! {
    /// Steps until every write on this thread fails, as if the process had been killed there.
    pub static STEPS_LEFT: std::cell::Cell<Option<u32>> = const { std::cell::Cell::new(None) };
}

#[cfg(test)]
fn step() -> io::Result<()> {
    match STEPS_LEFT.get() {
        None => Ok(()),
        Some(0) => Err(io::Error::other("stopped by a test")),
        Some(n) => {
            STEPS_LEFT.set(Some(n - 1));
            Ok(())
        }
    }
}
