//! What `fix_mesh` writes, a check confirms: every defect by itself, all of them together, and
//! vertices that keep their bits.

mod common;
mod stitched;

use std::collections::HashSet;

use common::{BOX, corners};
use impinge_check::{Checked, FixOptions, Fixed, Options, Repair, check_mesh, fix_mesh};
use impinge_io::{Elements, Mesh, Positions};
use impinge_scenes::Random;
use impinge_scenes::surfaces::ball;
use stitched::stitched_boxes;

fn mesh(points: Vec<[f64; 3]>, faces: Vec<[u32; 3]>) -> Mesh {
    Mesh {
        positions: Positions::F64(points),
        elements: Elements::Triangles(faces),
    }
}

fn faces(mesh: &Mesh) -> &[[u32; 3]] {
    let Elements::Triangles(faces) = &mesh.elements else {
        panic!("triangles")
    };
    faces
}

/// A box, outward.
fn cube(low: [f64; 3], size: f64) -> Mesh {
    let high = low.map(|x| x + size);
    mesh(corners(low, high), BOX.to_vec())
}

/// Several meshes as one.
fn together(parts: &[Mesh]) -> Mesh {
    let (mut points, mut all) = (Vec::new(), Vec::new());
    for part in parts {
        let first = points.len() as u32;
        all.extend(faces(part).iter().map(|face| face.map(|v| v + first)));
        points.extend(part.positions.to_f64());
    }
    mesh(points, all)
}

fn round(n: usize) -> Mesh {
    let model = ball(n);
    let impinge::Elements::Triangles(faces) = &model.elements else {
        panic!("triangles")
    };
    Mesh {
        positions: Positions::F32(model.positions.clone()),
        elements: Elements::Triangles(faces.clone()),
    }
}

fn turned(mesh: &Mesh, which: impl Fn(usize) -> bool) -> Mesh {
    let mut mesh = mesh.clone();
    let Elements::Triangles(faces) = &mut mesh.elements else {
        panic!("triangles")
    };
    for (ix, face) in faces.iter_mut().enumerate() {
        if which(ix) {
            face.swap(1, 2);
        }
    }
    mesh
}

fn volume(mesh: &Mesh) -> f64 {
    let points = mesh.positions.to_f64();
    let faces = faces(mesh).iter();
    faces
        .map(|face| {
            let [a, b, c] = face.map(|v| points[v as usize]);
            (a[0] * (b[1] * c[2] - b[2] * c[1])
                + a[1] * (b[2] * c[0] - b[0] * c[2])
                + a[2] * (b[0] * c[1] - b[1] * c[0]))
                / 6.0
        })
        .sum()
}

fn bits(mesh: &Mesh) -> Vec<[u64; 3]> {
    match &mesh.positions {
        Positions::F32(held) => held.iter().map(|p| p.map(|x| x.to_bits().into())).collect(),
        Positions::F64(held) => held.iter().map(|p| p.map(f64::to_bits)).collect(),
    }
}

fn kept(mesh: Mesh) -> Checked {
    let options = Options {
        weld: false,
        keep_seams: true,
        threads: 1,
        ..Options::default()
    };
    check_mesh(mesh, &options).unwrap()
}

/// Mends with all repairs, and holds the result against what is promised of any result.
fn fix(mesh: &Mesh, close_holes: usize) -> Fixed {
    let options = FixOptions {
        close_holes,
        threads: 1,
        ..FixOptions::default()
    };
    let fixed = fix_mesh(mesh.clone(), &options).unwrap();
    let old: HashSet<[u64; 3]> = bits(mesh).into_iter().collect();
    assert!(bits(&fixed.mesh).iter().all(|at| old.contains(at)), "moved");
    if faces(&fixed.mesh).is_empty() {
        return fixed;
    }
    let counts = kept(fixed.mesh.clone()).counts;
    assert_eq!(counts, fixed.after);
    assert_eq!(counts.degenerate, 0);
    assert_eq!(counts.duplicates, 0);
    assert_eq!(counts.non_manifold_facets, 0);
    assert_eq!(counts.non_manifold_vertices, 0);
    assert_eq!(counts.unused_vertices, 0);
    if fixed.repairs.non_orientable == 0 {
        assert_eq!(counts.inconsistent_facets, 0);
    }
    assert_eq!(
        fixed.self_intersections.len() as u64,
        counts.self_intersections
    );
    fixed
}

