//! Which files of a command line are bodies, and which are frames.

use std::path::{Path, PathBuf};

use impinge_io::are_numbered;

use crate::error::Error;

/// A mesh, its frames, and other meshes.
#[derive(Debug)]
pub struct Files<'a> {
    pub mesh: &'a Path,
    pub frames: FrameFiles<'a>,
    /// Bodies that do not move.
    pub others: &'a [PathBuf],
}

#[derive(Debug)]
pub enum FrameFiles<'a> {
    /// It does not move.
    None,
    /// A point cache, a pattern, or the first of numbered files.
    Sequence(&'a Path),
    /// One mesh file per frame.
    Each(&'a [PathBuf]),
}

impl<'a> Files<'a> {
    /// Tells by their names what files are, or as the options `--sequence` and `--bodies` say.
    pub fn of(all: &'a [PathBuf], is_sequence: bool, are_bodies: bool) -> Result<Self, Error> {
        let Some((mesh, rest)) = all.split_first() else {
            return Err(Error::Usage("no mesh is given".to_owned()));
        };
        // A pattern that the shell expands repeats a mesh that it matches.
        let numbered = match rest.contains(mesh) {
            true => rest,
            false => all,
        };
        let frames = match rest {
            [] if is_sequence => {
                return Err(Error::Usage(
                    "--sequence needs a mesh and its frames".to_owned(),
                ));
            }
            [second, ..] if !are_bodies && names_sequence(second) => FrameFiles::Sequence(second),
            [second] if is_sequence => FrameFiles::Sequence(second),
            _ if is_sequence => FrameFiles::Each(match are_numbered(all) {
                true => numbered,
                false => rest,
            }),
            [_, _, ..] if !are_bodies && are_numbered(rest) => {
                match are_numbered(&all[..2]) {
                    true => FrameFiles::Each(numbered),
                    // Two numbered files beside another mesh may be bodies.
                    false if rest.len() > 2 => FrameFiles::Each(rest),
                    false => FrameFiles::None,
                }
            }
            _ => FrameFiles::None,
        };
        let others = match frames {
            FrameFiles::None => rest,
            FrameFiles::Sequence(_) => &rest[1..],
            FrameFiles::Each(_) => &[],
        };
        Ok(Files {
            mesh,
            frames,
            others,
        })
    }
}

/// Whether a name can only be that of a sequence: a point cache or a pattern.
fn names_sequence(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    impinge_io::SequenceFormat::from_extension(&extension).is_some()
        || (!path.exists() && name.contains(['%', '*', '?']))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The kinds of files as text.
    fn split(words: &str) -> String {
        let is_given = |option| words.split(' ').any(|word| word == option);
        let files: Vec<PathBuf> = words
            .split(' ')
            .filter(|word| !word.starts_with("--"))
            .map(PathBuf::from)
            .collect();
        match Files::of(&files, is_given("--sequence"), is_given("--bodies")) {
            Err(error) => error.line(),
            Ok(files) => {
                let frames = match files.frames {
                    FrameFiles::None => "none".to_owned(),
                    FrameFiles::Sequence(path) => path.display().to_string(),
                    FrameFiles::Each(files) => format!("{} files", files.len()),
                };
                let mesh = files.mesh.display();
                format!("{mesh}, frames: {frames}, others: {}", files.others.len())
            }
        }
    }

    #[test]
    fn names_tell_bodies_from_frames() {
        for (words, expected) in [
            ("a.obj", "a.obj, frames: none, others: 0"),
            ("a.obj b.obj c.obj", "a.obj, frames: none, others: 2"),
            ("a.obj a.pc2 c.obj", "a.obj, frames: a.pc2, others: 1"),
            ("a.obj r_%d.obj", "a.obj, frames: r_%d.obj, others: 0"),
            ("r_1.obj r_2.obj", "r_1.obj, frames: none, others: 1"),
            (
                "r_08.obj r_9.obj r_10.obj",
                "r_08.obj, frames: 3 files, others: 0",
            ),
            // As in `impinge sequence`.
            (
                "r_-2.obj r_-1.obj r_0.obj",
                "r_-2.obj, frames: 3 files, others: 0",
            ),
            (
                "a.obj r_1.obj r_2.obj r_3.obj",
                "a.obj, frames: 3 files, others: 0",
            ),
            ("a.obj r_1.obj r_2.obj", "a.obj, frames: none, others: 2"),
            ("--sequence a.obj b.obj", "a.obj, frames: b.obj, others: 0"),
            (
                "--sequence a.obj b.obj c.obj",
                "a.obj, frames: 2 files, others: 0",
            ),
            (
                "--sequence r_1.obj r_2.obj r_3.obj",
                "r_1.obj, frames: 3 files, others: 0",
            ),
            // `r_1.obj r_*.obj`, and a mesh that is another of the frames.
            (
                "--sequence r_1.obj r_1.obj r_2.obj r_3.obj",
                "r_1.obj, frames: 3 files, others: 0",
            ),
            (
                "r_2.obj r_1.obj r_2.obj r_3.obj",
                "r_2.obj, frames: 3 files, others: 0",
            ),
            (
                "--bodies r_1.obj r_2.obj r_3.obj",
                "r_1.obj, frames: none, others: 2",
            ),
            ("--sequence a.obj", "--sequence needs a mesh and its frames"),
        ] {
            assert_eq!(split(words), expected, "{words}");
        }
    }
}
