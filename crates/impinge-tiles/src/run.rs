//! Runs one tile: reads its elements from all parts, finds the pairs among them, and keeps those
//! that the tile owns.

mod ranges;
mod records;
mod step;
mod surfaces;

use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

use impinge::{
    Backend, Control, Detector, Precision, Query, Settings, SharedVertex, Start, hash_rows,
};
use serde_json::{Value, json};

use self::ranges::both;
use self::records::Records;
use crate::disk;
use crate::error::Error;
use crate::npy;
use crate::plan::Plan;

/// The query for the whole scene. It must be the same for all tiles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ask {
    /// Pairs of different files.
    pub between: bool,
    /// Pairs within each file.
    pub within: bool,
    /// How pairs of one file that share a vertex are treated. In a step they never count.
    pub shared_vertex: SharedVertex,
    /// In a step: what happens to pairs that touch at its start.
    pub start: Start,
    /// In a step: the precision to which times are rounded down.
    pub precision: Precision,
}

impl Default for Ask {
    fn default() -> Self {
        Ask {
            between: true,
            within: true,
            shared_vertex: SharedVertex::default(),
            start: Start::Report,
            precision: Precision::F32,
        }
    }
}

impl Ask {
    /// The query in words, as in results.
    pub fn name(self) -> String {
        let resolve = self.shared_vertex == SharedVertex::Resolve;
        let mut name = match (self.between, self.within, resolve) {
            (true, false, _) => "between",
            (false, _, false) => "self, shared vertices skipped",
            (false, _, true) => "self, shared vertices resolved",
            (true, true, false) => "everything, shared vertices skipped",
            (true, true, true) => "everything, shared vertices resolved",
        }
        .to_owned();
        if self.start == Start::Skip {
            name += ", contacts at the start skipped";
        }
        if self.precision == Precision::F64 {
            name += ", times in f64";
        }
        name
    }

    fn query(self) -> Query {
        match (self.between, self.within) {
            (true, true) => Query::all(),
            (true, false) => Query::between_all(),
            (false, _) => Query::self_all(),
        }
        .shared_vertex(self.shared_vertex)
    }
}

/// How a tile is run.
#[derive(Debug, Clone, Default)]
pub struct RunOptions {
    /// The query.
    pub ask: Ask,
    /// Settings of the detector. The backend is the CPU unless they name a GPU.
    pub settings: Settings,
    /// Whether to run tiles again that have a result for the same query.
    pub again: bool,
}

/// The result of one tile.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TileResult {
    /// The tile.
    pub tile: u32,
    /// Elements in it.
    pub n_elements: u64,
    /// Pairs that belong to it; in a step, first contacts.
    pub n_pairs: u64,
    /// The sum of the hashes of these pairs; see [`hash_rows`]. In a step, a checksum of the rows
    /// as the tile stores them: their edges have numbers, and the answer its hash, only after
    /// merging.
    pub hash: u64,
    pub(crate) step: Option<OfStep>,
    /// Pairs that were found here but belong to another tile.
    pub n_elsewhere: u64,
    /// The number of pieces into which the tile was split, every piece tested against every other.
    /// It is above 1 if its elements overlap so much that no cut of space separates them.
    pub n_pieces: u64,
    /// Whether the result already existed.
    pub was_kept: bool,
    pub(crate) ask: String,
}

/// What else a result of a step says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct OfStep {
    /// The elements that the tile lists so that merging can number them, and the hash of that list.
    pub n_names: u64,
    pub names_hash: u64,
    pub toi: Precision,
}

impl Plan {
    pub(crate) fn rows_path(&self, tile: u32) -> PathBuf {
        self.folder()
            .join("results")
            .join(format!("tile-{tile:08}.npy"))
    }

    /// The list of elements to number, in a step.
    pub(crate) fn names_path(&self, tile: u32) -> PathBuf {
        self.folder()
            .join("results")
            .join(format!("tile-{tile:08}-names.npy"))
    }

    pub(crate) fn result_path(&self, tile: u32) -> PathBuf {
        self.folder()
            .join("results")
            .join(format!("tile-{tile:08}.json"))
    }