#[test]
fn a_sound_mesh_stays_as_it_is() {
    let whole = round(1000);
    let fixed = fix(&whole, 64);
    assert_eq!(fixed.mesh, whole);
    assert_eq!(fixed.before, fixed.after);
    assert_eq!((fixed.repairs.shells, fixed.repairs.turned_shells), (1, 0));
}

#[test]
fn a_soup_is_welded() {
    let whole = round(500);
    let points = whole.positions.to_f64();
    let soup = faces(&whole).iter().flatten();
    let soup: Vec<[f64; 3]> = soup.map(|&v| points[v as usize]).collect();
    let n = soup.len() as u32;
    let loose = mesh(
        soup,
        (0..n / 3).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect(),
    );
    let fixed = fix(&loose, 0);
    let n_welded = n as usize - whole.n_vertices();
    assert_eq!(fixed.repairs.welded_vertices, n_welded as u64);
    assert_eq!(
        (fixed.after.boundary_facets, fixed.after.components),
        (0, 1)
    );
}

#[test]
fn copies_go_and_the_first_stays() {
    let whole = round(300);
    let mut twice = whole.clone();
    let Elements::Triangles(more) = &mut twice.elements else {
        panic!("triangles")
    };
    let again: Vec<[u32; 3]> = more[10..20].iter().map(|&[a, b, c]| [c, b, a]).collect();
    more.extend(again);
    let fixed = fix(&twice, 0);
    assert_eq!(fixed.repairs.duplicate_faces, 10);
    assert_eq!(fixed.mesh, whole);
}

/// A tetrahedron with further vertices on one edge: one face is a fan of flat ones and a face of
/// the whole edge, the other face has the vertices.
fn with_flat_faces(on_edge: &[f64], order: bool) -> Mesh {
    let mut points = vec![
        [0.0, 0.0, 0.0],
        [8.0, 0.0, 0.0],
        [0.0, 8.0, 0.0],
        [0.0, 0.0, 8.0],
    ];
    points.extend(on_edge.iter().map(|&x| [x, 0.0, 0.0]));
    let chain: Vec<u32> = [0]
        .into_iter()
        .chain(4..4 + on_edge.len() as u32)
        .chain([1])
        .collect();
    let mut faces = vec![[0, 2, 1], [1, 2, 3], [2, 0, 3]];
    // The face 0 1 3 in parts.
    faces.extend(chain.windows(2).map(|part| [part[0], part[1], 3]));
    // Between the edge 0 1 of the face 0 2 1 and its parts: flat faces.
    let flat = chain.windows(2).skip(1).map(|part| [0, part[1], part[0]]);
    let mut flat: Vec<[u32; 3]> = flat.collect();
    if order {
        flat.reverse();
    }
    faces.extend(flat);
    mesh(points, faces)
}

#[test]
fn flat_faces_divide_their_neighbours_and_leave_no_gap() {
    for (on_edge, order) in [
        (&[3.0][..], false),
        (&[1.0, 2.5, 7.0], false),
        (&[1.0, 2.5, 7.0], true),
        (&[1e-300, 0.1, 0.3, 7.9], true),
    ] {
        let flat = with_flat_faces(on_edge, order);
        let before = kept(flat.clone()).counts;
        assert_eq!(before.degenerate, on_edge.len() as u64);
        assert_eq!((before.boundary_facets, before.inconsistent_facets), (0, 0));
        let fixed = fix(&flat, 0);
        assert_eq!(fixed.repairs.divided_faces, on_edge.len() as u64);
        assert_eq!(fixed.repairs.degenerate_faces, 0);
        assert_eq!(
            (fixed.after.boundary_facets, fixed.after.self_intersections),
            (0, 0)
        );
        assert!((volume(&fixed.mesh) - 512.0 / 6.0).abs() < 1e-9);
    }
    // Two boxes that touch along an edge, which one of the four faces there has in two parts.
    let boxes = together(&[cube([-2.0, -2.0, 0.0], 2.0), cube([0.0; 3], 2.0)]);
    let (mut points, mut all) = (boxes.positions.to_f64(), faces(&boxes).to_vec());
    let is_on = |v: u32| points[v as usize][..2] == [0.0; 2];
    let at = all
        .iter()
        .position(|&[x, y, z]| !is_on(x) && is_on(y) && is_on(z));
    let [x, y, z] = all.swap_remove(at.unwrap());
    points.push([0.0, 0.0, 1.0]);
    all.extend([[x, y, 16], [x, 16, z], [y, z, 16]]);
    let fixed = fix(&mesh(points, all), 0);
    assert_eq!(
        (fixed.repairs.degenerate_faces, fixed.repairs.divided_faces),
        (0, 1)
    );
    assert_eq!(
        (fixed.after.boundary_facets, fixed.after.self_intersections),
        (0, 0)
    );
    assert!((volume(&fixed.mesh) - 16.0).abs() < 1e-9);
    // Faces that name a vertex twice have no place at all.
    let mut collapsed = round(100);
    let Elements::Triangles(faces) = &mut collapsed.elements else {
        panic!("triangles")
    };
    faces.insert(7, [3, 3, 9]);
    let fixed = fix(&collapsed, 0);
    assert_eq!(
        (fixed.repairs.degenerate_faces, fixed.repairs.divided_faces),
        (1, 0)
    );
    assert_eq!(fixed.mesh, round(100));
}

