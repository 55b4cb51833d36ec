//! Tiles compared with the oracle on lattices, where everything touches: any cuts, both precisions,
//! both adjacency rules, triangles and tetrahedra. One test shows that wrong comparisons would be
//! noticed.

use std::collections::BTreeMap;

use impinge::SharedVertex;

use super::made::{Random, answer, cells, lattice, oracle, oracle_as_given, rows, write};
use crate::cells::{Bounds, Cells, HalfOpen, Rule, owner_point};
use crate::{Ask, PlanOptions};

#[test]
fn tiles_have_the_rows_of_the_whole() {
    let mut random = Random(1);
    let (mut n_pairs, mut n_copies) = (0, 0);
    for scene in 0..120 {
        let folder = tempfile::tempdir().unwrap();
        let is_f64 = random.chance(2);
        let n_bodies = 1 + random.below(3);
        let meshes: Vec<_> = (0..n_bodies)
            .map(|_| {
                let (n, is_solid) = (10 + random.below(60) as usize, random.chance(3));
                lattice(&mut random, n, is_solid, is_f64)
            })
            .collect();
        let files: Vec<_> = meshes
            .iter()
            .enumerate()
            .map(|(ix, mesh)| write(folder.path(), &format!("body{ix}"), mesh))
            .collect();
        let (between, within) =
            [(true, true), (true, false), (false, true)][random.below(3) as usize];
        let shared_vertex = [SharedVertex::Skip, SharedVertex::Resolve][random.below(2) as usize];
        let ask = Ask {
            between,
            within,
            shared_vertex,
            ..Ask::default()
        };
        let cuts = cells(&mut random, if is_f64 { 1.0 / 3.0 } else { 0.25 });
        let options = PlanOptions {
            // Sometimes so small that tiles are split into pieces.
            cap: if random.chance(3) { 7 } else { 1000 },
            chunk: 1 + u64::from(random.below(20)),
            cells: random.chance(8).then(Cells::whole).or(Some(cuts)),
            weld: random.chance(2),
            ..PlanOptions::default()
        };
        let merged = answer(&folder.path().join("tiles"), &files, &options, ask).unwrap();
        let (expected, hash) = match options.weld {
            true => oracle(&meshes, ask),
            false => oracle_as_given(&meshes, ask),
        };
        assert_eq!(
            rows(&merged),
            expected,
            "scene {scene}: {ask:?}, {options:?}"
        );
        assert_eq!(merged.hash, hash);
        n_pairs += expected.len();
        n_copies +=
            merged.n_records as usize - meshes.iter().map(|mesh| mesh.n_elements()).sum::<usize>();
    }
    // The test had pairs, and elements in several tiles.
    assert!(
        n_pairs > 5_000 && n_copies > 1_000,
        "{n_pairs} pairs, {n_copies} copies"
    );
}

#[test]
fn cuts_of_the_plan_have_the_rows_of_the_whole() {
    let mut random = Random(2);
    for cap in [3, 10, 30] {
        let folder = tempfile::tempdir().unwrap();
        let meshes = [
            lattice(&mut random, 150, false, false),
            lattice(&mut random, 100, true, false),
        ];
        let files = [
            write(folder.path(), "a", &meshes[0]),
            write(folder.path(), "b", &meshes[1]),
        ];
        let options = PlanOptions {
            cap,
            chunk: 64,
            ..PlanOptions::default()
        };
        let merged = answer(
            &folder.path().join("tiles"),
            &files,
            &options,
            Ask::default(),
        )
        .unwrap();
        let (expected, hash) = oracle(&meshes, Ask::default());
        assert_eq!((rows(&merged), merged.hash), (expected, hash));
    }
}

