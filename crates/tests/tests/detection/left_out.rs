//! Pairs that are left out because of their vertices, or by name: every question, against its
//! answer without them.

use std::collections::{BTreeSet, VecDeque};

use impinge_core::{
    Backend, BodyId, Detector, Element, Elements, Error, Exclusion, Method, PairKind, Part, Query,
    Scene, Settings, Start,
};
use impinge_scenes::{Random, solids, surfaces};
use impinge_tests::detectors;

/// Crumpled cloth, and a body that it falls on; random end positions.
fn scene(seed: u64) -> (Scene, [BodyId; 2]) {
    let mut random = Random::new(seed);
    let mut scene = Scene::new();
    let bodies = [
        surfaces::cloth(9, 7, 0.2),
        surfaces::bumpy_ball(120, 0.3).scaled(0.5),
    ]
    .map(|model| {
        let mut crumple = || random.point(-0.15, 0.15);
        let mut at = |by: [f32; 3]| -> Vec<[f32; 3]> {
            let moved = |p: &[f32; 3]| {
                let q = crumple();
                [0, 1, 2].map(|axis| p[axis] + q[axis] + by[axis])
            };
            model.positions.iter().map(moved).collect()
        };
        let (start, end) = (at([0.0; 3]), at([0.1, 0.0, -0.1]));
        let body = scene.add((model.elements.clone(), start)).expect("good");
        scene.set_end_positions(body, end).expect("good");
        body
    });
    (scene, bodies)
}

/// A pair of elements of some parts.
type Named = ([Part; 2], [Element; 2]);

fn corners(scene: &Scene, part: Part, of: Element) -> Vec<u32> {
    let body = scene.body(of.body).expect("held");
    match part {
        Part::Vertices => vec![of.element],
        Part::Edges => body.edges().corners(of.element as usize).to_vec(),
        Part::Faces => body.faces().corners(of.element as usize).to_vec(),
        Part::Given => body.elements().corners(of.element as usize).to_vec(),
    }
}

fn corners_of_both(scene: &Scene, (parts, pair): &Named) -> [Vec<u32>; 2] {
    [0, 1].map(|side| corners(scene, parts[side], pair[side]))
}

/// The answers of all questions about a query, each as sorted pairs.
fn answers(
    detector: &mut Detector,
    scene: &Scene,
    query: &Query,
    is_detected: bool,
) -> Vec<Vec<Named>> {
    let of_kind = |kind: PairKind, a, b| (kind.parts(), [a, b]);
    let impacts = detector.impacts(scene, query).expect("good");
    let separated = detector
        .impacts(scene, &query.clone().separation(0.01))
        .expect("good");
    let near = detector.near(scene, 0.1, query).expect("good");
    let candidates = detector.candidates(scene, 0.02, query).expect("good");
    let mut all: Vec<Vec<Named>> = vec![
        impacts.iter().map(|i| of_kind(i.kind, i.a, i.b)).collect(),
        separated
            .iter()
            .map(|i| of_kind(i.kind, i.a, i.b))
            .collect(),
        near.iter().map(|n| of_kind(n.kind, n.a, n.b)).collect(),
        candidates
            .iter()
            .map(|(kind, a, b)| of_kind(kind, a, b))
            .collect(),
    ];
    let lists = detector.neighbours(scene, 0.1, query).expect("good");
    assert_eq!(lists.len(), near.len());
    assert_eq!(
        detector.is_free(scene, query).expect("good"),
        impacts.is_empty()
    );
    assert_eq!(
        detector.earliest(scene, query).expect("good"),
        impacts.earliest()
    );
    if is_detected {
        let pairs = detector.detect(scene, query).expect("good");
        assert_eq!(
            detector.count(scene, query).expect("good"),
            pairs.len() as u64
        );
        assert_eq!(detector.any(scene, query).expect("good"), !pairs.is_empty());
        all.push(
            pairs
                .iter()
                .map(|(a, b)| ([Part::Given; 2], [a, b]))
                .collect(),
        );
    }
    all
}

/// Asks everything, and expects what is asked without the exclusion, but for pairs that a function
/// refuses.
fn check(
    scene: &Scene,
    query: &Query,
    full: &Scene,
    without: &Query,
    is_detected: bool,
    keeps: impl Fn(&Named) -> bool,
) {
    let mut n_left_out = 0;
    for mut detector in detectors() {
        let all = answers(&mut detector, full, without, is_detected);
        let found = answers(&mut detector, scene, query, is_detected);
        let wrong = wrong_ones(&all, &found, &keeps);
        assert!(!wrong.contains(&true), "{wrong:?}");
        for (question, (all, found)) in all.iter().zip(&found).enumerate() {
            assert!(!found.is_empty(), "question {question}");
            n_left_out += all.len() - found.len();
        }
    }
    assert!(n_left_out > 0);
}

/// Of each question, whether its answer is another one than all pairs but for those that a function
/// refuses.
fn wrong_ones(
    all: &[Vec<Named>],
    found: &[Vec<Named>],
    keeps: impl Fn(&Named) -> bool,
) -> Vec<bool> {
    let is_wrong = |(all, found): (&Vec<Named>, &Vec<Named>)| {
        let expected = all.iter().filter(|pair| keeps(pair));
        !expected.eq(found)
    };
    all.iter().zip(found).map(is_wrong).collect()
}