#[test]
fn flat_faces_that_are_neighbours_divide_one_another() {
    let (points, faces) = stitched_boxes();
    let points = points.iter().map(|at| at.map(|x| x as f64)).collect();
    let stitched = mesh(points, faces);
    assert_eq!(kept(stitched.clone()).counts.degenerate, 3);
    let fixed = fix(&stitched, 0);
    assert_eq!(
        (fixed.repairs.degenerate_faces, fixed.repairs.divided_faces),
        (0, 3)
    );
    assert_eq!(
        (fixed.after.boundary_facets, fixed.after.self_intersections),
        (0, 0)
    );
    assert_eq!((fixed.after.components, fixed.repairs.shells), (2, 2));
    assert!((volume(&fixed.mesh) - 128.0).abs() < 1e-9);
}

/// `k` faces at one edge, which a chain of `m` faces of zero area divides.
fn fan_and_chain(k: u32, m: u32) -> Mesh {
    let end = f64::from(m) + 1.0;
    let mut points = vec![[0.0; 3], [end, 0.0, 0.0]];
    points.extend((0..k).map(|i| [0.0, 1.0, f64::from(i)]));
    points.extend((1..=m).map(|i| [f64::from(i), 0.0, 0.0]));
    let mut faces: Vec<[u32; 3]> = (2..2 + k).map(|apex| [0, 1, apex]).collect();
    let chain: Vec<u32> = (2 + k..2 + k + m).chain([1]).collect();
    faces.extend(chain.windows(2).map(|part| [0, part[1], part[0]]));
    mesh(points, faces)
}

#[test]
fn faces_do_not_multiply_where_many_share_the_long_side_of_a_flat_one() {
    let divided = |k, m| {
        let options = FixOptions {
            repairs: vec![Repair::Degenerate],
            ..FixOptions::default()
        };
        let fixed = fix_mesh(fan_and_chain(k, m), &options).unwrap();
        assert_eq!(
            fixed.repairs.degenerate_faces + fixed.repairs.divided_faces,
            u64::from(m)
        );
        (fixed.repairs.divided_faces, fixed.after.n_triangles)
    };
    assert_eq!(divided(2, 3), (3, 8));
    assert_eq!(divided(16, 1), (1, 32));
    assert_eq!(divided(17, 1), (0, 17));
    // Each adds one face, or 15, and no more are added than the mesh had.
    assert_eq!(divided(2, 100), (100, 202));
    assert_eq!(divided(16, 100), (7, 128));
    assert_eq!(divided(2000, 2000), (0, 2000));
}

#[test]
fn the_fewest_faces_are_turned() {
    let whole = round(800);
    let fixed = fix(&turned(&whole, |ix| ix % 7 == 3), 0);
    let n = faces(&whole).len().saturating_sub(4).div_ceil(7) as u64;
    assert_eq!(fixed.repairs.turned_faces, n);
    assert_eq!(fixed.mesh, whole);
}

