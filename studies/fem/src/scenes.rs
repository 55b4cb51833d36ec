//! Scenes with large deformation: one body dropped on another one like it.
//!
//! The bodies are those of the paper's table 2, with other meshes of about the same size. The files
//! are not part of the repository (`tets/*.msh` in the folder of shared data, see
//! [`impinge_testing::data`]). If a file is absent, a ball of about the same number of tetrahedra
//! stands in, and the scene's label says so.

use std::path::Path;

use impinge::Elements;
use impinge_io::{ReadOptions, read};
use impinge_scenes::solids;
use impinge_testing::data;

use crate::error::Error;
use crate::settings::{Damping, Ground, Settings};
use crate::solid::{Material, Solid};

/// A scene by its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum SceneName {
    /// Two bunnies of 7,356 tetrahedra each.
    Bunny7k,
    /// Two bunnies of 19,379 tetrahedra each.
    Bunny19k,
    /// Two dragons of 8,408 tetrahedra each.
    Dragon8k,
    /// Two dragons of 15,047 tetrahedra each.
    Dragon15k,
    /// Two blocks of 1,296 tetrahedra each: generated, small and quick.
    Blocks,
}

impl SceneName {
    /// All scenes.
    pub const ALL: [SceneName; 5] = [
        SceneName::Bunny7k,
        SceneName::Bunny19k,
        SceneName::Dragon8k,
        SceneName::Dragon15k,
        SceneName::Blocks,
    ];

    /// The name on the command line: `"bunny-7k"` and so on.
    pub fn name(self) -> &'static str {
        match self {
            SceneName::Bunny7k => "bunny-7k",
            SceneName::Bunny19k => "bunny-19k",
            SceneName::Dragon8k => "dragon-8k",
            SceneName::Dragon15k => "dragon-15k",
            SceneName::Blocks => "blocks",
        }
    }

    /// The file in the folder of shared data and its number of tetrahedra.
    fn file(self) -> Option<(&'static str, usize)> {
        match self {
            SceneName::Bunny7k => Some(("tets/bunny_7k.msh", 7_356)),
            SceneName::Bunny19k => Some(("tets/bunny_19k.msh", 19_379)),
            SceneName::Dragon8k => Some(("tets/dragon_8k.msh", 8_408)),
            SceneName::Dragon15k => Some(("tets/dragon_15k.msh", 15_047)),
            SceneName::Blocks => None,
        }
    }
}

/// A scene ready to be simulated.
#[derive(Debug, Clone)]
pub struct DropScene {
    /// A description with the number of tetrahedra; it says if the body is a stand-in.
    pub label: String,
    /// Whether a generated body stands in for a mesh that is absent.
    pub is_stand_in: bool,
    /// The lower body, and the one that is dropped on it.
    pub solids: Vec<Solid>,
    /// The settings of its simulation.
    pub settings: Settings,
    /// Enough steps for the upper body to fall, to be crushed and to come to rest again.
    pub n_steps: u64,
}

/// The material of the bodies: soft enough to be crushed to a fraction of their height.
pub const SOFT: Material = Material {
    young: 3e4,
    poisson: 0.4,
    density: 1e3,
};

/// Builds a scene: two bodies with the longest side of their box 1 m, the upper one turned a little
/// and thrown down on the lower one.
///
/// # Errors
/// A mesh file that exists but can't be read, or holds no tetrahedra.
pub fn drop_scene(name: SceneName) -> Result<DropScene, Error> {
    let mesh = name.file().and_then(|(path, _)| data::data_file(path));
    build(name, mesh.as_deref())
}

/// The same scene with the caller's mesh: a file of tetrahedra.
///
/// # Errors
/// A file that can't be read, or holds no tetrahedra.
pub fn drop_scene_of(path: &Path) -> Result<DropScene, Error> {
    let label = path.display().to_string();
    Ok(dropped(load(path, SOFT)?, label, false))
}

/// The scene with a mesh from a file, or with a generated one.
fn build(name: SceneName, mesh: Option<&Path>) -> Result<DropScene, Error> {
    let (solid, label, is_stand_in) = match name.file() {
        None => {
            // A block is far heavier than a bunny in the same box, so its material is stiffer.
            let material = Material { young: 1e5, ..SOFT };
            let solid = block(6, 6, 6, 1.0 / 6.0, material);
            (solid, "block".to_owned(), false)
        }
        Some((_, n_tets)) => match mesh {
            Some(path) => (load(path, SOFT)?, name.name().to_owned(), false),
            None => {
                let label = format!("ball, standing in for {}", name.name());
                (ball(n_tets, SOFT), label, true)
            }
        },
    };
    Ok(dropped(solid, label, is_stand_in))
}