/// The vertices at most some number of edges away.
fn around(scene: &Scene, body: BodyId, from: u32, n: u32) -> BTreeSet<u32> {
    let edges = scene.body(body).expect("held").edges();
    let edges: Vec<Vec<u32>> = (0..edges.len())
        .map(|ix| edges.corners(ix).to_vec())
        .collect();
    let mut seen = BTreeSet::from([from]);
    let mut next = VecDeque::from([(from, 0)]);
    while let Some((at, depth)) = next.pop_front() {
        if depth == n {
            continue;
        }
        for edge in &edges {
            for (a, b) in [(edge[0], edge[1]), (edge[1], edge[0])] {
                if a == at && seen.insert(b) {
                    next.push_back((b, depth + 1));
                }
            }
        }
    }
    seen
}

#[test]
fn rings_are_left_out() {
    for n in [0, 1, 2, 3] {
        let (scene, _) = scene(u64::from(n));
        check(
            &scene,
            &Query::all().exclude(Exclusion::rings(n)),
            &scene,
            &Query::all(),
            true,
            |pair @ (_, [a, b])| {
                a.body != b.body || {
                    let [from, to] = corners_of_both(&scene, pair);
                    from.iter().all(|&v| {
                        let near = around(&scene, a.body, v, n);
                        to.iter().all(|w| !near.contains(w))
                    })
                }
            },
        );
    }
}

/// Edges inside of tetrahedra count: the corners of each are one edge apart, though no edge of the
/// surface joins them.
#[test]
fn rings_go_through_tetrahedra() {
    let block = solids::block(2, 2, 2, 1.0);
    let Elements::Tetrahedra(tetrahedra) = &block.elements else {
        panic!("tetrahedra")
    };
    let mut scene = Scene::new();
    let body = block.add_to(&mut scene).expect("good");
    let edges = scene.body(body).expect("held").edges();
    let on_surface: BTreeSet<[u32; 2]> = (0..edges.len())
        .map(|ix| {
            let mut ends = [edges.corners(ix)[0], edges.corners(ix)[1]];
            ends.sort_unstable();
            ends
        })
        .collect();
    let query = Query::all()
        .kinds([PairKind::VertexVertex])
        .exclude(Exclusion::rings(1));
    for mut detector in detectors() {
        let near = detector.near(&scene, 100.0, &query).expect("good");
        let found: BTreeSet<[u32; 2]> = near
            .iter()
            .map(|pair| [pair.a.element, pair.b.element])
            .collect();
        let vertices: BTreeSet<u32> = found.iter().flatten().copied().collect();
        let mut n_inside = 0;
        for &a in &vertices {
            for &b in vertices.range(a + 1..) {
                let are_joined = tetrahedra
                    .iter()
                    .any(|of| of.contains(&a) && of.contains(&b));
                assert_eq!(found.contains(&[a, b]), !are_joined, "{a} {b}");
                n_inside += usize::from(are_joined && !on_surface.contains(&[a, b]));
            }
        }
        assert!(n_inside > 0);
    }
}

#[test]
fn groups_that_do_not_meet_are_left_out() {
    let (mut scene, bodies) = scene(5);
    let n = scene.body(bodies[0]).expect("held").n_vertices() as u32;
    let groups: Vec<u32> = (0..n).map(|ix| 3 + ix / (n / 3 + 1)).collect();
    scene.set_groups(bodies[0], &groups).expect("good");
    // The other body is in no group at first.
    for has_both in [false, true] {
        if has_both {
            let n = scene.body(bodies[1]).expect("held").n_vertices();
            scene.set_groups(bodies[1], &vec![9; n]).expect("good");
        }
        let query = Query::all()
            .exclude(Exclusion::groups(4, 3))
            .exclude(Exclusion::groups(5, 5))
            .exclude(Exclusion::groups(9, 5));
        let group = |body: BodyId, vertex: u32| match (body == bodies[0], has_both) {
            (true, _) => Some(groups[vertex as usize]),
            (false, true) => Some(9),
            (false, false) => None,
        };
        check(
            &scene,
            &query,
            &scene,
            &Query::all(),
            true,
            |pair @ (_, [a, b])| {
                let [from, to] = corners_of_both(&scene, pair);
                from.iter().any(|&v| {
                    to.iter().any(|&w| {
                        let (Some(g), Some(h)) = (group(a.body, v), group(b.body, w)) else {
                            return true;
                        };
                        ![(3, 4), (5, 5), (5, 9)].contains(&(g.min(h), g.max(h)))
                    })
                })
            },
        );
    }
}

/// Random lists, unsorted and with repetitions: of one body, of two in either order, and two
/// exclusions at once.
#[test]
fn listed_vertices_are_left_out() {
    let mut random = Random::new(3);
    for [from, to] in [[0, 0], [0, 1], [1, 0], [1, 1]] {
        let (scene, bodies) = scene(6);
        let n = bodies.map(|body| scene.body(body).expect("held").n_vertices() as u32);
        let mut lists = |from: usize, to: usize| -> (Vec<u64>, Vec<u32>) {
            let (mut offsets, mut vertices) = (vec![0], Vec::new());
            for _ in 0..n[from] {
                let n_listed = random.below(3) * random.below(6);
                vertices.extend((0..n_listed).map(|_| random.below(n[to])));
                offsets.push(vertices.len() as u64);
            }
            (offsets, vertices)
        };
        let given = [(from, to, lists(from, to)), (1, 1, lists(1, 1))];
        let mut query = Query::all();
        let mut listed = BTreeSet::new();
        for (from, to, (offsets, vertices)) in given {
            for (v, of) in offsets.windows(2).enumerate() {
                for &w in &vertices[of[0] as usize..of[1] as usize] {
                    let pair = [(bodies[from], v as u32), (bodies[to], w)];
                    listed.extend([pair, [pair[1], pair[0]]]);
                }
            }
            let (a, b) = (bodies[from], bodies[to]);
            query = query.exclude(Exclusion::vertices(a, b, offsets, vertices));
        }
        check(
            &scene,
            &query,
            &scene,
            &Query::all(),
            true,
            |pair @ (_, [a, b])| {
                let [of_a, of_b] = corners_of_both(&scene, pair);
                of_a.iter().all(|&v| {
                    of_b.iter()
                        .all(|&w| !listed.contains(&[(a.body, v), (b.body, w)]))
                })
            },
        );
    }
}

