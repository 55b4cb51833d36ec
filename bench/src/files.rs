//! The benchmark meshes: files if they exist, otherwise labelled stand-ins.

use std::path::Path;

use impinge::Elements;
use impinge_io::ReadOptions;
use impinge_scenes::{Model, adversarial, solids, surfaces};
use impinge_testing::data;

use crate::Failure;
use crate::problem::{Ask, Problem, models};

/// The offset of the second ball. The balls have a diameter of 1.
const BALL_OFFSET: [f32; 3] = [0.9, 0.01, 0.02];
/// Pairs of the two balls, counted by the oracle.
const N_PAIRS_BALL_15K: u64 = 277;
const N_PAIRS_BALL: u64 = 390;

/// Reads a mesh file in single precision. Coordinates that need more precision are rounded, because
/// a bench measures time.
fn load(path: &Path, weld: bool) -> Result<Model, Failure> {
    let options = ReadOptions {
        weld,
        ..ReadOptions::default()
    };
    let mesh = impinge_io::read(path, &options)?;
    Ok(Model {
        positions: mesh.positions.to_f32_rounded(),
        elements: match mesh.elements {
            impinge_io::Elements::Triangles(faces) => Elements::Triangles(faces),
            impinge_io::Elements::Tetrahedra(tets) => Elements::Tetrahedra(tets),
        },
    })
}

/// A mesh from the shared data, or a stand-in, and a description of it.
fn mesh(file: &str, stand_in: impl FnOnce() -> Model) -> Result<(Model, String), Failure> {
    match data::data_file(file) {
        Some(path) => Ok((load(&path, false)?, format!("`{file}`"))),
        None => {
            let model = stand_in();
            let about = format!(
                "a generated stand-in of {} elements, because `{file}` is not here",
                model.n_elements()
            );
            Ok((model, about))
        }
    }
}

const MIRRORED: &str = "frames alternate with the mirror image, whose pairs are the same because changing signs is exact";

/// Two copies of a body, their number of pairs, and a description. Scenes: `ball15k`, `ball`
/// (30,000), `bunny`, `buddha`, `dragon`.
fn twice(scene: &str) -> Result<(Vec<Model>, Option<u64>, String), Failure> {
    let (model, offset, expected, about) = match scene {
        "ball15k" => (
            surfaces::ball(15_000),
            BALL_OFFSET,
            Some(N_PAIRS_BALL_15K),
            "generated; pairs counted by the oracle".to_owned(),
        ),
        "ball" => (
            surfaces::ball(30_000),
            BALL_OFFSET,
            Some(N_PAIRS_BALL),
            "generated; pairs counted by the oracle".to_owned(),
        ),
        "bunny" | "buddha" | "dragon" => {
            let n_stand_in = match scene {
                "bunny" => 69_450,
                "buddha" => 100_000,
                _ => 400_000,
            };
            match (
                data::data_file(&format!("meshes/{scene}.ply")),
                published(scene)?,
            ) {
                (Some(path), Some((offset, n_pairs))) => (
                    load(&path, false)?,
                    offset,
                    Some(n_pairs),
                    format!("`meshes/{scene}.ply`; pairs as published with the data"),
                ),
                _ => (
                    surfaces::stand_in(n_stand_in),
                    [0.4, 0.01, 0.01],
                    None,
                    format!("a generated stand-in, because `meshes/{scene}.ply` is not here"),
                ),
            }
        }
        _ => {
            return Err(format!(
                "no scene `{scene}`: ball15k, ball, bunny, buddha, dragon or parts"
            )
            .into());
        }
    };
    let moved = model.translated(offset);
    Ok((vec![model, moved], expected, about))
}

/// Triangles of the two machine parts.
const N_PARTS: usize = 60_000;

/// Two copies of a body, in place; or, as `parts`, two generated parts of a machine.
pub fn two_body(scene: &str) -> Result<Problem, Failure> {
    if scene == "parts" {
        let models = models(adversarial::machine_parts(N_PARTS)?)?;
        return Ok(
            Problem::mirrored(scene, models, Ask::Between).about(format!(
                "generated: slivers, fans and fillets, turned in space; {MIRRORED}"
            )),
        );
    }
    let (models, expected, about) = twice(scene)?;
    Ok(Problem::mirrored(scene, models, Ask::Between)
        .about(format!("{about}; {MIRRORED}"))
        .expecting(expected))
}

