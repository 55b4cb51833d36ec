//! The inequality of safe distances in rational arithmetic that is written here, and shares nothing
//! with the tests of the library.

use dashu_int::IBig;

use std::collections::{BTreeMap, BTreeSet};

use super::near::PARTS;
use super::safe::{Held, elements, pairs, points, scene, set_each};
use impinge_core::exact::Point;
use impinge_core::{BodyId, Bounds, Exclusion, PairKind, Part, Query, SafeDistances, Scene};
use impinge_scenes::Random;
use impinge_testing::data::test_file;
use impinge_tests::{detectors, thickness_of};

type Vector = [IBig; 3];

/// All numbers here are whole multiples of this power of two.
const UNIT: i32 = -160;

/// A float in units.
fn whole(x: f64) -> IBig {
    if x == 0.0 {
        return IBig::ZERO;
    }
    let bits = x.to_bits();
    let exponent = (bits >> 52) as i32 & 0x7ff;
    let fraction = bits & ((1 << 52) - 1) | 1 << 52;
    let shift = exponent - 1075 - UNIT;
    assert!(exponent > 0 && shift >= 0, "{x:e}");
    let size = IBig::from(fraction) << shift as usize;
    if x < 0.0 { -size } else { size }
}

fn minus(a: &Vector, b: &Vector) -> Vector {
    std::array::from_fn(|k| &a[k] - &b[k])
}

fn dot(a: &Vector, b: &Vector) -> IBig {
    (0..3).map(|k| &a[k] * &b[k]).sum()
}

fn cross(a: &Vector, b: &Vector) -> Vector {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| &a[i] * &b[j] - &a[j] * &b[i])
}

/// The square of a distance: a numerator, and a denominator above 0.
#[derive(Clone)]
struct Square(IBig, IBig);

impl Square {
    fn least(self, other: Square) -> Square {
        match &self.0 * &other.1 <= &other.0 * &self.1 {
            true => self,
            false => other,
        }
    }

    /// Whether a length is below the distance, or its square.
    fn is_above(&self, length: &IBig) -> bool {
        length * length * &self.1 < self.0
    }
}

fn of_points(p: &Vector, q: &Vector) -> Square {
    let way = minus(p, q);
    Square(dot(&way, &way), IBig::ONE)
}

fn of_point_segment(p: &Vector, [a, b]: [&Vector; 2]) -> Square {
    let (edge, way) = (minus(b, a), minus(p, a));
    let (along, length) = (dot(&way, &edge), dot(&edge, &edge));
    if along <= IBig::ZERO {
        return of_points(p, a);
    }
    if along >= length {
        return of_points(p, b);
    }
    Square(dot(&way, &way) * &length - &along * &along, length)
}

/// In the plane of the triangle, if the point is over it; else at an edge.
fn of_point_triangle(p: &Vector, corners: [&Vector; 3]) -> Square {
    let [a, b, c] = corners;
    let sides = [[a, b], [b, c], [c, a]];
    let edges = sides.map(|side| of_point_segment(p, side));
    let [x, y, z] = edges;
    let nearest = x.least(y).least(z);
    let normal = cross(&minus(b, a), &minus(c, a));
    let length = dot(&normal, &normal);
    let is_inside = |[from, to]: [&Vector; 2]| {
        dot(&cross(&minus(to, from), &minus(p, from)), &normal) >= IBig::ZERO
    };
    if length == IBig::ZERO || !sides.into_iter().all(is_inside) {
        return nearest;
    }
    let height = dot(&minus(p, a), &normal);
    Square(&height * &height, length)
}

/// Where the lines come nearest, if that is between the ends of both; else at an end.
fn of_segments([a, b]: [&Vector; 2], [c, d]: [&Vector; 2]) -> Square {
    let nearest = of_point_segment(a, [c, d])
        .least(of_point_segment(b, [c, d]))
        .least(of_point_segment(c, [a, b]))
        .least(of_point_segment(d, [a, b]));
    let (first, second, way) = (minus(b, a), minus(d, c), minus(c, a));
    let normal = cross(&first, &second);
    let length = dot(&normal, &normal);
    let shares = [&second, &first].map(|other| dot(&cross(&way, other), &normal));
    let is_between = |share: &IBig| *share >= IBig::ZERO && *share <= length;
    if length == IBig::ZERO || !shares.iter().all(is_between) {
        return nearest;
    }
    let height = dot(&way, &normal);
    Square(&height * &height, length)
}

