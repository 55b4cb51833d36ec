//! Sequences of positions: point caches, and meshes in numbered files.

use std::borrow::Cow;
use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use crate::binary::{Cursor, Endian, Scalar, array};
use crate::budget::reserve;
use crate::error::{Error, Name, Place, in_folder, printable, shown};
use crate::files::{Source as Input, folder_of};
use crate::mesh::Positions;
use crate::options::ReadOptions;
use crate::read::collect;

/// A format that holds the frames of a sequence in one file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum SequenceFormat {
    /// PC2 point cache, little endian (`.pc2`).
    Pc2,
    /// Lightwave MDD, big endian (`.mdd`).
    Mdd,
}

impl SequenceFormat {
    /// The format that files with this extension have (without the dot; case does not matter).
    pub fn from_extension(extension: &str) -> Option<Self> {
        match extension.to_ascii_lowercase().as_str() {
            "pc2" => Some(SequenceFormat::Pc2),
            "mdd" => Some(SequenceFormat::Mdd),
            _ => None,
        }
    }
}

/// The frames of a deforming mesh: positions only, all with the same number of vertices. Opening
/// reads the header (or the first of numbered files). Each frame is read on request, in any order.
#[derive(Debug)]
pub struct Sequence {
    name: String,
    frames: Frames,
    n_frames: usize,
    n_points: usize,
    notes: Vec<String>,
}

#[derive(Debug)]
enum Frames {
    /// Frames of equal size from `start` on.
    Cache {
        source: Source,
        start: u64,
        endian: Endian,
    },
    /// One mesh file per frame, with the faces of the first. If a path named them, they are in its
    /// folder.
    Files {
        files: Vec<PathBuf>,
        named: Option<PathBuf>,
        faces: Faces,
    },
}

/// The triangles and tetrahedra of a mesh file; none of a file that has positions alone.
#[derive(Debug, PartialEq, Eq)]
struct Faces(Vec<[u32; 3]>, Vec<[u32; 4]>);

impl Faces {
    /// Whether positions of a file with these faces can be those of a mesh with others.
    fn are_of(&self, mesh: &Faces) -> bool {
        let is_empty = |faces: &Faces| faces.0.is_empty() && faces.1.is_empty();
        self == mesh || is_empty(self) || is_empty(mesh)
    }

    /// The first place where they differ from those of the mesh.
    fn mismatch(&self, mesh: &Faces, file: &Path) -> Error {
        let file = file.display().to_string();
        let counts = [(mesh.0.len(), self.0.len()), (mesh.1.len(), self.1.len())];
        if let Some(&(expected, found)) = counts.iter().find(|(mesh, own)| mesh != own) {
            let what = format!("faces of a frame, as the mesh has ({FILE_BY_FILE})");
            return mismatch(&file, &what, expected, found);
        }
        let of_triangles = first_difference(&self.0, &mesh.0);
        let differing = of_triangles.or_else(|| first_difference(&self.1, &mesh.1));
        let (face, [expected, found]) = differing.unwrap_or_default();
        let what = format!("a vertex of face {face}, which the mesh has ({FILE_BY_FILE})");
        mismatch(&file, &what, expected as usize, found as usize)
    }
}

/// What helps where frames have other faces, or another number of vertices.
const FILE_BY_FILE: &str = "a mesh whose faces change is no sequence: ask about it file by file";

/// The first face that differs from that of the mesh, and the first of its vertices that does: that
/// of the mesh, and its own.
fn first_difference<const N: usize>(
    own: &[[u32; N]],
    mesh: &[[u32; N]],
) -> Option<(usize, [u32; 2])> {
    let mut faces = mesh.iter().zip(own).enumerate();
    faces.find_map(|(face, (mesh, own))| {
        let (&mesh, &own) = mesh.iter().zip(own).find(|(mesh, own)| mesh != own)?;
        Some((face, [mesh, own]))
    })
}

