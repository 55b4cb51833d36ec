//! Counts compared with closed forms, with plain definitions, and with published numbers.

use std::collections::{BTreeMap, BTreeSet};

use impinge::{Backend, Detector, Method, Query, Scene, Settings, SharedVertex};
use impinge_check::{
    Counts, ErrorKind, FixOptions, Options, Problem, check_file, check_mesh, fix_mesh,
};
use impinge_io::{Elements, Mesh, Positions};
use impinge_scenes::Random;
use impinge_testing::data::test_file;

fn triangles(positions: Vec<[f64; 3]>, faces: Vec<[u32; 3]>) -> Mesh {
    Mesh {
        positions: Positions::F64(positions),
        elements: Elements::Triangles(faces),
    }
}

fn counts(mesh: Mesh) -> Counts {
    check_mesh(mesh, &Options::default()).unwrap().counts
}

/// The boundary of a tetrahedron, oriented.
fn tetrahedron(at: f64) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let corners = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
    ];
    let positions = corners.map(|p: [f64; 3]| p.map(|x| x + at)).to_vec();
    (positions, vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
}

#[test]
fn a_closed_surface_has_nothing() {
    let (positions, faces) = tetrahedron(0.0);
    let counts = counts(triangles(positions, faces));
    let expected = Counts {
        n_vertices: 4,
        n_triangles: 4,
        hash: Some(0),
        inside_out: Some(0),
        components: 1,
        is_watertight: Some(true),
        volume: Some(1.0 / 6.0),
        euler: Some(2),
        ..Counts::default()
    };
    assert_eq!(counts, expected);
}

#[test]
fn unwelded_files_are_welded_first() {
    let (corners, faces) = tetrahedron(0.1);
    let positions: Vec<_> = faces
        .iter()
        .flatten()
        .map(|&ix| corners[ix as usize])
        .collect();
    let soup: Vec<[u32; 3]> = (0..4).map(|ix| [3 * ix, 3 * ix + 1, 3 * ix + 2]).collect();
    let welded = counts(triangles(positions.clone(), soup.clone()));
    assert_eq!((welded.n_vertices, welded.n_welded), (12, 8));
    assert_eq!(
        (
            welded.boundary_facets,
            welded.self_intersections,
            welded.components
        ),
        (0, 0, 1)
    );
    let options = Options {
        weld: false,
        ..Options::default()
    };
    let apart = check_mesh(triangles(positions, soup), &options)
        .unwrap()
        .counts;
    assert_eq!(
        (apart.n_welded, apart.boundary_facets, apart.components),
        (0, 12, 4)
    );
    // All four triangles touch each other.
    assert_eq!(apart.self_intersections, 6);
}

#[test]
fn each_fault_is_counted_as_what_it_is() {
    let (positions, mut faces) = tetrahedron(0.0);
    faces[1].swap(0, 1);
    let turned = counts(triangles(positions.clone(), faces));
    assert_eq!((turned.inconsistent_facets, turned.boundary_facets), (3, 0));

    let (_, mut faces) = tetrahedron(0.0);
    faces.push([1, 2, 0]);
    let doubled = check_mesh(triangles(positions.clone(), faces), &Options::default()).unwrap();
    assert_eq!(
        (
            doubled.counts.duplicates,
            doubled.counts.non_manifold_facets
        ),
        (1, 3)
    );
    // Equal triangles share more than their vertices.
    assert_eq!(doubled.counts.self_intersections, 1);
    assert!(doubled.marks[4].has(Problem::Duplicate) && !doubled.marks[0].has(Problem::Duplicate));
    assert_eq!(doubled.marks[4].first(), Some(Problem::SelfIntersection));

    let (_, mut faces) = tetrahedron(0.0);
    faces.pop();
    let open = counts(triangles(positions.clone(), faces));
    assert_eq!((open.boundary_facets, open.boundaries), (3, 1));

    // Two closed surfaces that touch in one vertex.
    let (mut both, mut faces) = tetrahedron(0.0);
    let (other, more) = tetrahedron(0.0);
    both.extend(other.iter().map(|p| p.map(|x| -x)));
    faces.extend(more.iter().map(|face| face.map(|ix| ix + 4)));
    let bow_tie = counts(triangles(both, faces));
    assert_eq!((bow_tie.non_manifold_vertices, bow_tie.components), (1, 2));
    assert_eq!((bow_tie.self_intersections, bow_tie.n_welded), (0, 1));

    let mut positions = positions;
    positions.push([9.0; 3]);
    let (_, faces) = tetrahedron(0.0);
    assert_eq!(counts(triangles(positions, faces)).unused_vertices, 1);
}

