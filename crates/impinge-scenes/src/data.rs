//! Where real meshes and published answers are looked for. They are not part of the repository.

use std::path::PathBuf;

/// The folder of shared data: `$IMPINGE_DATA` if set, else `../shared/data` beside the repository.
/// `None` when it is not there.
pub fn data_dir() -> Option<PathBuf> {
    let folder = match std::env::var_os("IMPINGE_DATA") {
        Some(folder) => PathBuf::from(folder),
        None => PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
    };
    folder.is_dir().then_some(folder)
}

/// A file of [`data_dir`] for a test. `None` only where `IMPINGE_NO_DATA=1` says that the test may go without.
///
/// # Panics
/// Where the file, or the folder, is absent and nobody has said so: a test of real meshes must not pass by skipping them.
pub fn test_file(path: &str) -> Option<PathBuf> {
    let found = data_dir()
        .map(|folder| folder.join(path))
        .filter(|path| path.exists());
    let may_be_absent = std::env::var_os("IMPINGE_NO_DATA").is_some_and(|value| value == "1");
    assert!(
        found.is_some() || may_be_absent,
        "{path} is not there: set IMPINGE_DATA to the folder of shared data, or IMPINGE_NO_DATA=1 to go without"
    );
    found
}

/// A file of [`data_dir`] by its path there, such as `meshes/bunny.ply`; `None` when it is absent.
pub fn data_file(path: &str) -> Option<PathBuf> {
    data_dir()
        .map(|folder| folder.join(path))
        .filter(|path| path.is_file())
}
