//! `impinge check --assembly`: which parts share space, touch or are near.

use std::io::Write;
use std::path::Path;

use impinge::CancelToken;
use impinge_check::{Assembly, AssemblyError, AssemblyOptions, Relation, check_assembly_with};
use impinge_io::{Format, Mesh, ReadOptions, printable, read_bodies, read_with_summary};

use super::args::{CheckArgs, FailOn, Touching};
use super::html::write_assembly;
use super::relations::{LEGEND, matrix, said, summary};
use super::say_wrote;
use crate::error::Error;
use crate::load::{named_parts, tell};
use crate::output::out;
use crate::report;
use crate::text::{counted, several};
use crate::watch::{Watch, go_on};

/// The most parts of which a matrix is printed, and the most pairs that are listed.
const MOST_IN_MATRIX: usize = 24;
const MOST_LISTED: usize = 50;

/// The problems of assemblies.
const OF_ASSEMBLIES: [FailOn; 3] = [FailOn::Interpenetrating, FailOn::Touching, FailOn::Near];

/// Refuses options of an assembly where none is checked.
pub fn refuse_alone(args: &CheckArgs) -> Result<(), Error> {
    let named = args
        .fail_on
        .iter()
        .find(|what| OF_ASSEMBLIES.contains(what));
    let text = match (named, args.touching) {
        (Some(what), _) => format!("--fail-on {}: only with --assembly", what.name()),
        (None, Touching::Ignore) => "--touching: only with --assembly".to_owned(),
        (None, Touching::Report) => return Ok(()),
    };
    Err(Error::Usage(text))
}

/// `impinge check --assembly`.
pub fn check(args: &CheckArgs, cancel: &CancelToken) -> Result<(), Error> {
    let of_meshes = |what: &&FailOn| !OF_ASSEMBLIES.contains(what) && **what != FailOn::Any;
    if let Some(what) = args.fail_on.iter().find(of_meshes) {
        let text = format!("--fail-on {}: not with --assembly", what.name());
        return Err(Error::Usage(text));
    }
    if args.fail_on.contains(&FailOn::Near) && args.clearance.is_none() {
        let text = "--fail-on near: --clearance D says how near";
        return Err(Error::Usage(text.to_owned()));
    }
    let (mut names, mut meshes) = (Vec::new(), Vec::new());
    for path in &args.meshes {
        go_on(cancel)?;
        for (name, mesh) in parts(path, args.meshes.len() > 1)? {
            names.push(name);
            meshes.push(mesh);
        }
    }
    if meshes.len() < 2 {
        let text = format!("--assembly: {}, where two are needed", counted(1, "part"));
        return Err(Error::Usage(text));
    }
    let options = AssemblyOptions {
        clearance: args.clearance,
        ignores_touching: args.touching == Touching::Ignore,
        threads: 0,
    };
    let shown = args.html.as_ref().map(|file| (file, meshes.clone()));
    let watch = Watch::detection(!args.no_progress, "comparing");
    let answer =
        check_assembly_with(meshes, &options, watch.control(cancel)).map_err(
            |error| match error {
                AssemblyError::Part(number, source) => Error::Refused {
                    what: names[number].clone(),
                    source,
                },
                AssemblyError::Tetrahedra(number, n) => Error::Usage(format!(
                    "{}: {}: parts are meshes of triangles",
                    printable(&names[number]),
                    several(n as u64, "tetrahedron", "tetrahedra")
                )),
                AssemblyError::Refused(source) => source.into(),
                other => Error::Usage(other.to_string()),
            },
        )?;
    drop(watch);
    if let Some((file, meshes)) = shown {
        write_assembly(&file.path, args, &names, &meshes, &answer)?;
        say_wrote(&file.path, args)?;
    }
    if args.json {
        report::print(&report(args, &names, &answer))?;
    } else {
        write!(out(), "{}", text(args, &names, &answer))?;
    }
    fail(args, &answer)
}