#[test]
fn lists_that_do_not_fit_are_refused_by_name() {
    let mut scene = Scene::new();
    let at = [[0.0f32; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]];
    let a = scene.add_points(&at).expect("good");
    let b = scene.add_points(&at[..2]).expect("good");
    let mut detector = detectors().into_iter().next().expect("some");
    let mut message = |scene: &Scene, offsets: &[u64], vertices: &[u32]| {
        let query = Query::all().exclude(Exclusion::vertices(a, b, offsets, vertices));
        let near = detector.near(scene, 1.0, &query);
        near.map_err(|error| error.to_string())
    };
    let of = "exclude: lists for the vertices of body 0, of vertices of body 1: ";
    for (offsets, vertices, expected) in [
        (
            &[0, 0, 1][..],
            &[1][..],
            "3 offsets, but body 0 has 3 vertices: one more is needed",
        ),
        (
            &[1, 1, 1, 1],
            &[1],
            "1 as the first offset, which must be 0",
        ),
        (
            &[0, 2, 1, 2],
            &[1, 1],
            "offset 1 after 2 at 2, but no offset may be below the one before it",
        ),
        (
            &[0, 0, 1, 2],
            &[1],
            "2 as the last offset, but there are 1 listed vertices",
        ),
        (
            &[0, 0, 1, 2],
            &[1, 2],
            "vertex 2 at 1, but body 1 has 2 vertices",
        ),
    ] {
        let refused = message(&scene, offsets, vertices).unwrap_err();
        assert_eq!(refused, format!("{of}{expected}"));
    }
    let all = message(&scene, &[0, 0, 0, 0], &[]).expect("good").len();
    let fewer = message(&scene, &[0, 2, 3, 3], &[1, 0, 1])
        .expect("good")
        .len();
    assert_eq!((all, fewer), (8, 5));
    // Pairs of a body that is no longer there are none.
    scene.remove(b).expect("held");
    assert_eq!(message(&scene, &[0], &[7]).expect("good").len(), 2);
    // The same lists are equal, other ones are not.
    let lists =
        |vertices: &[u32]| Query::all().exclude(Exclusion::vertices(a, a, [0, 1, 1, 1], vertices));
    assert_eq!(lists(&[1]), lists(&[1]));
    assert_ne!(lists(&[1]), lists(&[2]));
    // A question about whole bodies has no use for them.
    let refused = detector.nearest(&scene, &lists(&[1])).unwrap_err();
    assert!(
        refused.to_string().contains("lists of vertices"),
        "{refused}"
    );
}

#[test]
fn what_is_pinned_does_not_meet_what_is_pinned() {
    let (full, bodies) = scene(8);
    let mut scene = full.clone();
    let is_pinned = |body: BodyId, vertex: u32| body == bodies[1] || vertex % 5 < 3;
    for body in bodies {
        let n = scene.body(body).expect("held").n_vertices() as u32;
        let pinned: Vec<bool> = (0..n).map(|vertex| is_pinned(body, vertex)).collect();
        scene.set_pinned(body, &pinned).expect("good");
    }
    let all = Query::all();
    check(&scene, &all, &full, &all, true, |pair @ (_, of)| {
        let corners = corners_of_both(&full, pair);
        let moves = |side: usize| {
            let mut own = corners[side].iter();
            own.any(|&v| !is_pinned(of[side].body, v))
        };
        moves(0) || moves(1)
    });
    // Nothing is pinned any more.
    for body in bodies {
        let n = scene.body(body).expect("held").n_vertices();
        scene.set_pinned(body, &vec![false; n]).expect("good");
    }
    let mut detector = detectors().into_iter().next().expect("some");
    let [mine, theirs] =
        [&scene, &full].map(|of| detector.detect(of, &Query::all()).expect("good").len());
    assert_eq!(mine, theirs);
}

/// A rule about pairs: its scene and query, which may be wrong in one place, and the pairs that it
/// keeps where it is right.
struct Rule<'a> {
    name: &'static str,
    asked: Box<dyn Fn(Option<usize>) -> (Scene, Query) + 'a>,
    keeps: Box<dyn Fn(&Named) -> bool + 'a>,
    is_detected: bool,
}