fn mismatch(file: &str, what: &str, expected: usize, found: usize) -> Error {
    Error::Mismatch {
        file: file.to_owned(),
        what: what.to_owned(),
        expected: expected as u64,
        found: found as u64,
    }
}

#[derive(Debug)]
enum Source {
    File(PathBuf, Mutex<File>),
    Bytes(Vec<u8>),
}

/// The content of a point cache's header.
struct Header {
    n_points: u64,
    /// Where the number of points is.
    points_at: u64,
    n_frames: u64,
    start: u64,
    endian: Endian,
}

impl Sequence {
    /// Opens a sequence:
    /// - `run.pc2`, `run.mdd`: a point cache;
    /// - `run_0010.ply`: that file and all files with a greater number in this place (the last
    ///   number in the name), in the order of their numbers, gaps allowed;
    /// - `run_%04d.ply`, `run_%d.ply`: all files of that pattern, in the order of their numbers,
    ///   unless there is a file of this very name;
    /// - `run_*.ply`, `run_??.ply`: all files whose name matches, ordered by name with runs of
    ///   digits compared as numbers.
    ///
    /// Patterns may occur in the file's name, but not in the name of a folder. Numbered files may
    /// have any mesh format; they are never welded (see [`Weld`](crate::Weld)). All have the faces
    /// of the first, or no faces at all.
    ///
    /// # Errors
    /// As [`read`](crate::read); [`Error::Truncated`] if a cache is shorter than its header says,
    /// [`Error::Count`] if it is longer, [`Error::Syntax`] if its frames have no points.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let extension = path.extension().unwrap_or_default().to_string_lossy();
        match SequenceFormat::from_extension(&extension) {
            Some(format) => Self::open_cache(path, format),
            None => {
                let (files, notes) = numbered_files(path)?;
                let sequence = Self::of_named(files, Some(path.to_owned()))?;
                Ok(Sequence { notes, ..sequence })
            }
        }
    }

    /// The frames of mesh files, with the faces of the first, or none: in the order of their
    /// numbers if their names differ in nothing else, as a shell gives them in another one; else in
    /// the order given.
    ///
    /// # Errors
    /// As [`read`](crate::read), of the first file; there is none.
    pub fn of_files(mut files: Vec<PathBuf>) -> Result<Self, Error> {
        if are_numbered(&files) {
            files.sort_by_cached_key(|file| file.file_name().map(key_of));
        }
        Self::of_named(files, None)
    }

    /// Reads a point cache from bytes. Errors use `name` for the file.
    ///
    /// # Errors
    /// [`Error::Syntax`], [`Error::Truncated`] or [`Error::Count`].
    pub fn from_bytes(bytes: Vec<u8>, format: SequenceFormat, name: &str) -> Result<Self, Error> {
        let header = Header::read(&bytes, bytes.len() as u64, format, Name(name))?;
        Ok(Self::cache(header, Source::Bytes(bytes), name.to_owned()))
    }

    /// How many frames there are.
    pub fn n_frames(&self) -> usize {
        self.n_frames
    }

    /// The files that hold the frames: one per frame, or one for all of them; none if the frames
    /// are in memory.
    pub fn files(&self) -> &[PathBuf] {
        match &self.frames {
            Frames::Files { files, .. } => files,
            Frames::Cache {
                source: Source::File(path, _),
                ..
            } => std::slice::from_ref(path),
            Frames::Cache { .. } => &[],
        }
    }

    /// Whether each frame has a file of its own, also if there is one frame alone.
    pub fn has_numbered_files(&self) -> bool {
        matches!(self.frames, Frames::Files { .. })
    }

    /// What a path may have meant otherwise: which number of a name was taken where no other file
    /// follows, and files of a `*` or `?` whose names differ from the next in more than a number.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Gaps in the numbers of numbered files: the files before and after each gap. A gap is a step
    /// that is larger than the smallest step between two files, so a sequence of every tenth number
    /// has no gap.
    pub fn gaps(&self) -> Vec<[&Path; 2]> {
        let Frames::Files { files, named, .. } = &self.frames else {
            return Vec::new();
        };
        if named.is_none() && !are_numbered(files) {
            return Vec::new();
        }
        let number = |path: &PathBuf| {
            let name = path.file_name()?.to_string_lossy();
            // The last number of the name without its extension, as in `Matcher`.
            let key = natural_key(name.rsplit_once('.').map_or(&name, |(stem, _)| stem));
            Some((key.len(), key.last()?.0))
        };
        let numbers: Option<Vec<(usize, i128)>> = files.iter().map(number).collect();
        let Some(numbers) = numbers else {
            return Vec::new();
        };
        if numbers.iter().any(|(length, _)| *length != numbers[0].0) {
            // Some have fractions of frames.
            return Vec::new();
        }
        let numbers: Vec<i128> = numbers.into_iter().map(|(_, number)| number).collect();
        let steps = || numbers.windows(2).map(|two| two[1].saturating_sub(two[0]));
        let least = steps().min().unwrap_or(1).max(1);
        steps()
            .zip(files.windows(2))
            .filter(|(step, _)| *step > least)
            .map(|(_, two)| [two[0].as_path(), two[1].as_path()])
            .collect()
    }

    /// Whether the frames are those of the mesh in a file: point caches are of any, numbered files
    /// have its faces, or none.
    ///
    /// # Errors
    /// [`Error::Mismatch`] if the first frame has other faces than the mesh; as
    /// [`read`](crate::read).
    pub fn check_faces(&self, mesh: &Path) -> Result<(), Error> {
        let Frames::Files { files, faces, .. } = &self.frames else {
            return Ok(());
        };
        // Mostly the mesh is the first frame.
        if files.first().is_some_and(|first| first == mesh) {
            return Ok(());
        }
        let (positions, of_mesh) = read_frame(Input::Named(mesh))?;
        // Another number of vertices is an error of each frame.
        if positions.len() != self.n_points || faces.are_of(&of_mesh) {
            return Ok(());
        }
        Err(faces.mismatch(&of_mesh, &files[0]))
    }

    /// How many vertices each frame has.
    pub fn n_points(&self) -> usize {
        self.n_points
    }

    /// The positions of frame `frame_ix`, counted from 0: f32 from a point cache, else in the
    /// precision of the file.
    ///
    /// # Errors
    /// [`Error::Mismatch`] if there is no such frame, or a numbered file has another number of
    /// vertices or other faces; [`Error::NotFinite`]; as [`read`](crate::read) for numbered files.
    pub fn frame(&self, frame_ix: usize) -> Result<Positions, Error> {
        if frame_ix >= self.n_frames {
            return Err(mismatch(
                &self.name,
                "frame index beyond the frames",
                self.n_frames,
                frame_ix,
            ));
        }
        match &self.frames {
            Frames::Cache {
                source,
                start,
                endian,
            } => self.cached_frame(source, *start, *endian, frame_ix),
            Frames::Files {
                files,
                named,
                faces,
            } => {
                let path = &files[frame_ix];
                let (positions, own) = read_frame(input(path, named.as_deref()))?;
                if positions.len() != self.n_points {
                    return Err(mismatch(
                        &path.display().to_string(),
                        &format!("vertices of a frame ({FILE_BY_FILE})"),
                        self.n_points,
                        positions.len(),
                    ));
                }
                if !own.are_of(faces) {
                    return Err(own.mismatch(faces, path));
                }
                Ok(positions)
            }
        }
    }

    fn open_cache(path: &Path, format: SequenceFormat) -> Result<Self, Error> {
        let (mut file, length) = Input::Named(path).open()?;
        let mut start = Vec::new();
        file.by_ref()
            .take(32)
            .read_to_end(&mut start)
            .map_err(|source| Error::io(path, "read", source))?;
        let name = path.display().to_string();
        let header = Header::read(&start, length, format, Name(&name))?;
        Ok(Self::cache(
            header,
            Source::File(path.to_owned(), Mutex::new(file)),
            name,
        ))
    }

    fn cache(header: Header, source: Source, name: String) -> Self {
        Sequence {
            name,
            // Counts have 31 bits, so they fit.
            n_frames: header.n_frames as usize,
            n_points: header.n_points as usize,
            notes: Vec::new(),
            frames: Frames::Cache {
                source,
                start: header.start,
                endian: header.endian,
            },
        }
    }

    fn cached_frame(
        &self,
        source: &Source,
        start: u64,
        endian: Endian,
        frame_ix: usize,
    ) -> Result<Positions, Error> {
        let size = self.n_points * 12;
        let offset = start + frame_ix as u64 * size as u64;
        let name = Name(&self.name);
        let mut buffer = Vec::new();
        let bytes = match source {
            // The header was checked against the length of the bytes.
            Source::Bytes(bytes) => &bytes[offset as usize..offset as usize + size],
            Source::File(path, file) => {
                let mut file = file.lock().unwrap_or_else(PoisonError::into_inner);
                reserve(name, Place::File, &mut buffer, size as u64)?;
                buffer.resize(size, 0);
                let read = file
                    .seek(SeekFrom::Start(offset))
                    .and_then(|_| file.read_exact(&mut buffer));
                read.map_err(|source| Error::io(path, "read", source))?;
                &buffer
            }
        };
        let mut positions = Vec::new();
        reserve(name, Place::File, &mut positions, self.n_points as u64)?;
        for (vertex, record) in bytes.chunks_exact(12).enumerate() {
            let position = [0, 4, 8].map(|at| f32::from_le_bytes(array(&record[at..], endian)));
            let place = Place::Byte(offset + vertex as u64 * 12);
            crate::collect::finite(name, place, vertex, position.map(f64::from))?;
            positions.push(position);
        }
        Ok(Positions::F32(positions))
    }

    fn of_named(files: Vec<PathBuf>, named: Option<PathBuf>) -> Result<Self, Error> {
        let Some(first) = files.first() else {
            return Err(mismatch("a sequence", "frames, or more", 1, 0));
        };
        let name = named.as_ref().unwrap_or(first).display().to_string();
        let (positions, faces) = read_frame(input(first, named.as_deref()))?;
        Ok(Sequence {
            name,
            n_frames: files.len(),
            n_points: positions.len(),
            notes: Vec::new(),
            frames: Frames::Files {
                files,
                named,
                faces,
            },
        })
    }
}

