//! Where real meshes and published answers are looked for. They are not part of the repository.

use std::path::PathBuf;

/// The folder of shared data: `$IMPINGE_DATA` if set, else `../shared/data` beside the repository.
/// `None` when it is not there: tests that need it say so and pass.
pub fn data_dir() -> Option<PathBuf> {
    let folder = match std::env::var_os("IMPINGE_DATA") {
        Some(folder) => PathBuf::from(folder),
        None => PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
    };
    folder.is_dir().then_some(folder)
}

/// A file of [`data_dir`] by its path there, such as `meshes/bunny.ply`; `None` when it is absent.
pub fn data_file(path: &str) -> Option<PathBuf> {
    data_dir()
        .map(|folder| folder.join(path))
        .filter(|path| path.is_file())
}