    /// Finds the pairs of each of `tiles`, in a step the first contacts, and writes them, with one
    /// tile in memory at a time. Existing results for the same query are kept. `done` gets the
    /// result of each tile.
    ///
    /// # Errors
    /// No such tile; parts that are missing, stale or damaged; errors of [`Detector::detect`];
    /// cancellation.
    pub fn run(
        &self,
        tiles: impl IntoIterator<Item = u32>,
        options: &RunOptions,
        control: Control,
        done: &mut dyn FnMut(&TileResult),
    ) -> Result<(), Error> {
        self.check_ask(options.ask)?;
        let mut ask = options.ask;
        if self.is_step() {
            // The rule has no meaning there: results are for the same question whatever it is.
            ask.shared_vertex = SharedVertex::Skip;
        }
        let mut settings = options.settings.clone();
        if settings.backend == Backend::Auto {
            settings.backend = Backend::Cpu;
        }
        let refused = |source| Error::Detection { tile: 0, source };
        let mut detector = Detector::new(settings).map_err(refused)?;
        detector.set_control(control);
        self.check_parts()?;
        disk::folder(&self.folder().join("results"))?;
        for tile in tiles {
            if tile >= self.n_tiles() {
                return Err(Error::Argument {
                    what: "tile",
                    given: tile.to_string(),
                    allowed: format!("0 to {}", self.n_tiles() - 1),
                });
            }
            let held = self.result(tile).ok().filter(|held| {
                held.ask == ask.name() && !options.again && self.rows_path(tile).exists()
            });
            let result = match held {
                Some(held) => TileResult {
                    was_kept: true,
                    ..held
                },
                None => self.run_tile(tile, ask, &mut detector)?,
            };
            done(&result);
        }
        Ok(())
    }

    /// Refuses options that mean nothing in this plan: they would be mistaken for obeyed.
    fn check_ask(&self, ask: Ask) -> Result<(), Error> {
        let refuse = |what, given: &str, allowed: &str| {
            Err(Error::Argument {
                what,
                given: given.to_owned(),
                allowed: allowed.to_owned(),
            })
        };
        match self.is_step() {
            _ if ask.start == Start::Verify => refuse(
                "start",
                "verify",
                "report or skip (no tile sees all of the start; a plan of the starts without step says whether it intersects)",
            ),
            false if ask.start == Start::Skip => {
                refuse("start", "skip", "only report without a step")
            }
            false if ask.precision == Precision::F64 => {
                refuse("precision", "f64", "only f32 without a step")
            }
            _ => Ok(()),
        }
    }

    /// Checks that every part exists: otherwise no tile is complete.
    fn check_parts(&self) -> Result<(), Error> {
        let missing: Vec<usize> = (0..self.n_units())
            .filter(|&unit| !self.part_path(unit).exists())
            .collect();
        match missing.first() {
            None => Ok(()),
            Some(&first) => Err(Error::Missing {
                path: self.part_path(first),
                step: "tiles scatter",
                n_missing: missing.len() as u64,
                n: self.n_units() as u64,
            }),
        }
    }

    fn run_tile(&self, tile: u32, ask: Ask, detector: &mut Detector) -> Result<TileResult, Error> {
        let mut records = Records::default();
        for (unit_ix, unit) in self.units().enumerate() {
            records.add(self.read_segment(unit_ix, unit, tile)?);
        }
        if self.is_step() {
            return self.run_step_tile(tile, &records, ask, detector);
        }
        let n = records.len();
        let pieces = self.pieces(n);
        let (mut rows, mut n_elsewhere) = (Vec::new(), 0);
        let (query, refused) = (ask.query(), refused(tile));
        for (ix, a) in pieces.iter().enumerate() {
            for b in &pieces[ix..] {
                let ranges = both(a, b);
                let part = records.scene(&ranges, self.weld).map_err(refused)?;
                let pairs = detector.detect(&part.scene, &query).map_err(refused)?;
                for row in pairs.rows() {
                    let (first, second) =
                        (part.record(row[0], row[1]), part.record(row[2], row[3]));
                    // For two pieces, only pairs between them count: each piece was tested by
                    // itself before.
                    if a != b && a.contains(&first) == a.contains(&second) {
                        continue;
                    }
                    if self.cells.owner(records.owner_point(first, second)) == tile {
                        rows.push(records.row(first, second));
                    } else {
                        n_elsewhere += 1;
                    }
                }
            }
        }
        if pieces.len() > 1 {
            rows.sort_unstable();
        }
        let result = TileResult {
            tile,
            n_elements: n as u64,
            n_pairs: rows.len() as u64,
            hash: hash_rows(rows.iter().copied()),
            step: None,
            n_elsewhere,
            n_pieces: pieces.len() as u64,
            was_kept: false,
            ask: ask.name(),
        };
        self.remove_result(tile)?;
        write_rows(&self.rows_path(tile), &rows)?;
        self.write_result(&result)?;
        Ok(result)
    }

