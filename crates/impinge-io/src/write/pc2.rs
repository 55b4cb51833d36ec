//! Writing PC2 point caches.

use std::path::Path;

use super::atomic::AtomicFile;
use crate::error::{Error, Name, Place};

/// Writes a PC2 point cache frame by frame. [`finish`](Self::finish) gives the file its name;
/// dropping the writer without `finish` leaves no file.
#[derive(Debug)]
pub struct Pc2Writer {
    file: AtomicFile,
    n_points: usize,
    n_frames: i32,
}

/// The offset of the number of frames in the header.
const N_FRAMES_AT: u64 = 28;

impl Pc2Writer {
    /// Starts a cache of frames of `n_points` vertices. `start` is the time of the first frame and
    /// `rate` the time between two frames, both in frames of the program that plays the cache
    /// (usually 0 and 1).
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::TooLarge`] beyond 2^31 - 1 points.
    pub fn create(path: &Path, n_points: usize, start: f32, rate: f32) -> Result<Self, Error> {
        let count = i32::try_from(n_points)
            .map_err(|_| too_large(path, "number of points", n_points as u64))?;
        let mut file = AtomicFile::create(path)?;
        file.put(b"POINTCACHE2\0")?;
        file.put(&1i32.to_le_bytes())?;
        file.put(&count.to_le_bytes())?;
        file.put(&start.to_le_bytes())?;
        file.put(&rate.to_le_bytes())?;
        file.put(&0i32.to_le_bytes())?;
        Ok(Pc2Writer {
            file,
            n_points,
            n_frames: 0,
        })
    }

    /// Adds a frame. The format holds f32 only, so the caller must round f64 explicitly.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Mismatch`] if the number of positions is not that of the cache.
    pub fn append(&mut self, positions: &[[f32; 3]]) -> Result<(), Error> {
        if positions.len() != self.n_points {
            return Err(Error::Mismatch {
                file: self.file.path().display().to_string(),
                what: format!("positions of frame {}", self.n_frames),
                expected: self.n_points as u64,
                found: positions.len() as u64,
            });
        }
        let next = self
            .n_frames
            .checked_add(1)
            .ok_or_else(|| too_large(self.file.path(), "number of frames", 1 << 31))?;
        for coordinate in positions.as_flattened() {
            self.file.put(&coordinate.to_le_bytes())?;
        }
        self.n_frames = next;
        Ok(())
    }

    /// Writes the number of frames into the header and gives the file its name.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn finish(mut self) -> Result<(), Error> {
        self.file.patch(N_FRAMES_AT, &self.n_frames.to_le_bytes())?;
        self.file.finish()
    }
}

fn too_large(path: &Path, what: &str, found: u64) -> Error {
    Name(&path.display().to_string()).too_large(
        Place::File,
        what,
        u64::from(i32::MAX.unsigned_abs()),
        found,
    )
}
