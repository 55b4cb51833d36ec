//! One list of cases and one way to compare answers, for every method and backend.

use impinge_core::{
    Backend, BodyId, Detector, InstructionSet, Method, Pairs, Part, Query, Scene, Settings,
    SharedVertex, hash_rows,
};
use impinge_scenes::{Model, Random, adversarial, soup, surfaces};

/// A scene and a query.
pub struct Case {
    /// What failures call it.
    pub name: String,
    /// The bodies.
    pub scene: Scene,
    /// What is asked.
    pub query: Query,
}

/// Settings for the CPU.
pub fn cpu(method: Method, threads: usize) -> Settings {
    let settings = Settings::new().method(method).threads(threads);
    settings.backend(Backend::Cpu)
}

/// A detector on the CPU.
pub fn detector(method: Method, threads: usize) -> Detector {
    Detector::new(cpu(method, threads)).expect("settings")
}

/// Detectors that must give the same bytes: each instruction set, one thread and several, and the
/// oracle last.
pub fn detectors() -> [Detector; 4] {
    let with = |instruction_set, threads| {
        let settings = cpu(Method::Clusters, threads).instruction_set(instruction_set);
        Detector::new(settings).expect("settings")
    };
    [
        with(InstructionSet::Portable, 1),
        with(InstructionSet::Avx2, 2),
        with(InstructionSet::Avx512, 4),
        detector(Method::Naive, 2),
    ]
}

/// How thick an element is, from the numbers that its body was given: if these are about elements of
/// another part, as thick as the thickest of them that has all of its vertices, or whose vertices it
/// has.
pub fn thickness_of(scene: &Scene, body: BodyId, part: Part, element: u32) -> f64 {
    let held = scene.body(body).expect("known");
    let Some((given, each)) = held.thickness_by_element() else {
        return held.thickness();
    };
    if given == part {
        return each[element as usize];
    }
    let corners = |part, element: u32| match part {
        Part::Vertices => vec![element],
        _ => held.part(part).corners(element as usize).to_vec(),
    };
    let own = corners(part, element);
    let holds = |a: &[u32], b: &[u32]| b.iter().all(|id| a.contains(id));
    (0..).zip(each).fold(0.0, |most: f64, (other, &thickness)| {
        let other = corners(given, other);
        match holds(&other, &own) || holds(&own, &other) {
            true => most.max(thickness),
            false => most,
        }
    })
}

/// The rows of an answer.
pub fn rows(pairs: &Pairs) -> Vec<[u32; 4]> {
    pairs.rows().collect()
}

/// The oracle's answer.
pub fn naive(case: &Case) -> Vec<[u32; 4]> {
    let mut detector =
        Detector::new(Settings::new().method(Method::Naive).backend(Backend::Cpu)).unwrap();
    rows(&detector.detect(&case.scene, &case.query).unwrap())
}

/// Whether culled clusters are left out on this processor: without AVX2 this would gain nothing.
pub fn leaves_out() -> bool {
    #[cfg(target_arch = "x86_64")]
    {
        is_x86_feature_detected!("avx2")
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        false
    }
}

/// Whether an answer equals the oracle's: the same rows in the same order, and the same hash.
pub fn agree(expected: &[[u32; 4]], answer: &[[u32; 4]], hash: u64) -> Result<(), String> {
    if hash != hash_rows(expected.iter().copied()) {
        return Err(format!(
            "hash {hash:016x} of {} pairs, {} expected",
            answer.len(),
            expected.len()
        ));
    }
    match expected.iter().zip(answer).position(|(e, a)| e != a) {
        Some(ix) => Err(format!(
            "row {ix} is {:?}, expected {:?}",
            answer[ix], expected[ix]
        )),
        None if expected.len() != answer.len() => Err(format!(
            "{} pairs, {} expected",
            answer.len(),
            expected.len()
        )),
        None => Ok(()),
    }
}

/// Runs a case with these settings and compares.
pub fn check(case: &Case, expected: &[[u32; 4]], settings: Settings) {
    let mut detector = Detector::new(settings.clone()).unwrap();
    // Twice: the second frame uses the caches that the first filled.
    for frame in 0..2 {
        let pairs = detector.detect(&case.scene, &case.query).unwrap();
        if let Err(error) = agree(expected, &rows(&pairs), pairs.hash()) {
            panic!("{} frame {frame} with {settings:?}: {error}", case.name);
        }
    }
}