#[test]
fn shells_are_turned_by_what_is_inside_what() {
    let parts = [
        cube([-8.0; 3], 16.0),
        cube([-4.0; 3], 8.0),
        cube([-2.0; 3], 4.0),
        cube([100.0; 3], 1.0),
    ];
    let expected = 4096.0 - 512.0 + 64.0 + 1.0;
    for mask in 0..16 {
        let shells: Vec<Mesh> = (0..4)
            .map(|ix| turned(&parts[ix], |_| mask >> ix & 1 == 1))
            .collect();
        let fixed = fix(&together(&shells), 0);
        assert!((volume(&fixed.mesh) - expected).abs() < 1e-6, "{mask}");
        assert_eq!((fixed.repairs.shells, fixed.repairs.cavities), (4, 1));
        // Given are: outward, inward, outward, outward.
        let n_wrong = u64::from((mask ^ 2u32).count_ones());
        assert_eq!(fixed.repairs.turned_shells, n_wrong, "{mask}");
    }
    // Boxes that pass through each other contain nothing of each other, and touching a wall from
    // inside is inside.
    let crossing = together(&[cube([0.0; 3], 2.0), turned(&cube([1.0; 3], 2.0), |_| true)]);
    let fixed = fix(&crossing, 0);
    assert_eq!(
        (fixed.repairs.turned_shells, fixed.repairs.cavities),
        (1, 0)
    );
    assert!(fixed.after.self_intersections > 0);
    let mut touching = together(&[cube([0.0; 3], 4.0), cube([1.0, 1.0, 0.0], 1.0)]);
    touching.positions.narrow_if_exact();
    let fixed = fix(&touching, 0);
    assert_eq!(
        (fixed.repairs.turned_shells, fixed.repairs.cavities),
        (1, 1)
    );
}

#[test]
fn boxes_that_share_an_edge_or_a_vertex_come_apart() {
    // Around an edge, two to four boxes touch; of three or four, neighbours share walls, which then
    // are there twice.
    let sharing = |lows: &[[f64; 3]]| {
        let parts: Vec<Mesh> = lows.iter().map(|&low| cube(low, 1.0)).collect();
        together(&parts)
    };
    let edge = sharing(&[[0.0; 3], [1.0, 1.0, 0.0]]);
    let before = check_mesh(edge.clone(), &Options::default())
        .unwrap()
        .counts;
    assert_eq!(before.non_manifold_facets, 1);
    for flipped in [false, true] {
        let fixed = fix(&turned(&edge, |ix| flipped && ix >= 12), 0);
        assert_eq!(
            (fixed.repairs.split_edges, fixed.repairs.split_edges_added),
            (1, 2)
        );
        assert_eq!(
            (fixed.after.components, fixed.after.boundary_facets),
            (2, 0)
        );
        assert_eq!(
            fixed.after.self_intersections, 0,
            "touching is no intersection"
        );
        assert_eq!(fixed.repairs.shells, 2);
        assert!((volume(&fixed.mesh) - 2.0).abs() < 1e-12);
        assert!(fixed.has_seams());
    }
    let vertex = sharing(&[[0.0; 3], [1.0; 3]]);
    let fixed = fix(&vertex, 0);
    assert_eq!(
        (
            fixed.repairs.split_vertices,
            fixed.repairs.split_vertices_added
        ),
        (1, 1)
    );
    assert_eq!(
        (fixed.after.components, fixed.after.boundary_facets),
        (2, 0)
    );
    // Two boxes with a common wall: kept twice, it parts into two boxes.
    let wall = sharing(&[[0.0; 3], [1.0, 0.0, 0.0]]);
    let options = FixOptions {
        repairs: Repair::ALL
            .into_iter()
            .filter(|&it| it != Repair::Duplicates)
            .collect(),
        ..FixOptions::default()
    };
    // With all repairs, the wall goes: one solid is left.
    let whole = fix(&wall, 0);
    assert_eq!(
        (whole.repairs.duplicate_faces, whole.repairs.opposite_faces),
        (4, 4)
    );
    assert_eq!(
        (whole.after.components, whole.after.boundary_facets),
        (1, 0)
    );
    assert_eq!(whole.after.volume, Some(2.0));
    let fixed = fix_mesh(wall, &options).unwrap();
    assert_eq!(fixed.after.components, 2);
    assert_eq!(
        (fixed.after.boundary_facets, fixed.after.non_manifold_facets),
        (0, 0)
    );
}