/// The positions and faces of a mesh file, as they are.
fn read_frame(file: Input) -> Result<(Positions, Faces), Error> {
    collect(file, &ReadOptions::as_they_are(), |parts| {
        Ok((parts.positions, Faces(parts.triangles, parts.tetrahedra)))
    })
}

impl Header {
    /// Reads the header at the start of a file of `length` bytes, and checks that all frames are
    /// there.
    fn read(start: &[u8], length: u64, format: SequenceFormat, name: Name) -> Result<Self, Error> {
        let endian = match format {
            SequenceFormat::Pc2 => Endian::Little,
            SequenceFormat::Mdd => Endian::Big,
        };
        let mut cursor = Cursor::new(name, start, 0, endian);
        let header = match format {
            SequenceFormat::Pc2 => {
                let magic = cursor.take(12, 1, "the header")?;
                if magic != b"POINTCACHE2\0" {
                    return Err(name.syntax(Place::Byte(0), "'POINTCACHE2'", shown(magic)));
                }
                let version = cursor.integer(Scalar::I32, "the version")?;
                if version != 1 {
                    return Err(name.unsupported(
                        Place::Byte(12),
                        format!("PC2 version {version} (supported: 1)"),
                    ));
                }
                let n_points = cursor.count(Scalar::I32, "the number of points")?;
                cursor.take(2, 4, "start and rate")?;
                Header {
                    n_points,
                    points_at: 16,
                    n_frames: cursor.count(Scalar::I32, "the number of frames")?,
                    start: 32,
                    endian,
                }
            }
            SequenceFormat::Mdd => {
                let n_frames = cursor.count(Scalar::I32, "the number of frames")?;
                let n_points = cursor.count(Scalar::I32, "the number of points")?;
                Header {
                    n_points,
                    points_at: 4,
                    n_frames,
                    start: 8 + 4 * n_frames,
                    endian,
                }
            }
        };
        // Two counts of 31 bits and a factor of 12: below 2^66, so this may saturate.
        let needed = (header.n_points * header.n_frames)
            .saturating_mul(12)
            .saturating_add(header.start);
        if needed > length {
            let what = format!(
                "a sequence of {} frames of {} points",
                header.n_frames, header.n_points
            );
            return Err(name.truncated(Place::File, what, needed, length));
        }
        if needed < length {
            let what = format!(
                "bytes, as the header says ({} frames of {} points)",
                header.n_frames, header.n_points
            );
            return Err(name.count(Place::File, what, needed, length));
        }
        // Such frames take no bytes, so the length of the file would not limit their number.
        if header.n_points == 0 && header.n_frames > 0 {
            let expected = format!("points in {} frames, at least 1", header.n_frames);
            return Err(name.syntax(Place::Byte(header.points_at), expected, "0"));
        }
        Ok(header)
    }
}

