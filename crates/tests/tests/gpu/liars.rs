//! Proof that the comparison with the oracle can fail: the GPU's answers are falsified, and its
//! kernels damaged.

use crate::caller::Caller;

use impinge_core::{Backend, Detector, Method, Query, Scene, Settings, SharedVertex, hash_rows};
use impinge_scenes::{soup, surfaces};
use impinge_tests::{Case, agree, cases, naive, rows};

#[test]
fn answers_tampered_with_are_caught() {
    let case = cases().swap_remove(0);
    let truth = naive(&case);
    let mut detector = Detector::new(Backend::Gpu).unwrap();
    let pairs = detector.detect(&case.scene, &case.query).unwrap();
    let answer = rows(&pairs);
    assert!(answer.len() > 10);
    assert_eq!(agree(&truth, &answer, pairs.hash()), Ok(()));
    type Lie = fn(&mut Vec<[u32; 4]>);
    let lies: [(&str, Lie); 4] = [
        ("drops a pair", |rows| rows.truncate(rows.len() - 1)),
        ("repeats a pair", |rows| rows.insert(4, rows[4])),
        ("repeats one for another", |rows| rows[4] = rows[5]),
        ("swaps elements", |rows| rows[3].swap(1, 3)),
    ];
    for (lie, tell) in lies {
        let mut told = answer.clone();
        tell(&mut told);
        let hash = hash_rows(told.iter().copied());
        assert!(agree(&truth, &told, hash).is_err(), "{lie}");
        // The true hash does not hide the lie.
        assert!(agree(&truth, &told, pairs.hash()).is_err(), "{lie}");
    }
}