#[test]
fn degenerate_is_exactly_zero_area() {
    // The points 0.1, 0.2, 0.3 lie on the line x = y = z; 0.1 + 0.2 is one bit more than 0.3.
    let line = vec![[0.1; 3], [0.2; 3], [0.3; 3]];
    assert_eq!(counts(triangles(line, vec![[0, 1, 2]])).degenerate, 1);
    let thin = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 1e-60, 0.0]];
    assert_eq!(counts(triangles(thin, vec![[0, 1, 2]])).degenerate, 0);
    let near = vec![[0.1; 3], [0.2; 3], [0.3, 0.3, 0.1 + 0.2]];
    assert_eq!(counts(triangles(near, vec![[0, 1, 2]])).degenerate, 0);
    let twice = counts(triangles(vec![[0.0; 3], [1.0; 3]], vec![[0, 1, 1]]));
    assert_eq!(
        (twice.degenerate, twice.components, twice.boundary_facets),
        (1, 0, 0)
    );
}

#[test]
fn tetrahedra_are_checked_by_their_faces() {
    let positions = vec![
        [0.0; 3],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [1.0; 3],
    ];
    let check = |tets: Vec<[u32; 4]>| {
        let mesh = Mesh {
            positions: Positions::F64(positions.clone()),
            elements: Elements::Tetrahedra(tets),
        };
        counts(mesh)
    };
    let two = check(vec![[0, 1, 2, 3], [4, 1, 3, 2]]);
    assert_eq!(
        (
            two.n_tetrahedra,
            two.boundary_facets,
            two.inconsistent_facets
        ),
        (2, 6, 0)
    );
    assert_eq!(
        (two.components, two.boundaries, two.self_intersections),
        (1, 1, 0)
    );
    assert_eq!(
        check(vec![[0, 1, 2, 3], [4, 1, 2, 3]]).inconsistent_facets,
        1
    );
    assert_eq!(check(vec![[0, 1, 2, 2]]).degenerate, 1);
}