/// The number of steps of a passing body from one end of its path to the other.
const N_STEPS: usize = 15;

/// Two copies of a body, one of which passes by: `step` is the share of its width that it moves per
/// frame.
pub fn passing(scene: &str, step: f32) -> Result<Problem, Failure> {
    let (models, ..) = twice(scene)?;
    let width = models[0].bounds().map_or(0.0, |(min, max)| max[0] - min[0]);
    let name = format!("{scene}, {} % per frame", 100.0 * step);
    Ok(
        Problem::passing(&name, models, Ask::Between, step * width, N_STEPS).about(format!(
            "the second body goes to and fro along x around its place of `two-body`, {N_STEPS} steps of {} % of its width \
             each way; pairs of the first pose",
            100.0 * step
        )),
    )
}

/// Offset and number of pairs of a two-body scene from `expected/two_body.json`.
fn published(scene: &str) -> Result<Option<([f32; 3], u64)>, Failure> {
    let Some(path) = data::data_file("expected/two_body.json") else {
        return Ok(None);
    };
    let answers: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(path)?)?;
    let answer = &answers[scene];
    let offset: Option<Vec<f64>> = answer["offset_f32"].as_array().map(|offset| {
        offset
            .iter()
            .filter_map(serde_json::Value::as_f64)
            .collect()
    });
    match (offset.as_deref(), answer["pairs"].as_u64()) {
        // The file holds f32 numbers with all digits, so narrowing is exact.
        (Some(&[x, y, z]), Some(n_pairs)) => Ok(Some(([x as f32, y as f32, z as f32], n_pairs))),
        _ => Err(format!("two_body.json: no offset and pairs for `{scene}`").into()),
    }
}

/// Self-collision of one body: `ball`, `bunny`, `buddha`, `dragon`, `cow`, `camelhead`.
pub fn within(scene: &str) -> Result<Problem, Failure> {
    let (model, about, expected) = match scene {
        "ball" => (surfaces::ball(30_000), "generated".to_owned(), Some(0)),
        "bunny" | "buddha" | "dragon" => {
            let n_stand_in = match scene {
                "bunny" => 69_450,
                "buddha" => 100_000,
                _ => 400_000,
            };
            let (model, about) = mesh(&format!("meshes/{scene}.ply"), || {
                surfaces::stand_in(n_stand_in)
            })?;
            (model, about, None)
        }
        "cow" | "camelhead" => {
            let file = format!("meshes/{scene}.off");
            match (data::data_file(&file), published_within(&file)?) {
                (Some(path), Some(n_pairs)) => (
                    load(&path, true)?,
                    format!("`{file}`, vertices welded; pairs as published with the data"),
                    Some(n_pairs),
                ),
                _ => return Err(format!("`{file}` and its answers are not here").into()),
            }
        }
        _ => {
            return Err(format!(
                "no scene `{scene}`: ball, bunny, buddha, dragon, cow or camelhead"
            )
            .into());
        }
    };
    Ok(Problem::mirrored(scene, vec![model], Ask::Within)
        .about(format!("{about}; {MIRRORED}"))
        .expecting(expected))
}

/// Self-intersections of a mesh between triangles without a common vertex.
fn published_within(file: &str) -> Result<Option<u64>, Failure> {
    let Some(path) = data::data_file("expected/self_intersections.json") else {
        return Ok(None);
    };
    let answers: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(path)?)?;
    Ok(answers[file]["hits_noshared"].as_u64())
}

/// A solid twice, overlapping: moved by a third of its box along x and a little aside.
pub fn tets() -> Result<Problem, Failure> {
    let (model, about) = mesh("tets/bunny_19k.msh", || solids::solid_ball(19_379))?;
    let width = model.bounds().map_or(0.0, |(min, max)| max[0] - min[0]);
    let moved = model.translated([0.33 * width, 0.011 * width, 0.007 * width]);
    Ok(
        Problem::mirrored("tets", vec![model, moved], Ask::Between).about(format!(
            "{about} twice, a third of its width apart; {MIRRORED}"
        )),
    )
}
