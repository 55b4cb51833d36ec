//! A PC2 point cache that grows, and that a later run can continue.

use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::atomic::AtomicFile;
use crate::error::{Error, Name, Place};

/// The bytes before the number of frames: magic, version, points, start, rate.
const N_FRAMES_AT: usize = 28;

/// The bytes before the first frame.
const HEADER: usize = 32;

/// A PC2 point cache written in place, for long runs. It is complete and readable after each
/// [`save`](Self::save). After an interruption, [`resume`](Self::resume) cuts off later bytes and
/// continues. For an all-or-nothing file, use [`Pc2Writer`](crate::Pc2Writer).
#[derive(Debug)]
pub struct GrowingPc2 {
    path: PathBuf,
    file: BufWriter<File>,
    n_points: usize,
    n_frames: usize,
}

impl GrowingPc2 {
    /// Starts a cache of frames of `n_points` vertices, replacing any existing file. `start` is the
    /// time of the first frame and `rate` the time between two frames, both in frames of the
    /// program that plays the cache (usually 0 and 1).
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::TooLarge`] beyond 2^31 - 1 points.
    pub fn create(path: &Path, n_points: usize, start: f32, rate: f32) -> Result<Self, Error> {
        let count = i32::try_from(n_points)
            .map_err(|_| too_large(path, "number of points", n_points as u64))?;
        let mut header = b"POINTCACHE2\0".to_vec();
        header.extend(1i32.to_le_bytes());
        header.extend(count.to_le_bytes());
        header.extend(start.to_le_bytes());
        header.extend(rate.to_le_bytes());
        header.extend(0i32.to_le_bytes());
        // An existing file is replaced once the new one has its header on the disk.
        let mut file = AtomicFile::create(path)?;
        file.put(&header)?;
        file.finish()?;
        Self::resume(path, n_points, 0)
    }

    /// Continues after the first `n_frames` frames of a cache that [`create`](Self::create)
    /// started; later frames are cut off.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Mismatch`] if the file is not a PC2 cache of `n_points` vertices;
    /// [`Error::Truncated`] if it holds fewer frames. On an error the file is unchanged.
    pub fn resume(path: &Path, n_points: usize, n_frames: usize) -> Result<Self, Error> {
        let open = OpenOptions::new().read(true).write(true).open(path);
        let mut file = open.map_err(|source| Error::io(path, "open", source))?;
        let name = path.display().to_string();
        let mut header = [0; HEADER];
        file.read_exact(&mut header)
            .map_err(|source| Error::io(path, "read", source))?;
        let number = |at: usize| {
            let bytes = [header[at], header[at + 1], header[at + 2], header[at + 3]];
            i64::from(i32::from_le_bytes(bytes))
        };
        let is_cache = header.starts_with(b"POINTCACHE2\0") && number(12) == 1;
        let found = if is_cache { number(16) } else { 0 };
        if found != n_points as i64 {
            return Err(Error::Mismatch {
                file: name,
                what: "points of the PC2 cache to continue".to_owned(),
                expected: n_points as u64,
                found: found.unsigned_abs(),
            });
        }
        let length = file
            .metadata()
            .map_err(|source| Error::io(path, "read", source))?
            .len();
        let expected = (n_frames as u64)
            .checked_mul(n_points as u64)
            .and_then(|n| n.checked_mul(12))
            .and_then(|n| n.checked_add(HEADER as u64))
            .ok_or_else(|| too_large(path, "number of frames", n_frames as u64))?;
        if length < expected {
            return Err(Error::Truncated {
                at: Name(&name).at(Place::Byte(HEADER as u64)),
                what: format!("{n_frames} frames to continue after"),
                expected: expected - HEADER as u64,
                found: length.saturating_sub(HEADER as u64),
            });
        }
        let mut cache = GrowingPc2 {
            path: path.to_owned(),
            file: BufWriter::with_capacity(1 << 16, file),
            n_points,
            n_frames,
        };
        cache.tried("cut off", |file| {
            file.get_mut().set_len(expected)?;
            file.seek(SeekFrom::End(0)).map(|_| ())
        })?;
        cache.save()?;
        Ok(cache)
    }

    /// How many frames there are.
    pub fn n_frames(&self) -> usize {
        self.n_frames
    }

    /// Adds a frame. The format holds f32 only, so the caller must round f64 explicitly.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Mismatch`] if the number of positions is not that of the cache;
    /// [`Error::TooLarge`] beyond 2^31 - 1 frames.
    pub fn append<'a>(
        &mut self,
        positions: impl ExactSizeIterator<Item = &'a [f32; 3]>,
    ) -> Result<(), Error> {
        if positions.len() != self.n_points {
            return Err(Error::Mismatch {
                file: self.path.display().to_string(),
                what: format!("positions of frame {}", self.n_frames),
                expected: self.n_points as u64,
                found: positions.len() as u64,
            });
        }
        if self.n_frames >= i32::MAX as usize {
            return Err(too_large(&self.path, "number of frames", 1 << 31));
        }
        self.tried("write", |file| {
            for coordinate in positions.flatten() {
                file.write_all(&coordinate.to_le_bytes())?;
            }
            Ok(())
        })?;
        self.n_frames += 1;
        Ok(())
    }

    /// Makes the file complete: writes buffered bytes to the disk, and the number of frames to the
    /// header.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn save(&mut self) -> Result<(), Error> {
        // `append` keeps the number within 31 bits.
        let n_frames = self.n_frames as i32;
        self.tried("write", |file| {
            file.seek(SeekFrom::Start(N_FRAMES_AT as u64))?;
            file.write_all(&n_frames.to_le_bytes())?;
            file.seek(SeekFrom::End(0))?;
            file.get_ref().sync_data()
        })
    }

    fn tried(
        &mut self,
        action: &'static str,
        act: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
    ) -> Result<(), Error> {
        act(&mut self.file).map_err(|source| Error::io(&self.path, action, source))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Positions, Sequence};

    const FRAMES: [[[f32; 3]; 2]; 3] = [
        [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]],
        [[0.5, 1.5, 2.5], [3.5, 4.5, 5.5]],
        [[-1.0; 3], [7.0; 3]],
    ];

    fn frames(path: &Path) -> Vec<Positions> {
        let sequence = Sequence::open(path).unwrap();
        (0..sequence.n_frames())
            .map(|frame| sequence.frame(frame).unwrap())
            .collect()
    }

    #[test]
    fn what_is_saved_is_read_and_gone_on_with() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.pc2");
        let held = |n: usize| -> Vec<Positions> {
            FRAMES[..n]
                .iter()
                .map(|f| Positions::F32(f.to_vec()))
                .collect()
        };
        let mut cache = GrowingPc2::create(&path, 2, 0.0, 1.0).unwrap();
        assert_eq!(frames(&path), held(0));
        cache.append(FRAMES[0].iter()).unwrap();
        cache.append(FRAMES[2].iter()).unwrap();
        cache.save().unwrap();
        assert_eq!(frames(&path).len(), 2);
        // A run killed here leaves more frames than the header counts.
        cache.append(FRAMES[2].iter()).unwrap();
        drop(cache);

        let mut cache = GrowingPc2::resume(&path, 2, 1).unwrap();
        assert_eq!((cache.n_frames(), frames(&path)), (1, held(1)));
        cache.append(FRAMES[1].iter()).unwrap();
        cache.append(FRAMES[2].iter()).unwrap();
        cache.save().unwrap();
        assert_eq!(frames(&path), held(3));
        assert!(cache.append(FRAMES[0][..1].iter()).is_err());
        // A file that does not fit is refused and left unchanged.
        let bytes = std::fs::read(&path).unwrap();
        for (n_points, n_frames) in [(3, 1), (2, 4), (2, usize::MAX)] {
            assert!(GrowingPc2::resume(&path, n_points, n_frames).is_err());
        }
        assert_eq!(std::fs::read(&path).unwrap(), bytes);
        std::fs::write(&path, &bytes[..20]).unwrap();
        assert!(GrowingPc2::resume(&path, 2, 0).is_err());
        std::fs::write(&path, [b'x'; 100]).unwrap();
        assert!(GrowingPc2::resume(&path, 2, 0).is_err());
    }
}
