//! Stencils: against textbook formulas, finite differences, exact distances and a merge by hand.

use std::collections::{BTreeMap, BTreeSet};

use impinge_core::exact::Feature;
use impinge_core::{
    Backend, Detector, Elements, Error, NearPairs, PairKind, Query, Scene, Settings, Stencil,
    Stencils, project_psd, project_psd_all,
};
use impinge_scenes::Random;

type Point = [f64; 3];

const KINDS: [PairKind; 4] = [
    PairKind::VertexFace,
    PairKind::EdgeEdge,
    PairKind::EdgeVertex,
    PairKind::VertexVertex,
];

fn near(scene: &Scene, distance: f64) -> NearPairs {
    let query = Query::all().kinds(KINDS).distances();
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    detector.near(scene, distance, &query).unwrap()
}

/// Triangles, edges and points, in general position or on a small lattice, where much is parallel,
/// degenerate or at the same place.
fn soup(seed: u64, lattice: Option<u32>) -> Scene {
    let mut random = Random::new(seed);
    let mut scene = Scene::new();
    let mut points = |n: usize| -> Vec<Point> {
        let mut coordinate = || match lattice {
            Some(n) => f64::from(random.below(n)),
            None => f64::from(random.range(-1.0, 1.0)) * 1.000_000_123,
        };
        (0..n).map(|_| [0; 3].map(|_| coordinate())).collect()
    };
    for _ in 0..2 {
        let faces: Vec<[u32; 3]> = (0..12).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        scene.add_triangles(&faces, &points(36)).unwrap();
    }
    let edges: Vec<[u32; 2]> = (0..8).map(|i| [2 * i, 2 * i + 1]).collect();
    scene.add_edges(&edges, &points(16)).unwrap();
    scene.add_points(&points(12)).unwrap();
    scene
}

fn positions(scene: &Scene) -> Vec<Point> {
    let bodies = scene.bodies();
    bodies
        .flat_map(|(_, body)| (0..body.n_vertices()).map(|ix| body.positions().point(ix)))
        .collect()
}

fn sub(p: Point, q: Point) -> Point {
    [0, 1, 2].map(|k| p[k] - q[k])
}

fn dot(p: Point, q: Point) -> f64 {
    p[0] * q[0] + p[1] * q[1] + p[2] * q[2]
}

fn cross(p: Point, q: Point) -> Point {
    [0, 1, 2].map(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        p[i] * q[j] - p[j] * q[i]
    })
}

/// The points that span the features.
fn spanning(of: &Stencil) -> [Vec<Point>; 2] {
    let p = of.points;
    let corners: [&[Point]; 2] = match of.kind {
        PairKind::VertexFace => [&p[..1], &p[1..]],
        PairKind::EdgeEdge => [&p[..2], &p[2..]],
        PairKind::EdgeVertex => [&p[1..3], &p[..1]],
        _ => [&p[..1], &p[1..2]],
    };
    [0, 1].map(|ix| match of.features[ix] {
        Feature::Vertex(v) => vec![corners[ix][usize::from(v)]],
        Feature::Edge(e) => {
            let e = usize::from(e);
            vec![corners[ix][e], corners[ix][(e + 1) % corners[ix].len()]]
        }
        Feature::Face => corners[ix].to_vec(),
    })
}

/// The squared distance of points, lines and planes, as textbooks have it.
fn textbook(of: &Stencil) -> f64 {
    let [mut a, mut b] = spanning(of);
    if a.len() > b.len() {
        std::mem::swap(&mut a, &mut b);
    }
    let to_plane = |way: Point, normal: Point| dot(way, normal).powi(2) / dot(normal, normal);
    match (a.len(), b.len()) {
        (1, 1) => dot(sub(a[0], b[0]), sub(a[0], b[0])),
        (1, 2) => {
            let area = cross(sub(a[0], b[0]), sub(a[0], b[1]));
            dot(area, area) / dot(sub(b[0], b[1]), sub(b[0], b[1]))
        }
        (1, 3) => to_plane(sub(a[0], b[0]), cross(sub(b[1], b[0]), sub(b[2], b[0]))),
        _ => to_plane(sub(a[0], b[0]), cross(sub(a[1], a[0]), sub(b[1], b[0]))),
    }
}

/// The sine of the angle between what spans the features: derivatives are as accurate as it is
/// large.
fn sine(of: &Stencil) -> f64 {
    let [a, b] = spanning(of);
    let ways: Vec<Point> = [a, b]
        .iter()
        .flat_map(|of| of[1..].iter().map(|&p| sub(p, of[0])).collect::<Vec<_>>())
        .collect();
    match ways[..] {
        [u, v] => {
            let n = cross(u, v);
            (dot(n, n) / (dot(u, u) * dot(v, v))).sqrt()
        }
        _ => 1.0,
    }
}

fn size(of: &Stencil) -> f64 {
    let [a, b] = spanning(of);
    let all: Vec<Point> = a.into_iter().chain(b).collect();
    let shortest = |p: Point| {
        let lengths = all.iter().map(|&q| dot(sub(p, q), sub(p, q)).sqrt());
        lengths.filter(|&x| x > 0.0).fold(f64::INFINITY, f64::min)
    };
    all.iter().map(|&p| shortest(p)).fold(1.0, f64::min)
}

