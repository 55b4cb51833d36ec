//! Opening files: regular ones only, none larger than asked for, and files that another file names only in its folder.
//!
//! A pipe never ends if nobody writes to it, and a device may give bytes for ever; neither is a mesh. A path that a mesh file
//! holds may have been written by somebody who wants to see other files, so such a path is resolved, links and all, and
//! must lie in the folder of the file that names it or below.

use std::fs::{self, File, Metadata, OpenOptions};
use std::io::Read;
use std::path::{Component, Path, PathBuf};

use crate::budget::reserve;
use crate::error::{Error, Name, Place};
use crate::options::ReadOptions;

/// A path and who named it.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Source<'p> {
    /// The caller: any link may lead anywhere.
    Named(&'p Path),
    /// A file or a pattern of names in this folder: must lie in it or below, links resolved.
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
        // A file that grows meanwhile is read as long as it was.
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

/// Opens `path`, where `shown` stands in messages.
fn open(shown: &Path, path: &Path) -> Result<(File, u64), Error> {
    let failed = |source| Error::io(shown, "read", source);
    let check = |metadata: &Metadata| match metadata.is_file() {
        true => Ok(()),
        false => Err(Error::NotAFile {
            path: shown.to_owned(),
            what: kind(metadata),
        }),
    };
    // Opening a device can do something already, so the path is looked at first; and the open file again, which may be another by now.
    check(&fs::metadata(path).map_err(failed)?)?;
    let file = patient(OpenOptions::new().read(true))
        .open(path)
        .map_err(failed)?;
    let metadata = file.metadata().map_err(failed)?;
    check(&metadata)?;
    Ok((file, metadata.len()))
}

/// Makes opening a pipe return at once, where it would wait for a writer.
#[cfg(unix)]
fn patient(options: &mut OpenOptions) -> &mut OpenOptions {
    use std::os::unix::fs::OpenOptionsExt;
    options.custom_flags(libc::O_NONBLOCK | libc::O_NOCTTY)
}

#[cfg(not(unix))]
fn patient(options: &mut OpenOptions) -> &mut OpenOptions {
    options
}

/// What something is that is no regular file.
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

/// Where `path`, all links resolved, is; an error unless that is in `folder` or below.
fn resolved(path: &Path, folder: &Path) -> Result<PathBuf, Error> {
    let outside = || outside(path, folder);
    // Names that lead out are refused before anything is looked up: even whether there is such a file is not to be seen.
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

/// The error for a file that is named in or beside another, and lies outside its folder.
pub(crate) fn outside(path: &Path, folder: &Path) -> Error {
    Error::Outside {
        path: path.to_owned(),
        folder: folder.to_owned(),
    }
}

/// Whether a relative path leaves the folder it starts in, somewhere on its way.
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