/// A file of a sequence: the file that the caller named, or one found by a pattern.
fn input<'p>(path: &'p Path, named: Option<&'p Path>) -> Input<'p> {
    match named {
        Some(named) if path != named => Input::Beside(path, folder_of(path)),
        _ => Input::Named(path),
    }
}

/// The files that `path` stands for, in order, at least one, and notes on them. `path` is the first
/// file, a printf pattern, or a glob pattern.
fn numbered_files(path: &Path) -> Result<(Vec<PathBuf>, Vec<String>), Error> {
    let shown_path = path.display().to_string();
    let name = Name(&shown_path);
    if path.is_dir() {
        let expected = format!("frames, as in '{}'", in_folder(path));
        return Err(name.syntax(Place::File, &expected, "a folder"));
    }
    let pattern = path.file_name().map(OsStr::to_string_lossy);
    // Other programs write patterns so.
    let is_foreign = |pattern: &str| pattern.contains('#') || pattern.contains("$F");
    let hint = match pattern.as_deref().is_some_and(is_foreign) {
        true => " (in place of '####' or '$F4': '%04d')",
        false => "",
    };
    let wrong = |found: &str| {
        let expected = format!("a file name with a number, a '%d' or a '*' in it{hint}");
        name.syntax(Place::File, expected, found)
    };
    let pattern = match &pattern {
        None => return Err(wrong("none")),
        Some(Cow::Owned(_)) => return Err(wrong("a name that is not UTF-8")),
        Some(Cow::Borrowed(pattern)) => *pattern,
    };
    let matcher = match path.is_file() {
        true => Matcher::of_first(pattern),
        false => Matcher::new(pattern),
    };
    let matcher = matcher.ok_or_else(|| wrong(&format!("'{pattern}'")))?;
    let folder = folder_of(path);
    let mut found = Vec::new();
    let failed = |source| Error::io(folder, "list", source);
    for entry in fs::read_dir(folder).map_err(failed)? {
        let file_name = entry.map_err(failed)?.file_name();
        // Of a name that is not UTF-8, a pattern takes the rest for any character.
        if let Some(key) = matcher.key(&file_name.to_string_lossy()) {
            found.push((key, path.with_file_name(file_name)));
        }
    }
    if found.is_empty() {
        return Err(name.syntax(Place::File, format!("files of this name{hint}"), "none"));
    }
    found.sort();
    let files: Vec<PathBuf> = found.into_iter().map(|(_, path)| path).collect();
    let notes = matcher.notes(&files);
    Ok((files, notes))
}