/// The same counts, computed from their definitions with maps and repeated searches.
fn plainly(n_vertices: u32, faces: &[[u32; 3]]) -> [u64; 8] {
    let is_simplex = |f: &[u32; 3]| f[0] != f[1] && f[1] != f[2] && f[2] != f[0];
    let mut edges: BTreeMap<(u32, u32), Vec<(usize, bool)>> = BTreeMap::new();
    for (ix, face) in faces
        .iter()
        .enumerate()
        .filter(|(_, face)| is_simplex(face))
    {
        for k in 0..3 {
            let (a, b) = (face[k], face[(k + 1) % 3]);
            edges
                .entry((a.min(b), a.max(b)))
                .or_default()
                .push((ix, a < b));
        }
    }
    /// Whether to count an edge, given the faces that use it, each with its direction along the
    /// edge.
    type Pick = fn(&[(usize, bool)]) -> bool;
    let n = |pick: Pick| edges.values().filter(|users| pick(users)).count() as u64;
    let boundary = n(|users| users.len() == 1);
    let non_manifold = n(|users| users.len() > 2);
    let inconsistent = n(|users| users.len() == 2 && users[0].1 == users[1].1);
    // Connected pieces: each label becomes the smallest label linked to it, until nothing changes.
    let pieces = |members: &BTreeSet<usize>, linked: &dyn Fn(usize, usize) -> bool| -> u64 {
        let mut labels: BTreeMap<usize, usize> = members.iter().map(|&x| (x, x)).collect();
        loop {
            let before = labels.clone();
            for &a in members {
                for &b in members {
                    if linked(a, b) {
                        let least = labels[&a].min(labels[&b]);
                        labels.insert(a, least);
                        labels.insert(b, least);
                    }
                }
            }
            if labels == before {
                return labels.values().collect::<BTreeSet<_>>().len() as u64;
            }
        }
    };
    let share = |a: usize, b: usize, through: Option<u32>| {
        edges.iter().any(|(edge, users)| {
            through.is_none_or(|v| edge.0 == v || edge.1 == v)
                && users.iter().any(|user| user.0 == a)
                && users.iter().any(|user| user.0 == b)
        })
    };
    let proper: BTreeSet<usize> = (0..faces.len())
        .filter(|&ix| is_simplex(&faces[ix]))
        .collect();
    let components = pieces(&proper, &|a, b| share(a, b, None));
    let bow_ties = (0..n_vertices).filter(|&v| {
        let around: BTreeSet<usize> = proper
            .iter()
            .copied()
            .filter(|&ix| faces[ix].contains(&v))
            .collect();
        pieces(&around, &|a, b| share(a, b, Some(v))) > 1
    });
    let open: Vec<(u32, u32)> = edges
        .iter()
        .filter(|(_, users)| users.len() == 1)
        .map(|(&e, _)| e)
        .collect();
    let on_border: BTreeSet<usize> = open
        .iter()
        .flat_map(|e| [e.0 as usize, e.1 as usize])
        .collect();
    let borders = pieces(&on_border, &|a, b| {
        open.contains(&(a.min(b) as u32, a.max(b) as u32))
    });
    let sets: BTreeSet<[u32; 3]> = faces
        .iter()
        .map(|face| {
            let mut face = *face;
            face.sort();
            face
        })
        .collect();
    let duplicates = (faces.len() - sets.len()) as u64;
    let unused = (0..n_vertices)
        .filter(|v| !faces.iter().flatten().any(|held| held == v))
        .count() as u64;
    [
        boundary,
        non_manifold,
        inconsistent,
        components,
        bow_ties.count() as u64,
        borders,
        duplicates,
        unused,
    ]
}

#[test]
fn random_meshes_agree_with_the_definitions() {
    let mut random = Random::new(7);
    let mut below = |n| random.below(n);
    let mut seen = [0u64; 8];
    for _ in 0..400 {
        let n_vertices = 3 + below(8);
        let n_faces = 1 + below(14);
        let faces: Vec<[u32; 3]> = (0..n_faces)
            .map(|_| [below(n_vertices), below(n_vertices), below(n_vertices)])
            .collect();
        // All positions differ, so that nothing is welded.
        let positions = (0..n_vertices)
            .map(|v| [f64::from(v), f64::from(v * v), f64::from(v % 3)])
            .collect();
        let found = counts(triangles(positions, faces.clone()));
        let found = [
            found.boundary_facets,
            found.non_manifold_facets,
            found.inconsistent_facets,
            found.components,
            found.non_manifold_vertices,
            found.boundaries,
            found.duplicates,
            found.unused_vertices,
        ];
        assert_eq!(found, plainly(n_vertices, &faces), "{faces:?}");
        for (total, n) in seen.iter_mut().zip(found) {
            *total += n;
        }
    }
    // Every count was above zero in some mesh.
    assert!(seen.iter().all(|&n| n > 0), "{seen:?}");
}

/// Fails if the data is absent, unless `IMPINGE_NO_DATA=1` is set.
#[test]
fn real_meshes_have_the_published_self_intersections() {
    let Some(path) = test_file("expected/self_intersections.json") else {
        return;
    };
    let text = std::fs::read_to_string(path).unwrap();
    let published: serde_json::Value = serde_json::from_str(&text).unwrap();
    for (name, expected) in published.as_object().unwrap() {
        let row = check_file(&test_file(name).unwrap(), &Options::default());
        let counts = row.result.unwrap();
        let hits = ["hits_noshared", "hits_shared1", "hits_shared2"]
            .map(|key| expected[key].as_u64().unwrap());
        assert_eq!(
            counts.self_intersections,
            hits.iter().sum::<u64>(),
            "{name}"
        );
        assert_eq!(Some(counts.n_triangles), expected["F"].as_u64(), "{name}");
        assert_eq!(Some(counts.duplicates), expected["dup"].as_u64(), "{name}");
    }
}

