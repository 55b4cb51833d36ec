//! Files that exist whole or not at all.

use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use impinge_io::AtomicFile;

use crate::error::Error;

/// Writes a temporary file and renames it, so that readers see either the old file or the new one.
/// A process that is killed leaves a `.part` file behind, which no step reads:
/// [`remove_leftovers`].
pub fn replace(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), Error> {
    let error = |source| Error::io(path, "write", source);
    step().map_err(error)?;
    let mut file = AtomicFile::create(path)?;
    let mut to = BufWriter::with_capacity(1 << 18, Stepped(&mut file));
    let written = write(&mut to).and_then(|()| to.flush());
    drop(to);
    let synced = written
        .and_then(|()| step())
        .and_then(|()| file.sync())
        .and_then(|()| step());
    synced.map_err(error)?;
    file.finish()?;
    step().map_err(error)
}

/// Removes the temporary files, left by processes that were killed, of those files of a folder that
/// are whole by now.
pub fn remove_leftovers(folder: &Path) -> Result<(), Error> {
    let error = |source| Error::io(folder, "look into the folder", source);
    for entry in fs::read_dir(folder).map_err(error)? {
        let entry = entry.map_err(error)?;
        let name = entry.file_name();
        // `.NAME.PROCESS-SERIAL.part`, as `AtomicFile` calls them.
        let target = name.to_str().and_then(|name| {
            let (target, numbers) = name
                .strip_prefix('.')?
                .strip_suffix(".part")?
                .rsplit_once('.')?;
            let (process, serial) = numbers.split_once('-')?;
            let are_numbers = [process, serial].iter().all(|x| x.parse::<u32>().is_ok());
            are_numbers.then_some(target)
        });
        if target.is_some_and(|target| folder.join(target).exists()) {
            // Another process may have removed it.
            let _ = fs::remove_file(entry.path());
        }
    }
    Ok(())
}

/// Creates a folder, unless it exists.
pub fn folder(path: &Path) -> Result<(), Error> {
    fs::create_dir_all(path).map_err(|source| Error::io(path, "create the folder", source))
}

/// A file in which every write is a step at which a test may stop.
struct Stepped<'a>(&'a mut AtomicFile);

impl Write for Stepped<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if step().is_err() {
            // Like a process that is killed in the middle of a write: half of the bytes are on the
            // disk.
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
