//! What a question leaves out because of its elements: every pair by the exact tests, and rules
//! about pairs that are written here.

use std::collections::{BTreeMap, BTreeSet};

use super::safe::{Held, check_those, pairs, test_of};
use impinge_core::exact::{are_within, first_contact};
use impinge_core::{
    BodyId, Exclusion, Method, PairFilter, PairKind, Positions, Query, SafeDistances, Scene,
};
use impinge_scenes::{Random, surfaces};
use impinge_tests::{detector, detectors};

/// A waved cloth over a ball, apart from each other and themselves; both go anywhere.
fn scene(seed: u64) -> (Scene, [BodyId; 2]) {
    let mut random = Random::new(seed);
    let mut scene = Scene::new();
    let cloth = surfaces::cloth(6, 5, 0.2).mapped(|[x, y, z]| [x - 0.6, y - 0.5, z + 0.03 * x]);
    let ball = surfaces::ball(60).mapped(|[x, y, z]| [x, y, z - 0.56]);
    let bodies = [cloth, ball].map(|model| {
        let mut moved = |by: f32| {
            let points = model.positions.iter();
            Vec::from_iter(points.map(|p| {
                let q = random.point(-by, by);
                [0, 1, 2].map(|axis| f64::from(p[axis] + q[axis]))
            }))
        };
        let (start, end) = (moved(0.01), moved(0.25));
        let body = scene.add((model.elements.clone(), start)).expect("good");
        scene.set_end_positions(body, end).expect("good");
        body
    });
    (scene, bodies)
}

/// Bodies by their order, vertices by their numbers.
type Vertex = (usize, u32);

/// A rule about two elements, by their vertices and the kind of the pair.
type Keeps = Box<dyn Fn(&[Vertex], &[Vertex]) -> bool + Send + Sync>;

/// A question that leaves something out, what it leaves out by a rule, and its scene.
struct Case {
    name: &'static str,
    scene: Scene,
    bodies: [BodyId; 2],
    query: Query,
    keeps: Keeps,
}

/// For each vertex of a body, how many edges others are away.
fn edges_between(scene: &Scene, body: BodyId) -> BTreeMap<(u32, u32), u32> {
    let held = scene.body(body).expect("held");
    let edges = held.edges();
    let n = held.n_vertices() as u32;
    let mut away = BTreeMap::new();
    for vertex in 0..n {
        away.insert((vertex, vertex), 0);
    }
    for _ in 0..3 {
        let known = away.clone();
        for (&(from, at), &far) in &known {
            for edge in (0..edges.len()).map(|ix| edges.corners(ix)) {
                for [a, b] in [[edge[0], edge[1]], [edge[1], edge[0]]] {
                    if a == at {
                        let least = away.entry((from, b)).or_insert(far + 1);
                        *least = (far + 1).min(*least);
                    }
                }
            }
        }
    }
    away
}

fn any_two(a: &[Vertex], b: &[Vertex], is: impl Fn(Vertex, Vertex) -> bool) -> bool {
    a.iter().any(|&v| b.iter().any(|&w| is(v, w)))
}