#[test]
fn files_that_cannot_be_read_are_rows() {
    let folder = tempfile::tempdir().unwrap();
    let check = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        check_file(&path, &Options::default()).result.unwrap_err()
    };
    assert_eq!(check("a.txt", "").kind, ErrorKind::File);
    assert_eq!(check("a.obj", "v 0 0 0\nf 1 2 3\n").kind, ErrorKind::File);
    let nan = check("b.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    assert_eq!(nan.kind, ErrorKind::NotFinite, "{}", nan.message);
    let missing = check_file("nowhere.ply".as_ref(), &Options::default());
    assert_eq!(missing.result.unwrap_err().kind, ErrorKind::File);
}

/// Corners on a lattice of so few points that most elements have copies, with corners in another
/// order.
fn crowd<const K: usize>(random: &mut Random, n: usize, n_vertices: u32) -> Vec<[u32; K]> {
    let mut below = |n| random.below(n);
    let mut all: Vec<[u32; K]> = Vec::new();
    while all.len() < n {
        let mut corners = match below(3) {
            0 => std::array::from_fn(|_| below(n_vertices)),
            _ if all.is_empty() => continue,
            _ => all[below(all.len() as u32) as usize],
        };
        corners.rotate_left(below(K as u32) as usize);
        if below(2) == 0 {
            corners.swap(0, 1);
        }
        all.push(corners);
    }
    all
}

#[test]
fn copies_are_counted_as_if_each_were_tested() {
    let mut random = Random::new(3);
    let (mut n_duplicates, mut n_pairs) = (0, 0);
    for case in 0..120 {
        let n_vertices = 5 + case % 9;
        let at = |ix: u32, k: u32| f64::from((ix * 7 + k * k * 5 + ix * ix * k) % 4);
        let positions = (0..n_vertices).map(|ix| [at(ix, 0), at(ix, 1), at(ix, 2)]);
        let n = 4 + case as usize;
        let mesh = Mesh {
            positions: Positions::F64(positions.collect()),
            elements: match case % 2 {
                0 => Elements::Triangles(crowd(&mut random, n, n_vertices)),
                _ => Elements::Tetrahedra(crowd(&mut random, n, n_vertices)),
            },
        };
        let checked = check_mesh(mesh, &Options::default()).unwrap();
        let mut scene = Scene::new();
        let positions = checked.mesh.positions.to_f64();
        let body = match &checked.mesh.elements {
            Elements::Triangles(faces) => scene.add_triangles(faces, &positions),
            Elements::Tetrahedra(tets) => scene.add_tetrahedra(tets, &positions),
        };
        let query = Query::self_of(body.unwrap()).shared_vertex(SharedVertex::Resolve);
        let settings = Settings::new().method(Method::Naive).backend(Backend::Cpu);
        let mut naive = Detector::new(settings).unwrap();
        let pairs = naive.detect(&scene, &query).unwrap();
        let counts = checked.counts;
        assert_eq!(
            (counts.self_intersections, counts.hash),
            (pairs.len() as u64, Some(pairs.hash())),
            "case {case}"
        );
        let in_pairs: BTreeSet<u32> = pairs.rows().flat_map(|row| [row[1], row[3]]).collect();
        let marked = (0u32..).zip(&checked.marks);
        let marked = marked.filter(|(_, marks)| marks.has(Problem::SelfIntersection));
        assert_eq!(
            marked.map(|(ix, _)| ix).collect::<BTreeSet<_>>(),
            in_pairs,
            "case {case}"
        );
        assert_eq!(counts.n_intersecting, in_pairs.len() as u64);
        n_duplicates += counts.duplicates;
        n_pairs += counts.self_intersections;
    }
    assert!(
        n_duplicates > 2_000 && n_pairs > 50_000,
        "{n_duplicates}, {n_pairs}"
    );
}