#[test]
fn holes_are_closed_up_to_a_number_of_edges() {
    let whole = cube([0.0; 3], 1.0);
    let without = |gone: &[usize]| {
        let left = faces(&whole).iter().enumerate();
        let left = left
            .filter(|(ix, _)| !gone.contains(ix))
            .map(|(_, &face)| face);
        mesh(whole.positions.to_f64(), left.collect())
    };
    let triangle = without(&[3]);
    assert_eq!(fix(&triangle, 0).after.boundary_facets, 3);
    let fixed = fix(&triangle, 3);
    assert_eq!(
        (fixed.repairs.closed_holes, fixed.repairs.added_faces),
        (1, 1)
    );
    assert_eq!(
        (fixed.after.boundary_facets, fixed.after.self_intersections),
        (0, 0)
    );
    assert!((volume(&fixed.mesh) - 1.0).abs() < 1e-12);
    let side = without(&[2, 3]);
    assert_eq!(fix(&side, 3).repairs.closed_holes, 0);
    let fixed = fix(&side, 4);
    assert_eq!(
        (fixed.repairs.closed_holes, fixed.after.boundary_facets),
        (1, 0)
    );
    assert!((volume(&fixed.mesh) - 1.0).abs() < 1e-12);
    // A needle through the hole keeps it open: the filling would be pierced.
    let needle = mesh(
        vec![[0.5, 0.25, 0.25], [1.5, 0.25, 0.25], [1.5, 0.375, 0.25]],
        vec![[0, 1, 2]],
    );
    let pierced = together(&[side.clone(), needle]);
    let fixed = fix(&pierced, 4);
    assert_eq!(
        (fixed.repairs.closed_holes, fixed.repairs.refused_holes),
        (0, 2)
    );
    assert_eq!(fixed.after.self_intersections, 0);
    assert_eq!(faces(&fixed.mesh).len(), faces(&pierced).len());
}

#[test]
fn a_moebius_strip_is_said_and_left() {
    let n = 12u32;
    let at = |ix: u32, side: f64| {
        let turn = f64::from(ix) / f64::from(n) * std::f64::consts::TAU;
        let out = 4.0 + side * (turn / 2.0).cos();
        [
            out * turn.cos(),
            out * turn.sin(),
            side * (turn / 2.0).sin(),
        ]
    };
    let points = (0..n).flat_map(|ix| [at(ix, -1.0), at(ix, 1.0)]).collect();
    let mut all = Vec::new();
    for ix in 0..n {
        let (a, b) = (2 * ix, 2 * ix + 1);
        let (c, d) = if ix + 1 == n { (1, 0) } else { (a + 2, b + 2) };
        all.extend([[a, b, c], [c, b, d]]);
    }
    let strip = mesh(points, all);
    let fixed = fix(&strip, 0);
    assert_eq!(
        (fixed.repairs.non_orientable, fixed.repairs.turned_faces),
        (1, 0)
    );
    assert_eq!(fixed.mesh, strip);
    assert!(fixed.after.inconsistent_facets > 0);
}

#[test]
fn only_what_is_asked_is_done() {
    let mut bad = turned(&with_flat_faces(&[3.0], false), |ix| ix == 1);
    let Elements::Triangles(more) = &mut bad.elements else {
        panic!("triangles")
    };
    more.push(more[0]);
    let options = |repairs: &[Repair]| FixOptions {
        repairs: repairs.to_vec(),
        ..FixOptions::default()
    };
    assert_eq!(fix_mesh(bad.clone(), &options(&[])).unwrap().mesh, bad);
    let fixed = fix_mesh(bad.clone(), &options(&[Repair::Duplicates])).unwrap();
    assert_eq!((fixed.after.duplicates, fixed.after.degenerate), (0, 1));
    let fixed = fix_mesh(bad, &options(&[Repair::Degenerate, Repair::Orient])).unwrap();
    // Both copies are divided.
    assert_eq!((fixed.after.duplicates, fixed.after.degenerate), (2, 0));
}

#[test]
fn refusals_name_numbers() {
    let tets = Mesh {
        positions: Positions::F32(vec![[0.0; 3]; 4]),
        elements: Elements::Tetrahedra(vec![[0, 1, 2, 3]]),
    };
    let error = fix_mesh(tets, &FixOptions::default()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "1 tetrahedra: only meshes of triangles are mended"
    );
    let options = FixOptions {
        close_holes: 257,
        ..FixOptions::default()
    };
    let error = fix_mesh(cube([0.0; 3], 1.0), &options).unwrap_err();
    assert_eq!(
        error.to_string(),
        "holes of up to 257 edges: at most 256 can be asked for"
    );
    let far = mesh(vec![[0.0; 3]], vec![[0, 0, 9]]);
    assert!(
        fix_mesh(far, &FixOptions::default())
            .unwrap_err()
            .to_string()
            .contains('9')
    );
}

