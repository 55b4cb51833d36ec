//! Merges all results into one answer: sorted rows, their number, their hash.

mod step;

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use impinge::{PairKind, hash_rows};
use serde_json::json;

use crate::disk;
use crate::error::Error;
use crate::npy;
use crate::plan::Plan;
use crate::run::TileResult;

const STEP: &str = "tiles run";

/// The answer of the whole scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Merged {
    /// All pairs.
    pub n_pairs: u64,
    /// The hash of all pairs: equal to [`Pairs::hash`](impinge::Pairs::hash) of the whole scene in
    /// one process, with bodies in the order of files; in a step, to
    /// [`Impacts::hash`](impinge::Impacts::hash).
    pub hash: u64,
    /// Records of all tiles together: elements, counted once per tile that they touch.
    pub n_records: u64,
    /// Tiles that had to be split into pieces.
    pub n_uncut: u64,
    /// The query that all tiles answered, in words.
    pub asked: String,
    /// The rows `file_a, element_a, file_b, element_b` (u32, sorted); in a step, a structured
    /// array of `kind`, `body_a`, `element_a`, `body_b`, `element_b` and `toi`, as
    /// `impinge step --rows` writes it.
    pub rows: PathBuf,
    /// What else is known of a step.
    pub step: Option<MergedStep>,
}

/// The answer about a step, besides its rows.
#[derive(Debug, Clone, PartialEq)]
pub struct MergedStep {
    /// How many contacts there are of each kind: a vertex and a face, two edges.
    pub kinds: [(PairKind, u64); 2],
    /// How many touch at the start.
    pub touching_at_start: u64,
    /// The first contact: kind, `[file_a, element_a, file_b, element_b]`, time. Of several at the
    /// same time, the one whose row comes first.
    pub earliest: Option<(PairKind, [u32; 4], f64)>,
}

impl Plan {
    /// Merges the results of all tiles into `rows.npy` and `answer.json`. All contacts of a step
    /// are in memory then, about 150 bytes each.
    ///
    /// # Errors
    /// A tile whose result is missing, stale, damaged, or for another query than that of tile 0.
    pub fn merge(&self) -> Result<Merged, Error> {
        let results = self.results()?;
        let path = self.folder().join("rows.npy");
        let (hash, step) = if self.is_step() {
            let (hash, step) = self.merge_step(&results, &path)?;
            (hash, Some(step))
        } else {
            self.merge_rows(&results, &path)?;
            let hashes = results.iter().map(|result| result.hash);
            (hashes.fold(0, u64::wrapping_add), None)
        };
        let merged = Merged {
            n_pairs: results.iter().map(|result| result.n_pairs).sum(),
            hash,
            n_records: results.iter().map(|result| result.n_elements).sum(),
            n_uncut: results.iter().filter(|result| result.n_pieces > 1).count() as u64,
            asked: results[0].ask.clone(),
            rows: path,
            step,
        };
        let object = json!({
            "pairs": merged.n_pairs,
            "hash": format!("{:016x}", merged.hash),
            "asked": merged.asked,
            "tiles": self.n_tiles(),
            "records": merged.n_records,
            "uncut_tiles": merged.n_uncut,
            "plan": format!("{:016x}", self.id()),
        });
        disk::replace(&self.folder().join("answer.json"), |to| {
            writeln!(to, "{object}")
        })?;
        // All is whole now.
        for sub in ["", "parts", "results"] {
            disk::remove_leftovers(&self.folder().join(sub))?;
        }
        Ok(merged)
    }

    /// Writes the rows of all tiles, sorted.
    fn merge_rows(&self, results: &[TileResult], path: &Path) -> Result<(), Error> {
        let of = |result: &TileResult| (self.rows_path(result.tile), result.n_pairs, result.hash);
        let n_pairs = results.iter().map(|result| result.n_pairs).sum();
        let mut tiles = open_all(results.iter().map(of))?;
        let mut failure = None;
        let written = disk::replace(path, |to| {
            to.write_all(&npy::rows_header(n_pairs, 4))?;
            let sorted = each_sorted(&mut tiles, |tile, row| {
                npy::write_row(to, row)
                    .map_err(|source| Error::io(&tile.path, "write the rows of", source))
            });
            sorted.map_err(|error| {
                failure = Some(error);
                std::io::Error::other("a tile is damaged")
            })
        });
        match failure {
            Some(error) => Err(error),
            None => written,
        }
    }