/// A function's derivative by coordinate `i` of the points, by a rule of fourth order.
fn difference<const N: usize>(
    of: &Stencil,
    i: usize,
    step: f64,
    function: impl Fn(&Stencil) -> [f64; N],
) -> [f64; N] {
    let at = |by: f64| {
        let mut moved = *of;
        moved.points[i / 3][i % 3] += by;
        function(&moved)
    };
    let [a, b, c, d] = [-2.0, -1.0, 1.0, 2.0].map(|by| at(by * step));
    std::array::from_fn(|k| ((a[k] - d[k]) + 8.0 * (c[k] - b[k])) / (12.0 * step))
}

fn assert_near<const N: usize>(given: &[f64; N], expected: &[f64; N], tolerance: f64, what: &str) {
    for (given, expected) in given.iter().zip(expected) {
        assert!(
            (given - expected).abs() <= tolerance,
            "{what}: {given} {expected} {tolerance}"
        );
    }
}

/// Values against textbook formulas, first derivatives against differences of these, second
/// derivatives against differences of first ones.
fn check_derivatives(of: &Stencil) {
    let (sine, size) = (sine(of), size(of));
    let what = of.name();
    let [value, expected] = [of.squared_distance(), textbook(of)];
    assert!(
        (value - expected).abs() <= 1e-13 / sine,
        "{what}: {value} {expected}"
    );
    let way = (0..3).map(|k| {
        let terms = of.coefficients().into_iter().zip(of.points);
        terms.map(|(c, p)| c * p[k]).sum::<f64>()
    });
    let square: f64 = way.map(|x| x * x).sum();
    assert!((value - square).abs() <= 1e-13 / sine, "{what}");
    let gradient = of.gradient();
    let hessian = of.hessian();
    let n = match of.kind {
        PairKind::VertexVertex => 2,
        PairKind::EdgeVertex => 3,
        _ => 4,
    };
    for i in 0..3 * n {
        let step = 1e-3 * size * sine;
        let [slope] = difference(of, i, step, |of| [textbook(of)]);
        let allowed = 1e-9 / (size * sine).powi(2);
        assert!(
            (slope - gradient[i]).abs() <= allowed,
            "{what}: {slope} {} {allowed}",
            gradient[i]
        );
        let row = difference(of, i, step, Stencil::gradient);
        assert_near(&row, &hessian[i], 1e-8 / (size * sine).powi(3), what);
    }
    assert_symmetric(&hessian);
    assert!(gradient[3 * n..].iter().all(|&x| x == 0.0));
    assert!(hessian[3 * n..].as_flattened().iter().all(|&x| x == 0.0));
}

/// Bit by bit.
fn assert_symmetric<const N: usize>(matrix: &[[f64; N]; N]) {
    let bits = |of: fn(&[[f64; N]; N], [usize; 2]) -> f64| -> [[u64; N]; N] {
        std::array::from_fn(|i| std::array::from_fn(|j| of(matrix, [i, j]).to_bits()))
    };
    assert_eq!(bits(|m, [i, j]| m[i][j]), bits(|m, [i, j]| m[j][i]));
}

#[test]
fn derivatives_are_those_of_textbook_distances() {
    let mut seen = BTreeSet::new();
    for (seed, lattice) in [(1, None), (2, None), (3, Some(4)), (4, Some(3))] {
        let scene = soup(seed, lattice);
        let near = near(&scene, 0.8);
        let stencils = near.stencils(&scene, None).unwrap();
        assert_eq!(stencils.len(), near.len());
        let mut n = 0;
        for (pair, stencil) in near.iter().zip(&stencils) {
            assert_eq!(
                (pair.kind, pair.features, pair.name()),
                (stencil.kind, stencil.features, stencil.name())
            );
            seen.insert(stencil.name());
            let exact = pair.distance.expect("asked for").powi(2);
            let sine = sine(&stencil);
            assert!((stencil.squared_distance() - exact).abs() <= 1e-14 / sine);
            if sine * size(&stencil) > 0.02 {
                check_derivatives(&stencil);
                n += 1;
            }
            let coefficients = stencil.coefficients();
            assert!(coefficients.iter().sum::<f64>().abs() <= 1e-13 / sine);
            assert!(coefficients.iter().all(|x| x.abs() <= 1.0 + 1e-13 / sine));
            // What is not part of the features does not count.
            let n_used = spanning(&stencil).iter().map(Vec::len).sum::<usize>();
            assert!(coefficients.iter().filter(|&&x| x != 0.0).count() <= n_used);
        }
        assert!(n > 500 && n * 10 > near.len() * 9, "{n} of {}", near.len());
        for contact in &stencils.merged().unwrap() {
            if sine(&contact) * size(&contact) > 0.02 {
                check_derivatives(&contact);
            }
        }
    }
    let names = "P_T P_E0 P_E1 P_E2 P_T0 P_T1 P_T2 EA_EB EA_EB0 EA_EB1 EA0_EB EA1_EB EA0_EB0 EA0_EB1 EA1_EB0 EA1_EB1 P_E P_P";
    assert_eq!(seen, names.split(' ').collect());
}