fn two(name: &str, a: &Model, b: &Model, double: bool) -> Case {
    let mut scene = Scene::new();
    let add = |scene: &mut Scene, model: &Model| -> BodyId {
        if double {
            scene
                .add((model.elements.clone(), model.positions_f64()))
                .unwrap()
        } else {
            scene
                .add((model.elements.clone(), model.positions.clone()))
                .unwrap()
        }
    };
    let ids = (add(&mut scene, a), add(&mut scene, b));
    Case {
        name: format!("{name}{}", if double { ", f64" } else { "" }),
        scene,
        query: Query::between(ids.0, ids.1),
    }
}

/// Bodies of every kind and precision, some with huge elements.
fn many(n: u64, scale: f32) -> Case {
    let mut scene = Scene::new();
    for k in 0..n {
        let at = [0.35 * (k % 4) as f32, 0.3 * (k / 4) as f32, 0.1 * k as f32];
        let mut model = match k % 3 {
            0 => soup::tetrahedra(60, 0.15, k),
            1 => soup::triangles(120, 0.1, k),
            _ => surfaces::ball(300),
        }
        .translated(at);
        if k % 5 == 4 {
            model.positions[0] = [9.0, 8.0, 7.0];
        }
        for position in &mut model.positions {
            *position = position.map(|x| x * scale);
        }
        let added = if k % 4 == 1 {
            scene.add((model.elements.clone(), model.positions_f64()))
        } else {
            scene.add((model.elements, model.positions))
        };
        added.unwrap();
    }
    Case {
        name: format!("{n} bodies, scale {scale:e}"),
        scene,
        query: Query::between_all(),
    }
}

fn one(name: &str, model: &Model, rule: SharedVertex) -> Case {
    let mut scene = Scene::new();
    let id = scene
        .add((model.elements.clone(), model.positions.clone()))
        .unwrap();
    Case {
        name: format!("{name}, {rule:?}"),
        scene,
        query: Query::self_of(id).shared_vertex(rule),
    }
}

/// Two bodies, of which only the first may meet itself. It does so also where the second is not.
fn one_meets_itself(rule: SharedVertex) -> Case {
    let mut scene = Scene::new();
    let mut add = |model: Model| scene.add((model.elements, model.positions)).unwrap();
    add(soup::triangles(900, 0.15, 7));
    let ball = add(surfaces::ball(300).translated([1.5, 0.5, 0.5]));
    Case {
        name: format!("one of two meets itself, {rule:?}"),
        scene,
        query: Query::all().exclude((ball, ball)).shared_vertex(rule),
    }
}