#[test]
fn a_million_equal_faces_are_counted() {
    let positions = vec![
        [0.0; 3],
        [3.0, 0.0, 0.0],
        [0.0, 3.0, 0.0],
        [1.0, 1.0, -1.0],
        [1.0, 1.0, 1.0],
        [1.0, 2.0, 1.0],
    ];
    let n: u64 = 1_000_000;
    let mut faces = vec![[0, 1, 2]; n as usize];
    faces[7] = [2, 0, 1];
    // One face goes through all of them.
    faces.push([3, 4, 5]);
    let counts = counts(triangles(positions, faces));
    assert_eq!(counts.self_intersections, n * (n - 1) / 2 + n);
    assert_eq!((counts.hash, counts.duplicates), (None, n - 1));
    assert_eq!(counts.n_intersecting, n + 1);
}

#[test]
fn volume_euler_and_watertightness_of_known_surfaces() {
    let of = |faces: &[usize]| {
        let (positions, all) = tetrahedron(1e9);
        let faces = faces.iter().map(|&ix| all[ix]).collect();
        counts(triangles(positions, faces))
    };
    let whole = of(&[0, 1, 2, 3]);
    let said = |c: &Counts| (c.is_watertight, c.volume, c.euler);
    assert_eq!(said(&whole), (Some(true), Some(1.0 / 6.0), Some(2)));
    assert_eq!(said(&of(&[0, 1, 2])), (Some(false), None, Some(1)));
    let (positions, mut faces) = tetrahedron(0.0);
    for face in &mut faces {
        face.swap(0, 1);
    }
    let inside_out = counts(triangles(positions.clone(), faces.clone()));
    assert_eq!(said(&inside_out), (Some(true), Some(-1.0 / 6.0), Some(2)));
    faces[0].swap(0, 1);
    let mixed = counts(triangles(positions, faces));
    assert_eq!(said(&mixed), (Some(true), None, Some(2)));
    // A torus has a hole; its volume is that of its triangles.
    let model = impinge_scenes::surfaces::torus(24, 12, 2.0, 0.5);
    let impinge::Elements::Triangles(faces) = &model.elements else {
        panic!("triangles")
    };
    let points: Vec<[f64; 3]> = model.positions.iter().map(|p| p.map(f64::from)).collect();
    let torus = counts(triangles(points, faces.clone()));
    assert_eq!((torus.is_watertight, torus.euler), (Some(true), Some(0)));
    let round = 2.0 * std::f64::consts::PI.powi(2) * 2.0 * 0.25;
    let volume = torus.volume.unwrap().abs();
    assert!(volume < round && volume > 0.9 * round, "{volume} {round}");
}

#[test]
fn places_are_where_the_problems_are() {
    // Two tetrahedra far apart; a needle through a face of each, a hole in the second, and both
    // touch a third one's vertex.
    let (mut positions, mut faces) = tetrahedron(0.0);
    let (far, more) = tetrahedron(100.0);
    positions.extend(far);
    faces.extend(more[..3].iter().map(|face| face.map(|v| v + 4)));
    for at in [0.0, 100.0] {
        let first = positions.len() as u32;
        positions.extend(
            [[0.2, 0.2, -0.1], [0.21, 0.2, -0.1], [0.2, 0.2, 0.1]]
                .map(|p: [f64; 3]| p.map(|x| x + at)),
        );
        faces.push([first, first + 1, first + 2]);
    }
    let check = |most: usize, faces_too: bool| {
        let options = Options {
            places: most,
            faces: faces_too,
            ..Options::default()
        };
        let mesh = triangles(positions.clone(), faces.clone());
        check_mesh(mesh, &options).unwrap().places
    };
    let places = check(9, false);
    let crossing: Vec<_> = places
        .iter()
        .filter(|p| p.problem == Problem::SelfIntersection)
        .collect();
    assert_eq!(crossing.len(), 4);
    // The needles and the faces that they pass through share no vertex: four places of one element.
    for place in &crossing {
        assert_eq!((place.n_elements, place.elements.len()), (1, 1));
        let corners = faces[place.elements[0] as usize].map(|v| positions[v as usize]);
        let middle = [0, 1, 2].map(|axis| corners.iter().map(|p| p[axis]).sum::<f64>() / 3.0);
        for (found, expected) in place.point.iter().zip(middle) {
            assert!((found - expected).abs() < 1e-9);
        }
    }
    let borders: Vec<u64> = places
        .iter()
        .filter(|p| p.problem == Problem::Boundary)
        .map(|p| p.n_elements)
        .collect();
    assert_eq!(borders, [3, 1, 1]);
    assert_eq!(check(1, false).len(), 2);
    assert_eq!(check(0, false), []);
    // A strip of many faces names eight of them, or all.
    let strip: Vec<[u32; 3]> = (0..30).map(|ix| [ix, ix + 1, ix + 2]).collect();
    let points: Vec<[f64; 3]> = (0..32)
        .map(|ix| [f64::from(ix), f64::from(ix % 2), 0.0])
        .collect();
    for (all, n) in [(false, 8), (true, 30)] {
        let options = Options {
            faces: all,
            ..Options::default()
        };
        let places = check_mesh(triangles(points.clone(), strip.clone()), &options)
            .unwrap()
            .places;
        let border = places
            .iter()
            .find(|p| p.problem == Problem::Boundary)
            .unwrap();
        assert_eq!((border.n_elements, border.elements.len()), (30, n));
    }
}