/// Proof that the comparison can fail: of a backend that is wrong about one vertex or one pair of a
/// rule, every question has another answer in some of such cases.
#[test]
fn rules_that_are_wrong_in_one_place_are_noticed() {
    let (full, bodies) = scene(5);
    let mut random = Random::new(5);
    let n = bodies.map(|body| full.body(body).expect("held").n_vertices());
    // Most are in one group, or pinned; each vertex of the first body lists some of the second.
    let fourths = n.map(|n| Vec::from_iter((0..n).map(|_| random.below(4))));
    let groups = fourths
        .clone()
        .map(|of| Vec::from_iter(of.iter().map(|&ix| ix.min(1))));
    let pinned = fourths.map(|of| Vec::from_iter(of.iter().map(|&ix| ix > 0)));
    let mut some = || (0..n[1] as u32).filter(|_| random.below(8) == 0).collect();
    let listed: Vec<Vec<u32>> = (0..n[0]).map(|_| some()).collect();
    let any_two = |pair: &Named, is: &dyn Fn([(usize, usize); 2]) -> bool| {
        let corners = corners_of_both(&full, pair);
        let of = |side: usize| {
            let body = usize::from(pair.1[side].body == bodies[1]);
            corners[side].iter().map(move |&v| (body, v as usize))
        };
        of(0).any(|v| of(1).any(|w| is([v, w])))
    };
    let mut detector = detectors().into_iter().next().expect("some");
    let radius = 0.05;
    let near = detector.near(&full, radius, &Query::all().distances());
    let near = near.expect("good");
    let named = BTreeSet::from_iter(
        near.iter()
            .map(|pair| (pair.kind.parts(), [pair.a, pair.b])),
    );
    let mut distances = Vec::from_iter(near.iter().filter_map(|pair| pair.distance));
    distances.sort_by(|x, y| y.total_cmp(x));
    let rules = [
        Rule {
            name: "groups",
            asked: Box::new(|wrong| {
                let (mut scene, mut groups) = (full.clone(), groups.clone());
                if let Some(vertex) = wrong {
                    groups[0][vertex] = 7;
                }
                for (&body, groups) in bodies.iter().zip(&groups) {
                    scene.set_groups(body, groups).expect("good");
                }
                let query = Query::all().exclude(Exclusion::groups(0, 0));
                (scene, query.exclude(Exclusion::groups(1, 1)))
            }),
            keeps: Box::new(|pair| {
                any_two(pair, &|both| {
                    let [g, h] = both.map(|(body, vertex)| groups[body][vertex]);
                    g != h
                })
            }),
            is_detected: true,
        },
        Rule {
            name: "pins",
            asked: Box::new(|wrong| {
                let (mut scene, mut pinned) = (full.clone(), pinned.clone());
                if let Some(vertex) = wrong {
                    pinned[0][vertex] ^= true;
                }
                for (&body, pinned) in bodies.iter().zip(&pinned) {
                    scene.set_pinned(body, pinned).expect("good");
                }
                (scene, Query::all())
            }),
            keeps: Box::new(|pair| {
                any_two(pair, &|both| {
                    both.iter().any(|&(body, vertex)| !pinned[body][vertex])
                })
            }),
            is_detected: true,
        },
        Rule {
            name: "lists",
            asked: Box::new(|wrong| {
                let (mut offsets, mut vertices) = (vec![0], Vec::new());
                for (vertex, own) in listed.iter().enumerate() {
                    if wrong != Some(vertex) {
                        vertices.extend(own);
                    }
                    offsets.push(vertices.len() as u64);
                }
                let lists = Exclusion::vertices(bodies[0], bodies[1], offsets, vertices);
                (full.clone(), Query::all().exclude(lists))
            }),
            keeps: Box::new(|pair| {
                !any_two(pair, &|[v, w]| {
                    let is_listed = |v: (usize, usize), w: (usize, usize)| {
                        (v.0, w.0) == (0, 1) && listed[v.1].contains(&(w.1 as u32))
                    };
                    is_listed(v, w) || is_listed(w, v)
                })
            }),
            is_detected: true,
        },
        Rule {
            name: "pairs at rest",
            asked: Box::new(|wrong| {
                // The farthest pairs are missing.
                let radius = match wrong {
                    Some(ix) => (distances[ix] + distances[ix + 1]) / 2.0,
                    None => radius,
                };
                let mut detector = impinge_tests::detector(Method::Clusters, 1);
                let near = detector.near(&full, radius, &Query::all());
                (full.clone(), Query::all().exclude(&near.expect("good")))
            }),
            keeps: Box::new(|pair| !named.contains(pair)),
            is_detected: false,
        },
    ];
    for rule in rules {
        let of = (&Query::all(), rule.is_detected);
        let all = answers(&mut detector, &full, of.0, of.1);
        let mut ask = |wrong| {
            let (scene, query) = (rule.asked)(wrong);
            let found = answers(&mut detector, &scene, &query, of.1);
            wrong_ones(&all, &found, &rule.keeps)
        };
        let mut noticed = ask(None);
        assert!(!noticed.contains(&true), "{}: {noticed:?}", rule.name);
        let mut places = 0..n[0];
        while let (true, Some(place)) = (noticed.contains(&false), places.next()) {
            for (noticed, is_wrong) in noticed.iter_mut().zip(ask(Some(place))) {
                *noticed |= is_wrong;
            }
        }
        assert!(!noticed.contains(&false), "{}: {noticed:?}", rule.name);
    }
    // Of elements as they were given, by the corners of what was near.
    let moved = at_end(&full);
    let intersecting = |detector: &mut Detector, radius: f64| {
        let near = detector.near(&full, radius, &Query::all()).expect("good");
        let pairs = detector.detect(&moved, &Query::all().exclude(&near));
        pairs.expect("good").hash()
    };
    let right = intersecting(&mut detector, radius);
    let noticed = (0..n[0]).any(|ix| {
        let fewer = (distances[ix] + distances[ix + 1]) / 2.0;
        intersecting(&mut detector, fewer) != right
    });
    assert!(noticed);
}