/// Cases of up to a few thousand elements: every kind, every query, lattice troublemakers, and
/// the adversarial scenes in small.
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    let rules = [SharedVertex::Skip, SharedVertex::Resolve];
    let ball = surfaces::bumpy_ball(1500, 0.2);
    let torus = surfaces::torus(40, 20, 1.0, 0.4);
    for double in [false, true] {
        cases.push(two(
            "ball and torus",
            &ball,
            &torus.translated([0.3, 0.1, 0.2]),
            double,
        ));
        cases.push(two("coincident balls", &ball, &ball, double));
        cases.push(two(
            "disjoint balls",
            &ball,
            &ball.translated([9.0, 0.0, 0.0]),
            double,
        ));
        for (n, k) in [(1, 1), (7, 1), (64, 2), (65, 2), (130, 3), (260, 5)] {
            let a = soup::lattice_triangles(n, k, 1);
            let b = soup::lattice_triangles(n + 3, k, 2);
            cases.push(two(
                &format!("lattice triangles {n} in {k}"),
                &a,
                &b,
                double,
            ));
            let t = soup::lattice_tetrahedra(n, k, 3);
            let u = soup::lattice_tetrahedra(n + 3, k, 4);
            cases.push(two(
                &format!("lattice tetrahedra {n} in {k}"),
                &t,
                &u,
                double,
            ));
            cases.push(two(&format!("lattice mixed {n} in {k}"), &a, &u, double));
            cases.push(two(
                &format!("lattice mixed swapped {n} in {k}"),
                &t,
                &b,
                double,
            ));
        }
        for n in [1, 63, 64, 65, 129, 700] {
            let a = soup::triangles(n, 0.2, 5);
            let b = soup::triangles(n, 0.2, 6);
            cases.push(two(&format!("soup {n}"), &a, &b, double));
        }
    }
    for (n, scale) in [(12, 1.0), (8, 1.0), (7, 1e-30), (6, 1e25)] {
        cases.push(many(n, scale));
    }
    for rule in rules {
        cases.push(one_meets_itself(rule));
        cases.push(one("soup", &soup::triangles(900, 0.15, 7), rule));
        cases.push(one("tetrahedra", &soup::tetrahedra(300, 0.2, 8), rule));
        cases.push(one("torus", &torus, rule));
        for (n, k) in [(1, 1), (20, 1), (100, 2), (200, 3)] {
            let web = soup::lattice_web(n, k, 9);
            cases.push(one(&format!("lattice web {n} in {k}"), &web, rule));
            let web = soup::lattice_web_tetrahedra(n, k, 10);
            cases.push(one(
                &format!("lattice tetrahedra web {n} in {k}"),
                &web,
                rule,
            ));
        }
        cases.push(one("fan", &fan(300), rule));
    }
    for built in [
        adversarial::plain(600),
        adversarial::huge_over_small(600),
        adversarial::stadium(600),
        adversarial::one_cell(400),
        adversarial::one_point(150),
        adversarial::flat_cloth(600),
        adversarial::needle_row(400),
        adversarial::coincident(400),
        adversarial::outliers(400),
        adversarial::boxes(60, 3),
        adversarial::mixed_sizes(1500),
        adversarial::slivers(300),
        adversarial::machine_parts(1_200),
        adversarial::stacked_cubes(60),
        adversarial::chessboard(60),
    ] {
        let built = built.unwrap();
        for query in [
            built.query.clone(),
            Query::all(),
            Query::self_all(),
            Query::self_all().shared_vertex(SharedVertex::Skip),
        ] {
            cases.push(Case {
                name: format!("{} {query:?}", built.name),
                scene: built.scene.clone(),
                query,
            });
        }
    }
    cases.extend(of_any_size());
    cases
}

/// A number times a power of two, which may itself be out of range.
pub fn times_power(x: f64, exponent: i32) -> f64 {
    let half = exponent / 2;
    x * 2.0_f64.powi(half) * 2.0_f64.powi(exponent - half)
}

/// A way to leave the range in which products of three coordinates are doubles, for points of small
/// numbers. The answer stays the same for the first ones, which are linear maps.
#[derive(Debug, Clone, Copy)]
pub enum Size {
    /// Each axis times a power of two.
    Axes([i32; 3]),
    /// Some coordinates have shrunk to nearly nothing, as those of a damped motion do.
    Decayed,
    /// Some vertices are as far out as numbers go.
    Flung,
}

impl Size {
    /// Ways of each kind.
    pub const ALL: [Self; 8] = [
        Self::Axes([-1074; 3]),
        Self::Axes([-420; 3]),
        Self::Axes([-1074, 0, 1020]),
        Self::Axes([0, -1060, 0]),
        Self::Axes([300, -300, 0]),
        Self::Axes([1020; 3]),
        Self::Decayed,
        Self::Flung,
    ];

    /// The points, put out of that range.
    pub fn points(self, points: &[[f32; 3]], seed: u64) -> Vec<[f64; 3]> {
        let mut random = Random::new(seed);
        let least = f64::from_bits(1);
        let shrunk = [0.0, least, -least, 1e-320, 5e-76, -1e-200, 1e-60];
        let far = [f64::MAX, -f64::MAX, 1e300, -1e155, 1e80];
        let points = points.iter().map(|point| {
            let point = point.map(f64::from);
            match self {
                Size::Axes(exponents) => {
                    std::array::from_fn(|axis| times_power(point[axis], exponents[axis]))
                }
                Size::Decayed => point.map(|x| match random.below(3) {
                    0 => x,
                    _ => shrunk[random.below(shrunk.len() as u32) as usize],
                }),
                Size::Flung => {
                    let axis = random.below(3) as usize;
                    let by = far[random.below(far.len() as u32) as usize];
                    let is_flung = random.below(4) == 0;
                    std::array::from_fn(|k| if is_flung && k == axis { by } else { point[k] })
                }
            }
        });
        points.collect()
    }
}

