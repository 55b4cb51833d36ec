//! Parts that pass into each other, touch or are near, against separating axes of convex solids.

mod common;
mod stitched;

use common::{BOX, corners};
use impinge_check::{AssemblyError, AssemblyOptions, PartPair, Relation, check_assembly};
use impinge_io::{Elements, Mesh, Positions};
use impinge_scenes::Random;
use stitched::stitched_boxes;

type Point = [i64; 3];
type Faces = Vec<[u32; 3]>;

fn mesh(points: &[Point], faces: &Faces) -> Mesh {
    let at = |p: &Point| p.map(|x| x as f64);
    Mesh {
        positions: Positions::F64(points.iter().map(at).collect()),
        elements: Elements::Triangles(faces.clone()),
    }
}

fn ask(meshes: Vec<Mesh>, clearance: Option<f64>) -> Vec<PartPair> {
    let options = AssemblyOptions {
        clearance,
        threads: 1,
        ..AssemblyOptions::default()
    };
    check_assembly(meshes, &options).unwrap().pairs
}

fn relation(a: &Mesh, b: &Mesh) -> Option<Relation> {
    let found = ask(vec![a.clone(), b.clone()], None);
    found.first().map(|pair| pair.relation)
}

/// A box, outward.
fn cuboid(low: Point, high: Point) -> (Vec<Point>, Faces) {
    (corners(low, high), BOX.to_vec())
}

fn sub(a: Point, b: Point) -> Point {
    [0, 1, 2].map(|k| a[k] - b[k])
}

fn cross(a: Point, b: Point) -> Point {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn dot(a: Point, b: Point) -> i64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Whether a plane parts two convex sets of points, which may have points on it: with `strictly`,
/// not of both.
fn parted(a: (&[Point], &Faces), b: (&[Point], &Faces), strictly: bool) -> bool {
    let edges = |(points, faces): (&[Point], &Faces)| -> Vec<Point> {
        let sides = faces.iter().flat_map(|&[x, y, z]| [[x, y], [y, z], [z, x]]);
        sides
            .map(|[x, y]| sub(points[y as usize], points[x as usize]))
            .collect()
    };
    let normals = |(points, faces): (&[Point], &Faces)| -> Vec<Point> {
        let normal = |face: &[u32; 3]| {
            let [x, y, z] = face.map(|v| points[v as usize]);
            cross(sub(y, x), sub(z, x))
        };
        faces.iter().map(normal).collect()
    };
    let mut axes = [normals(a), normals(b)].concat();
    for &of_a in &edges(a) {
        axes.extend(edges(b).iter().map(|&of_b| cross(of_a, of_b)));
    }
    // Within the plane of a lone face.
    for (set, faces) in [a, b] {
        if faces.len() == 1 {
            let normal = normals((set, faces))[0];
            axes.extend(edges((set, faces)).iter().map(|&edge| cross(normal, edge)));
        }
    }
    axes.into_iter().filter(|axis| *axis != [0; 3]).any(|axis| {
        let range = |points: &[Point]| {
            let along = points.iter().map(|&p| dot(axis, p));
            (along.clone().min().unwrap(), along.max().unwrap())
        };
        let ((low_a, high_a), (low_b, high_b)) = (range(a.0), range(b.0));
        match strictly {
            true => high_a < low_b || high_b < low_a,
            false => high_a <= low_b || high_b <= low_a,
        }
    })
}

fn shares(found: Option<Relation>) -> bool {
    found.is_some_and(Relation::shares_space)
}

/// Asks how two convex meshes relate, and checks that they are apart (0), touch (1) or share space
/// (2) as their separating axes say.
fn as_axes_say(a: (&[Point], &Faces), b: (&[Point], &Faces)) -> usize {
    let found = relation(&mesh(a.0, a.1), &mesh(b.0, b.1));
    let (expected, is_right) = match (parted(a, b, true), parted(a, b, false)) {
        (true, _) => (0, found.is_none()),
        (_, true) => (1, found == Some(Relation::Touching)),
        _ => (2, shares(found)),
    };
    assert!(is_right, "{found:?}: {:?} {:?}", a.0, b.0);
    expected
}

fn tetrahedron(random: &mut Random, most: u32) -> (Vec<Point>, Faces) {
    loop {
        let points: Vec<Point> = (0..4)
            .map(|_| [0; 3].map(|_: i64| i64::from(random.below(most + 1))))
            .collect();
        let [a, b, c, d] = [0, 1, 2, 3].map(|ix: usize| points[ix]);
        let volume = dot(cross(sub(b, a), sub(c, a)), sub(d, a));
        if volume != 0 {
            // Half of them are inside out.
            return (points, vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]);
        }
    }
}