    /// Cuts the numbers of a tile's elements into pieces. The plan aims at `cap` elements per
    /// tile; a tile has more than twice that only if no cut was worth its copies.
    fn pieces(&self, n: usize) -> Vec<Range<usize>> {
        let piece = if n as u64 > 2 * self.cap {
            self.cap as usize
        } else {
            n.max(1)
        };
        let n_pieces = n.div_ceil(piece).max(1);
        (0..n_pieces)
            .map(|ix| ix * piece..((ix + 1) * piece).min(n))
            .collect()
    }

    /// Removes an older result, so that none names rows of another run. Rows are written next, then
    /// the result that names them.
    fn remove_result(&self, tile: u32) -> Result<(), Error> {
        let path = self.result_path(tile);
        if path.exists() {
            fs::remove_file(&path).map_err(|source| Error::io(&path, "remove", source))?;
        }
        Ok(())
    }

    fn write_result(&self, result: &TileResult) -> Result<(), Error> {
        let mut object = json!({
            "plan": format!("{:016x}", self.id()),
            "tile": result.tile,
            "asked": result.ask,
            "elements": result.n_elements,
            "pairs": result.n_pairs,
            "hash": format!("{:016x}", result.hash),
            "elsewhere": result.n_elsewhere,
            "pieces": result.n_pieces,
        });
        if let Some(step) = result.step {
            object["names"] = json!(step.n_names);
            object["names_hash"] = json!(format!("{:016x}", step.names_hash));
            object["toi_bytes"] = json!(if step.toi == Precision::F64 { 8 } else { 4 });
        }
        disk::replace(&self.result_path(result.tile), |to| {
            writeln!(to, "{object}")
        })
    }

    /// The result of a tile, if it exists and belongs to this plan.
    pub(crate) fn result(&self, tile: u32) -> Result<TileResult, Error> {
        const STEP: &str = "tiles run";
        let path = self.result_path(tile);
        let text = fs::read_to_string(&path).map_err(|source| Error::io(&path, "read", source))?;
        let read = || {
            let value: Value = serde_json::from_str(&text).ok()?;
            let number = |key: &str| value.get(key)?.as_u64();
            let hex = |key: &str| u64::from_str_radix(value.get(key)?.as_str()?, 16).ok();
            let result = TileResult {
                tile,
                n_elements: number("elements")?,
                n_pairs: number("pairs")?,
                hash: hex("hash")?,
                step: match value.get("names") {
                    None => None,
                    Some(n) => Some(OfStep {
                        n_names: n.as_u64()?,
                        names_hash: hex("names_hash")?,
                        toi: match number("toi_bytes")? {
                            4 => Precision::F32,
                            8 => Precision::F64,
                            _ => return None,
                        },
                    }),
                },
                n_elsewhere: number("elsewhere")?,
                n_pieces: number("pieces")?,
                was_kept: false,
                ask: value.get("asked")?.as_str()?.to_owned(),
            };
            (number("tile")? == u64::from(tile)).then_some((hex("plan")?, result))
        };
        match read() {
            None => Err(Error::damaged(&path, "not a result of this tile", STEP)),
            Some((plan, _)) if plan != self.id() => Err(Error::Stale { path, step: STEP }),
            Some((_, result)) => Ok(result),
        }
    }
}

/// The error of a detection in a tile.
fn refused(tile: u32) -> impl Fn(impinge::Error) -> Error + Copy {
    move |source| match source {
        impinge::Error::Cancelled => Error::Cancelled,
        source => Error::Detection { tile, source },
    }
}

fn write_rows<const N: usize>(path: &Path, rows: &[[u32; N]]) -> Result<(), Error> {
    disk::replace(path, |to| {
        to.write_all(&npy::rows_header(rows.len() as u64, N))?;
        rows.iter().try_for_each(|&row| npy::write_row(to, row))
    })
}