/// Faces at random on few places: every defect at once, surfaces that come back to an edge, Möbius
/// strips, needles, copies.
#[test]
fn random_soups_come_out_as_promised_and_stay_so() {
    let mut generator = Random::new(7);
    let mut random = |n: u32| generator.below(n);
    let (mut n_split, mut n_divided, mut n_closed, mut n_shells) = (0, 0, 0, 0);
    for round in 0..3000 {
        let n_points = 4 + random(9);
        let size = 2 + random(3);
        let points = (0..n_points).map(|_| [0; 3].map(|_| f64::from(random(size))));
        let points: Vec<[f64; 3]> = points.collect();
        let n_faces = 1 + random(28);
        let soup = (0..n_faces)
            .map(|_| [0; 3].map(|_| random(n_points)))
            .collect();
        let soup = mesh(points, soup);
        let holes = if round % 3 == 0 { 6 } else { 0 };
        let fixed = fix(&soup, holes);
        n_split += fixed.repairs.split_edges;
        n_divided += fixed.repairs.divided_faces;
        n_closed += fixed.repairs.closed_holes;
        n_shells += fixed.repairs.shells;
        if holes > 0 {
            assert!(fixed.after.self_intersections <= fix(&soup, 0).after.self_intersections);
        }
        if !faces(&fixed.mesh).is_empty() {
            let again = fix(&fixed.mesh, 0).after;
            assert_eq!(
                (again.n_triangles, again.self_intersections),
                (fixed.after.n_triangles, fixed.after.self_intersections)
            );
            let again = fix(&fixed.mesh, holes);
            assert_eq!(again.mesh, fixed.mesh, "{round}");
            assert_eq!(again.repairs.closed_holes, 0, "{round}");
        }
    }
    // The soups are as bad as they are meant to be.
    assert!(
        n_split > 1000 && n_divided > 5 && n_closed > 20 && n_shells > 20,
        "{n_split} {n_divided} {n_closed} {n_shells}"
    );
}

#[test]
fn opposite_faces_go_where_they_hang_on_others_and_else_one_stays() {
    // A fin of no thickness on an edge of a box.
    let solid = cube([0.0; 3], 1.0);
    let mut finned = solid.clone();
    if let Positions::F64(points) = &mut finned.positions {
        points.push([-1.0, -1.0, 0.5]);
    }
    if let Elements::Triangles(held) = &mut finned.elements {
        held.extend([[0, 1, 8], [1, 0, 8]]);
    }
    let fixed = fix(&finned, 0);
    assert_eq!(
        (fixed.repairs.duplicate_faces, fixed.repairs.opposite_faces),
        (2, 2)
    );
    assert_eq!(fixed.mesh, solid);
    // A sheet with two sides stays a sheet; so does one with the same side twice.
    let sheet = mesh(
        vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
        vec![[0, 1, 2], [0, 2, 3], [0, 2, 1], [0, 3, 2]],
    );
    let fixed = fix(&sheet, 0);
    assert_eq!(
        (fixed.after.n_triangles, fixed.repairs.opposite_faces),
        (2, 0)
    );
}

/// What `fix` writes, `check` confirms: every real mesh that there is, closed if it was.
#[test]
fn real_meshes_come_out_as_promised_and_no_border_opens() {
    for name in [
        "buddha.ply",
        "bunny.ply",
        "camelhead.off",
        "cow.off",
        "dragon.ply",
    ] {
        let Some(path) = impinge_testing::data::test_file(&format!("meshes/{name}")) else {
            continue;
        };
        let whole = impinge_io::read(&path, &impinge_io::ReadOptions::as_they_are()).unwrap();
        let fixed = fix(&whole, 0);
        assert!(
            fixed.after.self_intersections <= fixed.before.self_intersections,
            "{name}"
        );
        if fixed.before.boundary_facets == 0 {
            assert_eq!(fixed.after.boundary_facets, 0, "{name}");
        }
    }
}