/// A solid, and its copy above it.
fn dropped(solid: Solid, label: String, is_stand_in: bool) -> DropScene {
    let solid = normalised(solid);
    let label = format!("{label}, {} tetrahedra, twice", solid.tets.len());
    let top = solid.rest.iter().fold(0.0, |top: f64, p| top.max(p[1]));
    // A turn about the vertical axis: no two faces of the copies are parallel.
    let (sin, cos) = 0.5f64.sin_cos();
    let upper = solid
        .clone()
        .posed(|[x, y, z]| [cos * x + sin * z, y + top + 0.05, cos * z - sin * x])
        .moving([0.0, -2.0, 0.0]);
    DropScene {
        label,
        is_stand_in,
        solids: vec![solid, upper],
        settings: Settings {
            ground: Some(Ground {
                normal: [0.0, 1.0, 0.0],
                height: 0.0,
            }),
            // The error in the velocities is far below the velocity that gravity adds in a step.
            tolerance: 1e-4,
            // Enough for the bodies to stay together after the first impact.
            damping: Damping {
                mass: 0.5,
                stiffness: 4e-3,
            },
            ..Settings::default()
        },
        n_steps: 240,
    }
}

/// Reads a solid from a file of tetrahedra; vertices that no tetrahedron names are dropped.
///
/// # Errors
/// A file that can't be read, or holds triangles.
pub fn load(path: &Path, material: Material) -> Result<Solid, Error> {
    let mesh = read(path, &ReadOptions::as_they_are())?;
    match mesh.elements {
        impinge_io::Elements::Tetrahedra(tets) => {
            Ok(Solid::new(tets, mesh.positions.to_f64(), material).without_unused_vertices())
        }
        impinge_io::Elements::Triangles(_) => Err(Error::NoTetrahedra(path.display().to_string())),
    }
}

/// A block of `n_x` by `n_y` by `n_z` cubes of six tetrahedra with edge `spacing` in metres; one
/// corner is at the origin.
pub fn block(n_x: usize, n_y: usize, n_z: usize, spacing: f64, material: Material) -> Solid {
    let model = solids::block(n_x, n_y, n_z, 1.0);
    let rest = model.positions_f64();
    let rest = rest.iter().map(|p| p.map(|x| x * spacing)).collect();
    Solid::new(tetrahedra(model.elements), rest, material)
}

/// A ball of radius 0.5 m about the origin with about `n_tets` tetrahedra.
pub fn ball(n_tets: usize, material: Material) -> Solid {
    let model = solids::solid_ball(n_tets);
    let rest = model.positions_f64();
    Solid::new(tetrahedra(model.elements), rest, material)
}

fn tetrahedra(elements: Elements) -> Vec<[u32; 4]> {
    match elements {
        Elements::Tetrahedra(tets) => tets,
        _ => Vec::new(),
    }
}

/// The solid with the longest side of its box 1 m, standing on y = 0 above the origin.
fn normalised(solid: Solid) -> Solid {
    let (low, high) = solid.rest.iter().fold(
        ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]),
        |(low, high), p| {
            (
                std::array::from_fn(|k| low[k].min(p[k])),
                std::array::from_fn(|k| high[k].max(p[k])),
            )
        },
    );
    let longest = (0..3).fold(0.0, |longest: f64, k| longest.max(high[k] - low[k]));
    let foot = [0.5 * (low[0] + high[0]), low[1], 0.5 * (low[2] + high[2])];
    let scale = if longest > 0.0 { 1.0 / longest } else { 1.0 };
    let rest = solid
        .rest
        .iter()
        .map(|p| std::array::from_fn(|k| (p[k] - foot[k]) * scale))
        .collect();
    Solid::new(solid.tets, rest, solid.material)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stand_ins_say_so_and_have_about_the_size() {
        for name in SceneName::ALL {
            let scene = build(name, None).unwrap();
            let n_tets = scene.solids[0].tets.len();
            assert_eq!(scene.solids[1].tets.len(), n_tets);
            match name.file() {
                None => assert!(!scene.is_stand_in && !scene.label.contains("standing in")),
                Some((_, wanted)) => {
                    assert!(scene.is_stand_in);
                    let words = format!("standing in for {}, {n_tets} tetrahedra", name.name());
                    assert!(scene.label.contains(&words), "{}", scene.label);
                    assert!(n_tets.abs_diff(wanted) * 10 < wanted, "{n_tets} {wanted}");
                }
            }
        }
    }

    #[test]
    fn a_file_of_triangles_is_refused() {
        let Some(path) = data::test_file("meshes/cow.off") else {
            return;
        };
        let error = build(SceneName::Bunny7k, Some(&path)).unwrap_err();
        assert!(
            error.to_string().contains("the file holds triangles"),
            "{error}"
        );
    }
}