/// The area at rest that belongs to the vertices of an element, found by looking at all elements.
fn area_by_hand(elements: &Elements, of: &[u32], rest: &[Point]) -> f64 {
    let at = |vertex: u32| rest[vertex as usize];
    let length = |of: Point| dot(of, of).sqrt();
    let has_all = |corners: &[u32]| of.iter().all(|vertex| corners.contains(vertex));
    match elements {
        Elements::Triangles(faces) => {
            let around = faces.iter().filter(|face| has_all(&face[..]));
            around
                .map(|&[a, b, c]| length(cross(sub(at(b), at(a)), sub(at(c), at(a)))) / 6.0)
                .sum()
        }
        Elements::Edges(edges) => {
            let around = edges.iter().filter(|edge| has_all(&edge[..]));
            let lengths = around.map(|&[a, b]| length(sub(at(b), at(a))));
            lengths.sum::<f64>() * 0.5 * of.len() as f64
        }
        _ => 1.0,
    }
}

#[test]
fn weights_by_area_are_those_of_elements_at_rest() {
    for scene in [folded(), soup(5, None)] {
        let rest: Vec<Point> = positions(&scene)
            .iter()
            .map(|&[x, y, z]| [2.0 * x + 0.3 * z, y, z - 0.1 * y])
            .collect();
        let near = near(&scene, 0.3);
        let by_area = near.stencils_by_area(&scene, &rest).unwrap();
        let offsets = by_area.offsets();
        let mut kinds = BTreeSet::new();
        for (pair, of) in near.iter().zip(&by_area) {
            let parts = [pair.a, pair.b].map(|element| {
                let body = scene.body(element.body).unwrap();
                let first = offsets[element.body.index()] as usize;
                (element.element, body, &rest[first..])
            });
            let vertex = |ix: usize| {
                let (vertex, body, rest) = parts[ix];
                area_by_hand(body.elements(), &[vertex], rest)
            };
            let edge = |ix: usize| {
                let (edge, body, rest) = parts[ix];
                area_by_hand(body.elements(), body.edges().corners(edge as usize), rest)
            };
            let expected = match pair.kind {
                PairKind::VertexFace => vertex(0) / 4.0,
                PairKind::EdgeEdge => (edge(0) + edge(1)) / 4.0,
                PairKind::EdgeVertex => vertex(1) / 2.0,
                _ => (vertex(0) + vertex(1)) / 2.0,
            };
            assert!(
                (of.weight - expected).abs() <= 1e-14 * expected,
                "{pair:?}: {} {expected}",
                of.weight
            );
            kinds.insert(pair.kind);
        }
        assert_eq!(kinds.len(), KINDS.len());
        // The same in all else, and merged to the same sum, in whatever order they come.
        let plain = near.stencils(&scene, Some(&rest)).unwrap();
        let merged = by_area.merged().unwrap();
        let numbers = |of: Stencil| (of.vertices, of.features, of.mollifier().to_bits());
        assert!(by_area.iter().map(numbers).eq(plain.iter().map(numbers)));
        let counted = plain.merged().unwrap();
        assert!(merged.iter().map(numbers).eq(counted.iter().map(numbers)));
        let [all, of_merged] =
            [&by_area, &merged].map(|list| list.iter().map(|of| of.weight).sum::<f64>());
        assert!((all - of_merged).abs() <= 1e-12 * all && all > 0.1);
        let mut order: Vec<usize> = (0..by_area.len()).collect();
        let mut random = Random::new(3);
        for ix in 1..order.len() {
            order.swap(ix, random.below(ix as u32 + 1) as usize);
        }
        let shuffled = by_area.select(&order).unwrap().merged().unwrap();
        assert!(shuffled.iter().eq(merged.iter()));
    }
}

/// The numbers of the vertices that span the features, in an order of their own.
fn by_hand(of: &Stencil) -> (PairKind, Vec<u32>) {
    let corners: [&[u32]; 2] = match of.kind {
        PairKind::VertexFace => [&of.vertices[..1], &of.vertices[1..]],
        PairKind::EdgeEdge => [&of.vertices[..2], &of.vertices[2..]],
        PairKind::EdgeVertex => [&of.vertices[1..3], &of.vertices[..1]],
        _ => [&of.vertices[..1], &of.vertices[1..2]],
    };
    let mut spans = [0, 1].map(|ix| {
        let of_feature = match of.features[ix] {
            Feature::Vertex(v) => vec![corners[ix][usize::from(v)]],
            Feature::Edge(e) => {
                let e = usize::from(e);
                vec![corners[ix][e], corners[ix][(e + 1) % corners[ix].len()]]
            }
            Feature::Face => corners[ix].to_vec(),
        };
        match (of.kind, of_feature.len()) {
            (PairKind::EdgeEdge, 2) | (_, 3) => of_feature,
            _ => BTreeSet::from_iter(of_feature).into_iter().collect(),
        }
    });
    let sizes = [spans[0].len(), spans[1].len()];
    if sizes != [2, 2] {
        spans.sort_by_key(|span| (span.len(), span.clone()));
    }
    let kind = match (spans[0].len(), spans[1].len()) {
        (1, 1) => PairKind::VertexVertex,
        (1, 2) => PairKind::EdgeVertex,
        (1, 3) => PairKind::VertexFace,
        _ => PairKind::EdgeEdge,
    };
    if kind == PairKind::EdgeVertex {
        spans[1].sort_unstable();
    }
    (kind, spans.concat())
}

