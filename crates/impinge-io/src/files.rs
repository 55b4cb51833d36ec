//! Opening files safely: only regular files, only up to a size limit, and files named by a mesh
//! only in the mesh's folder.
//!
//! Reading a pipe may never end, and a device may give bytes forever; neither is a mesh. A path
//! inside a mesh file may have been written by somebody who wants to see other files. So such a
//! path is resolved, including links, and must lie in the folder of the mesh file or below.

use std::fs::{self, File, Metadata, OpenOptions};
use std::io::Read;
use std::path::{Component, Path, PathBuf};

use crate::budget::reserve;
use crate::error::{Error, Name, Place};
use crate::options::ReadOptions;

/// A path and its origin.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Source<'p> {
    /// Named by the caller: links may lead anywhere.
    Named(&'p Path),
    /// Named by a file or a pattern in this folder: must lie in it or below, links resolved.
    Beside(&'p Path, &'p Path),
}

impl<'p> Source<'p> {
    pub(crate) fn path(self) -> &'p Path {
        match self {
            Source::Named(path) | Source::Beside(path, _) => path,
        }
    }

    /// Opens the file, which must be a regular one.
    pub(crate) fn open(self) -> Result<(File, u64), Error> {
        match self {
            Source::Named(path) => open(path, path),
            Source::Beside(path, folder) => open(path, &resolved(path, folder)?),
        }
    }

    /// All bytes of the file, if they are no more than the options allow.
    pub(crate) fn read(self, options: &ReadOptions) -> Result<Vec<u8>, Error> {
        let path = self.path();
        let (file, length) = self.open()?;
        if length > options.max_file_bytes {
            return Err(Name(&path.display().to_string()).too_large(
                Place::File,
                "bytes of the file (see ReadOptions::max_file_bytes)",
                options.max_file_bytes,
                length,
            ));
        }
        let shown = path.display().to_string();
        let mut bytes = Vec::new();
        reserve(Name(&shown), Place::File, &mut bytes, length)?;
        // If the file grows meanwhile, only the initial length is read.
        file.take(length)
            .read_to_end(&mut bytes)
            .map_err(|source| Error::io(path, "read", source))?;
        Ok(bytes)
    }
}

/// The folder that a file is in.
pub(crate) fn folder_of(path: &Path) -> &Path {
    path.parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .unwrap_or(Path::new("."))
}

/// Opens `path`; messages name it `shown`.
fn open(shown: &Path, path: &Path) -> Result<(File, u64), Error> {
    let failed = |source| Error::io(shown, "read", source);
    let check = |metadata: &Metadata| match metadata.is_file() {
        true => Ok(()),
        false => Err(Error::NotAFile {
            path: shown.to_owned(),
            what: kind(metadata),
        }),
    };
    // Opening a device can already have effects, so the path is checked first. The open file is
    // checked again, because the path may lead to another file by now.
    check(&fs::metadata(path).map_err(failed)?)?;
    let file = patient(OpenOptions::new().read(true))
        .open(path)
        .map_err(failed)?;
    let metadata = file.metadata().map_err(failed)?;
    check(&metadata)?;
    Ok((file, metadata.len()))
}

/// Makes opening a pipe return at once instead of waiting for a writer.
#[cfg(unix)]
fn patient(options: &mut OpenOptions) -> &mut OpenOptions {
    use std::os::unix::fs::OpenOptionsExt;
    options.custom_flags(libc::O_NONBLOCK | libc::O_NOCTTY)
}

#[cfg(not(unix))]
fn patient(options: &mut OpenOptions) -> &mut OpenOptions {
    options
}

/// Describes a file that is not regular.
fn kind(metadata: &Metadata) -> &'static str {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        let kind = metadata.file_type();
        if kind.is_fifo() {
            return "a pipe";
        }
        if kind.is_socket() {
            return "a socket";
        }
        if kind.is_char_device() || kind.is_block_device() {
            return "a device";
        }
    }
    if metadata.is_dir() {
        "a folder"
    } else {
        "something else"
    }
}

/// `path` with all links resolved; an error unless it lies in `folder` or below.
fn resolved(path: &Path, folder: &Path) -> Result<PathBuf, Error> {
    let outside = || outside(path, folder);
    // Names that lead out are refused before any lookup, so that an error does not reveal whether
    // such a file exists.
    if path.strip_prefix(folder).is_ok_and(leads_out) {
        return Err(outside());
    }
    let failed = |source| Error::io(path, "read", source);
    let real = fs::canonicalize(path).map_err(failed)?;
    if !real.starts_with(fs::canonicalize(folder).map_err(failed)?) {
        return Err(outside());
    }
    Ok(real)
}

/// The error for a file named by a mesh or a pattern that lies outside its folder.
pub(crate) fn outside(path: &Path, folder: &Path) -> Error {
    Error::Outside {
        path: path.to_owned(),
        folder: folder.to_owned(),
    }
}

/// Whether a relative path leaves its starting folder at any point.
pub(crate) fn leads_out(relative: &Path) -> bool {
    let mut depth = 0usize;
    for component in relative.components() {
        match component {
            Component::CurDir => {}
            Component::Normal(_) => depth += 1,
            Component::ParentDir if depth > 0 => depth -= 1,
            Component::ParentDir | Component::RootDir | Component::Prefix(_) => return true,
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_that_lead_out() {
        for (path, is_out) in [
            ("a.bin", false),
            ("a/../b.bin", false),
            ("./a", false),
            ("..", true),
            ("a/../../b", true),
            ("../a/b", true),
            ("/a", true),
        ] {
            assert_eq!(leads_out(Path::new(path)), is_out, "{path}");
        }
    }

    #[test]
    fn a_file_without_a_folder_is_in_the_current_one() {
        assert_eq!(folder_of(Path::new("a.ply")), Path::new("."));
        assert_eq!(folder_of(Path::new("b/a.ply")), Path::new("b"));
    }
}
