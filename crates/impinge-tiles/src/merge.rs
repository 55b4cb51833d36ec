//! Merges all results into one answer: sorted rows, their number, their hash.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::PathBuf;

use impinge::hash_rows;
use serde_json::json;

use crate::disk;
use crate::error::Error;
use crate::npy;
use crate::plan::Plan;
use crate::run::TileResult;

const STEP: &str = "tiles run";

/// The answer of the whole scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Merged {
    /// All pairs.
    pub n_pairs: u64,
    /// The hash of all pairs: equal to [`Pairs::hash`](impinge::Pairs::hash) of the whole scene in one process, with bodies in
    /// the order of files.
    pub hash: u64,
    /// Records of all tiles together: primitives, counted once per tile that they touch.
    pub n_records: u64,
    /// Tiles that had to be split into pieces.
    pub n_uncut: u64,
    /// The query that all tiles answered, in words.
    pub asked: String,
    /// The rows `file_a, primitive_a, file_b, primitive_b` (u32, sorted).
    pub rows: PathBuf,
}

impl Plan {
    /// Merges the results of all tiles into `rows.npy` and `answer.json`.
    ///
    /// # Errors
    /// A tile whose result is missing, stale, damaged, or for another query than that of tile 0.
    pub fn merge(&self) -> Result<Merged, Error> {
        let results = self.results()?;
        let n_pairs = results.iter().map(|result| result.n_pairs).sum();
        let path = self.folder().join("rows.npy");
        // The blocks of rows of all tiles together take 64 MiB.
        let block = ((64 << 20) / 16 / results.len().max(1)).clamp(256, 1 << 16);
        let mut tiles = results
            .iter()
            .map(|result| Rows::open(self, result, block))
            .collect::<Result<Vec<_>, _>>()?;
        let mut failure = None;
        let written = disk::replace(&path, |to| {
            to.write_all(&npy::rows_header(n_pairs))?;
            if let Err(error) = sort_into(&mut tiles, to) {
                failure = Some(error);
                return Err(std::io::Error::other("a tile is damaged"));
            }
            Ok(())
        });
        if let Some(error) = failure {
            return Err(error);
        }
        written?;
        let merged = Merged {
            n_pairs,
            hash: results
                .iter()
                .fold(0, |sum, result| sum.wrapping_add(result.hash)),
            n_records: results.iter().map(|result| result.n_primitives).sum(),
            n_uncut: results.iter().filter(|result| result.n_pieces > 1).count() as u64,
            asked: results[0].ask.clone(),
            rows: path,
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
        Ok(merged)
    }

    fn results(&self) -> Result<Vec<TileResult>, Error> {
        let is_missing =
            |tile: &u32| !self.result_path(*tile).exists() || !self.rows_path(*tile).exists();
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

/// The rows of one tile, block by block. The file is closed in between, because there may be more tiles than a process may have
/// open files.
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

impl Rows {
    fn open(plan: &Plan, result: &TileResult, block: usize) -> Result<Self, Error> {
        let path = plan.rows_path(result.tile);
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
        if header.descr != "<u4"
            || header.shape != [result.n_pairs, 4]
            || length != header.start + 16 * result.n_pairs
        {
            return Err(damaged(&format!("not {} rows", result.n_pairs)));
        }
        Ok(Rows {
            start: header.start,
            n: result.n_pairs,
            n_read: 0,
            block,
            held: Vec::new().into_iter(),
            hash: 0,
            expected_hash: result.hash,
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

/// Writes the rows of all tiles, ascending. A repeated row, or one out of order, means a damaged file.
fn sort_into(tiles: &mut [Rows], to: &mut dyn Write) -> Result<(), Error> {
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
        npy::write_row(to, row)
            .map_err(|source| Error::io(&tiles[ix].path, "write the rows of", source))?;
        if let Some(next) = tiles[ix].next()? {
            heap.push(Reverse((next, ix)));
        }
    }
    Ok(())
}