/// A wavy square of cloth above itself.
fn folded() -> Scene {
    let mut scene = Scene::new();
    let mut random = Random::new(9);
    for height in [0.0, 0.05] {
        let n = 9_u32;
        let points: Vec<Point> = (0..n * n)
            .map(|ix| {
                let [x, y] = [ix % n, ix / n].map(|x| f64::from(x) / 8.0);
                let bump = f64::from(random.range(0.0, 0.03));
                [x + bump, y - bump, height + bump]
            })
            .collect();
        let corner = |i: u32, j: u32| i + n * j;
        let mut faces = Vec::new();
        for i in 0..n - 1 {
            for j in 0..n - 1 {
                faces.push([corner(i, j), corner(i + 1, j), corner(i, j + 1)]);
                faces.push([corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)]);
            }
        }
        scene.add_triangles(&faces, &points).unwrap();
    }
    scene
}

#[test]
fn contacts_are_pairs_merged_by_what_they_share() {
    for scene in [folded(), soup(5, None), soup(6, Some(3))] {
        let near = near(&scene, 0.3);
        let pairs = near.stencils(&scene, None).unwrap();
        let merged = pairs.merged().unwrap();
        let mut expected = BTreeMap::new();
        for pair in &pairs {
            *expected.entry(by_hand(&pair)).or_insert(0.0) += pair.weight;
        }
        let n = |of: &Stencil| match of.kind {
            PairKind::VertexVertex => 2,
            PairKind::EdgeVertex => 3,
            _ => 4,
        };
        let found: Vec<_> = merged
            .iter()
            .map(|of| ((of.kind, of.vertices[..n(&of)].to_vec()), of.weight))
            .collect();
        assert_eq!(found, expected.into_iter().collect::<Vec<_>>());
        assert!(
            merged.len() * 10 < pairs.len() * 9,
            "{} {}",
            merged.len(),
            pairs.len()
        );
        let total = |of: &Stencils, f: fn(&Stencil) -> f64| -> f64 {
            of.iter().map(|row| row.weight * f(&row)).sum()
        };
        let close = |f: fn(&Stencil) -> f64| {
            let [a, b] = [&pairs, &merged].map(|of| total(of, f));
            assert!((a - b).abs() <= 1e-9 * a.abs(), "{a} {b}");
        };
        close(|_| 1.0);
        close(Stencil::squared_distance);
        assert!(
            merged
                .iter()
                .all(|of| of.vertices[n(&of)..].iter().all(|&v| v == of.vertices[0]))
        );
        let again = merged.merged().unwrap();
        assert!(again.iter().eq(merged.iter()));
    }
}