/// A kernel, a line of it, and the replacement.
type Damage = (&'static str, &'static str, &'static str);

const HARMLESS: Damage = (
    "narrow",
    "let between = b.p - a.p;",
    "let between = b.p - a.p; ",
);

const OF_BOTH: &[Damage] = &[
    (
        "bounds_clusters",
        "high = max(high, highs[ix]);",
        "high = highs[ix];",
    ),
    (
        "bounds_top",
        "high = max(high, nodes[child].high);",
        "high = nodes[child].high;",
    ),
    (
        "narrow",
        "if low > 0 || high < 0 {",
        "if low > 0 || high > 0 {",
    ),
    (
        "narrow",
        "if low < 0 && high > 0 {",
        "if low < 0 && high > 0 { if low < 0 { return NO; }",
    ),
    (
        "narrow",
        "let a = number_at(candidate.a & ~FLAG);",
        "let a = candidate.a & ~FLAG;",
    ),
    (
        "narrow",
        "atomicAdd(&counters[counter], n);",
        "atomicAdd(&counters[counter], n - 1u);",
    ),
    (
        "narrow",
        "parted |= all((*by).faces[k] == vec4<i32>(-1));",
        "parted |= all((*by).faces[k] == vec4<i32>(1));",
    ),
    (
        "prepare",
        "n / per_group + select(0u, 1u, n % per_group != 0u);",
        "n / per_group;",
    ),
];

const OF_CLUSTERS: &[Damage] = &[
    (
        "narrow",
        "return select(NO, YES, a_q != b_q);",
        "return select(YES, NO, a_q != b_q);",
    ),
    (
        "narrow",
        "if b_q * b_r > 0 || a_q * a_r > 0 {",
        "if b_q * b_r > 0 || a_q * a_r < 0 {",
    ),
    (
        "narrow",
        "if sign != 0 {",
        "if sign != 0 { if sign != 2 { return YES; }",
    ),
    (
        "narrow",
        "return min(min(x, y), z) > above || max(max(x, y), z) < below;",
        "return max(max(x, y), z) > above || min(min(x, y), z) < below;",
    ),
    ("traversal", "&& !is_ignored(min(a, b), max(a, b))", ""),
    (
        "traversal",
        "found.a == found.b || extents_meet(node_extent(found.a), node_extent(found.b));",
        "found.a != found.b && extents_meet(node_extent(found.a), node_extent(found.b));",
    ),
    ("traversal", "i <= j && j < n_a", "j < n_a"),
    ("pairing", "walked &= after;", ""),
    ("pairing", "any(a == b.yzwx)", "false"),
    (
        "pairing",
        "return extents_meet(own, others);",
        "return extents_meet(own, others) && lane != 7u;",
    ),
    ("pairing", "first_partner + 32u", "first_partner + 31u"),
];

const OF_CELLS: &[Damage] = &[
    (
        "bounds_keep",
        "is_kept = overlap(own, reach);",
        "is_kept = overlap(own, reach) && lane != 7u;",
    ),
    (
        "bounds_reach",
        "found.high = max(found.high, min(mine.high, theirs.high));",
        "found.high = min(mine.high, theirs.high);",
    ),
    (
        "grid_ranges",
        "let high = max(cells(values(kept[ix].high), MARGIN), low);",
        "let high = low;",
    ),
    (
        "grid_count",
        "let high = fine >> (shift + vec3<u32>(16u));",
        "let high = low;",
    ),
    ("traversal_cells", "column = row;", "column = row + 1u;"),
    (
        "traversal_scatter",
        "entries[at] = ix;",
        "entries[at] = ix ^ 1u;",
    ),
    (
        "pairing_cells",
        "return all(low >> vec3<u32>(2u) == cell);",
        "return true;",
    ),
    ("pairing_cells", "(y & 2u) << 3u", "(y & 2u) << 2u"),
    (
        "pairing_cells",
        "partners |= membership[32u + firstTrailingBit(rest)];",
        "",
    ),
    ("traversal_tile", "row <= column", "row < column"),
];

fn questions() -> Vec<(Case, Vec<[u32; 4]>)> {
    let ball = surfaces::bumpy_ball(1500, 0.2);
    let mut scene = Scene::new();
    let a = ball.add_to(&mut scene).unwrap();
    let b = ball.translated([0.3, 0.1, 0.2]).add_to(&mut scene).unwrap();
    soup::tetrahedra(200, 0.3, 3).add_to(&mut scene).unwrap();
    soup::lattice_web(300, 4, 9).add_to(&mut scene).unwrap();
    soup::lattice_web_tetrahedra(300, 3, 10)
        .add_to(&mut scene)
        .unwrap();
    // So many bodies that the kernels, not the host, walk the tree over bodies.
    let mut cubes = Scene::new();
    let ids: Vec<_> = (0..300u32)
        .map(|ix| {
            let corner = [ix % 7, ix / 7 % 7, ix / 49].map(|k| 0.8 * k as f32);
            surfaces::cube(corner, 1.0).add_to(&mut cubes).unwrap()
        })
        .collect();
    let of_cubes = Query::all().exclude((ids[0], ids[1]));
    let of_scene = [
        Query::between(a, b),
        Query::all().shared_vertex(SharedVertex::Skip),
        Query::all(),
    ];
    let asked = of_scene.map(|query| (&scene, query)).into_iter();
    asked
        .chain([(&cubes, of_cubes)])
        .map(|(scene, query)| {
            let case = Case {
                name: format!("{query:?}"),
                scene: scene.clone(),
                query,
            };
            let truth = naive(&case);
            assert!(truth.len() > 100);
            (case, truth)
        })
        .collect()
}

/// Whether a damaged backend answers a question wrongly or not at all.
fn is_caught(settings: &Settings, damage: Damage, questions: &[(Case, Vec<[u32; 4]>)]) -> bool {
    let mut detector = Caller::new().damaged(settings.clone(), damage);
    questions.iter().any(|(case, truth)| {
        let pairs = detector.detect(&case.scene, &case.query);
        pairs.is_err()
            || pairs.is_ok_and(|pairs| agree(truth, &rows(&pairs), pairs.hash()).is_err())
    })
}

fn assert_all_are_caught(
    settings: &Settings,
    damages: &[Damage],
    questions: &[(Case, Vec<[u32; 4]>)],
) {
    assert!(!is_caught(settings, HARMLESS, questions));
    let is_unnoticed = |&&damage: &&Damage| !is_caught(settings, damage, questions);
    let unnoticed: Vec<_> = damages.iter().filter(is_unnoticed).collect();
    assert!(unnoticed.is_empty(), "{unnoticed:#?}");
}

#[test]
fn damaged_kernels_of_clusters_are_caught() {
    let settings = Settings::default();
    let damages = [OF_BOTH, OF_CLUSTERS].concat();
    assert_all_are_caught(&settings, &damages, &questions());
}

#[test]
fn damaged_kernels_of_cells_are_caught() {
    let settings = Settings::new().method(Method::Cells);
    let (of_tiles, of_cells) = OF_CELLS.split_last().unwrap();
    let questions = questions();
    assert_all_are_caught(&settings, of_cells, &questions);
    // One cell, processed in tiles.
    let crowded = settings.density(1e-9).group_size(10);
    assert_all_are_caught(&crowded, &[*of_tiles], &questions[1..2]);
}