/// Decides which file names belong to a sequence.
#[derive(Debug)]
enum Matcher<'p> {
    /// A number from `least` on between two texts. Zeros fill its digits up to one of two widths:
    /// some count a minus, others do not.
    Number {
        prefix: &'p str,
        suffix: &'p str,
        widths: [usize; 2],
        negative_widths: [usize; 2],
        least: i128,
    },
    Glob(&'p str),
}

impl<'p> Matcher<'p> {
    fn new(pattern: &'p str) -> Option<Self> {
        let printf = pattern.match_indices('%').find_map(|(at, _)| {
            let (width, suffix) = pattern[at + 1..].split_once('d')?;
            let width = match width {
                "" => 1,
                // Parsing alone would take a sign, too.
                _ if width.starts_with(|c: char| c.is_ascii_digit()) => width.parse().ok()?,
                _ => return None,
            };
            Some(Matcher::Number {
                prefix: &pattern[..at],
                suffix,
                widths: [width; 2],
                negative_widths: [width, width.saturating_sub(1)],
                least: i128::MIN,
            })
        });
        if printf.is_some() {
            return printf;
        }
        if pattern.contains(['*', '?']) {
            return Some(Matcher::Glob(pattern));
        }
        Self::of_first(pattern)
    }

    /// That of a file with a number in its name, and all files with a greater one.
    fn of_first(pattern: &'p str) -> Option<Self> {
        // Digits in the extension are not a frame number.
        let stem = pattern.rfind('.').map_or(pattern, |dot| &pattern[..dot]);
        let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
        let start = stem[..end]
            .rfind(|c: char| !c.is_ascii_digit())
            .map_or(0, |before| {
                // The character before the digits may take several bytes.
                before + stem[before..].chars().next().map_or(1, char::len_utf8)
            });
        let width = end - start;
        let before = stem[..start].strip_suffix('-');
        let is_negative = before.is_some_and(|before| !before.ends_with(char::is_alphanumeric));
        let start = start - usize::from(is_negative);
        Some(Matcher::Number {
            prefix: &pattern[..start],
            suffix: &pattern[end..],
            widths: [width, width + usize::from(is_negative)],
            negative_widths: [width; 2],
            least: stem[start..end].parse().ok()?,
        })
    }

