//! Steps tile by tile compared with the oracle on the whole: rows, times and hash, on lattices
//! where everything touches.

use std::path::PathBuf;

use impinge::{PairKind, Precision, Start};
use impinge_io::{Cell, Elements, Mesh, Positions, Table, TableFormat, Weld, impact_columns};

use super::made::{Random, answer, cells, lattice, moved, plan, run, scatter, step_oracle, write};
use super::refusals::{npy, soup};
use crate::{Ask, Cells, Error, Merged, Plan, PlanOptions};

fn files(folder: &std::path::Path, bodies: &[[Mesh; 2]]) -> Vec<PathBuf> {
    let named = bodies.iter().enumerate().flat_map(|(ix, [start, end])| {
        [(format!("body{ix}-0"), start), (format!("body{ix}-1"), end)]
    });
    named
        .map(|(name, mesh)| write(folder, &name, mesh))
        .collect()
}

fn body(random: &mut Random, n: usize, is_solid: bool, is_f64: bool) -> [Mesh; 2] {
    let mut start = lattice(random, n, is_solid, is_f64);
    let mut end = moved(random, &start);
    // Some vertices go with another one.
    for vertex in 0..start.n_vertices() {
        if random.chance(4) {
            let other = random.below(start.n_vertices() as u32) as usize;
            for mesh in [&mut start, &mut end] {
                match &mut mesh.positions {
                    Positions::F32(positions) => positions[vertex] = positions[other],
                    Positions::F64(positions) => positions[vertex] = positions[other],
                }
            }
        }
    }
    [start, end]
}

/// How many vertices are where another one is, both at the start and at the end.
fn n_coincident([start, end]: &[Mesh; 2]) -> usize {
    let [start, end] = [start, end].map(|mesh| Weld::by_position(&mesh.positions));
    start.and(&end).n_welded()
}

/// Compares everything that merging says with the oracle.
fn compare(
    merged: &Merged,
    bodies: &[[Mesh; 2]],
    options: &PlanOptions,
    ask: Ask,
    what: &str,
) -> [usize; 3] {
    let impacts = step_oracle(bodies, options, ask);
    let rows: Vec<_> = impacts
        .iter()
        .map(|impact| (impact.kind, impact.row(), impact.toi))
        .collect();
    let table = Table::new(
        TableFormat::Npy,
        impact_columns(ask.precision == Precision::F64),
    );
    let mut expected = table.header(Some(rows.len() as u64));
    for &(kind, row, toi) in &rows {
        let cells = Cell::impact(kind.name(), row, toi);
        table.row(&mut expected, &cells).unwrap();
    }
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
    let n_at_start = impacts.iter().filter(|impact| impact.at_start).count();
    assert_eq!(step.touching_at_start, n_at_start as u64);
    let earliest = impacts.earliest();
    let earliest = earliest.map(|impact| (impact.kind, impact.row(), impact.toi));
    assert_eq!(step.earliest, earliest, "{what}");
    [
        impacts.of(kinds[0]).len(),
        impacts.of(kinds[1]).len(),
        n_at_start,
    ]
}

#[test]
fn tiles_have_the_impacts_of_the_whole() {
    let mut random = Random(11);
    let (mut found, mut n_copies, mut n_uncut) = ([0; 3], 0, 0);
    let (mut n_welded, mut n_separate) = (0, 0);
    for scene in 0..160 {
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
            precision: [Precision::F32, Precision::F64][random.below(2) as usize],
            ..Ask::default()
        };
        let unit = if is_f64 { 1.0 / 3.0 } else { 0.25 };
        let cuts = cells(&mut random, unit);
        let options = PlanOptions {
            // Sometimes so small that tiles are split into pieces.
            cap: if random.chance(3) { 7 } else { 1000 },
            chunk: 1 + u64::from(random.below(20)),
            cells: random.chance(8).then(Cells::whole).or(Some(cuts)),
            step: true,
            weld: random.chance(2),
            // None; exactly the distance of neighbours on the lattice; less than that; more than a
            // cell.
            separation: [0.0, unit, 0.1, 3.0 * unit][random.below(4) as usize],
            ..PlanOptions::default()
        };
        let files = files(folder.path(), &bodies);
        let merged = answer(&folder.path().join("tiles"), &files, &options, ask).unwrap();
        let what = format!("scene {scene}: {ask:?}, {options:?}");
        let n = compare(&merged, &bodies, &options, ask, &what);
        found = [0, 1, 2].map(|ix| found[ix] + n[ix]);
        let n_given: usize = bodies.iter().map(|[start, _]| start.n_elements()).sum();
        n_copies += merged.n_records as usize - n_given;
        n_uncut += merged.n_uncut;
        n_separate += n[2] * usize::from(options.separation > 0.0);
        n_welded += usize::from(options.weld) * bodies.iter().map(n_coincident).sum::<usize>();
    }
    // The test had both kinds, contacts at the start, elements in several tiles, and pieces.
    assert!(found.iter().all(|&n| n > 1_000), "{found:?}");
    assert!(n_copies > 1_000 && n_uncut > 20, "{n_copies}, {n_uncut}");
    assert!(
        n_welded > 50 && n_separate > 1_000,
        "{n_welded}, {n_separate}"
    );
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
        compare(
            &merged,
            &bodies,
            &options,
            Ask::default(),
            &format!("cap {cap}"),
        );
    }
}