/// Tetrahedra: where each begins, the length of its edges, and whether its faces point outward.
fn tetrahedra(of: &[(f64, f64, bool)]) -> Mesh {
    let (mut positions, mut faces) = (Vec::new(), Vec::new());
    for &(at, size, is_outward) in of {
        let (corners, held) = tetrahedron(0.0);
        let first = positions.len() as u32;
        positions.extend(corners.iter().map(|p| p.map(|x| at + size * x)));
        faces.extend(held.iter().map(|&[a, b, c]| match is_outward {
            true => [first + a, first + b, first + c],
            false => [first + a, first + c, first + b],
        }));
    }
    triangles(positions, faces)
}

#[test]
fn each_closed_piece_may_be_inside_out() {
    let (outer, far, hollow, core) = ((0.0, 9.0), (20.0, 1.0), (1.0, 2.0), (1.125, 0.5));
    let with = |(at, size): (f64, f64), is_outward| (at, size, is_outward);
    for (of, turned) in [
        (&[with(outer, true), with(far, true)][..], &[][..]),
        (&[with(outer, true), with(far, false)], &[1]),
        (&[with(outer, false), with(far, false)], &[0, 1]),
        // A hole, which the faces around it bound; and matter in the hole.
        (&[with(outer, true), with(hollow, false)], &[]),
        (&[with(hollow, true), with(outer, true)], &[0]),
        (
            &[with(core, true), with(outer, true), with(hollow, false)],
            &[],
        ),
        (
            &[with(core, false), with(outer, false), with(hollow, false)],
            &[0, 1],
        ),
    ] {
        let checked = check_mesh(tetrahedra(of), &Options::default()).unwrap();
        assert_eq!(checked.counts.inside_out, Some(turned.len() as u64));
        for (face, marks) in checked.marks.iter().enumerate() {
            let is_turned = turned.contains(&(face / 4));
            assert_eq!(marks.has(Problem::InsideOut), is_turned, "{of:?} {face}");
        }
        let places = checked.places.iter();
        let places = places.filter(|place| place.problem == Problem::InsideOut);
        let named: Vec<&[u32]> = places.map(|place| &place.elements[..]).collect();
        assert_eq!(named.len(), turned.len());
        // Mending finds the same, and leaves none.
        let fixed = fix_mesh(tetrahedra(of), &FixOptions::default()).unwrap();
        assert_eq!(fixed.repairs.turned_shells, turned.len() as u64);
        assert_eq!(fixed.after.inside_out, Some(0));
    }
    // Nothing is closed.
    let mut mesh = tetrahedra(&[with(outer, false)]);
    if let Elements::Triangles(faces) = &mut mesh.elements {
        faces.pop();
    }
    assert_eq!(counts(mesh).inside_out, Some(0));
}
