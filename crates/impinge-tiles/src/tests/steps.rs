//! Steps tile by tile compared with the oracle on the whole: rows, times and hash, on lattices where everything touches.

use std::path::PathBuf;

use impinge::{PairKind, SharedVertex, Start, Toi};
use impinge_io::{Mesh, write_impacts_npy};

use super::made::{Random, answer, cells, lattice, moved, plan, step_oracle, write};
use crate::{Ask, Cells, Error, Merged, PlanOptions};

fn files(folder: &std::path::Path, bodies: &[[Mesh; 2]]) -> Vec<PathBuf> {
    let named = bodies.iter().enumerate().flat_map(|(ix, [start, end])| {
        [(format!("body{ix}-0"), start), (format!("body{ix}-1"), end)]
    });
    named
        .map(|(name, mesh)| write(folder, &name, mesh))
        .collect()
}

fn body(random: &mut Random, n: usize, is_solid: bool, is_f64: bool) -> [Mesh; 2] {
    let start = lattice(random, n, is_solid, is_f64);
    let end = moved(random, &start);
    [start, end]
}

/// Compares everything that merging says with the oracle.
fn compare(merged: &Merged, bodies: &[[Mesh; 2]], ask: Ask, what: &str) -> [usize; 3] {
    let impacts = step_oracle(bodies, ask);
    let rows: Vec<_> = impacts
        .iter()
        .map(|impact| (impact.kind, impact.row(), impact.toi))
        .collect();
    let named = rows.iter().map(|&(kind, row, toi)| (kind.name(), row, toi));
    let mut expected = Vec::new();
    write_impacts_npy(&mut expected, named, ask.toi == Toi::F64).unwrap();
    assert_eq!(std::fs::read(&merged.rows).unwrap(), expected, "{what}");
    assert_eq!(
        (merged.n_pairs, merged.hash),
        (rows.len() as u64, impacts.hash()),
        "{what}"
    );
    let step = merged.step.as_ref().unwrap();
    let kinds = [PairKind::VertexFace, PairKind::EdgeEdge];
    assert_eq!(
        step.kinds,
        kinds.map(|kind| (kind, impacts.of(kind).len() as u64))
    );
    assert_eq!(step.touching_at_start, impacts.touching_at_start() as u64);
    let earliest = impacts.earliest();
    let earliest = earliest.map(|impact| (impact.kind, impact.row(), impact.toi));
    assert_eq!(step.earliest, earliest, "{what}");
    [
        impacts.of(kinds[0]).len(),
        impacts.of(kinds[1]).len(),
        impacts.touching_at_start(),
    ]
}

#[test]
fn tiles_have_the_impacts_of_the_whole() {
    let mut random = Random(11);
    let (mut found, mut n_copies, mut n_uncut) = ([0; 3], 0, 0);
    for scene in 0..80 {
        let folder = tempfile::tempdir().unwrap();
        let is_f64 = random.chance(2);
        let n_bodies = 1 + random.below(3);
        let bodies: Vec<_> = (0..n_bodies)
            .map(|_| {
                let (n, is_solid) = (8 + random.below(30) as usize, random.chance(3));
                body(&mut random, n, is_solid, is_f64)
            })
            .collect();
        let (between, within) =
            [(true, true), (true, false), (false, true)][random.below(3) as usize];
        let ask = Ask {
            between,
            within,
            start: [Start::Report, Start::Skip][random.below(2) as usize],
            toi: [Toi::F32, Toi::F64][random.below(2) as usize],
            ..Ask::default()
        };
        let cuts = cells(&mut random, if is_f64 { 1.0 / 3.0 } else { 0.25 });
        let options = PlanOptions {
            // Sometimes so small that tiles are split into pieces.
            cap: if random.chance(3) { 7 } else { 1000 },
            chunk: 1 + u64::from(random.below(20)),
            cells: random.chance(8).then(Cells::whole).or(Some(cuts)),
            step: true,
            ..PlanOptions::default()
        };
        let files = files(folder.path(), &bodies);
        let merged = answer(&folder.path().join("tiles"), &files, &options, ask).unwrap();
        let what = format!("scene {scene}: {ask:?}, {options:?}");
        let n = compare(&merged, &bodies, ask, &what);
        found = [0, 1, 2].map(|ix| found[ix] + n[ix]);
        let n_given: usize = bodies.iter().map(|[start, _]| start.n_primitives()).sum();
        n_copies += merged.n_records as usize - n_given;
        n_uncut += merged.n_uncut;
    }
    // The test had both kinds, contacts at the start, primitives in several tiles, and pieces.
    assert!(found.iter().all(|&n| n > 1_000), "{found:?}");
    assert!(n_copies > 1_000 && n_uncut > 20, "{n_copies}, {n_uncut}");
}