/// A mesh with one more vertex, and one more face.
fn with_face(mesh_of: &Mesh, at: [f64; 3], face: [u32; 3]) -> Mesh {
    let mut points = mesh_of.positions.to_f64();
    points.push(at);
    mesh(
        points,
        faces(mesh_of).iter().copied().chain([face]).collect(),
    )
}

/// The faces by their corners, from the lowest one on, sorted.
fn surface(mesh: &Mesh) -> Vec<[[u64; 3]; 3]> {
    let points = bits(mesh);
    let face = |face: &[u32; 3]| {
        let mut face = face.map(|v| points[v as usize]);
        let first = (0..3).min_by_key(|&ix| face[ix]).unwrap_or_default();
        face.rotate_left(first);
        face
    };
    let mut all: Vec<_> = faces(mesh).iter().map(face).collect();
    all.sort_unstable();
    all
}

#[test]
fn a_stray_face_opens_no_solid() {
    let solid = cube([0.0; 3], 2.0);
    let mut fins = vec![
        ([4.0, 0.0, 0.0], [4, 5, 8]),
        ([1.0, 1.0, 1.0], [4, 5, 8]),
        ([1.0, 0.5, 1.5], [4, 7, 8]),
    ];
    // Faces through the cube between its corners; the sides of the cube have others.
    for a in 0..8u32 {
        for b in 0..a {
            for c in 0..b {
                let mut sides = BOX.map(|mut face| {
                    face.sort_unstable();
                    face
                });
                sides.sort_unstable();
                if sides.binary_search(&[c, b, a]).is_err() {
                    fins.push(([1.0; 3], [c, b, a]));
                }
            }
        }
    }
    assert_eq!(fins.len(), 3 + 56 - 12);
    for (at, [a, b, c]) in fins {
        for fin in [[a, b, c], [a, c, b]] {
            let with_fin = with_face(&solid, at, fin);
            let outward = fix(&with_fin, 0);
            let inward = fix(&turned(&with_fin, |ix| ix < 12), 0);
            let again = fix(&outward.mesh, 0);
            for fixed in [&outward, &inward, &again] {
                let after = &fixed.after;
                assert_eq!(
                    (
                        fixed.repairs.shells,
                        after.components,
                        after.boundary_facets
                    ),
                    (1, 2, 3),
                    "{fin:?}"
                );
                assert_eq!(surface(&fixed.mesh), surface(&with_fin), "{fin:?}");
            }
            assert_eq!(outward.mesh, inward.mesh);
            assert_eq!(outward.mesh.n_vertices(), again.mesh.n_vertices());
            let n_turned = [&outward, &inward, &again].map(|it| it.repairs.turned_shells);
            assert_eq!(n_turned, [0, 1, 0]);
        }
    }
}

#[test]
fn a_collar_or_a_lid_opens_no_solid() {
    // A collar around a waist parts the solid into two pieces, and is itself a ring.
    let waist = |size: f64, z: f64| {
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]| [size * x, size * y, z])
    };
    let mut points = [
        waist(1.0, -1.0),
        waist(1.0, 0.0),
        waist(1.0, 1.0),
        waist(2.0, 0.0),
    ]
    .concat();
    let ring = |low: u32, high: u32| {
        (0..4).flat_map(move |ix| {
            let next = (ix + 1) % 4;
            [
                [low + ix, low + next, high + ix],
                [low + next, high + next, high + ix],
            ]
        })
    };
    let mut solid = vec![[0, 2, 1], [0, 3, 2], [8, 9, 10], [8, 10, 11]];
    solid.extend(ring(0, 4).chain(ring(4, 8)));
    let n_solid = solid.len();
    let mut collared = solid.clone();
    collared.extend(ring(4, 12));
    let collared = mesh(points.clone(), collared);
    for flipped in [|_, _| false, |ix, n| ix < n, |ix, n| ix >= n, |_, _| true] {
        let fixed = fix(&turned(&collared, |ix| flipped(ix, n_solid)), 0);
        assert_eq!((fixed.repairs.shells, fixed.after.components), (1, 2));
        assert_eq!(fixed.after.boundary_facets, 8);
    }
    // A wall through a cube parts it into two prisms of which either could stay closed.
    let box_with_wall = with_face(
        &with_face(&cube([0.0; 3], 2.0), [1.0; 3], [0, 4, 7]),
        [1.0; 3],
        [0, 7, 3],
    );
    for flips in 0..4u32 {
        let mixed = turned(&box_with_wall, |ix| flips >> u32::from(ix >= 12) & 1 == 1);
        let fixed = fix(&mixed, 0);
        assert_eq!((fixed.repairs.shells, fixed.after.components), (1, 2));
        assert_eq!(fixed.after.boundary_facets, 4);
        assert_eq!(fixed.repairs.turned_shells, u64::from(flips & 1));
    }
    // A lid over the hole of a ring of matter has no border of its own.
    points = [
        waist(1.0, 0.0),
        waist(2.0, 0.0),
        waist(2.0, 1.0),
        waist(1.0, 1.0),
    ]
    .concat();
    let mut lidded: Vec<[u32; 3]> = ring(0, 4).chain(ring(4, 8)).collect();
    lidded.extend(ring(8, 12).chain(ring(12, 0).map(|face| face.map(|v| v % 16))));
    let n_solid = lidded.len();
    lidded.extend([[0, 1, 2], [0, 2, 3]]);
    let lidded = mesh(points, lidded);
    for flipped in [|_, _| false, |ix, n| ix < n, |ix, n| ix >= n, |_, _| true] {
        let fixed = fix(&turned(&lidded, |ix| flipped(ix, n_solid)), 0);
        assert_eq!((fixed.repairs.shells, fixed.after.components), (1, 2));
        assert_eq!(fixed.after.boundary_facets, 4);
    }
}