#[test]
fn pairs_of_an_answer_are_left_out() {
    let (mut scene, bodies) = scene(11);
    let mut detector = detectors().into_iter().next().expect("some");
    let at_rest = detector.near(&scene, 0.05, &Query::all()).expect("good");
    assert!(at_rest.len() > 20);
    let named: BTreeSet<(PairKind, [u32; 4])> =
        at_rest.iter().map(|pair| (pair.kind, pair.row())).collect();
    let keeps = |(parts, [a, b]): &Named| {
        let mut kinds = PairKind::ALL.into_iter();
        let kind = kinds.find(|kind| kind.parts() == *parts).expect("a kind");
        let row = [
            a.body.index() as u32,
            a.element,
            b.body.index() as u32,
            b.element,
        ];
        !named.contains(&(kind, row))
    };
    let query = Query::all().exclude(&at_rest);
    check(&scene, &query, &scene, &Query::all(), false, keeps);
    // Other numbers: a query about one body, and a body before the others that is new.
    let query = Query::self_of(bodies[0]).exclude(&at_rest);
    check(
        &scene,
        &query,
        &scene,
        &Query::self_of(bodies[0]),
        false,
        keeps,
    );
    let points: Vec<[f32; 3]> = (0..7).map(|ix| [ix as f32, 20.0, 0.0]).collect();
    scene.add_edges(&[[0, 1], [2, 3]], &points).expect("good");
    let query = Query::all().exclude(&at_rest).exclude(Exclusion::rings(1));
    let rings = Query::all().exclude(Exclusion::rings(1));
    check(&scene, &query, &scene, &rings, false, keeps);
    // The look at the start of a step leaves out what the step does: all that intersects is near.
    let intersects = |query: &Query, detector: &mut Detector| {
        let query = query.clone().start(Start::Verify);
        let taken = detector.advance(&scene, &query).expect("good");
        taken.start_intersects
    };
    assert_eq!(intersects(&Query::between_all(), &mut detector), Some(true));
    let between = Query::between_all().exclude(&at_rest);
    assert_eq!(intersects(&between, &mut detector), Some(false));
    assert_eq!(query, query.clone());
    assert_ne!(query, rings);
}

/// Faces that were near at rest, and later intersect, by the corners of what was near.
fn check_elements_at_rest(rest: &Scene, moved: &Scene) {
    let mut n_left_out = [0; 2];
    for mut detector in detectors() {
        let at_rest = detector.near(rest, 0.05, &Query::all()).expect("good");
        let named: Vec<([BodyId; 2], [Vec<u32>; 2])> = at_rest
            .iter()
            .map(|pair| {
                let named = (pair.kind.parts(), [pair.a, pair.b]);
                ([pair.a.body, pair.b.body], corners_of_both(rest, &named))
            })
            .collect();
        let has = |[a, b]: [Element; 2]| {
            let pair = [a, b].map(|of| corners(moved, Part::Given, of));
            let holds = |of: usize, named: &[u32]| named.iter().all(|at| pair[of].contains(at));
            let bodies = [a.body, b.body];
            named.iter().any(|(of, [first, second])| {
                (*of == bodies && holds(0, first) && holds(1, second))
                    || (*of == [bodies[1], bodies[0]] && holds(1, first) && holds(0, second))
            })
        };
        for all in [Query::all(), Query::self_all(), Query::between_all()] {
            let pairs = detector.detect(moved, &all).expect("good");
            let expected: Vec<_> = pairs.iter().filter(|&(a, b)| !has([a, b])).collect();
            let query = all.exclude(&at_rest);
            let found = detector.detect(moved, &query).expect("good");
            assert_eq!(found.iter().collect::<Vec<_>>(), expected);
            let n = detector.count(moved, &query).expect("good");
            assert_eq!(n, expected.len() as u64);
            assert_eq!(detector.any(moved, &query).expect("good"), n > 0);
            n_left_out[0] += pairs.len() - found.len();
            n_left_out[1] += found.len();
        }
    }
    assert!(n_left_out.iter().all(|&n| n > 20), "{n_left_out:?}");
}

/// The scene where its bodies are at the end of their step.
fn at_end(scene: &Scene) -> Scene {
    let mut moved = scene.clone();
    for (id, body) in scene.bodies() {
        if let Some(end) = body.end_positions() {
            moved.set_positions(id, end).expect("good");
        }
    }
    moved
}

#[test]
fn elements_that_were_near_are_left_out_of_intersections() {
    let (rest, _) = scene(12);
    let moved = at_end(&rest);
    check_elements_at_rest(&rest, &moved);
    // Of faces without a common vertex, these are the ones that were within the distance.
    let mut detector = detectors().into_iter().next().expect("some");
    let [mut near, mut shares] = [BTreeSet::new(), BTreeSet::new()];
    let faces = Query::all().kinds([PairKind::FaceFace]);
    for pair in &detector.near(&rest, 0.05, &faces).expect("good") {
        near.insert((pair.a, pair.b));
    }
    let at_rest = detector.near(&rest, 0.05, &Query::all()).expect("good");
    let all = detector.detect(&moved, &Query::all()).expect("good");
    for (a, b) in all.iter() {
        let [of_a, of_b] = [a, b].map(|of| corners(&moved, Part::Given, of));
        if a.body == b.body && of_a.iter().any(|at| of_b.contains(at)) {
            shares.insert((a, b));
        }
    }
    let query = Query::all().exclude(&at_rest);
    let found = detector.detect(&moved, &query).expect("good");
    let apart = |pair: &(Element, Element)| !shares.contains(pair);
    let expected: Vec<_> = all
        .iter()
        .filter(|pair| apart(pair) && !near.contains(pair))
        .collect();
    assert_eq!(found.iter().filter(apart).collect::<Vec<_>>(), expected);
    // Everything that intersects is near.
    let now = detector.near(&moved, 0.0, &Query::all()).expect("good");
    let query = Query::between_all().exclude(&now);
    assert!(!detector.any(&moved, &query).expect("good"));
    assert!(detector.any(&moved, &Query::between_all()).expect("good"));
}