    /// What the name may have meant otherwise, of the files that were found, at least one.
    fn notes(&self, files: &[PathBuf]) -> Vec<String> {
        match *self {
            // A pattern says where the number is.
            Matcher::Number { least, .. } if files.len() == 1 && least > i128::MIN => {
                vec![format!(
                    "the only frame: no file has a greater number in place of {least}, the last number of the name"
                )]
            }
            Matcher::Number { .. } => Vec::new(),
            Matcher::Glob(_) => {
                let differ = |two: &&[PathBuf]| differ_otherwise([&two[0], &two[1]]);
                let mut others = files.windows(2).filter(differ);
                let Some(first) = others.next() else {
                    return Vec::new();
                };
                let more = match others.count() {
                    0 => String::new(),
                    n => format!(", as do {n} more files from the next"),
                };
                let [a, b] = [&first[0], &first[1]].map(printable);
                vec![format!(
                    "{a} and {b} are frames in a row, and differ in more than the value of one number{more}"
                )]
            }
        }
    }

    /// The sort key of a file name; `None` if it does not belong to the sequence.
    fn key(&self, candidate: &str) -> Option<Vec<(i128, String)>> {
        match *self {
            Matcher::Number {
                prefix,
                suffix,
                widths,
                negative_widths,
                least,
            } => {
                let number = candidate.strip_prefix(prefix)?.strip_suffix(suffix)?;
                let (digits, widths) = match number.strip_prefix('-') {
                    Some(digits) => (digits, negative_widths),
                    None => (number, widths),
                };
                let is_number = !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit());
                // Zeros only fill up to the width: 7 and 07 never belong to one sequence.
                let is_padded = widths.into_iter().any(|width| {
                    digits.len() == width || (digits.len() > width && !digits.starts_with('0'))
                });
                let number = number
                    .parse()
                    .ok()
                    .filter(|&number| is_number && is_padded && number >= least)?;
                Some(vec![(number, String::new())])
            }
            Matcher::Glob(pattern) => {
                matches_glob(pattern, candidate).then(|| key_of_file(candidate))
            }
        }
    }
}

