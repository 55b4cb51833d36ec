//! Rows on disk, so that an interrupted run can continue where it stopped.
//!
//! The list of meshes is cut into batches of equal length. The rows of batch 12 are in
//! `rows-00000012.jsonl`, one line per mesh, in the order of the list. A file is replaced as a
//! whole by a rename, at most once per second while its batch is in progress, so it always holds
//! complete lines only. Batch b belongs to the process whose rank is b modulo the number of
//! processes, so no two processes write one file. `cat rows-*.jsonl` gives all rows.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

use impinge_io::AtomicFile;

use crate::row::Row;

/// How long rows may wait before they are written to disk.
const WAIT: Duration = Duration::from_secs(1);

/// Why rows can't be kept.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// The operating system reported an error. Check the folder and the free space on its disk.
    #[error("{}: cannot {action}: {source}", impinge_io::printable(.path))]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The failed action.
        action: &'static str,
        /// The system's error.
        source: io::Error,
    },
    /// A file of rows could not be written. Check the free space on its disk.
    #[error(transparent)]
    Write(#[from] impinge_io::Error),
    /// A line is not a row of this program. Remove the file, and its meshes are checked again.
    #[error("{}:{line}: not a row; remove the file to check its meshes again", impinge_io::printable(.path))]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1.
        line: usize,
    },
    /// The folder holds rows of another list, batch length or welding. Use a new folder.
    #[error("{}:{line}: the row of '{}' is not of this run: {why}", impinge_io::printable(.path), impinge_io::printable(.found))]
    OtherRun {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1.
        line: usize,
        /// The mesh of the row.
        found: String,
        /// The mismatch.
        why: &'static str,
    },
}

/// The rows of one process, in memory and on disk.
#[derive(Debug)]
pub struct RowStore {
    folder: PathBuf,
    batches: Vec<Batch>,
    batch_len: usize,
    world_size: usize,
}

#[derive(Debug)]
struct Batch {
    /// The number of the batch in the whole list.
    number: usize,
    rows: Vec<Option<Row>>,
    /// When the oldest row arrived that is not on disk.
    waiting: Option<Instant>,
}

impl RowStore {
    /// Opens or creates a folder for the rows of `paths`, the whole list of meshes. Takes the
    /// batches of process `rank` of `world_size` and reads their existing rows. The row of a mesh
    /// whose file was written after it counts as missing; with `retry`, so do rows of kind
    /// `timeout`, `memory` and `crash`.
    ///
    /// # Errors
    /// A folder that can't be created or read; a file with a line that is not a row, or belongs to
    /// another run.
    pub fn open(
        folder: &Path,
        paths: &[PathBuf],
        weld: bool,
        batch_len: usize,
        (rank, world_size): (usize, usize),
        retry: bool,
    ) -> Result<Self, StoreError> {
        let io_error = |action| {
            move |source| StoreError::Io {
                path: folder.to_owned(),
                action,
                source,
            }
        };
        fs::create_dir_all(folder).map_err(io_error("create the folder"))?;
        let batch_len = batch_len.max(1);
        let world_size = world_size.max(1);
        remove_leftovers(folder, |batch| batch % world_size == rank)
            .map_err(io_error("remove temporary files from the folder"))?;
        let mut batches = Vec::new();
        for (number, meshes) in paths.chunks(batch_len).enumerate() {
            if number % world_size == rank {
                let mut rows = vec![None; meshes.len()];
                read_batch(&file(folder, number), meshes, weld, &mut rows)?;
                if retry {
                    for held in &mut rows {
                        held.take_if(|row| matches!(&row.result, Err(why) if why.kind.may_pass()));
                    }
                }
                batches.push(Batch {
                    number,
                    rows,
                    waiting: None,
                });
            }
        }
        Ok(RowStore {
            folder: folder.to_owned(),
            batches,
            batch_len,
            world_size,
        })
    }

    /// The numbers in the list of this process's meshes that have no row yet, ascending.
    pub fn missing(&self) -> Vec<usize> {
        self.numbered()
            .filter_map(|(ix, row)| row.is_none().then_some(ix))
            .collect()
    }

    /// All existing rows of this process, in the order of the list.
    pub fn rows(&self) -> impl Iterator<Item = (usize, &Row)> {
        self.numbered().filter_map(|(ix, row)| Some((ix, row?)))
    }