/// The square of the distance of two elements: `a` is the one that the kind names first.
fn distance(kind: PairKind, a: &[Point], b: &[Point]) -> Square {
    let [a, b] = [a, b].map(|points| Vec::from_iter(points.iter().map(|p| p.map(whole))));
    match kind {
        PairKind::VertexFace => of_point_triangle(&a[0], [&b[0], &b[1], &b[2]]),
        PairKind::EdgeEdge => of_segments([&a[0], &a[1]], [&b[0], &b[1]]),
        PairKind::EdgeVertex => of_point_segment(&b[0], [&a[0], &a[1]]),
        _ => of_points(&a[0], &b[0]),
    }
}

/// Whether an edge and a face share a point: an end on the face, a side of the face that meets the
/// edge, or the ends on either side of the plane and all corners on one side of the edge's line.
fn meet(edge: &[Point], face: &[Point]) -> bool {
    let [edge, face] =
        [edge, face].map(|points| Vec::from_iter(points.iter().map(|p| p.map(whole))));
    let ([p, q], [a, b, c]) = ([&edge[0], &edge[1]], [&face[0], &face[1], &face[2]]);
    let touches = |square: Square| square.0 == IBig::ZERO;
    if [p, q]
        .into_iter()
        .any(|end| touches(of_point_triangle(end, [a, b, c])))
        || [[a, b], [b, c], [c, a]]
            .into_iter()
            .any(|side| touches(of_segments([p, q], side)))
    {
        return true;
    }
    let normal = cross(&minus(b, a), &minus(c, a));
    let way = minus(q, p);
    let corners = [a, b, c].map(|corner| minus(corner, p));
    let turns = [(0, 1), (1, 2), (2, 0)]
        .map(|(from, to): (usize, usize)| dot(&way, &cross(&corners[from], &corners[to])));
    let are = |sign: fn(&IBig) -> bool| turns.iter().all(sign);
    let heights = [p, q].map(|end| dot(&minus(end, a), &normal));
    &heights[0] * &heights[1] < IBig::ZERO && (are(|x| *x > IBig::ZERO) || are(|x| *x < IBig::ZERO))
}

#[test]
fn known_edges_meet_a_face() {
    let face = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
    let flat = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [2.0, 0.0, 0.0]];
    for (edge, face, expected) in [
        ([[1.0, 1.0, -1.0], [1.0, 1.0, 1.0]], &face, true),
        ([[1.0, 1.0, 1.0], [1.0, 1.0, -1.0]], &face, true),
        ([[3.0, 3.0, -1.0], [3.0, 3.0, 1.0]], &face, false),
        ([[1.0, 1.0, 1.0], [1.0, 1.0, 2.0]], &face, false),
        // An end on the face, on a side, on a corner.
        ([[1.0, 1.0, 0.0], [1.0, 1.0, 1.0]], &face, true),
        ([[2.0, 2.0, 0.0], [3.0, 3.0, 1.0]], &face, true),
        ([[4.0, 0.0, 0.0], [5.0, 0.0, 1.0]], &face, true),
        // Through a side, through a corner, past it.
        ([[2.0, 2.0, -1.0], [2.0, 2.0, 1.0]], &face, true),
        ([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]], &face, true),
        ([[-0.5, -0.5, -1.0], [-0.5, -0.5, 1.0]], &face, false),
        // In its plane: across it, within it, beside it.
        ([[-1.0, 1.0, 0.0], [9.0, 1.0, 0.0]], &face, true),
        ([[0.5, 0.5, 0.0], [1.0, 1.0, 0.0]], &face, true),
        ([[3.0, 3.0, 0.0], [9.0, 3.0, 0.0]], &face, false),
        // A face that is a segment, and an edge that is a point.
        ([[1.0, -1.0, 0.0], [1.0, 1.0, 0.0]], &flat, true),
        ([[1.0, -1.0, 1.0], [1.0, 1.0, 1.0]], &flat, false),
        ([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0]], &face, true),
        ([[1.0, 1.0, 0.5], [1.0, 1.0, 0.5]], &face, false),
    ] {
        assert_eq!(meet(&edge, face), expected, "{edge:?} {face:?}");
    }
}