/// Scenes in double precision with numbers from one end of the range to the other.
fn of_any_size() -> Vec<Case> {
    let mut cases = Vec::new();
    for size in Size::ALL {
        let mut scene = Scene::new();
        let mut add = |model: Model, seed: u64| {
            let points = size.points(&model.positions, seed);
            scene.add((model.elements, points)).unwrap()
        };
        let ids = [
            add(soup::lattice_triangles(14, 3, 1), 1),
            add(soup::lattice_web(24, 3, 2), 2),
            add(soup::lattice_tetrahedra(6, 3, 3), 3),
            add(soup::lattice_web_tetrahedra(8, 3, 4), 4),
        ];
        for query in [
            Query::between(ids[0], ids[1]),
            Query::all().shared_vertex(SharedVertex::Skip),
            Query::self_all().shared_vertex(SharedVertex::Resolve),
        ] {
            cases.push(Case {
                name: format!("{size:?} {query:?}"),
                scene: scene.clone(),
                query,
            });
        }
        if let Size::Flung | Size::Axes([300, ..]) = size {
            let mut scene = Scene::new();
            let fan = fan(100);
            let points = size.points(&fan.positions, 5);
            let id = scene.add((fan.elements, points)).unwrap();
            cases.push(Case {
                name: format!("fan, {size:?}"),
                scene,
                query: Query::self_of(id).shared_vertex(SharedVertex::Resolve),
            });
        }
    }
    cases
}

/// Triangles that all share one vertex, more than in any mesh: a hub for the adjacency masks.
fn fan(n: u32) -> Model {
    let mut positions = vec![[0.0f32; 3]];
    let mut faces = Vec::new();
    for k in 0..n {
        let angle = k as f32 * 0.7;
        let (sin, cos) = angle.sin_cos();
        let first = positions.len() as u32;
        positions.push([cos, sin, 0.1 * k as f32]);
        positions.push([cos - 0.3 * sin, sin + 0.3 * cos, 0.1 * k as f32 + 0.05]);
        faces.push([0, first, first + 1]);
    }
    Model {
        positions,
        elements: faces.into(),
    }
}

/// Triangles at the start and at the end of a step in which `n` of them land on a slope, nearly at
/// once, each on a way of its own. The slope is a triangle too, the first. They land where x and y
/// are at most `half_width` from `far`.
pub fn landing(
    random: &mut Random,
    n: u32,
    half_width: f32,
    far: f32,
) -> (Vec<[u32; 3]>, [Vec<[f32; 3]>; 2]) {
    let slope = |x: f32, y: f32| 0.37 * x + 0.21 * y;
    let corners = [[-4.5, -4.0], [4.5, -3.5], [0.5, 4.5]].map(|corner| {
        let [x, y] = corner.map(|x: f32| x * half_width);
        [x, y, slope(x, y)]
    });
    let mut ends = [(); 2].map(|()| corners.to_vec());
    for _ in 0..n {
        let [x, y] = [(); 2].map(|()| random.range(-half_width, half_width));
        let triangle = [
            [x, y, slope(x, y)],
            [x + random.range(-0.2, 0.2), y - 0.1, slope(x, y) + 0.5],
            [x + random.range(-0.2, 0.2), y + 0.1, slope(x, y) + 0.5],
        ];
        let way = [(); 3].map(|()| random.range(-0.5, 0.5) - 0.5);
        let at = random.range(0.5, 0.5 + 2e-7 * far);
        for (end, time) in ends.iter_mut().zip([0.0, 1.0]) {
            let moved = |point: [f32; 3]| std::array::from_fn(|k| point[k] + (time - at) * way[k]);
            end.extend(triangle.map(moved));
        }
    }
    let faces = (0..=n).map(|face| [0, 1, 2].map(|corner| 3 * face + corner));
    let ends = ends.map(|points| {
        let points = points.iter().map(|point| point.map(|x| x + far));
        points.collect()
    });
    (faces.collect(), ends)
}
