//! Cases of two bodies, and their correct answers.

#![allow(dead_code)]

use std::collections::BTreeMap;

use impinge_baseline::duplicates::Checks;
use impinge_core::{Backend, BodyId, Detector, Method, Query, Scene, Settings};
use impinge_scenes::{Model, adversarial, soup, surfaces};

/// Two bodies of a scene.
pub struct Case {
    pub name: String,
    pub scene: Scene,
    pub a: BodyId,
    pub b: BodyId,
}

impl Case {
    pub fn new(name: &str, a: &Model, b: &Model, double: bool) -> Self {
        let mut scene = Scene::new();
        let add = |scene: &mut Scene, model: &Model| {
            let elements = model.elements.clone();
            if double {
                scene.add((elements, model.positions_f64())).unwrap()
            } else {
                scene.add((elements, model.positions.clone())).unwrap()
            }
        };
        let (a, b) = (add(&mut scene, a), add(&mut scene, b));
        Case {
            name: name.to_owned(),
            scene,
            a,
            b,
        }
    }

    pub fn query(&self) -> Query {
        Query::between(self.a, self.b)
    }
}

/// The answer of the oracle.
pub fn oracle(case: &Case) -> Vec<[u32; 4]> {
    let mut detector =
        Detector::new(Settings::new().method(Method::Naive).backend(Backend::Cpu)).unwrap();
    let pairs = detector.detect(&case.scene, &case.query()).unwrap();
    pairs.rows().collect()
}

/// Every kind of element, both precisions, lattices, and small adversarial scenes.
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    let ball = surfaces::bumpy_ball(1200, 0.2);
    let torus = surfaces::torus(30, 20, 1.0, 0.4).translated([0.3, 0.1, 0.2]);
    let empty = soup::triangles(0, 1.0, 1);
    for double in [false, true] {
        let far = ball.translated([9.0, 0.0, 0.0]);
        cases.push(Case::new("ball and torus", &ball, &torus, double));
        cases.push(Case::new("torus and ball", &torus, &ball, double));
        cases.push(Case::new("coincident", &ball, &ball, double));
        cases.push(Case::new("disjoint", &ball, &far, double));
        cases.push(Case::new("empty", &ball, &empty, double));
        for (n, k) in [(1, 1), (7, 1), (65, 2), (130, 4)] {
            let a = soup::lattice_triangles(n, k, 1);
            let b = soup::lattice_triangles(n + 3, k, 2);
            let t = soup::lattice_tetrahedra(n, k, 3);
            let u = soup::lattice_tetrahedra(n + 3, k, 4);
            for (kinds, a, b) in [
                ("triangles", &a, &b),
                ("tetrahedra", &t, &u),
                ("mixed", &a, &u),
            ] {
                let name = format!("lattice {kinds} {n} in {k}");
                cases.push(Case::new(&name, a, b, double));
            }
        }
        let (a, b) = (soup::triangles(700, 0.2, 5), soup::triangles(700, 0.2, 6));
        cases.push(Case::new("soup", &a, &b, double));
    }
    for built in [
        adversarial::plain(500),
        adversarial::huge_over_small(500),
        adversarial::stadium(500),
        adversarial::one_cell(400),
        adversarial::one_point(150),
        adversarial::flat_cloth(500),
        adversarial::needle_row(400),
        adversarial::coincident(400),
        adversarial::outliers(400),
        adversarial::mixed_sizes(900),
        adversarial::slivers(300),
        adversarial::stacked_cubes(60),
        adversarial::chessboard(60),
    ] {
        let built = built.unwrap();
        let [a, b, ..] = built.bodies[..] else {
            continue;
        };
        cases.push(Case {
            name: built.name,
            scene: built.scene,
            a,
            b,
        });
    }
    cases
}

/// How often each pair of f32 bodies is tested, by brute force: for each pair, the number of coarse
/// cells (by the paper's equations 1 to 3) that hold a common sub-cell.
pub fn brute_checks(case: &Case, lambda: f64, boxes: bool) -> Checks {
    type Box = [[f32; 3]; 2];
    let elements = |id: BodyId| -> Vec<Box> {
        let body = case.scene.body(id).unwrap();
        let of = |ix: usize| {
            let points = body.elements().corners(ix).iter();
            let mut found = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
            for &corner in points {
                for (axis, x) in body
                    .positions()
                    .point(corner as usize)
                    .into_iter()
                    .enumerate()
                {
                    found[0][axis] = found[0][axis].min(x as f32);
                    found[1][axis] = found[1][axis].max(x as f32);
                }
            }
            found
        };
        (0..body.n_elements()).map(of).collect()
    };
    let overlap = |a: &Box, b: &Box| (0..3).all(|k| a[0][k] <= b[1][k] && b[0][k] <= a[1][k]);
    let (a, b) = (elements(case.a), elements(case.b));
    let whole = |boxes: &[Box]| {
        boxes.iter().fold(boxes[0], |mut all, next| {
            for axis in 0..3 {
                all[0][axis] = all[0][axis].min(next[0][axis]);
                all[1][axis] = all[1][axis].max(next[1][axis]);
            }
            all
        })
    };
    let (of_a, of_b) = (whole(&a), whole(&b));
    let region: Box = [
        std::array::from_fn(|k| of_a[0][k].max(of_b[0][k])),
        std::array::from_fn(|k| of_a[1][k].min(of_b[1][k])),
    ];
    let reach = |boxes: Vec<Box>| -> Vec<Box> {
        boxes.into_iter().filter(|x| overlap(x, &region)).collect()
    };
    let (a, b) = (reach(a), reach(b));
    let extent: [f64; 3] =
        std::array::from_fn(|k| f64::from(region[1][k]) - f64::from(region[0][k]));
    let density = (lambda * (a.len() + b.len()) as f64 / extent.iter().product::<f64>()).cbrt();
    let resolution = extent.map(|extent| (extent * density) as u32);
    assert!(
        resolution.iter().all(|&along| along > 0),
        "not a flat region"
    );
    let fine = |point: &[f32; 3], axis: usize| {
        let scale = (4 * resolution[axis]) as f32 / (region[1][axis] - region[0][axis]);
        let at = ((point[axis] - region[0][axis]) * scale).floor();
        (at as u32).min(4 * resolution[axis] - 1)
    };
    let mut times = BTreeMap::new();
    for (i, a) in a.iter().enumerate() {
        for (j, b) in b.iter().enumerate() {
            // The common sub-cells form a block, and so do the cells that hold any of them.
            let mut n_cells = 1u64;
            for axis in 0..3 {
                let low = fine(&a[0], axis).max(fine(&b[0], axis));
                let high = fine(&a[1], axis).min(fine(&b[1], axis));
                n_cells *= match low <= high {
                    true => u64::from(high / 4 - low / 4 + 1),
                    false => 0,
                };
            }
            if n_cells > 0 && (!boxes || overlap(a, b)) {
                times.insert((i, j), n_cells);
            }
        }
    }
    Checks {
        n_tests: times.values().sum(),
        n_pairs: times.len() as u64,
        n_repeated: times.values().filter(|&&n| n > 1).count() as u64,
    }
}