#[test]
fn known_distances_are_those() {
    let three = |x: f64, y: f64, z: f64| [x, y, z];
    let face = [
        three(0.0, 0.0, 0.0),
        three(4.0, 0.0, 0.0),
        three(0.0, 4.0, 0.0),
    ];
    let unit = whole(1.0);
    let of = |kind, a: &[Point], b: &[Point], square: i32| {
        let Square(n, d) = distance(kind, a, b);
        assert_eq!(n, &unit * &unit * IBig::from(square) * d);
    };
    of(PairKind::VertexFace, &[three(1.0, 1.0, -3.0)], &face, 9);
    of(PairKind::VertexFace, &[three(5.0, 0.0, 1.0)], &face, 2);
    of(PairKind::VertexFace, &[three(4.0, 4.0, 0.0)], &face, 8);
    of(PairKind::VertexFace, &[three(-1.0, 2.0, 2.0)], &face, 5);
    let edge = [three(0.0, 0.0, 0.0), three(4.0, 0.0, 0.0)];
    of(
        PairKind::EdgeEdge,
        &edge,
        &[three(1.0, -1.0, 2.0), three(1.0, 1.0, 2.0)],
        4,
    );
    of(
        PairKind::EdgeEdge,
        &edge,
        &[three(1.0, 1.0, 0.0), three(9.0, 1.0, 0.0)],
        1,
    );
    of(
        PairKind::EdgeEdge,
        &edge,
        &[three(6.0, 0.0, 1.0), three(6.0, 9.0, 1.0)],
        5,
    );
    of(PairKind::EdgeVertex, &edge, &[three(2.0, 2.0, 0.0)], 4);
    of(PairKind::VertexVertex, &edge[..1], &edge[1..], 16);
    // Two thirds of a square are no whole number.
    let slanted = [
        three(1.0, 0.0, 0.0),
        three(0.0, 1.0, 0.0),
        three(0.0, 0.0, 1.0),
    ];
    let Square(n, d) = distance(PairKind::VertexFace, &[[0.0; 3]], &slanted);
    assert_eq!(n * IBig::from(3), &unit * &unit * d);
}

/// Holds the bounds against the pairs that a question is about, given one by one.
struct Check<'a> {
    scene: &'a Scene,
    safe: &'a SafeDistances,
    most: f64,
    fixed: &'a [BodyId],
    /// For each vertex, whether a pair says why it may not go farther.
    reasons: BTreeMap<(BodyId, u32), bool>,
    n_touching: usize,
}

impl Check<'_> {
    fn bound(&self, body: BodyId, vertex: u32) -> f64 {
        self.safe.of(body).expect("held").get(vertex as usize)
    }

    fn largest(&self, of: &Held) -> f64 {
        let own = of.corners.iter().map(|&corner| self.bound(of.body, corner));
        own.fold(0.0, f64::max)
    }

    fn thickness(&self, of: &Held) -> IBig {
        whole(thickness_of(self.scene, of.body, of.part, of.element))
    }

    /// Together, both move less than they are apart; or neither moves.
    fn pair(&mut self, kind: PairKind, a: &Held, b: &Held) {
        let square = distance(kind, &points(self.scene, a), &points(self.scene, b));
        let moves = [a, b].map(|of| whole(self.largest(of)));
        let thick = self.thickness(a) + self.thickness(b);
        let [x, y] = &moves;
        let is_safe = square.is_above(&(x + y + &thick));
        let stays = moves.iter().all(|of| *of == IBig::ZERO);
        self.n_touching += usize::from(!is_safe);
        assert!(is_safe || stays, "{kind:?} {a:?} {b:?}");
        // A bound is at least its share of the distance, less a part of 2^-10.
        let is_fixed = [a, b].map(|of| self.fixed.contains(&of.body));
        let n_shares = if is_fixed == [false; 2] { 2 } else { 1 };
        for of in [a, b] {
            for &corner in &of.corners {
                let bound = whole(self.bound(of.body, corner)) * IBig::from(n_shares * 1024);
                let is_reason = {
                    let Square(n, d) = &square;
                    let length = bound + &thick * IBig::from(1023);
                    &length * &length * d >= n * IBig::from(1023 * 1023)
                };
                let reason = self.reasons.entry((of.body, corner)).or_default();
                *reason |= is_reason;
            }
        }
    }

    /// An edge and a face that meet stay where they are. Returns whether they do meet.
    fn edge_face(&mut self, e: &Held, f: &Held) -> bool {
        let meets = meet(&points(self.scene, e), &points(self.scene, f));
        if meets {
            for of in [e, f] {
                assert_eq!(self.largest(of), 0.0, "{e:?} {f:?}");
                let own = of.corners.iter().map(|&corner| (of.body, corner));
                self.reasons.extend(own.map(|vertex| (vertex, true)));
            }
        }
        meets
    }

    /// Every vertex may go as far as any, exactly, or has a reason. Returns how many have one.
    fn end(&self) -> usize {
        let mut n_bounded = 0;
        let bodies = self.scene.bodies();
        let vertices =
            bodies.flat_map(|(id, body)| (0..body.n_vertices() as u32).map(move |v| (id, v)));
        for (body, vertex) in vertices {
            let has_reason = self.reasons.get(&(body, vertex)) == Some(&true);
            let bound = self.bound(body, vertex);
            let is_fixed = self.fixed.contains(&body);
            // In the precision of the body, rounded down.
            let whole = match self.safe.of(body) {
                Some(Bounds::F32(_)) if f64::from(self.most as f32) > self.most => {
                    f64::from((self.most as f32).next_down())
                }
                Some(Bounds::F32(_)) => f64::from(self.most as f32),
                _ => self.most,
            };
            let is_whole = bound == whole;
            assert!(bound <= self.most, "{vertex} {bound}");
            match is_fixed {
                true => assert_eq!(bound, 0.0, "{vertex}"),
                false => assert!(has_reason || is_whole, "{vertex} {bound}"),
            }
            n_bounded += usize::from(!is_whole && !is_fixed);
        }
        n_bounded
    }
}

