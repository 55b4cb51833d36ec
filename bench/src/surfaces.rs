//! Surfaces of the shared data, and the choice among the scenes that are made from them.

use std::path::PathBuf;

use impinge_io::{Elements, Positions, ReadOptions};
use impinge_testing::data;

use crate::{Failure, Options};

/// The path of a file of the shared data.
pub fn file(name: &str) -> Result<PathBuf, Failure> {
    let path = data::data_file(name);
    path.ok_or_else(|| format!("{name} is not there: set IMPINGE_DATA").into())
}

/// The faces and the vertices of a mesh file of the shared data.
pub fn read(name: &str) -> Result<(Vec<[u32; 3]>, Positions), Failure> {
    let mesh = impinge_io::read(&file(name)?, &ReadOptions::as_they_are())?;
    match mesh.elements {
        Elements::Triangles(faces) => Ok((faces, mesh.positions)),
        Elements::Tetrahedra(_) => Err(format!("{name}: not a surface").into()),
    }
}

/// Measures the scenes that the options name: all, or those of one name.
pub fn measure_each<K>(
    all: &[K],
    name: impl Fn(&K) -> &'static str,
    options: &Options,
    measure: impl FnMut(&K) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let wanted = options.scene.as_deref();
    if wanted.is_some_and(|wanted| all.iter().all(|scene| name(scene) != wanted)) {
        let mut names: Vec<_> = all.iter().map(name).collect();
        names.dedup();
        return Err(format!("no such scene: {}", names.join(" or ")).into());
    }
    all.iter()
        .filter(|scene| wanted.is_none_or(|wanted| name(scene) == wanted))
        .try_for_each(measure)
}