    fn results(&self) -> Result<Vec<TileResult>, Error> {
        let is_missing = |tile: &u32| {
            let files = [self.result_path(*tile), self.rows_path(*tile)];
            let names = self.is_step().then(|| self.names_path(*tile));
            !files.iter().chain(&names).all(|path| path.exists())
        };
        let missing: Vec<u32> = (0..self.n_tiles()).filter(is_missing).collect();
        if let Some(&tile) = missing.first() {
            return Err(Error::Missing {
                path: self.result_path(tile),
                step: STEP,
                n_missing: missing.len() as u64,
                n: u64::from(self.n_tiles()),
            });
        }
        let results = (0..self.n_tiles())
            .map(|tile| self.result(tile))
            .collect::<Result<Vec<_>, _>>()?;
        match results.iter().find(|result| result.ask != results[0].ask) {
            None => Ok(results),
            Some(other) => Err(Error::MixedQuestions {
                tile: other.tile,
                found: other.ask.clone(),
                expected: results[0].ask.clone(),
            }),
        }
    }
}

/// The rows of one tile, block by block. The file is closed in between, because there may be more
/// tiles than a process may have open files.
struct Rows {
    path: PathBuf,
    start: u64,
    n: u64,
    n_read: u64,
    block: usize,
    held: std::vec::IntoIter<[u32; 4]>,
    hash: u64,
    expected_hash: u64,
}

/// Opens files of rows, each given by its path, the number of its rows and their hash.
fn open_all(files: impl ExactSizeIterator<Item = (PathBuf, u64, u64)>) -> Result<Vec<Rows>, Error> {
    // The blocks of rows of all tiles together take 64 MiB.
    let block = ((64 << 20) / 16 / files.len().max(1)).clamp(256, 1 << 16);
    files
        .map(|(path, n, hash)| Rows::open(path, n, hash, block))
        .collect()
}

impl Rows {
    fn open(path: PathBuf, n: u64, expected_hash: u64, block: usize) -> Result<Self, Error> {
        let damaged = |what: &str| Error::damaged(&path, what, STEP);
        let mut head = Vec::new();
        let file = File::open(&path).map_err(|source| Error::io(&path, "read", source))?;
        let length = file
            .metadata()
            .map_err(|source| Error::io(&path, "read", source))?
            .len();
        file.take(256)
            .read_to_end(&mut head)
            .map_err(|source| Error::io(&path, "read", source))?;
        let header = npy::parse(&head).ok_or_else(|| damaged("its header is invalid"))?;
        if header.descr != "<u4" || header.shape != [n, 4] || length != header.start + 16 * n {
            return Err(damaged(&format!("not {n} rows")));
        }
        Ok(Rows {
            start: header.start,
            n,
            n_read: 0,
            block,
            held: Vec::new().into_iter(),
            hash: 0,
            expected_hash,
            path,
        })
    }

    fn next(&mut self) -> Result<Option<[u32; 4]>, Error> {
        if let Some(row) = self.held.next() {
            return Ok(Some(row));
        }
        if self.n_read == self.n {
            // The hash of all rows must be that of the result.
            return if self.hash == self.expected_hash {
                Ok(None)
            } else {
                Err(Error::damaged(
                    &self.path,
                    "the hash of its rows differs",
                    STEP,
                ))
            };
        }
        let n = (self.n - self.n_read).min(self.block as u64);
        let mut bytes = vec![0; n as usize * 16];
        let read = File::open(&self.path).and_then(|mut file| {
            file.seek(SeekFrom::Start(self.start + 16 * self.n_read))?;
            file.read_exact(&mut bytes)
        });
        read.map_err(|source| Error::io(&self.path, "read", source))?;
        let word =
            |row: &[u8], at: usize| u32::from_le_bytes(std::array::from_fn(|ix| row[at + ix]));
        let rows: Vec<[u32; 4]> = bytes
            .chunks_exact(16)
            .map(|row| std::array::from_fn(|ix| word(row, 4 * ix)))
            .collect();
        self.n_read += n;
        self.hash = self.hash.wrapping_add(hash_rows(rows.iter().copied()));
        self.held = rows.into_iter();
        Ok(self.held.next())
    }
}

/// Hands over the rows of all tiles, ascending. A repeated row, or one out of order, means a
/// damaged file.
fn each_sorted(
    tiles: &mut [Rows],
    mut each: impl FnMut(&Rows, [u32; 4]) -> Result<(), Error>,
) -> Result<(), Error> {
    let mut heap = BinaryHeap::new();
    for (ix, tile) in tiles.iter_mut().enumerate() {
        if let Some(row) = tile.next()? {
            heap.push(Reverse((row, ix)));
        }
    }
    let mut last = None;
    while let Some(Reverse((row, ix))) = heap.pop() {
        if last.is_some_and(|last| last >= row) {
            return Err(Error::damaged(
                &tiles[ix].path,
                format!("row {row:?} is not in order"),
                STEP,
            ));
        }
        last = Some(row);
        each(&tiles[ix], row)?;
        if let Some(next) = tiles[ix].next()? {
            heap.push(Reverse((next, ix)));
        }
    }
    Ok(())
}