    fn numbered(&self) -> impl Iterator<Item = (usize, Option<&Row>)> {
        self.batches.iter().flat_map(|batch| {
            let first = batch.number * self.batch_len;
            (first..).zip(batch.rows.iter().map(Option::as_ref))
        })
    }

    /// Stores the row of mesh `ix` of the list, and writes it soon.
    ///
    /// # Errors
    /// A file that can't be written.
    pub fn put(&mut self, ix: usize, row: Row) -> Result<(), StoreError> {
        let held = ix / self.batch_len / self.world_size;
        let batch = &mut self.batches[held];
        batch.rows[ix % self.batch_len] = Some(row);
        let since = *batch.waiting.get_or_insert_with(Instant::now);
        let is_complete = batch.rows.iter().all(Option::is_some);
        if is_complete || since.elapsed() >= WAIT {
            write_batch(&self.folder, batch)?;
        }
        Ok(())
    }

    /// Writes every row that is not on disk yet.
    ///
    /// # Errors
    /// A file that can't be written.
    pub fn flush(&mut self) -> Result<(), StoreError> {
        let waiting = self
            .batches
            .iter_mut()
            .filter(|batch| batch.waiting.is_some());
        for batch in waiting {
            write_batch(&self.folder, batch)?;
        }
        Ok(())
    }
}

fn file(folder: &Path, batch: usize) -> PathBuf {
    folder.join(format!("rows-{batch:08}.jsonl"))
}

/// When a file was written, if the system knows.
fn modified(path: &Path) -> Option<SystemTime> {
    fs::metadata(path).and_then(|of| of.modified()).ok()
}

/// Reads the rows of a batch into their places; some may be missing.
fn read_batch(
    path: &Path,
    meshes: &[PathBuf],
    weld: bool,
    rows: &mut [Option<Row>],
) -> Result<(), StoreError> {
    let text = match fs::read_to_string(path) {
        Ok(text) => text,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        Err(source) => {
            return Err(StoreError::Io {
                path: path.to_owned(),
                action: "read",
                source,
            });
        }
    };
    let written = modified(path);
    let mut ix = 0;
    for (line, held) in (1..).zip(text.lines()) {
        let value = serde_json::from_str(held).ok();
        let row = value.as_ref().and_then(Row::from_json);
        let row = row.ok_or_else(|| StoreError::Damaged {
            path: path.to_owned(),
            line,
        })?;
        let other = |why| StoreError::OtherRun {
            path: path.to_owned(),
            line,
            found: row.path.clone(),
            why,
        };
        if row.is_welded != weld {
            return Err(other("its vertices were treated differently (--no-weld)"));
        }
        let is_its = |mesh: &PathBuf| mesh.display().to_string() == row.path;
        match meshes[ix..].iter().position(is_its) {
            None => return Err(other("its batch has no such mesh at this place")),
            Some(skipped) => ix += skipped,
        }
        // Times are counted in steps: what was written in the same step may be later.
        let is_newer = modified(&meshes[ix]);
        let is_newer = is_newer.is_some_and(|mesh| written.is_none_or(|rows| mesh >= rows));
        // Names that are not UTF-8 may look alike.
        let is_stale = is_newer || meshes[ix].to_str().is_none();
        rows[ix] = (!is_stale).then_some(row);
        ix += 1;
    }
    Ok(())
}

/// Writes the rows of a batch to a temporary file and renames it.
fn write_batch(folder: &Path, batch: &mut Batch) -> Result<(), StoreError> {
    let path = file(folder, batch.number);
    let mut text = String::new();
    for row in batch.rows.iter().flatten() {
        text += &row.to_json().to_string();
        text.push('\n');
    }
    let mut to = AtomicFile::create(&path)?;
    let written = to.write_all(text.as_bytes()).and_then(|()| to.sync());
    written.map_err(|source| StoreError::Io {
        path,
        action: "write",
        source,
    })?;
    to.finish()?;
    batch.waiting = None;
    Ok(())
}

/// Removes temporary files that a killed process left in this process's batches. No other process
/// writes these batches.
fn remove_leftovers(folder: &Path, is_mine: impl Fn(usize) -> bool) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name();
        let batch = name
            .to_str()
            .and_then(|name| name.strip_prefix(".rows-")?.strip_suffix(".part"))
            .and_then(|rest| rest.split('.').next()?.parse().ok());
        if batch.is_some_and(&is_mine) {
            fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}