/// The parts of a file, with their names.
fn parts(path: &Path, are_several: bool) -> Result<Vec<(String, Mesh)>, Error> {
    let options = ReadOptions::as_they_are();
    let file = path.display().to_string();
    let has_parts = matches!(
        Format::from_path(path)?,
        Format::Gltf | Format::ThreeMf | Format::Obj
    );
    if !has_parts {
        let (mesh, summary) = read_with_summary(path, &options)?;
        tell(&file, &summary.notes());
        return Ok(vec![(file, mesh)]);
    }
    let (bodies, summary) = read_bodies(path, &options)?;
    tell(&file, &summary.notes());
    let parts = named_parts(&file, bodies, are_several);
    Ok(parts.map(|(name, part)| (name, part.mesh)).collect())
}

fn report(args: &CheckArgs, names: &[String], answer: &Assembly) -> report::Assembly {
    let parts = names.iter().zip(&answer.parts);
    let parts = parts.map(|(name, part)| report::Part {
        name: name.clone(),
        faces: part.n_faces,
        solid: part.is_solid,
    });
    let pairs = answer.pairs.iter().map(|pair| report::Parts {
        parts: pair.parts,
        relation: pair.relation.name(),
        pairs: pair.n_pairs,
        distance: pair.distance,
        point: pair.point,
    });
    let rows = matrix(answer).into_iter().map(String::from_iter);
    report::Assembly {
        clearance: args.clearance,
        touching: match args.touching {
            Touching::Report => "report",
            Touching::Ignore => "ignore",
        },
        parts: parts.collect(),
        pairs: pairs.collect(),
        matrix: rows.collect(),
    }
}

fn text(args: &CheckArgs, names: &[String], answer: &Assembly) -> String {
    let mut text = String::new();
    if names.len() <= MOST_IN_MATRIX {
        let width = names
            .iter()
            .map(|name| printable(name).chars().count())
            .max();
        let width = width.unwrap_or(0);
        text += &" ".repeat(width + 4);
        for number in 0..names.len() {
            text += &format!(" {number:>2}");
        }
        text += "\n";
        for (number, (name, row)) in names.iter().zip(matrix(answer)).enumerate() {
            let name = printable(name);
            text += &format!("{number:>2}  {name:<width$}");
            for letter in row {
                text += &format!("  {letter}");
            }
            text += "\n";
        }
        text += &format!("{}\n\n", LEGEND.join(", "));
    }
    for pair in answer.pairs.iter().take(MOST_LISTED) {
        let [a, b] = pair.parts.map(|part| printable(&names[part]));
        text += &format!("{}\n", said([&a, &b], pair));
    }
    if answer.pairs.len() > MOST_LISTED {
        let n = (answer.pairs.len() - MOST_LISTED) as u64;
        text += &format!("… and {} more: see --json\n", counted(n, "pair"));
    }
    text + &summary(args, answer) + "\n"
}

/// Fails if there is a pair that `--fail-on` names.
fn fail(args: &CheckArgs, answer: &Assembly) -> Result<(), Error> {
    let kind = |relation: Relation| match relation {
        Relation::Touching => FailOn::Touching,
        Relation::Near => FailOn::Near,
        _ => FailOn::Interpenetrating,
    };
    let asks = |kind: FailOn| args.fail_on.contains(&kind) || args.fail_on.contains(&FailOn::Any);
    let found: Vec<String> = OF_ASSEMBLIES
        .into_iter()
        .filter(|&what| asks(what))
        .filter_map(|what| {
            let pairs = answer.pairs.iter();
            let n = pairs.filter(|pair| kind(pair.relation) == what).count() as u64;
            let words = match what {
                FailOn::Touching => "parts that touch",
                FailOn::Near => "parts that are near",
                _ => "parts that share space",
            };
            (n > 0).then(|| format!("{} of {words}", counted(n, "pair")))
        })
        .collect();
    match found.is_empty() {
        true => Ok(()),
        false => Err(Error::CheckFailed(found.join(", "))),
    }
}