/// Points of a lattice whose axes are slanted: many elements are parallel or in one plane, and no
/// coordinate says so.
fn slanted(seed: u64) -> (Scene, Vec<BodyId>) {
    let mut random = Random::new(seed);
    let mut scene = Scene::new();
    let axes = [[3.0, 1.0, -2.0], [-1.0, 4.0, 1.0], [2.0, -1.0, 5.0]];
    let mut points = |n: usize, levels: u32| {
        Vec::from_iter((0..n).map(|_| {
            let steps = [random.below(4), random.below(4), random.below(levels)].map(f64::from);
            [0, 1, 2]
                .map(|k: usize| (0..3).map(|axis| steps[axis] * axes[axis][k]).sum::<f64>() / 32.0)
        }))
    };
    let faces = [[0, 1, 2], [2, 1, 3], [4, 5, 6], [7, 5, 6]];
    let bodies = [
        scene.add_triangles(&faces, &points(8, 3)),
        // All of it in one plane.
        scene.add_triangles(&faces, &points(8, 1)),
        scene.add_edges(&[[0, 1], [1, 2]], &points(3, 2)),
        scene.add_points(&points(3, 2)),
    ];
    let bodies = bodies.into_iter().collect::<Result<_, _>>();
    (scene, bodies.expect("good"))
}

#[test]
fn bounds_of_small_scenes_hold_as_rational_numbers() {
    let [mut n_touching, mut n_meeting, mut n_bounded, mut n_left_out] = [0; 4];
    let mut detectors = detectors();
    for seed in 0..60 {
        let (mut scene, bodies) = match seed % 3 {
            0 => scene(seed, false, seed % 2 == 0),
            1 => scene(seed, true, seed % 2 == 0),
            _ => slanted(seed),
        };
        let fixed = match seed % 4 {
            3 => vec![bodies[1]],
            _ => vec![],
        };
        if seed % 5 == 4 {
            scene.set_thickness(bodies[0], 0.1).expect("good");
            scene.set_thickness(bodies[2], 0.03).expect("good");
        }
        if seed % 5 == 3 {
            let part = PARTS[seed as usize / 5 % 3];
            set_each(&mut scene, bodies[0], part, |ix| 0.1 / (1 + ix % 4) as f64);
            set_each(&mut scene, bodies[1], part, |ix| 0.03 * (ix % 3) as f64);
        }
        let mut random = Random::new(seed);
        for (ix, &body) in bodies.iter().enumerate() {
            let n = scene.body(body).expect("held").n_vertices();
            let groups = Vec::from_iter((0..n).map(|_| random.below(2 + ix as u32)));
            scene.set_groups(body, &groups).expect("good");
        }
        let groups = |of: &Held| {
            let held = scene
                .body(of.body)
                .expect("held")
                .groups()
                .expect("set")
                .to_vec();
            Vec::from_iter(of.corners.iter().map(|&corner| held[corner as usize]))
        };
        let most = [0.05, 0.4, 2.0][seed as usize % 3];
        let all = Query::all().fixed(fixed.iter().copied());
        let grouped = all
            .clone()
            .exclude(Exclusion::groups(1, 1))
            .exclude(Exclusion::groups(0, 2));
        for (query, is_grouped) in [(all, false), (grouped, true)] {
            let query = query.exclude((bodies[3], bodies[2]));
            let detector = &mut detectors[(seed / 4) as usize % 4];
            let safe = detector.safe_distances(&scene, most, &query).expect("good");
            let mut check = Check {
                scene: &scene,
                safe: &safe,
                most,
                fixed: &fixed,
                reasons: Default::default(),
                n_touching: 0,
            };
            let counts = |a: &Held, b: &Held| {
                let meet = |(&g, &h): (&u32, &u32)| {
                    !is_grouped || ![(1, 1), (0, 2)].contains(&(g.min(h), g.max(h)))
                };
                let (own, others) = (groups(a), groups(b));
                let may = own.iter().any(|g| others.iter().any(|h| meet((g, h))));
                let bodies_of = [a.body, b.body];
                let are_named = bodies_of.contains(&bodies[2]) && bodies_of.contains(&bodies[3]);
                may && !are_named
            };
            for (kind, a, b, _) in pairs(&scene) {
                if counts(&a, &b) {
                    check.pair(kind, &a, &b);
                } else {
                    n_left_out += 1;
                }
            }
            for e in elements(&scene, Part::Edges) {
                for f in elements(&scene, Part::Faces) {
                    let shares =
                        e.body == f.body && e.corners.iter().any(|c| f.corners.contains(c));
                    if !shares && counts(&e, &f) {
                        n_meeting += usize::from(check.edge_face(&e, &f));
                    }
                }
            }
            n_bounded += check.end();
            n_touching += check.n_touching;
        }
    }
    assert!(
        n_touching > 1000 && n_meeting > 300 && n_bounded > 300 && n_left_out > 5000,
        "{n_touching} {n_meeting} {n_bounded} {n_left_out}"
    );
}

