//! Part files: the elements of one unit, sorted by tile.
//!
//! ```text
//! 0   8 bytes  "IMPTILE1"
//! 8   u64      the plan's id
//! 16  u32      number of the unit          20  u32  number of its file
//! 24  u32      corners per element         28  u32  bytes per coordinate
//! 32  u32      tiles                       36  u32  1 in a step, else 0
//! 40  per tile: u64 where its records start, u64 how many there are, u64 checksum
//!     records: u32 element, u32 vertex per corner, 3 coordinates per corner, in a step 3 more per corner at the end
//! ```
//!
//! All numbers are little-endian. A checksum covers the tile's number, the place and number of its
//! records, and the records. A tile reads one entry of the table and its records; it does not touch
//! the rest of the file.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::PathBuf;

use crate::cells::HalfOpen;
use crate::chunk::{Chunk, Shape};
use crate::disk;
use crate::error::Error;
use crate::hash::checksum;
use crate::plan::{Plan, Unit};

const MAGIC: &[u8; 8] = b"IMPTILE1";
const HEADER: usize = 40;
const ENTRY: usize = 24;
const STEP: &str = "tiles scatter";

/// The records of one tile in one part.
pub struct Segment {
    pub file: usize,
    pub shape: Shape,
    pub bytes: Vec<u8>,
}

impl Plan {
    pub(crate) fn part_path(&self, unit: usize) -> PathBuf {
        self.folder()
            .join("parts")
            .join(format!("unit-{unit:08}.bin"))
    }

    fn part_header(&self, unit_ix: usize, file: usize) -> Vec<u8> {
        let shape = self.files[file].shape;
        let mut header = MAGIC.to_vec();
        header.extend(self.id().to_le_bytes());
        for word in [
            unit_ix,
            file,
            shape.corners,
            shape.width,
            self.n_tiles() as usize,
            shape.poses - 1,
        ] {
            header.extend((word as u32).to_le_bytes());
        }
        header
    }

    /// Whether the part of a unit exists and belongs to this plan.
    pub(crate) fn has_part(&self, unit_ix: usize, file: usize) -> bool {
        let mut held = [0; HEADER];
        let read =
            File::open(self.part_path(unit_ix)).and_then(|mut part| part.read_exact(&mut held));
        read.is_ok() && held[..] == self.part_header(unit_ix, file)
    }

    /// Writes the part of a unit. Returns the number of its records, including copies.
    pub(crate) fn write_part(
        &self,
        unit_ix: usize,
        file: usize,
        chunk: &Chunk,
    ) -> Result<u64, Error> {
        let shape = self.files[file].shape;
        let n_tiles = self.n_tiles() as usize;
        let mut places: Vec<(u32, u32)> = Vec::with_capacity(chunk.vertices.len() / shape.corners);
        for (ix, bounds) in (0u32..).zip(chunk.bounds(shape)) {
            self.cells
                .route::<HalfOpen>(&bounds, self.separation, |tile| places.push((tile, ix)));
        }
        // Sorted by tile, then by element.
        places.sort_unstable();
        let mut table = Vec::with_capacity(n_tiles * ENTRY);
        let mut records = Vec::with_capacity(places.len() * shape.stride());
        let mut rest = places.as_slice();
        for tile in 0..n_tiles as u32 {
            let n = rest.partition_point(|place| place.0 == tile);
            let start = records.len();
            for &(_, ix) in &rest[..n] {
                chunk.encode(shape, ix as usize, &mut records);
            }
            rest = &rest[n..];
            let offset = (HEADER + n_tiles * ENTRY + start) as u64;
            table.extend(offset.to_le_bytes());
            table.extend((n as u64).to_le_bytes());
            table.extend(sum(tile, offset, n as u64, &records[start..]).to_le_bytes());
        }
        disk::replace(&self.part_path(unit_ix), |to| {
            to.write_all(&self.part_header(unit_ix, file))?;
            to.write_all(&table)?;
            to.write_all(&records)
        })?;
        Ok(places.len() as u64)
    }

    /// The records of a tile in the part of a unit.
    pub(crate) fn read_segment(
        &self,
        unit_ix: usize,
        unit: Unit,
        tile: u32,
    ) -> Result<Segment, Error> {
        let path = self.part_path(unit_ix);
        let damaged = |what: &str| Error::damaged(&path, what, STEP);
        let read_error = |source: std::io::Error| match source.kind() {
            std::io::ErrorKind::UnexpectedEof => damaged("shorter than it says"),
            _ => Error::io(&path, "read", source),
        };
        let mut part = File::open(&path).map_err(read_error)?;
        let mut held = [0; HEADER];
        part.read_exact(&mut held).map_err(read_error)?;
        let expected = self.part_header(unit_ix, unit.file);
        if held[..] != expected {
            if held[..8] == MAGIC[..] && held[8..16] != expected[8..16] {
                return Err(Error::Stale { path, step: STEP });
            }
            return Err(damaged("its header is not that of this unit"));
        }
        let mut entry = [0; ENTRY];
        let at = (HEADER + tile as usize * ENTRY) as u64;
        part.seek(SeekFrom::Start(at)).map_err(read_error)?;
        part.read_exact(&mut entry).map_err(read_error)?;
        let word = |ix: usize| u64::from_le_bytes(std::array::from_fn(|b| entry[8 * ix + b]));
        let (offset, n) = (word(0), word(1));
        let shape = self.files[unit.file].shape;
        if n > unit.n as u64 {
            return Err(damaged(&format!(
                "tile {tile} has {n} records of {} elements",
                unit.n
            )));
        }
        let mut bytes = vec![0; n as usize * shape.stride()];
        part.seek(SeekFrom::Start(offset)).map_err(read_error)?;
        part.read_exact(&mut bytes).map_err(read_error)?;
        if sum(tile, offset, n, &bytes) != word(2) {
            return Err(damaged(&format!("the checksum of tile {tile} differs")));
        }
        Ok(Segment {
            file: unit.file,
            shape,
            bytes,
        })
    }
}

fn sum(tile: u32, offset: u64, n: u64, records: &[u8]) -> u64 {
    let place: Vec<u8> = [u64::from(tile), offset, n, checksum(records)]
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    checksum(&place)
}