/// Two edges at an angle, one above the other, at rest as they are.
fn crossing(angle: f64) -> (Scene, Vec<Point>) {
    let mut scene = Scene::new();
    let (sine, cosine) = angle.sin_cos();
    scene
        .add_edges(&[[0, 1]], &[[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
        .unwrap();
    let upper = [-1.5, 0.5].map(|t| [t * cosine, t * sine, 0.1]);
    scene.add_edges(&[[0, 1]], &upper).unwrap();
    let rest = positions(&scene);
    (scene, rest)
}

#[test]
fn nearly_parallel_edges_are_mollified() {
    // The threshold is a sine of 0.0316.
    for angle in [0.0, 1e-9, 1e-4, 0.01, 0.02, 0.031, 0.0317, 0.5] {
        let (scene, rest) = crossing(angle);
        let near = near(&scene, 0.2);
        let stencils = near.stencils(&scene, Some(&rest)).unwrap();
        let merged = stencils.merged().unwrap();
        let edges: Vec<_> = stencils
            .iter()
            .filter(|of| of.kind == PairKind::EdgeEdge)
            .collect();
        let [of] = edges[..] else {
            panic!("{edges:?}");
        };
        let is_below = angle < 0.0316;
        assert_eq!(of.is_mollified(), is_below);
        let share = angle.sin().powi(2) / 1e-3;
        let expected = if is_below { share * (2.0 - share) } else { 1.0 };
        assert!((of.mollifier() - expected).abs() <= 1e-13, "{angle}");
        assert!(
            of.mollifier_hessian()
                .as_flattened()
                .iter()
                .all(|x| x.is_finite())
        );
        for i in 0..12 {
            let [slope] = difference(&of, i, 1e-4, |of| [of.mollifier()]);
            let row = difference(&of, i, 1e-4, Stencil::mollifier_gradient);
            let gradient = of.mollifier_gradient();
            // The rule of differences does not see the kink of the second derivative.
            if (angle - 0.0316).abs() > 1e-3 {
                assert!(
                    (slope - gradient[i]).abs() <= 1e-8,
                    "{slope} {}",
                    gradient[i]
                );
                assert_near(&row, &of.mollifier_hessian()[i], 1e-7, "mollifier");
            }
            for j in 0..12 {
                let hessian = of.mollifier_hessian();
                assert_eq!(hessian[i][j].to_bits(), hessian[j][i].to_bits());
            }
        }
        // It stays a pair of edges, with the type it has, and without positions at rest it does
        // not.
        let kept = merged.iter().find(|of| of.kind == PairKind::EdgeEdge);
        if is_below {
            assert_eq!(kept.map(|of| of.name()), Some(of.name()));
        }
        let plain = near.stencils(&scene, None).unwrap();
        assert!(
            plain
                .iter()
                .all(|of| of.mollifier() == 1.0 && !of.is_mollified())
        );
        let has_edges = plain
            .merged()
            .unwrap()
            .iter()
            .any(|of| of.kind == PairKind::EdgeEdge);
        assert_eq!(has_edges, of.name() == "EA_EB");
    }
    let (scene, rest) = crossing(0.0);
    let stencils = near(&scene, 0.2).stencils(&scene, Some(&rest)).unwrap();
    let of = stencils
        .iter()
        .find(|of| of.kind == PairKind::EdgeEdge)
        .unwrap();
    assert_ne!(of.name(), "EA_EB");
    assert!(of.gradient().iter().all(|x| x.is_finite()));
    assert_eq!(of.mollifier(), 0.0);
    assert!(
        of.mollifier_hessian()
            .as_flattened()
            .iter()
            .any(|&x| x != 0.0)
    );
}

/// Lengths to the fourth power would underflow or overflow: all numbers are those of a scene of
/// ordinary size, bit by bit, but for the power of two.
#[test]
fn sizes_change_no_bit() {
    let at_size = |size: f64| {
        let mut scene = folded();
        let ids: Vec<_> = scene.bodies().map(|(id, _)| id).collect();
        let scaled = |of: Vec<Point>| -> Vec<Point> {
            let scaled = of.into_iter().map(|point| point.map(|x| x * size));
            scaled.collect()
        };
        for (ix, id) in ids.into_iter().enumerate() {
            let own = positions(&scene)[81 * ix..81 * (ix + 1)].to_vec();
            scene.set_positions(id, scaled(own)).unwrap();
        }
        let rest = positions(&scene);
        let near = near(&scene, 0.1 * size);
        near.stencils(&scene, Some(&rest)).unwrap()
    };
    let usual = at_size(1.0).merged().unwrap();
    assert!(usual.iter().filter(Stencil::is_mollified).count() > 20);
    for exponent in [-300, -250, -1, 40, 250, 300] {
        let size = 2.0_f64.powi(exponent);
        let sized = at_size(size).merged().unwrap();
        assert_eq!(sized.len(), usual.len(), "2^{exponent}");
        for (of, usual) in sized.iter().zip(&usual) {
            assert_eq!(of.vertices, usual.vertices);
            assert_eq!(of.is_mollified(), usual.is_mollified());
            assert_eq!(of.mollifier().to_bits(), usual.mollifier().to_bits());
            let gradient = of.mollifier_gradient().map(|x| x * size);
            assert_eq!(gradient, usual.mollifier_gradient());
            let hessian = of.mollifier_hessian();
            let hessian = hessian.map(|row| row.map(|x| x * size * size));
            assert_eq!(hessian, usual.mollifier_hessian());
        }
    }
    // One edge is very long, the other very short.
    let mut scene = Scene::new();
    let [long, short] = [2.0_f64.powi(280), 2.0_f64.powi(-280)];
    for (length, height) in [(long, 0.0), (short, short)] {
        let corners = [[-length, 0.0, height], [length, 0.0, height]];
        scene.add_edges(&[[0, 1]], &corners).unwrap();
    }
    let rest = positions(&scene);
    let stencils = near(&scene, short).stencils(&scene, Some(&rest)).unwrap();
    assert!(stencils.iter().any(|of| of.is_mollified()));
    // An edge without a length has no mollifier, also beside one whose square is barely finite.
    for length in [1.0, 2.0_f64.powi(500), 2.0_f64.powi(-700)] {
        let mut scene = Scene::new();
        let along = [[0.0; 3], [length, 0.0, 0.0]];
        scene.add_edges(&[[0, 1]], &along).unwrap();
        scene.add_edges(&[[0, 1]], &[[0.0; 3]; 2]).unwrap();
        let rest = positions(&scene);
        let stencils = near(&scene, 0.0).stencils(&scene, Some(&rest)).unwrap();
        assert!(!stencils.is_empty());
        assert!(stencils.iter().all(|of| !of.is_mollified()));
        assert!(stencils.iter().eq(&stencils), "no threshold is NaN");
    }
}

/// An orthogonal matrix as a product of reflections, and eigenvalues.
fn spectral<const N: usize>(
    random: &mut Random,
    values: [f64; N],
) -> ([[f64; N]; N], [[f64; N]; N]) {
    let mut q: [[f64; N]; N] =
        std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    for _ in 0..N {
        let v: [f64; N] = std::array::from_fn(|_| f64::from(random.range(-1.0, 1.0)));
        let square: f64 = v.iter().map(|x| x * x).sum();
        for row in &mut q {
            let along: f64 = row.iter().zip(v).map(|(x, y)| x * y).sum();
            for (x, y) in row.iter_mut().zip(v) {
                *x -= 2.0 * along / square * y;
            }
        }
    }
    let sum = |values: [f64; N]| {
        std::array::from_fn(|i| {
            std::array::from_fn(|j| (0..N).map(|k| values[k] * q[k][i] * q[k][j]).sum())
        })
    };
    (sum(values), sum(values.map(|x| x.max(0.0))))
}

fn check_projection<const N: usize>(random: &mut Random) {
    for scale in [1.0, 1e-200, 1e150] {
        for n_negative in 0..=N {
            let values: [f64; N] = std::array::from_fn(|k| {
                let x = f64::from(random.range(0.1, 2.0)) * 10.0_f64.powi(-(k as i32 % 4));
                scale * if k < n_negative { -x } else { x }
            });
            let (mut matrix, expected) = spectral(random, values);
            let given = matrix;
            project_psd(&mut matrix);
            for (row, expected) in matrix.iter().zip(&expected) {
                assert_near(row, expected, 1e-14 * scale * 4.0, "projection");
            }
            assert_symmetric(&matrix);
            if n_negative == 0 {
                let mean = |i: usize, j: usize| 0.5 * given[i][j] + 0.5 * given[j][i];
                assert_eq!(
                    matrix,
                    std::array::from_fn(|i| std::array::from_fn(|j| mean(i, j)))
                );
            }
        }
    }
}

#[test]
fn negative_eigenvalues_become_zero() {
    let mut random = Random::new(4);
    check_projection::<1>(&mut random);
    check_projection::<3>(&mut random);
    check_projection::<6>(&mut random);
    check_projection::<9>(&mut random);
    check_projection::<12>(&mut random);
    // Equal, zero and non-finite ones.
    for matrix in [
        [[0.0; 3]; 3],
        [[2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]],
    ] {
        let mut projected = matrix;
        project_psd(&mut projected);
        assert_eq!(projected, matrix);
    }
    // Small entries beside large ones: the eigenvalues are 1, -1 and about -1e-9.
    let mut small = [[0.0, 1.0, 1e-9], [1.0, 0.0, 0.0], [1e-9, 0.0, -1e-9]];
    project_psd(&mut small);
    let expected = [[0.5, 0.5, 5e-10], [0.5, 0.5, 5e-10], [5e-10, 5e-10, 5e-19]];
    for (row, expected) in small.iter().zip(&expected) {
        assert_near(row, expected, 2e-16, "small");
    }
    // The smallest numbers: halves and quotients of them would be rounded.
    let mut tiny = [[1e-308, 0.0, 0.0], [0.0, -1e-308, 0.0], [0.0, 0.0, 2e-308]];
    project_psd(&mut tiny);
    assert_eq!(tiny, [[1e-308, 0.0, 0.0], [0.0; 3], [0.0, 0.0, 2e-308]]);
    let least = f64::from_bits(1);
    let mut turned = [[0.0, 64.0 * least], [64.0 * least, 0.0]];
    project_psd(&mut turned);
    assert_eq!(turned, [[32.0 * least; 2]; 2]);
    let mut kept = [[least, 0.0], [0.0, 3.0 * least]];
    project_psd(&mut kept);
    assert_eq!(kept, [[least, 0.0], [0.0, 3.0 * least]]);
    let mut dropped = [[-least, 0.0], [0.0, -3.0 * least]];
    project_psd(&mut dropped);
    assert_eq!(dropped, [[0.0; 2]; 2]);
    // A power of two changes no bit while all numbers are normal.
    let [usual, small, large] = [1.0, 2.0_f64.powi(-900), 2.0_f64.powi(1000)].map(|size| {
        let mut matrix = [[0.3, 1.7, -0.9], [1.7, -2.3, 0.4], [-0.9, 0.4, 0.7]];
        matrix
            .as_flattened_mut()
            .iter_mut()
            .for_each(|x| *x *= size);
        project_psd(&mut matrix);
        matrix.map(|row| row.map(|x| x / size))
    });
    assert!(usual == small && usual == large);
    let mut negative = [[-1.0, 0.0], [0.0, -1.0]];
    project_psd(&mut negative);
    assert_eq!(negative, [[0.0; 2]; 2]);
    let mut strange = [[f64::NAN, 1.0], [1.0, -1.0]];
    project_psd(&mut strange);
    assert!(strange[0][0].is_nan());
    let mut infinite = [[1.0, f64::INFINITY], [f64::INFINITY, 1.0]];
    project_psd(&mut infinite);
    assert!(!infinite[0][1].is_finite());
}

#[test]
fn vertices_are_numbered_through_the_scene() {
    let mut scene = soup(7, None);
    let ids: Vec<_> = scene.bodies().map(|(id, _)| id).collect();
    scene.remove(ids[1]).unwrap();
    let near = near(&scene, 0.9);
    let stencils = near.stencils(&scene, None).unwrap();
    assert_eq!(stencils.offsets(), [0, 36, 36, 52, 64]);
    let all = positions(&scene);
    assert!(stencils.iter().any(|of| of.vertices[0] >= 52));
    for of in &stencils {
        assert_eq!(of.points, of.vertices.map(|vertex| all[vertex as usize]));
    }
    // Positions are those of the scene at the time, features those that were found.
    let moved: Vec<Point> = all[..36]
        .iter()
        .map(|&[x, y, z]| [x, y, z + 0.25])
        .collect();
    scene.set_positions(ids[0], &moved).unwrap();
    let later = near.stencils(&scene, None).unwrap();
    assert!(
        later
            .iter()
            .zip(&stencils)
            .all(|(a, b)| a.features == b.features)
    );
    assert!(
        later
            .iter()
            .zip(&stencils)
            .any(|(a, b)| a.points != b.points)
    );
    assert!(Stencils::default().is_empty());
}

#[test]
fn refusals_name_what_is_wrong() {
    let mut scene = folded();
    let pairs = near(&scene, 0.1);
    let refused = |near: &NearPairs, scene: &Scene, rest: Option<&[Point]>| {
        near.stencils(scene, rest).unwrap_err().to_string()
    };
    assert_eq!(
        refused(&pairs, &scene, Some(&[[0.0; 3]; 100])),
        "rest: 100 positions for 162 vertices given, as many as all bodies have vertices, one body after another, allowed"
    );
    assert_eq!(
        refused(&pairs, &scene, Some(&[[0.0; 3]; 163])),
        "rest: 163 positions for 162 vertices given, as many as all bodies have vertices, one body after another, allowed"
    );
    let mut rest = positions(&scene);
    rest[3][1] = f64::NAN;
    assert!(refused(&pairs, &scene, Some(&rest)).starts_with("rest: row 3 is not finite"));
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    let query = Query::all().kinds([PairKind::FaceFace]);
    let faces = detector.near(&scene, 0.1, &query).unwrap();
    let message = refused(&faces, &scene, None);
    assert!(
        message.starts_with("kinds: ff (element 0 of body 0 and 3 of body 0; ")
            && message.ends_with("the kinds vf and ee) given, vf, ee, ev or vv allowed"),
        "{message}"
    );
    assert!(matches!(
        pairs.stencils(&soup(1, None), None),
        Err(Error::UnknownBody { .. })
    ));
    // A body may have as many elements as before, with other numbers.
    let (id, body) = scene.bodies().next().unwrap();
    let Elements::Triangles(mut faces) = body.elements().clone() else {
        panic!("a soup");
    };
    let points = body.positions().clone();
    let query = Query::all().exclude(&pairs);
    assert!(detector.near(&scene, 0.1, &query).is_ok());
    for few in [false, true] {
        faces.reverse();
        faces.truncate(if few { 1 } else { faces.len() });
        scene.remesh(id, (faces.clone(), points.clone())).unwrap();
        let text = "body 0: the pairs were found before it was re-meshed or its edges were set, and name other elements";
        assert_eq!(refused(&pairs, &scene, None), text);
        // So it is with pairs that are left out.
        let refused = detector.near(&scene, 0.1, &query);
        assert_eq!(refused.unwrap_err().to_string(), text);
    }
    // A body that no pair names may change, and edges are not what pairs of vertices and faces name.
    let mut add = |x: f64, faces: &[[u32; 3]]| {
        let corners = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.2, 0.1],
        ];
        let corners = corners.map(|[a, b, c]| [a + x, b, c]);
        scene.add_triangles(faces, &corners).unwrap()
    };
    let [near, far] = [add(70.0, &[[0, 1, 2], [1, 2, 3]]), add(90.0, &[[0, 1, 2]])];
    let query = Query::all().kinds([PairKind::VertexFace]);
    let pairs = detector.near(&scene, 0.2, &query).unwrap();
    let names = |body| {
        pairs
            .iter()
            .any(|pair| [pair.a.body, pair.b.body].contains(&body))
    };
    assert!(names(near) && !names(far));
    let all = Query::all().exclude(&pairs);
    scene
        .remesh(far, (vec![[0u32, 1, 2]], points.clone()))
        .unwrap();
    scene
        .set_edges(near, &[[1, 0], [2, 0], [2, 1], [3, 1], [3, 2]])
        .unwrap();
    assert!(pairs.stencils(&scene, None).is_ok());
    assert!(detector.near(&scene, 0.1, &all).is_ok());
    // Pairs of edges are in the way only of questions about edges of this body.
    let kinds = [PairKind::VertexFace, PairKind::EdgeEdge];
    let edges = detector.near(&scene, 0.2, &Query::all().kinds(kinds));
    let edges = edges.unwrap();
    let [one, other] = [0.0, 0.1].map(|z| {
        let corners = [[50.0, 0.0, z], [51.0, 0.0, z], [50.0, 1.0, z]];
        scene.add_triangles(&[[0, 1, 2]], &corners).unwrap()
    });
    let own = [[1, 0], [2, 0], [2, 1], [3, 1], [3, 2]];
    scene.set_edges(near, &own).unwrap();
    let same = edges.stencils(&scene, None).err();
    assert!(same.is_none(), "{same:?}");
    scene.set_edges(near, &[]).unwrap();
    let without = |query: Query| query.exclude(&edges);
    let [faces, two] = [query.clone(), Query::between(one, other)].map(without);
    detector.near(&scene, 0.1, &faces).unwrap();
    assert!(detector.near(&scene, 0.2, &two).unwrap().len() > 3);
    let all = without(Query::all());
    assert!(detector.near(&scene, 0.1, &all).is_err());
    // Those of a body that is no longer there are none.
    scene.remove(id).unwrap();
    assert!(detector.near(&scene, 0.1, &query).is_ok());
}

/// Stencils are those of one pair after another, columns and projections those of one stencil after
/// another, however many threads compute them.
#[test]
fn threads_change_no_bit() {
    let scene = folded();
    let rest = positions(&scene);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(4);
    let pool = pool.build().expect("threads");
    let mut first: Option<Vec<f64>> = None;
    for threads in [1, 2, 5, 0] {
        let settings = Settings::new().backend(Backend::Cpu).threads(threads);
        let mut detector = Detector::new(settings).unwrap();
        let query = Query::all().kinds(KINDS);
        let near = detector.near(&scene, 0.3, &query).unwrap();
        let stencils = near.stencils(&scene, Some(&rest)).unwrap();
        // More than one part for a thread.
        assert!(stencils.len() > 2000, "{}", stencils.len());
        pool.install(|| {
            // More threads than made the first ones, perhaps.
            let again = near.stencils(&scene, Some(&rest)).unwrap();
            assert!(again.iter().eq(&stencils));
            let pairs = near.iter().map(|pair| (pair.kind, pair.features));
            assert!(again.iter().map(|of| (of.kind, of.features)).eq(pairs));
            // Of all pairs that are refused, the first is named.
            let query = Query::all().kinds([PairKind::FaceFace]);
            let faces = detector.near(&scene, 0.3, &query).unwrap();
            let message = faces.stencils(&scene, None).unwrap_err().to_string();
            let pair = faces.iter().next().unwrap();
            let [a, b] = [pair.a, pair.b].map(|of| format!("{} of body {}", of.element, of.body));
            let expected = format!("kinds: ff (element {a} and {b}; ");
            assert!(
                faces.len() > 2000 && message.starts_with(&expected),
                "{message}"
            );
            let column = stencils.column(|of| *of).unwrap();
            assert!(column.into_iter().eq(&stencils), "each in its place");
            let each = stencils.iter().map(|of| of.squared_distance());
            let column = stencils.column(Stencil::squared_distance).unwrap();
            assert!(column.into_iter().eq(each));
            let mut hessians = stencils.column(Stencil::hessian).unwrap();
            for (hessian, of) in hessians.iter_mut().zip(&stencils) {
                assert_eq!(*hessian, of.hessian());
                let negative = hessian.map(|row| row.map(|x| -x));
                *hessian = negative;
            }
            let mut together = hessians.as_flattened().as_flattened().to_vec();
            project_psd_all(&mut together, 12, threads).unwrap();
            hessians.iter_mut().for_each(project_psd);
            assert_eq!(together, hessians.as_flattened().as_flattened());
            assert_eq!(first.get_or_insert(together.clone()), &together);
        });
        let some = stencils.select(&[7, 0, 7]).unwrap();
        let of = |ix: usize| stencils.get(ix).unwrap();
        assert!(some.iter().eq([of(7), of(0), of(7)]));
        assert_eq!(stencils.get(stencils.len()), None);
        assert_eq!(some.offsets(), stencils.offsets());
    }
    let refused = |n: usize, size: usize| {
        let error = project_psd_all(&mut vec![0.0; n], size, 0).unwrap_err();
        error.to_string()
    };
    assert!(refused(16, 4).starts_with("size: 4 given, 3, 6, 9 or 12"));
    assert!(refused(19, 3).starts_with("matrices: 19 numbers given"));
    // What is not finite is named, and nothing is changed.
    for strange in [f64::NAN, f64::NEG_INFINITY] {
        let mut given = vec![-1.0; 3 * 36];
        given[2 * 36 + 7] = strange;
        let before = given.clone();
        let error = project_psd_all(&mut given, 6, 0).unwrap_err().to_string();
        assert_eq!(
            error,
            format!(
                "matrices: {strange} in row 1, column 1 of matrix 2 given, finite numbers allowed"
            )
        );
        assert_eq!(given[..2 * 36 + 7], before[..2 * 36 + 7]);
    }
}

/// The same bits on every machine: a hash of all numbers.
#[test]
fn bits_are_the_same_everywhere() {
    let scene = folded();
    let rest = positions(&scene);
    let stencils = near(&scene, 0.1).stencils(&scene, Some(&rest)).unwrap();
    let mut hash = 0_u64;
    let mut add = |numbers: &[f64]| {
        for x in numbers {
            hash = hash.rotate_left(5) ^ x.to_bits();
            hash = hash.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        }
    };
    for of in &stencils.merged().unwrap() {
        let mut hessian = of.hessian();
        add(&[of.weight, of.squared_distance(), of.mollifier()]);
        add(&of.coefficients());
        add(&of.gradient());
        add(hessian.as_flattened());
        add(&of.mollifier_gradient());
        add(of.mollifier_hessian().as_flattened());
        for row in &mut hessian {
            row.iter_mut().for_each(|x| *x = -*x);
        }
        project_psd(&mut hessian);
        add(hessian.as_flattened());
    }
    assert_eq!(format!("{hash:016x}"), "11aa35fc1adc1f69");
}
