//! Walls that are too thin: plates, hollow balls, wedges, gaps, and solids inside out.

mod common;

use common::{BOX, corners};
use impinge_check::{Checked, Options, Problem, check_mesh};
use impinge_io::{Elements, Mesh, Positions};

type Faces = Vec<[u32; 3]>;

/// A box, outward.
fn cuboid(low: [f64; 3], high: [f64; 3]) -> (Vec<[f64; 3]>, Faces) {
    (corners(low, high), BOX.to_vec())
}

fn turned((points, faces): (Vec<[f64; 3]>, Faces)) -> (Vec<[f64; 3]>, Faces) {
    (
        points,
        faces.into_iter().map(|[a, b, c]| [a, c, b]).collect(),
    )
}

fn mesh(parts: &[(Vec<[f64; 3]>, Faces)]) -> Mesh {
    let (mut points, mut all) = (Vec::new(), Vec::new());
    for (at, faces) in parts {
        let first = points.len() as u32;
        points.extend_from_slice(at);
        all.extend(faces.iter().map(|face| face.map(|v| v + first)));
    }
    Mesh {
        positions: Positions::F64(points),
        elements: Elements::Triangles(all),
    }
}

fn checked(mesh: Mesh, most: f64) -> Checked {
    let options = Options {
        min_thickness: Some(most),
        threads: 1,
        ..Options::default()
    };
    check_mesh(mesh, &options).unwrap()
}

fn thin(mesh: Mesh, most: f64) -> (Option<u64>, Option<f64>) {
    let counts = checked(mesh, most).counts;
    (counts.thin_faces, counts.thinnest)
}

#[test]
fn a_plate_is_as_thick_as_it_is() {
    let plate = || mesh(&[cuboid([0.0; 3], [10.0, 8.0, 0.5])]);
    assert_eq!(thin(plate(), 0.5), (Some(4), Some(0.5)));
    assert_eq!(thin(plate(), 0.5f64.next_down()), (Some(0), None));
    let found = checked(plate(), 0.7);
    for (ix, marks) in found.marks.iter().enumerate() {
        // The faces below and above; not the rim.
        let [a, b, c] = [0, 1, 2].map(|corner| match &found.mesh.elements {
            Elements::Triangles(faces) => {
                found.mesh.positions.to_f64()[faces[ix][corner] as usize][2]
            }
            Elements::Tetrahedra(_) => panic!("triangles"),
        });
        assert_eq!(marks.has(Problem::Thin), a == b && b == c, "{ix}");
    }
    assert!(
        found
            .places
            .iter()
            .any(|place| place.problem == Problem::Thin)
    );
    // Nothing is asked, nothing is said.
    let counts = check_mesh(plate(), &Options::default()).unwrap().counts;
    assert_eq!((counts.thin_faces, counts.min_thickness), (None, None));
}

#[test]
fn a_gap_is_no_wall_and_a_cavity_has_walls() {
    let two = || {
        mesh(&[
            cuboid([0.0; 3], [4.0; 3]),
            cuboid([0.0, 0.0, 4.25], [4.0, 4.0, 8.0]),
        ])
    };
    assert_eq!(thin(two(), 1.0), (Some(0), None));
    let hollow = || {
        mesh(&[
            cuboid([0.0; 3], [4.0; 3]),
            turned(cuboid([1.0, 1.0, 0.25], [3.0; 3])),
        ])
    };
    let (n, thinnest) = thin(hollow(), 0.5);
    assert!(n.is_some_and(|n| n >= 2), "{n:?}");
    assert_eq!(thinnest, Some(0.25));
    // A slot from above, 0.5 wide, between walls of 1.75: matter is not in the slot.
    let slot = [
        [0.0, 0.0],
        [4.0, 0.0],
        [4.0, 4.0],
        [2.25, 4.0],
        [2.25, 1.0],
        [1.75, 1.0],
        [1.75, 4.0],
        [0.0, 4.0],
    ];
    let cut = [
        [0u32, 1, 4],
        [1, 2, 4],
        [2, 3, 4],
        [0, 4, 5],
        [0, 5, 7],
        [5, 6, 7],
    ];
    let prism = || {
        let n = slot.len() as u32;
        let points = [0.0, 5.0]
            .iter()
            .flat_map(|&z| slot.iter().map(move |&[x, y]| [x, y, z]));
        let mut faces: Faces = cut.iter().map(|&[a, b, c]| [a, c, b]).collect();
        faces.extend(cut.iter().map(|face| face.map(|v| v + n)));
        for a in 0..n {
            let b = (a + 1) % n;
            faces.extend([[a, b, b + n], [a, b + n, a + n]]);
        }
        mesh(&[(points.collect(), faces)])
    };
    assert_eq!(checked(prism(), 0.6).counts.is_watertight, Some(true));
    assert!(checked(prism(), 0.6).counts.volume.unwrap() > 0.0);
    assert_eq!(thin(prism(), 0.6), (Some(0), None));
    let (n, thinnest) = thin(prism(), 1.8);
    assert!(n.is_some_and(|n| n >= 4), "{n:?}");
    assert!(
        thinnest.is_some_and(|at| at == 1.75 || at == 1.0),
        "{thinnest:?}"
    );
}

#[test]
fn overlaps_and_sharp_edges_are_none() {
    // Two solids that overlap by 0.125: no wall is there.
    let overlap = mesh(&[
        cuboid([0.0; 3], [4.0; 3]),
        cuboid([0.5, 0.5, 3.875], [3.5, 3.5, 8.0]),
    ]);
    assert_eq!(thin(overlap, 0.5), (Some(0), None));
    // A wedge whose sides meet at 60°.
    let tip = 3f64.sqrt();
    let points = vec![
        [-1.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, tip, 0.0],
        [-1.0, 0.0, 9.0],
        [1.0, 0.0, 9.0],
        [0.0, tip, 9.0],
    ];
    let faces = vec![
        [0, 2, 1],
        [3, 4, 5],
        [0, 1, 4],
        [0, 4, 3],
        [1, 2, 5],
        [1, 5, 4],
        [2, 0, 3],
        [2, 3, 5],
    ];
    assert_eq!(thin(mesh(&[(points, faces)]), 0.5), (Some(0), None));
}

#[test]
fn inside_out_has_walls_and_an_open_surface_has_none() {
    let plate = || cuboid([0.0; 3], [10.0, 8.0, 0.5]);
    assert_eq!(thin(mesh(&[turned(plate())]), 0.5), (Some(4), Some(0.5)));
    let (points, mut faces) = plate();
    faces.pop();
    assert_eq!(thin(mesh(&[(points, faces)]), 0.5), (None, None));
}
