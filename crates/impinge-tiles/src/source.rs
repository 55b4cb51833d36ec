//! Mesh files as chunks of elements.
//!
//! Binary PLY of triangles, binary STL and `.npy` arrays have elements of equal length on disk,
//! so any run of them can be read separately. All other formats of `impinge-io` are held in memory
//! as a whole.

mod moving;
mod npy;
mod ply;
mod stl;
mod welded;
mod whole;

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use impinge_io::{Positions, Weld};

use crate::chunk::{Chunk, Shape, back_to_f32};
use crate::error::Error;
use crate::hash::checksum;

/// A mesh file that several threads can read at a time, in runs of elements.
pub trait Source: Send + Sync {
    /// `ply`, `stl`, `npy` or `whole`; of a step, those of its start and its end with a comma
    /// between them.
    fn reader(&self) -> String;
    /// The kind of its elements.
    fn shape(&self) -> Shape;
    /// How many elements there are.
    fn n_elements(&self) -> u64;
    /// How many vertices there are.
    fn n_vertices(&self) -> u64;
    /// Elements `first..first + n`, which must be in range; `None` if they are not triangles, so
    /// that the file must be read whole.
    fn read(&self, first: u64, n: usize) -> Result<Option<Chunk>, Error>;
    /// Which vertices have the position of an earlier one. Unless overridden, vertices are the
    /// corners of elements in order.
    fn weld(&self) -> Result<Weld, Error> {
        const BLOCK: u64 = 1 << 18;
        let (mut narrow, mut wide) = (Vec::new(), Vec::new());
        for first in (0..self.n_elements()).step_by(BLOCK as usize) {
            let n = BLOCK.min(self.n_elements() - first) as usize;
            let points = self.read(first, n)?.into_iter().flat_map(|c| c.positions);
            match self.shape().width {
                4 => narrow.extend(points.map(|point| point.map(back_to_f32))),
                _ => wide.extend(points),
            }
        }
        Ok(Weld::by_position(&match self.shape().width {
            4 => Positions::F32(narrow),
            _ => Positions::F64(wide),
        }))
    }
}

/// Opens a mesh file with the reader for its format.
pub fn open(path: &Path) -> Result<Box<dyn Source>, Error> {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    match extension.to_ascii_lowercase().as_str() {
        "ply" => {
            if let Some(source) = ply::Ply::open(path)? {
                return Ok(Box::new(source));
            }
        }
        "stl" => {
            if let Some(source) = stl::Stl::open(path)? {
                return Ok(Box::new(source));
            }
        }
        "npy" => return Ok(Box::new(npy::Npy::open(path)?)),
        _ => {}
    }
    open_whole(path)
}

/// Opens a mesh file and reads all of it.
pub fn open_whole(path: &Path) -> Result<Box<dyn Source>, Error> {
    Ok(Box::new(whole::Whole::open(path)?))
}

/// Opens the start and the end of a body as one file of which each vertex has two positions.
pub fn open_step(
    paths: [&Path; 2],
    mut open: impl FnMut(&Path) -> Result<Box<dyn Source>, Error>,
) -> Result<Box<dyn Source>, Error> {
    let [start, end] = paths;
    let moving = moving::Moving::new(paths, [open(start)?, open(end)?])?;
    Ok(Box::new(moving))
}

/// Welds the vertices of a body of a step.
pub fn weld(source: Box<dyn Source>) -> Result<Box<dyn Source>, Error> {
    Ok(Box::new(welded::Welded::new(source)?))
}

/// Opens a file with the reader that a plan names.
pub fn open_as(path: &Path, reader: &str) -> Result<Box<dyn Source>, Error> {
    let source = if reader == "whole" {
        open_whole(path)?
    } else {
        open(path)?
    };
    if source.reader() != reader {
        return Err(Error::Changed {
            path: path.to_owned(),
        });
    }
    Ok(source)
}

/// The length of a file, and a checksum of up to 16 blocks spread evenly over it: enough to
/// recognise another file.
pub fn fingerprint(path: &Path) -> Result<(u64, u64), Error> {
    const BLOCK: u64 = 4096;
    const N: u64 = 16;
    let length = length(path)?;
    let mut bytes = Vec::new();
    for block in 0..N {
        let start = length.saturating_sub(BLOCK) / (N - 1) * block;
        let n = BLOCK.min(length - start);
        bytes.extend(read_at(path, start, n as usize)?);
    }
    Ok((length, checksum(&bytes)))
}

fn length(path: &Path) -> Result<u64, Error> {
    let metadata = std::fs::metadata(path).map_err(|source| Error::io(path, "open", source))?;
    if !metadata.is_file() {
        let source = std::io::Error::other("not a regular file");
        return Err(Error::io(path, "read", source));
    }
    Ok(metadata.len())
}

/// Reads exactly `n` bytes of a file from `start` on.
fn read_at(path: &Path, start: u64, n: usize) -> Result<Vec<u8>, Error> {
    let read = || {
        let mut file = File::open(path)?;
        file.seek(SeekFrom::Start(start))?;
        let mut bytes = vec![0; n];
        file.read_exact(&mut bytes)?;
        Ok(bytes)
    };
    read().map_err(|source| Error::io(path, "read", source))
}

/// The first bytes of a file, up to `most`.
fn head(path: &Path, most: u64) -> Result<Vec<u8>, Error> {
    let n = length(path)?.min(most);
    read_at(path, 0, n as usize)
}

fn f32_at(bytes: &[u8], at: usize) -> f64 {
    f64::from(f32::from_le_bytes(std::array::from_fn(|ix| bytes[at + ix])))
}

fn f64_at(bytes: &[u8], at: usize) -> f64 {
    f64::from_le_bytes(std::array::from_fn(|ix| bytes[at + ix]))
}

/// Refuses more elements than 32-bit numbers can name.
fn check_count(path: &Path, what: &'static str, given: u64) -> Result<(), Error> {
    let limit = u64::from(u32::MAX);
    if given > limit {
        return Err(Error::TooMany {
            path: path.to_owned(),
            what,
            given,
            limit,
        });
    }
    Ok(())
}