/// Boxes and tetrahedra that share corners, edges and walls or lie in each other, some of them
/// inside out, with fins between their vertices; open ones too if asked for.
fn random_scene(generator: &mut Random, opens: bool) -> Mesh {
    let mut random = |n: u32| generator.below(n);
    let parts = (0..1 + random(4)).map(|_| {
        let low = [0; 3].map(|_| f64::from(random(4)));
        let size = f64::from(1 + random(3));
        let mut part = cube(low, size);
        if random(3) == 0 {
            part = mesh(
                corners(low, low.map(|x| x + size))[..].to_vec(),
                vec![[0, 2, 1], [0, 1, 4], [1, 2, 4], [2, 0, 4]],
            );
        }
        let is_turned = random(2) == 0;
        let gone = if opens { random(80) as usize } else { 99 };
        let part = turned(&part, |_| is_turned);
        let left = faces(&part).iter().enumerate().filter(|it| it.0 != gone);
        mesh(part.positions.to_f64(), left.map(|it| *it.1).collect())
    });
    let mut scene = together(&parts.collect::<Vec<_>>());
    let n = scene.n_vertices() as u32;
    for _ in 0..random(4) {
        let fin = [0; 3].map(|_| random(n));
        scene = with_face(&scene, [0; 3].map(|_| f64::from(random(6))), fin);
    }
    scene
}

#[test]
fn what_is_mended_stays_as_it_is_and_does_not_depend_on_what_was_inside_out() {
    let mut generator = Random::new(11);
    let (mut n_split, mut n_turned, mut n_open, mut n_closed) = (0, 0, 0, 0);
    for round in 0..750 {
        let opens = round % 2 == 1;
        let holes = if round % 3 == 2 { 8 } else { 0 };
        let scene = random_scene(&mut generator, opens);
        let fixed = fix(&scene, holes);
        if faces(&fixed.mesh).is_empty() {
            continue;
        }
        n_split += u32::from(fixed.repairs.split_edges > 0);
        n_turned += u32::from(fixed.repairs.turned_shells > 0);
        n_open += u32::from(fixed.after.boundary_facets > 0);
        n_closed += u32::from(fixed.repairs.split_edges > 0 && fixed.repairs.closed_holes > 0);
        let again = fix(&fixed.mesh, holes);
        assert_eq!(again.mesh, fixed.mesh, "{round}");
        assert_eq!(again.after, fixed.after, "{round}");
        assert_eq!(again.repairs.shells, fixed.repairs.shells, "{round}");
        assert_eq!(again.repairs.turned_shells, 0, "{round}");
        if !opens {
            let other = fix(&turned(&scene, |_| true), holes);
            assert_eq!(other.after, fixed.after, "{round}");
        }
    }
    assert!(
        n_split > 100 && n_turned > 100 && n_open > 100 && n_closed > 10,
        "{n_split} {n_turned} {n_open} {n_closed}"
    );
}