fn cases(seed: u64) -> Vec<Case> {
    let mut random = Random::new(seed + 100);
    let mut cases = Vec::new();
    let mut add = |name, (scene, bodies): (Scene, [BodyId; 2]), query, keeps| {
        cases.push(Case {
            name,
            scene,
            bodies,
            query,
            keeps,
        });
    };
    let of = self::scene(seed);
    let sizes =
        of.1.map(|body| of.0.body(body).expect("held").n_vertices() as u32);

    add(
        "nothing",
        of.clone(),
        Query::all(),
        Box::new(|_: &[Vertex], _: &[Vertex]| true) as Keeps,
    );

    for rings in [0, 1, 2] {
        let away = of.1.map(|body| edges_between(&of.0, body));
        let keeps = move |a: &[Vertex], b: &[Vertex]| {
            let near = |v: Vertex, w: Vertex| {
                v.0 == w.0 && away[v.0].get(&(v.1, w.1)).is_some_and(|&far| far <= rings)
            };
            !any_two(a, b, near)
        };
        let query = Query::all().exclude(Exclusion::rings(rings));
        add("rings", of.clone(), query, Box::new(keeps));
    }

    let (mut grouped, bodies) = self::scene(seed);
    let groups = sizes.map(|n| Vec::from_iter((0..n).map(|_| random.below(3))));
    for (body, groups) in bodies.iter().zip(&groups) {
        grouped.set_groups(*body, groups).expect("good");
    }
    let query = Query::all()
        .exclude(Exclusion::groups(0, 1))
        .exclude(Exclusion::groups(2, 2));
    // A pair counts if two of its vertices may meet.
    let keeps = move |a: &[Vertex], b: &[Vertex]| {
        any_two(a, b, |v, w| {
            let [g, h] = [v, w].map(|(body, vertex)| groups[body][vertex as usize]);
            ![(0, 1), (2, 2)].contains(&(g.min(h), g.max(h)))
        })
    };
    add("groups", (grouped, bodies), query, Box::new(keeps));

    let (mut held, bodies) = self::scene(seed);
    let pinned = sizes.map(|n| Vec::from_iter((0..n).map(|_| random.below(5) > 0)));
    for (body, pinned) in bodies.iter().zip(&pinned) {
        held.set_pinned(*body, pinned).expect("good");
    }
    let keeps = move |a: &[Vertex], b: &[Vertex]| {
        let mut both = a.iter().chain(b);
        both.any(|&(body, vertex)| !pinned[body][vertex as usize])
    };
    add("pins", (held, bodies), Query::all(), Box::new(keeps));

    let mut query = Query::all();
    let mut listed = BTreeSet::new();
    for [from, to] in [[0, 0], [1, 0]] {
        let (mut offsets, mut vertices) = (vec![0], Vec::new());
        for v in 0..sizes[from] {
            for _ in 0..random.below(12) {
                let w = random.below(sizes[to]);
                vertices.push(w);
                listed.extend([((from, v), (to, w)), ((to, w), (from, v))]);
            }
            offsets.push(vertices.len() as u64);
        }
        let [from, to] = [from, to].map(|ix| of.1[ix]);
        query = query.exclude(Exclusion::vertices(from, to, offsets, vertices));
    }
    let keeps = move |a: &[Vertex], b: &[Vertex]| !any_two(a, b, |v, w| listed.contains(&(v, w)));
    add("lists", of.clone(), query, Box::new(keeps));

    // Of a pose of rest, every pair within a distance by the exact tests.
    let radius = 0.25;
    let (rest, _) = &of;
    let near = detector(Method::Clusters, 1)
        .near(rest, radius, &Query::all())
        .expect("good");
    let mut at_rest = BTreeSet::new();
    for (kind, a, b, four) in pairs(rest) {
        let is_asked = matches!(kind, PairKind::VertexFace | PairKind::EdgeEdge);
        if is_asked && are_within(test_of(kind), &four, radius) {
            let named = [&a, &b].map(|held| named(held, &of.1));
            at_rest.insert((named[0].clone(), named[1].clone()));
        }
    }
    let keeps = move |a: &[Vertex], b: &[Vertex]| {
        let (a, b) = (a.to_vec(), b.to_vec());
        !at_rest.contains(&(a.clone(), b.clone())) && !at_rest.contains(&(b, a))
    };
    add(
        "pairs at rest",
        of.clone(),
        Query::all().exclude(&near),
        Box::new(keeps),
    );
    cases
}

/// The vertices of an element.
fn named(held: &Held, bodies: &[BodyId; 2]) -> Vec<Vertex> {
    let body = bodies
        .iter()
        .position(|&id| id == held.body)
        .expect("known");
    held.corners.iter().map(|&corner| (body, corner)).collect()
}

impl Case {
    fn keeps(&self, a: &Held, b: &Held) -> bool {
        (self.keeps)(&named(a, &self.bodies), &named(b, &self.bodies))
    }
}

/// Kinds that steps are asked about.
const OF_STEPS: [PairKind; 2] = [PairKind::VertexFace, PairKind::EdgeEdge];

#[test]
fn bounds_are_about_what_is_not_left_out() {
    let mut n_others = 0;
    for seed in 0..4 {
        let mut of_all = None;
        for case in cases(seed) {
            let safe = detectors().map(|mut detector| {
                detector
                    .safe_distances(&case.scene, 0.15, &case.query)
                    .expect("good")
            });
            let of = |safe: &SafeDistances| case.bodies.map(|body| format!("{:?}", safe.of(body)));
            for other in &safe[1..] {
                assert_eq!(of(&safe[0]), of(other), "{}", case.name);
            }
            let keeps = |kind: PairKind, a: &Held, b: &Held| {
                let is_asked = OF_STEPS.contains(&kind) || kind == PairKind::EdgeFace;
                is_asked && case.keeps(a, b)
            };
            let [_, n_bounded] = check_those(&case.scene, &safe[0], (0.15, &[]), keeps);
            assert!(n_bounded > 20, "{}", case.name);
            // The first case leaves out nothing.
            let all = of_all.get_or_insert_with(|| of(&safe[0]));
            n_others += usize::from(of(&safe[0]) != *all);
        }
    }
    assert!(n_others > 20, "{n_others}");
}