/// Of all kinds of bodies, of edges that have their own numbers, and of bodies that are gone.
#[test]
fn elements_of_all_kinds_that_were_near_are_left_out() {
    let mut random = Random::new(5);
    let (mut rest, [cloth, ball]) = scene(6);
    let block = solids::block(3, 3, 2, 0.4);
    let block = block.add_to(&mut rest).expect("good");
    let some = |random: &mut Random, n: usize| -> Vec<[f32; 3]> {
        (0..n).map(|_| random.point(-0.6, 0.6)).collect()
    };
    let ends: Vec<[u32; 2]> = (0..40).map(|ix| [2 * ix, 2 * ix + 1]).collect();
    let lines = rest.add_edges(&ends, &some(&mut random, 80)).expect("good");
    rest.add_points(&some(&mut random, 30)).expect("good");
    let edges = rest.body(cloth).expect("held").edges();
    let mut own: Vec<[u32; 2]> = (0..edges.len())
        .map(|ix| [1, 0].map(|end| edges.corners(ix)[end]))
        .collect();
    own.reverse();
    rest.set_edges(cloth, &own).expect("good");
    let mut moved = at_end(&rest);
    moved
        .set_positions(lines, some(&mut random, 80))
        .expect("good");
    let n = moved.body(block).expect("held").n_vertices();
    moved
        .set_positions(block, some(&mut random, n))
        .expect("good");
    check_elements_at_rest(&rest, &moved);
    // The answer names a body that one clone no longer has.
    let mut detector = detectors().into_iter().next().expect("some");
    let at_rest = detector.near(&rest, 0.05, &Query::all()).expect("good");
    let query = Query::all().exclude(&at_rest);
    let mut fewer = moved.clone();
    fewer.remove(ball).expect("held");
    let afresh = Query::all().exclude(&at_rest);
    let n = detector.count(&moved, &afresh).expect("good");
    let counts = [&fewer, &moved, &fewer].map(|of| detector.count(of, &query).expect("good"));
    assert!(counts[0] < n, "{counts:?}");
    assert_eq!(counts, [counts[0], n, counts[0]]);
    let alone = Query::all().exclude((ball, ball)).exclude(&at_rest);
    let of_others = detector.detect(&moved, &alone).expect("good");
    let others = of_others
        .iter()
        .filter(|(a, b)| a.body != ball && b.body != ball);
    assert_eq!(others.count() as u64, counts[0]);
    // Elements that have other numbers than those that were near.
    let mut other = moved.clone();
    own.rotate_left(1);
    other.set_edges(cloth, &own).expect("good");
    for question in [
        detector.detect(&other, &query).map(drop),
        detector.count(&other, &query).map(drop),
        detector.any(&other, &query).map(drop),
    ] {
        let error = question.expect_err("other numbers");
        assert!(
            matches!(error, Error::Remeshed { body } if body == cloth),
            "{error}"
        );
    }
    assert!(
        detector
            .detect(&other, &Query::self_of(ball).exclude(&at_rest))
            .is_ok()
    );
}

#[test]
fn bad_exclusions_are_refused_by_name() {
    let (mut scene, bodies) = scene(1);
    let mut detector = detectors().into_iter().next().expect("some");
    let query = Query::all().exclude(Exclusion::rings(17));
    let error = detector.near(&scene, 0.1, &query).expect_err("refused");
    assert!(matches!(
        error,
        Error::Setting {
            setting: "rings",
            ..
        }
    ));
    let error = scene.set_pinned(bodies[0], &[true]).expect_err("refused");
    assert_eq!(
        error.to_string(),
        format!(
            "body {}: 1 pinned given, but there are {} vertices",
            bodies[0],
            scene.body(bodies[0]).expect("held").n_vertices()
        )
    );
    assert!(scene.set_groups(bodies[1], &[]).is_err());
    let query = Query::between_all().exclude(Exclusion::rings(1));
    let error = detector.nearest(&scene, &query).expect_err("refused");
    assert!(matches!(
        error,
        Error::Setting {
            setting: "exclude",
            ..
        }
    ));
}

