//! Scattering: writes one part file per unit, with any number of threads and processes.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use impinge::CancelToken;

use crate::disk;
use crate::error::Error;
use crate::plan::{Plan, Unit};
use crate::source::Source;

/// Options of scattering.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ScatterOptions {
    /// The rank of this process, from 0.
    pub rank: usize,
    /// How many processes share the units.
    pub world_size: usize,
    /// Threads, each with one unit at a time; 0 means one per core.
    pub threads: usize,
}

impl Default for ScatterOptions {
    fn default() -> Self {
        ScatterOptions {
            rank: 0,
            world_size: 1,
            threads: 0,
        }
    }
}

/// The result of scattering.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Scattered {
    /// Parts written.
    pub n_written: u64,
    /// Parts that already existed.
    pub n_kept: u64,
    /// Elements in the parts written.
    pub n_elements: u64,
    /// Records in the parts written: an element has one in each tile that its box touches.
    pub n_records: u64,
}

impl Plan {
    /// Writes the missing parts of this process's units. `progress` gets the number of units done
    /// and the total.
    ///
    /// # Errors
    /// Files that have changed or can't be read, refused coordinates, a full disk, cancellation.
    pub fn scatter(
        &self,
        options: &ScatterOptions,
        cancel: &CancelToken,
        progress: &(dyn Fn(u64, u64) + Sync),
    ) -> Result<Scattered, Error> {
        check_share(options.rank, options.world_size)?;
        disk::folder(&self.folder().join("parts"))?;
        let share = |ix: usize| ix % options.world_size == options.rank;
        let mine: Vec<(usize, Unit)> = self
            .units()
            .enumerate()
            .filter(|(ix, _)| share(*ix))
            .collect();
        let n_cores = std::thread::available_parallelism().map_or(1, usize::from);
        let threads = if options.threads == 0 {
            n_cores
        } else {
            options.threads
        };
        let done = AtomicU64::new(0);
        let mut scattered = Scattered::default();
        // One file at a time, so that the vertices of only one body are in memory.
        for units in mine.chunk_by(|a, b| a.1.file == b.1.file) {
            let todo: Vec<(usize, Unit)> = units
                .iter()
                .copied()
                .filter(|(ix, unit)| !self.has_part(*ix, unit.file))
                .collect();
            let n_kept = (units.len() - todo.len()) as u64;
            scattered.n_kept += n_kept;
            done.fetch_add(n_kept, Ordering::Relaxed);
            let Some(&(_, Unit { file, .. })) = todo.first() else {
                // Parts may outlive their file, but are not those of another one.
                if let Some(path) = self.files[units[0].1.file].changed() {
                    let path = path.to_owned();
                    return Err(Error::Changed { path });
                }
                continue;
            };
            let source = self.files[file].open(self.weld)?;
            let n_records = self.spread(&todo, source.as_ref(), threads, cancel, &|| {
                progress(done.fetch_add(1, Ordering::Relaxed) + 1, mine.len() as u64);
            })?;
            scattered.n_written += todo.len() as u64;
            scattered.n_elements += todo.iter().map(|(_, unit)| unit.n as u64).sum::<u64>();
            scattered.n_records += n_records;
        }
        Ok(scattered)
    }

    /// Writes the parts of units of one file. Returns the number of records.
    fn spread(
        &self,
        todo: &[(usize, Unit)],
        source: &dyn Source,
        threads: usize,
        cancel: &CancelToken,
        done: &(dyn Fn() + Sync),
    ) -> Result<u64, Error> {
        let next = AtomicUsize::new(0);
        let n_records = AtomicU64::new(0);
        let failure = Mutex::new(None);
        let work = || {
            while let Some(&(unit_ix, unit)) = todo.get(next.fetch_add(1, Ordering::Relaxed)) {
                let written = if cancel.is_cancelled() {
                    Err(Error::Cancelled)
                } else {
                    self.scatter_unit(unit_ix, unit, source)
                };
                match written {
                    Ok(n) => {
                        n_records.fetch_add(n, Ordering::Relaxed);
                        done();
                    }
                    Err(error) => {
                        next.store(todo.len(), Ordering::Relaxed);
                        let mut held = failure
                            .lock()
                            .unwrap_or_else(|poisoned| poisoned.into_inner());
                        held.get_or_insert(error);
                    }
                }
            }
        };
        std::thread::scope(|scope| {
            for _ in 1..threads.min(todo.len()) {
                scope.spawn(work);
            }
            work();
        });
        match failure
            .into_inner()
            .unwrap_or_else(|poisoned| poisoned.into_inner())
        {
            Some(error) => Err(error),
            None => Ok(n_records.into_inner()),
        }
    }

    pub(crate) fn scatter_unit(
        &self,
        unit_ix: usize,
        unit: Unit,
        source: &dyn Source,
    ) -> Result<u64, Error> {
        let paths = self.files[unit.file].paths();
        let chunk = source.read(unit.first, unit.n)?;
        // When the plan was made, all faces were triangles.
        let chunk = chunk.ok_or_else(|| Error::Changed {
            path: paths[0].to_owned(),
        })?;
        // The plan has checked the coordinates, but the file may have changed: a box with NaN would
        // lie in no tile.
        chunk.check(paths, source.shape())?;
        self.write_part(unit_ix, unit.file, &chunk)
    }
}

/// Refuses a rank that is not below the world size.
pub(crate) fn check_share(rank: usize, world_size: usize) -> Result<(), Error> {
    if rank < world_size {
        return Ok(());
    }
    Err(Error::Argument {
        what: "rank",
        given: rank.to_string(),
        allowed: format!("0 up to, but not including, the world size {world_size}"),
    })
}