/// Whether `name` matches the pattern: `*` stands for any text, `?` for one character.
fn matches_glob(pattern: &str, name: &str) -> bool {
    let (pattern, name): (Vec<char>, Vec<char>) =
        (pattern.chars().collect(), name.chars().collect());
    let (mut p, mut n) = (0, 0);
    // The position of the last star, and how far into the name its match reaches so far.
    let mut star: Option<(usize, usize)> = None;
    while n < name.len() {
        match pattern.get(p) {
            Some('*') => {
                star = Some((p, n));
                p += 1;
            }
            Some(&c) if c == '?' || c == name[n] => {
                p += 1;
                n += 1;
            }
            _ => match star {
                Some((at, reach)) => {
                    star = Some((at, reach + 1));
                    (p, n) = (at + 1, reach + 1);
                }
                None => return false,
            },
        }
    }
    pattern[p..].iter().all(|&c| c == '*')
}

/// The key of a file's name: that of the name without its extension, so that frame 1001 comes
/// before 1001.50, and then the extension.
fn key_of_file(name: &str) -> Vec<(i128, String)> {
    let (stem, extension) = name.rsplit_once('.').unwrap_or((name, ""));
    let mut key = natural_key(stem);
    // Less than any text that goes on.
    key.push((i128::MIN, extension.to_owned()));
    key
}

/// Whether the names of two files differ in anything but the value of one number, which may be
/// negative or have a fraction.
fn differ_otherwise(files: [&Path; 2]) -> bool {
    let names = files.map(|file| file.file_name().unwrap_or_default().to_string_lossy());
    let [a, b] = [names[0].as_bytes(), names[1].as_bytes()];
    let is_part = |byte: &u8| byte.is_ascii_digit() || *byte == b'.';
    // What is alike before and after, without the digits beside what is not.
    let n_alike = a.iter().zip(b).take_while(|(a, b)| a == b).count();
    let n_digits = a[..n_alike].iter().rev().take_while(|byte| is_part(byte));
    let start = n_alike - n_digits.count();
    let ends = a[n_alike..].iter().rev().zip(b[n_alike..].iter().rev());
    let n_alike = ends.take_while(|(a, b)| a == b).count();
    let after = &a[a.len() - n_alike..];
    let end = n_alike - after.iter().take_while(|byte| is_part(byte)).count();
    let is_number = |name: &[u8]| {
        let number = &name[start..name.len() - end];
        let digits = number.strip_prefix(b"-").unwrap_or(number);
        digits.iter().all(is_part) && digits.iter().any(u8::is_ascii_digit)
    };
    let is_same = natural_key(&names[0]) == natural_key(&names[1]);
    is_same || !is_number(a) || !is_number(b)
}

/// Whether files are in one folder, and their names differ in numbers and in nothing else.
pub fn are_numbered(files: &[PathBuf]) -> bool {
    let words = |file: &Path| -> Option<Vec<String>> {
        let key = key_of(file.file_name()?);
        Some(key.into_iter().map(|(_, text)| text).collect())
    };
    files.windows(2).all(|two| {
        let [a, b] = [&two[0], &two[1]];
        a.parent() == b.parent() && words(a) == words(b)
    })
}

fn key_of(name: &OsStr) -> Vec<(i128, String)> {
    natural_key(&name.to_string_lossy())
}