/// Exclusions that name bodies of another scene are refused by every question that takes them; those
/// of a clone, and of bodies that were removed, are not.
#[test]
fn exclusions_of_another_scene_are_refused() {
    let (mut scene, bodies) = scene(1);
    let (rest, others) = self::scene(1);
    let mut detector = detectors().into_iter().next().expect("some");
    let [at_rest, own] =
        [&rest, &scene.clone()].map(|of| detector.near(of, 0.05, &Query::all()).expect("good"));
    let corners = Query::all().kinds([PairKind::VertexVertex]);
    let far = detector.near(&rest, 0.0, &corners).expect("good");
    assert!(!own.is_empty() && far.is_empty());
    let lists = |[a, b]: [BodyId; 2]| {
        let n = rest.body(others[0]).expect("held").n_vertices();
        Exclusion::vertices(a, b, vec![0; n + 1], [])
    };
    let none = detector.near(&Scene::new(), 1.0, &Query::all());
    let none = Exclusion::from(&none.expect("good"));
    let foreign: [(Exclusion, BodyId); 6] = [
        ((others[0], others[1]).into(), others[0]),
        ((bodies[0], others[1]).into(), others[1]),
        (lists(others), others[0]),
        (lists([bodies[0], others[1]]), others[1]),
        ((&at_rest).into(), others[0]),
        // Also where nothing was near.
        ((&far).into(), others[0]),
    ];
    for (exclusion, named) in foreign {
        let query = Query::all().exclude(exclusion);
        let answers = [
            detector.near(&scene, 0.1, &query).err(),
            detector.neighbours(&scene, 0.1, &query).err(),
            detector.safe_distances(&scene, 0.1, &query).err(),
            detector.candidates(&scene, 0.1, &query).err(),
            detector.impacts(&scene, &query).err(),
            detector.is_free(&scene, &query).err(),
            detector.advance(&scene, &query).err(),
            detector.truncate(&scene, &query).err(),
        ];
        for error in answers {
            let error = error.expect("refused");
            let Error::UnknownBody { body, n_bodies: 2 } = error else {
                panic!("{error}");
            };
            assert_eq!(body, named);
            assert!(error.to_string().contains("another scene"), "{error}");
        }
    }
    let error = detector.near(&Scene::new(), 0.1, &Query::all().exclude(&at_rest));
    assert!(matches!(error, Err(Error::UnknownBody { .. })));
    // About elements as they were given, and about whole bodies.
    let query = Query::between_all().exclude((others[0], others[1]));
    assert!(detector.detect(&scene, &query).is_err());
    assert!(detector.count(&scene, &query).is_err());
    assert!(detector.any(&scene, &query).is_err());
    assert!(detector.nearest(&scene, &query).is_err());
    let query = Query::all().exclude(lists(others));
    assert!(detector.detect(&scene, &query).is_err());
    // What is known of this scene.
    let query = Query::all().exclude(&own).exclude(lists(bodies));
    let query = query.exclude((bodies[1], bodies[1])).exclude(none);
    let late = scene.add_points(&[[9.0f32; 3]]).expect("good");
    let query = query.exclude((late, late));
    detector.near(&scene, 0.1, &query).expect("good");
    let mut clone = scene.clone();
    clone.remove(bodies[1]).expect("held");
    detector.near(&clone, 0.1, &query).expect("good");
    clone.remove(late).expect("held");
    clone.add_points(&[[9.0f32; 3]]).expect("good");
    detector.near(&clone, 0.1, &query).expect("good");
}

/// A detector with a memory budget compares the vertices of every candidate; one without knows the
/// excluded pairs of a body as bits.
#[test]
fn excluded_pairs_are_known_whatever_was_asked_before() {
    let settings = || Settings::new().threads(3).backend(Backend::Cpu);
    let mut by_bits = Detector::new(settings()).expect("settings");
    let mut one_by_one = Detector::new(settings().memory_budget(1 << 30)).expect("settings");
    let mut scene = Scene::new();
    let ball = surfaces::bumpy_ball(900, 0.4);
    let mut random = Random::new(3);
    let mut at = |positions: &[[f32; 3]], by: f32| -> Vec<[f32; 3]> {
        let moved = |p: &[f32; 3]| {
            let q = random.point(-by, by);
            [0, 1, 2].map(|axis| p[axis] + q[axis])
        };
        positions.iter().map(moved).collect()
    };
    let body = scene
        .add((ball.elements.clone(), at(&ball.positions, 0.05)))
        .expect("good");
    let cloth = surfaces::cloth(25, 20, 1.5);
    let falling = scene
        .add((cloth.elements.clone(), at(&cloth.positions, 0.1)))
        .expect("good");
    let mut n_pairs = BTreeSet::new();
    for round in 0..6 {
        match round {
            // Other positions, other clusters, other elements, marked vertices.
            1 => {
                let positions = at(&ball.positions, 0.2);
                scene.set_positions(body, positions).expect("good");
            }
            2 => {
                // The clusters fit no more, and are made anew.
                let mut positions = at(&ball.positions, 0.05);
                positions.reverse();
                scene.set_positions(body, positions).expect("good");
            }
            3 => {
                let Elements::Triangles(mut faces) = ball.elements.clone() else {
                    panic!("triangles")
                };
                faces.reverse();
                faces.truncate(faces.len() - 7);
                let mesh = (Elements::Triangles(faces), ball.positions.clone());
                scene.remesh(body, mesh).expect("good");
            }
            4 => {
                let n = scene.body(falling).expect("held").n_vertices();
                let pinned: Vec<bool> = (0..n).map(|ix| ix % 3 != 1).collect();
                scene.set_pinned(falling, &pinned).expect("good");
                let groups: Vec<u32> = (0..n).map(|ix| (ix / 50) as u32).collect();
                scene.set_groups(falling, &groups).expect("good");
            }
            _ => {}
        }
        let kinds = [
            PairKind::VertexFace,
            PairKind::EdgeEdge,
            PairKind::EdgeFace,
            PairKind::VertexVertex,
        ];
        let all = Query::all().kinds(kinds);
        let n = scene.body(body).expect("held").n_vertices();
        let offsets: Vec<u64> = (0..=n as u64).collect();
        let next: Vec<u32> = (0..n as u32).map(|ix| (ix * 7 + 1) % n as u32).collect();
        let lists = Exclusion::vertices(body, body, offsets, next);
        let near = by_bits.near(&scene, 0.1, &all).expect("good");
        let queries = [
            all.clone(),
            all.clone().exclude(Exclusion::rings(1)),
            all.clone().exclude(lists.clone()),
            all.clone().exclude(&near),
            all.clone().exclude(Exclusion::rings(2)).exclude(lists),
            Query::self_of(body).exclude(Exclusion::rings(2)),
            all.exclude(Exclusion::rings(3))
                .exclude(Exclusion::groups(1, 1)),
        ];
        for query in queries.iter().chain(&queries[..2]) {
            let of = |detector: &mut Detector| {
                let near = detector.near(&scene, 0.15, query).expect("good");
                near.iter()
                    .map(|pair| (pair.kind, pair.row()))
                    .collect::<Vec<_>>()
            };
            let found = of(&mut by_bits);
            assert!(found == of(&mut one_by_one), "{round}: {query:?}");
            n_pairs.insert(found.len());
        }
    }
    assert!(n_pairs.len() > 20, "{n_pairs:?}");
}

