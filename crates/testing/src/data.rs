//! Locations of real meshes and published answers. They are not part of the repository.

use std::path::PathBuf;

/// The folder of shared data: `$IMPINGE_DATA` if set, else `shared/data` in the first folder above
/// the current one that has it, as beside the repository. `None` if it does not exist.
pub fn data_dir() -> Option<PathBuf> {
    if let Some(folder) = std::env::var_os("IMPINGE_DATA") {
        return Some(PathBuf::from(folder)).filter(|folder| folder.is_dir());
    }
    let current = std::env::current_dir().ok()?;
    let mut folders = current.ancestors().map(|above| above.join("shared/data"));
    folders.find(|folder| folder.is_dir())
}

/// A file of [`data_dir`] for a test. `None` only if the file is absent and `IMPINGE_NO_DATA=1` is
/// set.
///
/// # Panics
/// If the file is absent and `IMPINGE_NO_DATA=1` is not set: a test of real meshes must not pass by
/// skipping them.
pub fn test_file(path: &str) -> Option<PathBuf> {
    let found = data_dir()
        .map(|folder| folder.join(path))
        .filter(|path| path.exists());
    let may_be_absent = std::env::var_os("IMPINGE_NO_DATA").is_some_and(|value| value == "1");
    assert!(
        found.is_some() || may_be_absent,
        "{path} does not exist: set IMPINGE_DATA to the folder of shared data, or IMPINGE_NO_DATA=1 to skip this test"
    );
    found
}

/// A file of [`data_dir`] by its path there, such as `meshes/bunny.ply`; `None` if it is absent.
pub fn data_file(path: &str) -> Option<PathBuf> {
    data_dir()
        .map(|folder| folder.join(path))
        .filter(|path| path.is_file())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_is_found_or_waived() {
        if let Some(path) = test_file("expected/two_body.json") {
            assert!(path.is_file());
        }
        assert_eq!(data_file("no/such/file"), None);
    }
}