/// Of a real frame: the pairs whose boxes are near.
#[test]
fn bounds_of_a_real_frame_hold_as_rational_numbers() {
    let Some(path) = test_file("ccd/cloth-ball/frames/cloth_ball92.ply") else {
        return;
    };
    let mesh = impinge_io::read(&path, &impinge_io::ReadOptions::as_they_are()).expect("a mesh");
    let impinge_io::Elements::Triangles(faces) = mesh.elements else {
        panic!("a surface");
    };
    let mut scene = Scene::new();
    let body = match mesh.positions {
        impinge_io::Positions::F32(at) => scene.add((faces, at)),
        impinge_io::Positions::F64(at) => scene.add((faces, at)),
    };
    let body = body.expect("good");
    let held = scene.body(body).expect("held");
    let at = held.positions();
    let length = |corners: &[u32]| {
        let [p, q] = [0, 1].map(|ix| at.point(corners[ix] as usize));
        (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>().sqrt()
    };
    let n_edges = held.edges().len();
    let mean = (0..n_edges)
        .map(|ix| length(held.edges().corners(ix)))
        .sum::<f64>()
        / n_edges as f64;
    let most = 0.2 * mean;
    let [mut detector, ..] = detectors();
    let query = Query::all().exclude(Exclusion::rings(2));
    let safe = detector.safe_distances(&scene, most, &query).expect("good");
    let near = detector
        .candidates(&scene, 1.001 * most, &query)
        .expect("good");
    let mut check = Check {
        scene: &scene,
        safe: &safe,
        most,
        fixed: &[],
        reasons: Default::default(),
        n_touching: 0,
    };
    let held = |part: Part, element: u32| Held {
        body,
        part,
        element,
        corners: match part {
            Part::Vertices => vec![element],
            Part::Edges => held.edges().corners(element as usize).to_vec(),
            _ => held.faces().corners(element as usize).to_vec(),
        },
    };
    for (kind, a, b) in near.iter() {
        let [of_a, of_b] = kind.parts();
        check.pair(kind, &held(of_a, a.element), &held(of_b, b.element));
    }
    // The frame intersects itself in places: the same as are named.
    let mut meeting = BTreeSet::new();
    let crossing = query.kinds([PairKind::EdgeFace]);
    let crossing = detector.candidates(&scene, 0.0, &crossing).expect("good");
    for (_, e, f) in crossing.iter() {
        let [of_e, of_f] = [held(Part::Edges, e.element), held(Part::Faces, f.element)];
        if check.edge_face(&of_e, &of_f) {
            meeting.insert([e.element, f.element]);
        }
    }
    let named = safe.touching().of(PairKind::EdgeFace);
    let named = BTreeSet::from_iter(named.map(|pair| [pair.a.element, pair.b.element]));
    assert_eq!(meeting, named);
    let n_bounded = check.end();
    assert!(
        near.len() > 10_000 && n_bounded > 1000,
        "{} {n_bounded}",
        near.len()
    );
    assert!(!meeting.is_empty());
}