/// A fan whose middle all triangles share has no such bits: they would be one for each pair.
#[test]
fn rings_of_fans_are_left_out() {
    let n = 300;
    let mut positions = vec![[0.0f32; 3]];
    positions.extend((0..n).map(|ix| {
        let angle = ix as f32 * 0.02;
        [angle.cos(), angle.sin(), 0.01 * ix as f32]
    }));
    let faces: Vec<[u32; 3]> = (1..n).map(|ix| [0, ix, ix + 1]).collect();
    let mut scene = Scene::new();
    let fan = scene.add_triangles(&faces, &positions).expect("good");
    let query = Query::all().exclude(Exclusion::rings(1));
    for mut detector in detectors() {
        // Everything is one edge from the middle, and shares a vertex with all faces; rims of the
        // fan that are far apart in it are near.
        let near = detector.near(&scene, 0.5, &query).expect("good");
        assert!(!near.is_empty());
        let edges = scene.body(fan).expect("held").edges();
        for pair in near.iter() {
            assert_eq!(pair.kind, PairKind::EdgeEdge);
            let ends = [pair.a, pair.b].map(|of| edges.corners(of.element as usize));
            assert!(ends[0].iter().all(|v| {
                ends[1]
                    .iter()
                    .all(|w| *v != 0 && *w != 0 && v.abs_diff(*w) > 1)
            }));
        }
    }
}

/// What a body that takes no part was re-meshed to plays no part, in the scene that is asked about or
/// in one that was asked about before.
#[test]
fn bodies_that_take_no_part_may_be_remeshed() {
    let mut rest = Scene::new();
    let [a, b, c] = [9u8, 7, 8].map(|n| {
        let sheet = surfaces::cloth(n.into(), n.into(), 0.2);
        let sheet = sheet.translated([0.0, 0.0, 0.05 * f32::from(n)]);
        rest.add((sheet.elements, sheet.positions)).expect("good")
    });
    let mut detector = detectors().into_iter().next().expect("some");
    // Only some vertices and faces of the first body are near those of others.
    let query = Query::all().kinds([PairKind::VertexFace, PairKind::EdgeEdge]);
    let at_rest = detector.near(&rest, 0.075, &query).expect("good");
    let mut moved = rest.clone();
    for (body, n) in [(a, 9u8), (b, 7), (c, 8)] {
        let mut random = Random::new(n.into());
        let sheet = surfaces::cloth(n.into(), n.into(), 0.2);
        let crumpled = sheet.positions.iter().map(|p| {
            let q = random.point(-0.2, 0.2);
            [0, 1, 2].map(|axis| p[axis] + q[axis])
        });
        let crumpled: Vec<[f32; 3]> = crumpled.collect();
        moved.set_positions(body, crumpled).expect("good");
    }
    let hash = |detector: &mut Detector, scene: &Scene, query: &Query| {
        detector.detect(scene, query).expect("good").hash()
    };
    // An exclusion of its own, or one that all questions share.
    let afresh = || Exclusion::from(&at_rest);
    let shared = afresh();
    let of_two = |exclusion| Query::between(b, c).exclude(exclusion);
    let whole = |exclusion| Query::all().exclude(exclusion);
    let expected = hash(&mut detector, &moved, &of_two(afresh()));
    assert_ne!(expected, hash(&mut detector, &moved, &Query::between(b, c)));
    let of_all = hash(&mut detector, &moved, &whole(afresh()));
    for n in [2, 20] {
        let mut remeshed = moved.clone();
        let sheet = surfaces::cloth(n, n, 0.2);
        let mesh = (sheet.elements, sheet.positions);
        remeshed.remesh(a, mesh).expect("good");
        for exclusion in [&afresh(), &shared] {
            let [two, whole] = [of_two(exclusion.clone()), whole(exclusion.clone())];
            assert_eq!(hash(&mut detector, &remeshed, &two), expected);
            let error = detector
                .detect(&remeshed, &whole)
                .expect_err("other numbers");
            assert!(
                matches!(error, Error::Remeshed { body } if body == a),
                "{error}"
            );
            // The same exclusion, in the scene that still has what it names.
            assert_eq!(hash(&mut detector, &moved, &whole), of_all);
            assert_eq!(hash(&mut detector, &moved, &two), expected);
        }
    }
}