#[test]
fn tetrahedra_of_a_lattice_as_their_separating_axes_say() {
    let mut random = Random::new(20);
    let mut n = [0; 3];
    for _ in 0..6000 {
        let [(a, faces_a), (b, faces_b)] = [2, 3].map(|most| tetrahedron(&mut random, most));
        n[as_axes_say((&a, &faces_a), (&b, &faces_b))] += 1;
    }
    assert!(n.iter().all(|&n| n > 200), "{n:?}");
}

#[test]
fn a_triangle_and_a_solid_as_their_separating_axes_say() {
    let mut random = Random::new(21);
    let mut n = [0; 3];
    let one_face: Faces = vec![[0, 1, 2]];
    for _ in 0..6000 {
        let (a, faces_a) = tetrahedron(&mut random, 2);
        let b: Vec<Point> = (0..3)
            .map(|_| [0; 3].map(|_: i64| i64::from(random.below(4))))
            .collect();
        if cross(sub(b[1], b[0]), sub(b[2], b[0])) == [0; 3] {
            continue;
        }
        n[as_axes_say((&a, &faces_a), (&b, &one_face))] += 1;
    }
    assert!(n.iter().all(|&n| n > 200), "{n:?}");
}

#[test]
fn boxes_of_a_lattice_as_their_intervals_say() {
    let mut random = Random::new(22);
    let any = |random: &mut Random| {
        let ends = [0; 3].map(|_: i64| {
            let low = i64::from(random.below(4));
            (low, low + 1 + i64::from(random.below(3)))
        });
        (ends.map(|(low, _)| low), ends.map(|(_, high)| high))
    };
    let mut n = [0; 3];
    for _ in 0..3000 {
        let [a, b] = [any(&mut random), any(&mut random)];
        let meshes = [a, b].map(|(low, high)| {
            let (points, faces) = cuboid(low, high);
            mesh(&points, &faces)
        });
        let over = (0..3)
            .map(|k| a.1[k].min(b.1[k]) - a.0[k].max(b.0[k]))
            .min();
        let found = relation(&meshes[0], &meshes[1]);
        match over {
            Some(1..) => {
                let contains = |outer: (Point, Point), inner: (Point, Point)| {
                    (0..3).all(|k| outer.0[k] < inner.0[k] && inner.1[k] < outer.1[k])
                };
                let expected = match (contains(b, a), contains(a, b)) {
                    (true, _) => Relation::Inside,
                    (_, true) => Relation::Around,
                    _ => Relation::Interpenetrating,
                };
                n[2] += 1;
                assert_eq!(found, Some(expected), "{a:?} {b:?}");
            }
            Some(0) => {
                n[1] += 1;
                assert_eq!(found, Some(Relation::Touching), "{a:?} {b:?}");
            }
            _ => {
                n[0] += 1;
                assert_eq!(found, None, "{a:?} {b:?}");
            }
        }
    }
    assert!(n.iter().all(|&n| n > 100), "{n:?}");
}

#[test]
fn a_hole_holds_its_pin() {
    // A frame around a square hole, and pins that fit it, that are thinner, and that are thicker.
    let mut points: Vec<Point> = Vec::new();
    for z in [0, 2] {
        for [low, high] in [[0, 12], [4, 8]] {
            points.extend([
                [low, low, z],
                [high, low, z],
                [high, high, z],
                [low, high, z],
            ]);
        }
    }
    let mut faces: Faces = Vec::new();
    let mut quad = |[a, b, c, d]: [u32; 4]| faces.extend([[a, b, c], [a, c, d]]);
    for i in 0..4u32 {
        let j = (i + 1) % 4;
        quad([i, i + 4, j + 4, j]); // below
        quad([i + 8, j + 8, j + 12, i + 12]); // above
        quad([i, j, j + 8, i + 8]); // outside
        quad([i + 4, i + 12, j + 12, j + 4]); // the hole
    }
    let frame = mesh(&points, &faces);
    let pin = |low, high| {
        let (points, faces) = cuboid([low, low, -3], [high, high, 5]);
        mesh(&points, &faces)
    };
    assert_eq!(relation(&frame, &pin(4, 8)), Some(Relation::Touching));
    assert_eq!(relation(&frame, &pin(5, 7)), None);
    assert_eq!(
        relation(&frame, &pin(3, 8)),
        Some(Relation::Interpenetrating)
    );
    assert_eq!(
        relation(&frame, &pin(3, 9)),
        Some(Relation::Interpenetrating)
    );
    let near = ask(vec![frame.clone(), pin(5, 7)], Some(1.0));
    assert_eq!((near[0].relation, near[0].distance), (Relation::Near, 1.0));
    assert!(ask(vec![frame, pin(5, 7)], Some(1f64.next_down())).is_empty());
}