/// Splits a name into texts and numbers, so that 9 comes before 10, and -2 before -1; each entry is
/// a number and the text after it. A minus is that of a number where no letter or digit comes
/// before it.
fn natural_key(name: &str) -> Vec<(i128, String)> {
    let is_digit = |c: &char| c.is_ascii_digit();
    let mut key = vec![(0, String::new())];
    let (mut rest, mut before) = (name, None);
    while let Some(first) = rest.chars().next() {
        let signed = rest.strip_prefix('-');
        let digits = signed.filter(|_| !before.is_some_and(char::is_alphanumeric));
        let digits = digits.unwrap_or(rest);
        let n_digits = digits.chars().take_while(is_digit).count();
        let length = match n_digits {
            0 => first.len_utf8(),
            n => rest.len() - digits.len() + n,
        };
        let (own, after) = rest.split_at(length);
        match key.last_mut() {
            Some((_, text)) if n_digits == 0 => text.push(first),
            _ => key.push((own.parse().unwrap_or(i128::MAX), String::new())),
        }
        (rest, before) = (after, own.chars().next_back());
    }
    key
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names() {
        let first = Matcher::new("é7_run_0009.v2").unwrap();
        let key = |name: &str| first.key(name).map(|key| key[0].0);
        assert_eq!(key("é7_run_0009.v2"), Some(9));
        assert_eq!(key("é7_run_0010.v2"), Some(10));
        assert_eq!(key("é7_run_10000.v2"), Some(10000));
        for other in [
            "é7_run_0008.v2",
            "é7_run_10.v2",
            "é7_run_00010.v2",
            "é7_run_0010.v3",
            "é7_run_.v2",
            "x",
        ] {
            assert_eq!(key(other), None, "{other}");
        }
        let printf = Matcher::new("a%03db").unwrap();
        assert!(
            printf.key("a001b").is_some()
                && printf.key("a1b").is_none()
                && printf.key("a1000b").is_some()
        );
        assert!(Matcher::new("none.ply").is_none());
        assert!(Matcher::new("%s").is_none());
    }

    #[test]
    fn globs_and_their_order() {
        for (pattern, name, is_match) in [
            ("a*b*c", "aXbYc", true),
            ("a*b*c", "abbc", true),
            ("a*c", "ab", false),
            ("?é*", "xé", true),
            ("??", "x", false),
            ("*", "", true),
        ] {
            assert_eq!(matches_glob(pattern, name), is_match, "{pattern} {name}");
        }
        for sorted in [
            &["f1.ply", "f1b.ply", "f9.ply", "f10.ply"][..],
            &["f_-10.ply", "f_-9.ply", "f_0.ply", "f_9.ply"],
            &["-2.ply", "-1.ply", "0.ply", "1.ply"],
            &["f.-2.ply", "f.1.ply"],
            // Here it only parts the number from the name, or two numbers.
            &["f-1.ply", "f-2.ply"],
            &["1-1.ply", "1-2.ply"],
            &["s.1001.obj", "s.1001.25.obj", "s.1001.50.obj", "s.1002.obj"],
        ] {
            let mut names = sorted.to_vec();
            names.reverse();
            names.sort_by_key(|name| key_of_file(name));
            assert_eq!(names, sorted);
        }
        let printf = Matcher::new("a_%04d.b").unwrap();
        for (name, is_match) in [
            ("a_-0002.b", true),
            ("a_-002.b", true),
            ("a_-02.b", false),
            ("a_--002.b", false),
            ("a_-.b", false),
        ] {
            assert_eq!(printf.key(name).is_some(), is_match, "{name}");
        }
        for (first, name, is_match) in [
            ("a_-02.b", "a_-01.b", true),
            ("a_-02.b", "a_000.b", true),
            ("a_-02.b", "a_00.b", true),
            ("a_-02.b", "a_-03.b", false),
            ("a_02.b", "a_-03.b", false),
            // A line between a name and a number is no minus.
            ("a-02.b", "a-03.b", true),
            ("a-02.b", "a-01.b", false),
        ] {
            let matcher = Matcher::new(first).unwrap();
            assert_eq!(matcher.key(name).is_some(), is_match, "{first} {name}");
        }
    }
}
