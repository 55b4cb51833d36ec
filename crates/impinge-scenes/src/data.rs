//! Locations of real meshes and published answers. They are not part of the repository.

use std::path::PathBuf;

/// The folder of shared data: `$IMPINGE_DATA` if set, else `../shared/data` beside the repository.
/// `None` if it does not exist.
pub fn data_dir() -> Option<PathBuf> {
    let folder = match std::env::var_os("IMPINGE_DATA") {
        Some(folder) => PathBuf::from(folder),
        None => PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
    };
    folder.is_dir().then_some(folder)
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