#[test]
fn lists_name_what_is_not_left_out() {
    let radius = 0.3;
    let mut n_left_out = 0;
    for seed in 0..2 {
        for case in cases(seed) {
            let (scene, query) = (&case.scene, &case.query);
            let mut expected: BTreeMap<PairKind, BTreeSet<(u32, u32)>> = BTreeMap::new();
            for mut detector in detectors() {
                let lists = detector.neighbours(scene, radius, query).expect("good");
                if expected.is_empty() {
                    for (kind, a, b, four) in pairs(scene) {
                        if !OF_STEPS.contains(&kind) || !are_within(test_of(kind), &four, radius) {
                            continue;
                        }
                        if !case.keeps(&a, &b) {
                            n_left_out += 1;
                            continue;
                        }
                        let [row, column] = [&a, &b]
                            .map(|of| lists.first(of.body, of.part).expect("held") + of.element);
                        let own = expected.entry(kind).or_default();
                        own.insert((row, column));
                        if kind == PairKind::EdgeEdge {
                            own.insert((column, row));
                        }
                    }
                }
                for kind in OF_STEPS {
                    let own = lists.of(kind);
                    let rows = 0..own.offsets.len() - 1;
                    let found =
                        BTreeSet::from_iter(rows.flat_map(|row| {
                            own.of(row).map(move |(column, _)| (row as u32, column))
                        }));
                    assert_eq!(found, expected[&kind], "{} {kind:?}", case.name);
                }
            }
        }
    }
    assert!(n_left_out > 1000, "{n_left_out}");
}

/// The points of all pairs that touch on the way to other ends, and whether the question is about
/// them.
fn meeting(case: &Case, ends: &BTreeMap<BodyId, Positions>) -> [usize; 2] {
    let mut n = [0; 2];
    for (kind, a, b, start) in pairs(&case.scene) {
        if !OF_STEPS.contains(&kind) {
            continue;
        }
        let own = [&a, &b].map(|of| {
            of.corners
                .iter()
                .map(|&corner| ends[&of.body].point(corner as usize))
        });
        let mut end = [[0.0; 3]; 4];
        for (to, from) in end.iter_mut().zip(own.into_iter().flatten()) {
            *to = from;
        }
        if first_contact(test_of(kind), &start, &end).is_some() {
            n[usize::from(case.keeps(&a, &b))] += 1;
        }
    }
    n
}

/// The same rule as a function of the caller's, which no part of the other filters knows.
fn by_function(case: &Case) -> (Scene, Query) {
    let (mut scene, bodies) = (case.scene.clone(), case.bodies);
    for body in bodies {
        let n = scene.body(body).expect("held").n_vertices();
        scene.set_pinned(body, &vec![false; n]).expect("good");
    }
    (scene, Query::all())
}

#[test]
fn steps_are_kept_free_of_what_is_not_left_out() {
    let (mut n_passing, mut n_cut) = (0, 0);
    for seed in 0..4 {
        for case in cases(seed) {
            let name = case.name;
            let of = detectors().map(|mut detector| {
                let truncation = detector.truncate(&case.scene, &case.query).expect("good");
                let advance = detector.advance(&case.scene, &case.query).expect("good");
                (truncation, advance)
            });
            for other in &of[1..] {
                assert_eq!(of[0].0, other.0, "{name}");
                assert_eq!(of[0].1.fraction, other.1.fraction, "{name}");
            }
            let (truncation, advance) = &of[0];
            // Nothing that counts meets, by every pair of the scene; what is left out may pass.
            let ends = BTreeMap::from_iter(truncation.iter().map(|(id, at)| (id, at.clone())));
            let [passing, met] = meeting(&case, &ends);
            assert_eq!(met, 0, "{name}");
            n_passing += passing;
            n_cut += truncation.n_cut();
            let ends = BTreeMap::from_iter(advance.iter().map(|(id, at)| (id, at.clone())));
            assert_eq!(meeting(&case, &ends)[1], 0, "{name}");
            // The same as by a function of the caller's.
            let (scene, query) = by_function(&case);
            let bodies = case.bodies;
            let number = move |id: BodyId| bodies.iter().position(|&own| own == id).expect("known");
            let keeps = case.keeps;
            let filter = PairFilter::new(move |pair| {
                let [a, b] = pair.map(|(id, corners)| {
                    Vec::from_iter(corners.iter().map(|&corner| (number(id), corner)))
                });
                keeps(&a, &b)
            });
            let query = query.filter(filter);
            let mut detector = detector(Method::Clusters, 2);
            let alike = detector.truncate(&scene, &query).expect("good");
            assert_eq!(*truncation, alike, "{name}");
            let alike = detector.advance(&scene, &query).expect("good");
            assert_eq!(advance.fraction, alike.fraction, "{name}");
        }
    }
    assert!(n_passing > 100 && n_cut > 100, "{n_passing} {n_cut}");
}
