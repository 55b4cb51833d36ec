//! Where rows are written to: a file that exists whole or not at all, or standard output.

use std::io::{self, BufWriter, Write};
use std::path::PathBuf;

use impinge_io::AtomicFile;

use crate::error::Error;
use crate::output::out;
use crate::values::RowsFile;

/// A file that gets its name in the end, or standard output.
pub struct Target {
    path: PathBuf,
    /// `None` for standard output.
    file: Option<AtomicFile>,
}

impl Target {
    pub fn create(rows: &RowsFile) -> Result<Self, Error> {
        let file = match rows.is_stdout() {
            true => None,
            false => Some(AtomicFile::create(&rows.path)?),
        };
        Ok(Target {
            path: rows.path.clone(),
            file,
        })
    }

    /// Writes all rows at once.
    pub fn fill(
        rows: &RowsFile,
        act: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<(), Error> {
        let mut target = Target::create(rows)?;
        target.write(act)?;
        target.finish()
    }

    /// Adds what `act` writes.
    pub fn write(
        &mut self,
        act: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<(), Error> {
        match &mut self.file {
            Some(file) => act(file).map_err(|source| Error::Write {
                path: self.path.clone(),
                source,
            }),
            None => {
                let mut to = BufWriter::new(out());
                act(&mut to)?;
                Ok(to.flush()?)
            }
        }
    }

    /// Writes over the first bytes of a file.
    pub fn write_start(&mut self, bytes: &[u8]) -> Result<(), Error> {
        match &mut self.file {
            Some(file) => Ok(file.patch(0, bytes)?),
            None => Ok(()),
        }
    }

    /// Gives the file its name.
    pub fn finish(self) -> Result<(), Error> {
        match self.file {
            Some(file) => Ok(file.finish()?),
            None => Ok(()),
        }
    }
}