#[test]
fn soups_are_welded_as_a_whole() {
    let mut random = Random(14);
    let folder = tempfile::tempdir().unwrap();
    let triangles = body(&mut random, 60, false, false).map(|mesh| soup(&mesh));
    let files: Vec<PathBuf> = (0..2)
        .map(|pose| {
            let path = folder.path().join(format!("soup-{pose}.npy"));
            std::fs::write(&path, npy(&triangles[pose])).unwrap();
            path
        })
        .collect();
    // Each corner is a vertex of its own.
    let meshes = triangles.map(|triangles| Mesh {
        elements: Elements::Triangles(
            (0..triangles.len() as u32)
                .map(|ix| [3 * ix, 3 * ix + 1, 3 * ix + 2])
                .collect(),
        ),
        positions: Positions::F32(triangles.into_flattened()),
    });
    let mut n_pairs = Vec::new();
    for weld in [true, false] {
        let options = PlanOptions {
            cap: 20,
            chunk: 16,
            step: true,
            weld,
            ..PlanOptions::default()
        };
        let tiles = folder.path().join(format!("tiles-{weld}"));
        let merged = answer(&tiles, &files, &options, Ask::default()).unwrap();
        let bodies = [meshes.clone()];
        compare(&merged, &bodies, &options, Ask::default(), "soup");
        n_pairs.push(merged.n_pairs);
    }
    assert!(
        n_pairs[0] > 100 && n_pairs[1] > 2 * n_pairs[0],
        "{n_pairs:?}"
    );
}

#[test]
fn a_separation_belongs_to_the_plan() {
    let mut random = Random(15);
    let folder = tempfile::tempdir().unwrap();
    let files = files(folder.path(), &[body(&mut random, 20, false, false)]);
    let tiles = folder.path().join("tiles");
    let step = |separation| PlanOptions {
        step: true,
        separation,
        ..PlanOptions::default()
    };
    for separation in [0.1, 1.0 / 3.0, f64::MIN_POSITIVE, 0.0, -0.0] {
        let options = PlanOptions {
            replace: true,
            ..step(separation)
        };
        let made = plan(&tiles, &files, &options).unwrap();
        assert_eq!(Plan::open(&tiles).unwrap(), made);
        assert_eq!(made.separation(), separation);
    }
    let without = plan(&tiles, &files, &step(0.0)).unwrap();
    scatter(&without).unwrap();
    let part = std::fs::read(without.part_path(0)).unwrap();
    let other = plan(&tiles, &files, &step(0.25)).unwrap_err();
    assert!(matches!(other, Error::OtherPlan { .. }), "{other}");
    // A part of the plan without the separation lacks boxes that the separation reaches.
    let options = PlanOptions {
        replace: true,
        ..step(0.25)
    };
    let with = plan(&tiles, &files, &options).unwrap();
    scatter(&with).unwrap();
    std::fs::write(with.part_path(0), part).unwrap();
    let stale = run(&with, Ask::default()).unwrap_err();
    assert!(matches!(stale, Error::Stale { .. }), "{stale}");
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
        differ.to_string().contains("element 0 has the vertices ["),
        "{differ}"
    );
    for (separation, step, allowed) in [
        (-1.0, true, "a finite number"),
        (f64::NAN, true, "a finite number"),
        (f64::INFINITY, true, "a finite number"),
        (0.5, false, "only 0 without a step"),
    ] {
        let options = PlanOptions {
            separation,
            step,
            ..PlanOptions::default()
        };
        let refused = refusal(&files, &options, Ask::default()).to_string();
        let expected = format!("separation: {separation} given, {allowed}");
        assert!(refused.starts_with(&expected), "{refused}");
    }
    let still = PlanOptions {
        replace: true,
        ..PlanOptions::default()
    };
    let double = Ask {
        precision: Precision::F64,
        ..Ask::default()
    };
    assert!(
        refusal(&files, &still, double)
            .to_string()
            .starts_with("precision: f64 given")
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
    let changed = scatter(&made).unwrap_err();
    assert!(
        changed.to_string().contains("body0-1.ply: changed"),
        "{changed}"
    );
}