#[test]
fn a_pile_that_no_cut_parts_falls_apart_into_pieces() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(3);
    let mut mesh = lattice(&mut random, 90, false, false);
    // All boxes are the same.
    if let impinge_io::Positions::F32(positions) = &mut mesh.positions {
        positions[0] = [-9.0; 3];
        positions[1] = [9.0; 3];
    }
    if let impinge_io::Elements::Triangles(faces) = &mut mesh.elements {
        for face in faces {
            (face[0], face[1]) = (0, 1);
        }
    }
    let file = write(folder.path(), "pile", &mesh);
    let ask = Ask {
        shared_vertex: SharedVertex::Resolve,
        ..Ask::default()
    };
    let options = PlanOptions {
        cap: 8,
        ..PlanOptions::default()
    };
    let merged = answer(&folder.path().join("tiles"), &[file], &options, ask).unwrap();
    assert_eq!((merged.n_uncut, merged.n_records), (1, 90));
    let (expected, hash) = oracle(&[mesh], ask);
    assert_eq!((rows(&merged), merged.hash), (expected, hash));
}

/// For boxes on a lattice: how many pairs with gaps of at most the separation the tiles of a rule
/// miss, and how many pairs they find more than once.
fn found<R: Rule>(seed: u64, separation: f64) -> (usize, usize) {
    let mut random = Random(seed);
    let (mut n_lost, mut n_twice) = (0, 0);
    for _ in 0..40 {
        let cells = cells(&mut random, 1.0);
        let boxes: Vec<Bounds> = (0..40)
            .map(|_| {
                let lo: [f64; 3] = std::array::from_fn(|_| f64::from(random.below(10)));
                (lo, lo.map(|x| x + f64::from(random.below(4))))
            })
            .collect();
        let mut tiles: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (ix, bounds) in boxes.iter().enumerate() {
            cells.route::<R>(bounds, separation, |tile| {
                tiles.entry(tile).or_default().push(ix)
            });
        }
        let mut times: BTreeMap<(usize, usize), usize> = BTreeMap::new();
        for (&tile, members) in &tiles {
            for &a in members {
                for &b in members.iter().filter(|&&b| a < b) {
                    if cells.owner_by::<R>(owner_point(&boxes[a].0, &boxes[b].0)) == tile {
                        *times.entry((a, b)).or_default() += 1;
                    }
                }
            }
        }
        for a in 0..boxes.len() {
            for b in a + 1..boxes.len() {
                let meet = (0..3).all(|axis| {
                    boxes[a].0[axis] - boxes[b].1[axis] <= separation
                        && boxes[b].0[axis] - boxes[a].1[axis] <= separation
                });
                let n = times.get(&(a, b)).copied().unwrap_or(0);
                n_lost += usize::from(meet && n == 0);
                n_twice += usize::from(n > 1);
            }
        }
    }
    (n_lost, n_twice)
}

macro_rules! spoiled {
    ($name:ident, $low:expr, $high:expr, $lies:expr) => {
        struct $name;
        impl Rule for $name {
            fn goes_low(lo: f64, cut: f64) -> bool {
                $low(lo, cut)
            }
            fn goes_high(hi: f64, cut: f64) -> bool {
                $high(hi, cut)
            }
            fn lies_low(x: f64, cut: f64) -> bool {
                $lies(x, cut)
            }
        }
    };
}

fn lt(a: f64, b: f64) -> bool {
    a < b
}
fn le(a: f64, b: f64) -> bool {
    a <= b
}
fn gt(a: f64, b: f64) -> bool {
    a > b
}
fn ge(a: f64, b: f64) -> bool {
    a >= b
}

spoiled!(HighIsOpen, lt, gt, lt);
spoiled!(PointsOnCutsAreLow, lt, ge, le);

#[test]
fn every_pair_is_found_once_and_wrong_comparisons_are_noticed() {
    for seed in 10..20 {
        for separation in [0.0, 1.0, 2.5] {
            assert_eq!(found::<HalfOpen>(seed, separation), (0, 0));
            assert!(found::<HighIsOpen>(seed, separation).0 > 0 || separation.fract() > 0.0);
            assert!(found::<PointsOnCutsAreLow>(seed, separation).0 > 0);
        }
        assert!(found::<NotInflated>(seed, 1.0).0 > 0);
        assert!(found::<HalfInflated>(seed, 1.0).0 > 0);
    }
}