/// Surfaces that are apart, of parts in several pieces: as the intervals of the pieces say.
#[test]
fn pieces_inside_and_pieces_outside_are_partly_inside() {
    let joined = |boxes: &[(i64, i64)]| {
        let (mut points, mut faces): (Vec<Point>, Faces) = (Vec::new(), Vec::new());
        for &(low, high) in boxes {
            let first = points.len() as u32;
            let (own, of_box) = cuboid([low.min(high); 3], [low.max(high); 3]);
            // A cavity is inside out.
            let turned = |[a, b, c]: [u32; 3]| if low < high { [a, b, c] } else { [a, c, b] };
            points.extend(own);
            faces.extend(of_box.iter().map(|&face| turned(face).map(|v| first + v)));
        }
        mesh(&points, &faces)
    };
    let block = joined(&[(0, 9)]);
    for (boxes, [as_first, as_second]) in [
        (&[(1, 2), (3, 4)][..], [Relation::Inside, Relation::Around]),
        (
            &[(1, 2), (11, 12)],
            [Relation::PartlyInside, Relation::PartlyAround],
        ),
        (
            &[(11, 12), (-2, -1), (1, 2)],
            [Relation::PartlyInside, Relation::PartlyAround],
        ),
        (&[(-1, 10), (20, 21)], [Relation::Around, Relation::Inside]),
        // The block is in the matter, and holds a cavity.
        (
            &[(-1, 10), (5, 4)],
            [Relation::PartlyAround, Relation::PartlyInside],
        ),
        // A piece of each is inside the other.
        (&[(1, 2), (20, 29)], [Relation::PartlyInside; 2]),
    ] {
        let part = joined(boxes);
        let other = match boxes {
            [(1, 2), (20, 29)] => joined(&[(0, 9), (21, 22)]),
            _ => block.clone(),
        };
        assert_eq!(relation(&part, &other), Some(as_first), "{boxes:?}");
        assert_eq!(relation(&other, &part), Some(as_second), "{boxes:?}");
        assert!(as_first.shares_space());
    }
    assert_eq!(relation(&joined(&[(10, 11), (12, 13)]), &block), None);
}

/// A part with faces of zero area is the solid that it is without them, although they are
/// neighbours of one another: two boxes at an edge, three of whose four faces are split.
#[test]
fn faces_of_zero_area_at_one_edge_leave_a_part_solid() {
    let (points, faces) = stitched_boxes();
    let (inner, of_inner) = cuboid([1, 1, 1], [2, 2, 2]);
    let parts = vec![mesh(&points, &faces), mesh(&inner, &of_inner)];
    let answer = check_assembly(parts, &AssemblyOptions::default()).unwrap();
    assert!(answer.parts[0].is_solid);
    let said = answer.pairs.iter().map(|pair| pair.relation);
    assert_eq!(said.collect::<Vec<_>>(), [Relation::Around]);
}

#[test]
fn sheets_pass_through_each_other_or_lie_on_each_other() {
    let sheet = |points: [Point; 4]| mesh(&points, &vec![[0, 1, 2], [0, 2, 3]]);
    let floor = sheet([[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]]);
    let through = sheet([[1, 1, -1], [3, 1, -1], [3, 1, 1], [1, 1, 1]]);
    // Along the diagonal, which is an edge of the floor.
    let along = sheet([[0, 0, -1], [4, 4, -1], [4, 4, 1], [0, 0, 1]]);
    let upon = sheet([[1, 1, 0], [3, 1, 0], [3, 1, 1], [1, 1, 1]]);
    let over = sheet([[1, 1, 0], [3, 1, 0], [3, 3, 0], [1, 3, 0]]);
    assert_eq!(relation(&floor, &through), Some(Relation::Interpenetrating));
    assert_eq!(relation(&floor, &along), Some(Relation::Interpenetrating));
    assert_eq!(relation(&floor, &upon), Some(Relation::Touching));
    assert_eq!(relation(&floor, &over), Some(Relation::Touching));
}

#[test]
fn touching_may_be_left_out_and_bad_questions_are_refused() {
    let at = |x| {
        let (points, faces) = cuboid([x, 0, 0], [x + 2, 2, 2]);
        mesh(&points, &faces)
    };
    let options = AssemblyOptions {
        clearance: Some(1.0),
        ignores_touching: true,
        threads: 1,
    };
    let answer = check_assembly(vec![at(0), at(2), at(5)], &options).unwrap();
    assert!(
        answer
            .parts
            .iter()
            .all(|part| part.is_solid && part.n_faces == 12)
    );
    let said: Vec<_> = answer
        .pairs
        .iter()
        .map(|pair| (pair.parts, pair.relation))
        .collect();
    assert_eq!(said, [([1, 2], Relation::Near)]);
    let bad = AssemblyOptions {
        clearance: Some(-1.0),
        ..options
    };
    assert!(matches!(
        check_assembly(vec![at(0)], &bad),
        Err(AssemblyError::Clearance(_))
    ));
    let broken = mesh(&[[0; 3]], &vec![[0, 1, 2]]);
    assert!(matches!(
        check_assembly(vec![at(0), broken], &options),
        Err(AssemblyError::Part(1, _))
    ));
}