#[test]
fn cuts_of_the_plan_have_the_impacts_of_the_whole() {
    let mut random = Random(12);
    for (cap, start_is_f64) in [(4, false), (12, true), (40, false)] {
        let folder = tempfile::tempdir().unwrap();
        let mut bodies = [
            body(&mut random, 70, false, false),
            body(&mut random, 50, true, false),
        ];
        if start_is_f64 {
            // The two files of a body may differ in precision.
            bodies[0][0].positions = impinge_io::Positions::F64(bodies[0][0].positions.to_f64());
        }
        let options = PlanOptions {
            cap,
            chunk: 32,
            step: true,
            ..PlanOptions::default()
        };
        let files = files(folder.path(), &bodies);
        let tiles = folder.path().join("tiles");
        let merged = answer(&tiles, &files, &options, Ask::default()).unwrap();
        bodies[0][0].positions.narrow_if_exact();
        compare(&merged, &bodies, Ask::default(), &format!("cap {cap}"));
    }
}

#[test]
fn what_is_no_step_is_refused_by_name() {
    let mut random = Random(13);
    let folder = tempfile::tempdir().unwrap();
    let bodies = [
        body(&mut random, 20, false, false),
        body(&mut random, 20, false, false),
    ];
    let files = files(folder.path(), &bodies);
    let step = PlanOptions {
        step: true,
        ..PlanOptions::default()
    };
    let tiles = folder.path().join("tiles");
    let refusal = |files: &[PathBuf], options: &PlanOptions, ask: Ask| -> Error {
        answer(&tiles, files, options, ask).unwrap_err()
    };
    let alone = refusal(&files[..3], &step, Ask::default());
    assert!(
        alone.to_string().contains("body1-0.ply without an end"),
        "{alone}"
    );
    let other = [files[0].clone(), files[3].clone()];
    let differ = refusal(&other, &step, Ask::default());
    assert!(matches!(differ, Error::Ends { .. }), "{differ}");
    assert!(
        differ
            .to_string()
            .contains("primitive 0 has the vertices ["),
        "{differ}"
    );
    let weld = PlanOptions {
        weld: true,
        ..step.clone()
    };
    assert!(
        refusal(&files, &weld, Ask::default())
            .to_string()
            .starts_with("weld: a step given")
    );
    let resolve = Ask {
        shared_vertex: SharedVertex::Resolve,
        ..Ask::default()
    };
    assert!(
        refusal(&files, &step, resolve)
            .to_string()
            .starts_with("shared_vertex: resolve")
    );
    let still = PlanOptions {
        replace: true,
        ..PlanOptions::default()
    };
    let double = Ask {
        toi: Toi::F64,
        ..Ask::default()
    };
    assert!(
        refusal(&files, &still, double)
            .to_string()
            .starts_with("toi: f64 given")
    );
    // An end that changes after the plan is noticed, and so is a list of names that is missing.
    let mut other_end = bodies[0][1].clone();
    if let impinge_io::Positions::F32(positions) = &mut other_end.positions {
        positions[0][0] += 8.0;
    }
    let replaced = PlanOptions {
        replace: true,
        ..step.clone()
    };
    answer(&tiles, &files, &replaced, Ask::default()).unwrap();
    let made = plan(&tiles, &files, &step).unwrap();
    std::fs::remove_file(made.names_path(0)).unwrap();
    assert!(matches!(made.merge(), Err(Error::Missing { .. })));
    write(folder.path(), "body0-1", &other_end);
    std::fs::remove_file(made.part_path(0)).unwrap();
    let changed = super::made::scatter(&made).unwrap_err();
    assert!(
        changed.to_string().contains("body0-1.ply: changed"),
        "{changed}"
    );
}