/// Boxes reach only as far as without a separation.
struct NotInflated;

impl Rule for NotInflated {
    fn goes_low(lo: f64, cut: f64) -> bool {
        lt(lo, cut)
    }
    fn goes_high(hi: f64, cut: f64) -> bool {
        ge(hi, cut)
    }
    fn lies_low(x: f64, cut: f64) -> bool {
        lt(x, cut)
    }
    fn reach(hi: f64, _: f64) -> f64 {
        hi
    }
}

/// As if both boxes were inflated by half the separation: then the owner point of the boxes as they
/// are can lie outside.
struct HalfInflated;

impl Rule for HalfInflated {
    fn goes_low(lo: f64, cut: f64) -> bool {
        lt(lo, cut)
    }
    fn goes_high(hi: f64, cut: f64) -> bool {
        ge(hi, cut)
    }
    fn lies_low(x: f64, cut: f64) -> bool {
        lt(x, cut)
    }
    fn reach(hi: f64, separation: f64) -> f64 {
        hi + separation / 2.0
    }
}

#[test]
fn a_sum_that_rounds_down_still_reaches_the_owner_point() {
    // The boxes of two vertices whose distance is exactly the separation, or as near to it as
    // numbers allow.
    let mut random = Random(8);
    let mut n_rounded = 0;
    for _ in 0..100_000 {
        let mut real = || (f64::from(random.below(1 << 30)) + 1.0).powi(3) * 1e-27;
        let (hi, separation) = (real(), real());
        // The largest number whose distance from `hi` is at most the separation, as real numbers.
        let mut owner = (hi + separation).next_up();
        while difference_exceeds(owner, hi, separation) {
            owner = owner.next_down();
        }
        n_rounded += usize::from(owner != hi + separation);
        let mut cells = Cells::whole();
        let high = cells.cut(0, 0, owner);
        let mut touched = Vec::new();
        let bounds = ([0.0; 3], [hi, 0.0, 0.0]);
        cells.route::<HalfOpen>(&bounds, separation, |tile| touched.push(tile));
        assert!(touched.contains(&high), "{hi:e} {separation:e}");
    }
    assert!(n_rounded > 1_000, "{n_rounded}");
}

/// Whether `a - b` exceeds `c` as real numbers, all three positive and `a` the largest: `a - b` is
/// split into a rounded difference and its error.
fn difference_exceeds(a: f64, b: f64, c: f64) -> bool {
    let difference = a - b;
    let back = a - difference;
    let error = (a - (difference + back)) + (back - b);
    (difference - c) + error > 0.0
}

#[test]
fn cells_survive_json_and_nonsense_does_not() {
    let mut random = Random(5);
    for _ in 0..50 {
        let cells = cells(&mut random, 0.1);
        assert_eq!(Cells::from_json(&cells.to_json()), Some(cells));
    }
    for text in [
        "[]",
        "{}",
        "[{\"tile\": 1}]",
        "[{\"tile\": 0}, {\"tile\": 0}]",
        "[{\"axis\": 0, \"cut_bits\": \"0\", \"low\": 0, \"high\": 0}]",
        "[{\"axis\": 3, \"cut_bits\": \"0\", \"low\": 1, \"high\": 2}, {\"tile\": 0}, {\"tile\": 1}]",
        "[{\"axis\": 0, \"cut_bits\": \"7ff0000000000000\", \"low\": 1, \"high\": 2}, {\"tile\": 0}, {\"tile\": 1}]",
    ] {
        assert_eq!(
            Cells::from_json(&serde_json::from_str(text).unwrap()),
            None,
            "{text}"
        );
    }
}
