//! Walls thinner than a length.
//!
//! In: a mesh of triangles whose indices are in range, and a length. Out: marks of the faces on
//! either side of a thin wall, their number, and the thickness of the thinnest wall.
//!
//! A wall is a pair of a vertex and a face, or of two edges, of closed pieces of one orientation.
//! Their distance is at most the length, which [`Detector::near`] decides exactly. Two faces of
//! theirs turn their backs to each other: their normals are within 45° of opposite, and within 45°
//! of the segment between the nearest points, so that the sharp edge of a wedge is none. Matter is
//! between them: the segment, moved a little towards the middle of the first face and without a
//! hundredth at either end, meets no face and starts inside. It is moved because nearest points are
//! often at the rim, where the segment lies in the surface. Both faces belong to one shell, or one
//! of them to a cavity: where two solids overlap is no wall.

use impinge::exact::internal::closest_of_elements;
use impinge::exact::internal::filter::{cross, difference, dot};
use impinge::{BodyId, Detector, Error, Hit, NearPair, PairKind, Query, Scene, Settings};
use impinge_io::Positions;

use crate::by_vertex::ByVertex;
use crate::marks::{Marks, Problem};
use crate::row::Counts;
use crate::shells::shells;
use crate::surface::{Surface, held};

/// The cosine of 45°.
const ALONG: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// The part of a segment that is left out at either end: its ends are rounded and lie on faces.
const END: f64 = 0.01;
/// How far a segment is moved, as a part of its length: less than its ends are shortened, so that
/// between faces at 45° it does not leave the wall.
const ASIDE: f64 = 0.005;

/// A vector.
type Vector = [f64; 3];

/// The faces of closed pieces.
struct Faces {
    corners: Vec<[u32; 3]>,
    /// Unit normals; zero for a face without area.
    normals: Vec<Vector>,
    /// The shell of each face, and whether its signed volume is positive.
    shells: Vec<(u32, bool)>,
    /// The face's number in the mesh.
    numbers: Vec<u32>,
    /// The faces of each vertex.
    around: ByVertex,
}

/// Counts and marks the faces at walls that are at most `most` thick.
///
/// # Errors
/// A length that is negative or not finite; no memory.
pub fn find(
    positions: &Positions,
    triangles: &[[u32; 3]],
    most: f64,
    settings: &Settings,
    counts: &mut Counts,
    marks: &mut [Marks],
) -> Result<(), Error> {
    let surface = Surface::new(positions.clone(), triangles.to_vec());
    let faces = Faces::new(&surface);
    if faces.corners.is_empty() {
        // Without a closed piece nothing has an inside.
        return Ok(());
    }
    let mut scene = Scene::new();
    let elements: impinge::Elements = faces.corners.clone().into();
    let body = scene.add((elements, held(positions)))?;
    let mut detector = Detector::new(settings.clone())?;
    let query = Query::self_of(body).kinds([PairKind::VertexFace, PairKind::EdgeEdge]);
    let near = detector.near(&scene, most, &query)?;
    let edges = scene.body(body)?.edges().clone();
    let mut walls = Vec::new();
    for pair in near.iter() {
        add_walls(&faces, &surface, &edges, &pair, &mut walls);
    }
    let is_matter = are_matter(&mut detector, &scene, body, &walls)?;
    let mut is_thin = vec![false; triangles.len()];
    let mut thinnest = f64::INFINITY;
    for wall in walls.iter().zip(is_matter).filter(|it| it.1).map(|it| it.0) {
        thinnest = thinnest.min(wall.thickness);
        for &face in &wall.faces {
            is_thin[faces.numbers[face as usize] as usize] = true;
        }
    }
    let mut n = 0;
    for (marks, _) in marks
        .iter_mut()
        .zip(is_thin)
        .filter(|(_, is_thin)| *is_thin)
    {
        marks.add(Problem::Thin);
        n += 1;
    }
    counts.thin_faces = Some(n);
    counts.thinnest = (n > 0).then_some(thinnest);
    Ok(())
}

/// A pair that may be a wall.
struct Wall {
    thickness: f64,
    /// The segment without its ends: where it starts, and how it goes on.
    start: Vector,
    along: Vector,
    faces: [u32; 2],
}

/// Adds the faces of a pair that turn their backs to each other.
fn add_walls(
    faces: &Faces,
    surface: &Surface,
    edges: &impinge::Elements,
    pair: &NearPair,
    walls: &mut Vec<Wall>,
) {
    let (a, b) = (pair.a.element, pair.b.element);
    // The vertices of both elements.
    let (held, n) = match (pair.kind, edges) {
        (PairKind::VertexFace, _) => {
            let [x, y, z] = faces.corners[b as usize];
            ([a, x, y, z], 1)
        }
        (PairKind::EdgeEdge, impinge::Elements::Edges(edges)) => {
            let [[u, v], [x, y]] = [a, b].map(|edge| edges[edge as usize]);
            ([u, v, x, y], 2)
        }
        _ => return,
    };
    let sides = [&held[..n], &held[n..]].map(|vertices| faces.of(vertices).collect::<Vec<_>>());
    let backs = |&(a, b): &(u32, u32)| faces.are_opposite(a, b);
    let both = sides[0]
        .iter()
        .flat_map(|&a| sides[1].iter().map(move |&b| (a, b)));
    let both: Vec<(u32, u32)> = both.filter(backs).collect();
    if both.is_empty() {
        return;
    }
    let held = held.map(|vertex| surface.at(vertex));
    let (_, thickness, [p, q]) = closest_of_elements(&held[..n], &held[n..]);
    let way = difference(&q, &p);
    let Some(direction) = unit(way) else {
        return;
    };
    let length = dot(&way, &way).sqrt();
    let along = |face: u32| dot(&faces.normals[face as usize], &direction).abs() >= ALONG;
    for (a, b) in both {
        if along(a) && along(b) {
            let corners = surface.corners(faces.corners[a as usize]);
            let middle = [0, 1, 2].map(|k| corners.iter().map(|at| at[k] / 3.0).sum::<f64>());
            let inward = difference(&middle, &p);
            let far = dot(&inward, &inward).sqrt();
            let part = if far > 0.0 {
                (ASIDE * length / far).min(0.5)
            } else {
                0.0
            };
            walls.push(Wall {
                thickness,
                start: [0, 1, 2].map(|k| p[k] + part * inward[k] + END * way[k]),
                along: way.map(|x| (1.0 - 2.0 * END) * x),
                faces: [a, b],
            });
        }
    }
}

/// Whether the segment of each wall lies inside.
fn are_matter(
    detector: &mut Detector,
    scene: &Scene,
    body: BodyId,
    walls: &[Wall],
) -> Result<Vec<bool>, Error> {
    let starts: Vec<Vector> = walls.iter().map(|wall| wall.start).collect();
    let along: Vec<Vector> = walls.iter().map(|wall| wall.along).collect();
    let places = detector.contains(scene, body, &starts)?;
    let mut inside: Vec<bool> = places.into_iter().map(|place| place == 1).collect();
    let query = Query::of(body).hits(Hit::Any);
    let hits = detector.cast(scene, &starts, &along, 1.0, &query)?;
    for (inside, is_hit) in inside.iter_mut().zip(hits.is_hit()) {
        *inside &= !is_hit;
    }
    Ok(inside)
}

impl Faces {
    fn new(surface: &Surface) -> Self {
        let (mut all, mut normals) = (Vec::new(), Vec::new());
        let (mut of_shells, mut numbers) = (Vec::new(), Vec::new());
        for (shell, held) in (0u32..).zip(shells(surface)) {
            // A shell of zero volume has no inside.
            if held.sign.is_zero() {
                continue;
            }
            for &number in &held.faces {
                let corners = surface.faces[number as usize];
                let [a, b, c] = surface.corners(corners);
                all.push(corners);
                normals.push(normal(difference(&b, &a), difference(&c, &a)));
                let is_outward = held.sign == impinge::exact::Sign::Positive;
                of_shells.push((shell, is_outward));
                numbers.push(number);
            }
        }
        Faces {
            around: ByVertex::of_faces(surface.n_vertices(), &all),
            corners: all,
            normals,
            shells: of_shells,
            numbers,
        }
    }

    /// The faces that have all these vertices.
    fn of<'a>(&'a self, vertices: &'a [u32]) -> impl Iterator<Item = u32> + 'a {
        let around = self.around.of(vertices[0]).iter();
        around.copied().filter(|&face| {
            let corners = &self.corners[face as usize];
            vertices[1..].iter().all(|vertex| corners.contains(vertex))
        })
    }

    /// Whether two faces have normals within 45° of opposite, and belong to one shell or to an
    /// outer one and a cavity.
    fn are_opposite(&self, a: u32, b: u32) -> bool {
        let [of_a, of_b] = [a, b].map(|face| self.shells[face as usize]);
        let [normal_a, normal_b] = [a, b].map(|face| self.normals[face as usize]);
        (of_a.0 == of_b.0 || of_a.1 != of_b.1) && dot(&normal_a, &normal_b) <= -ALONG
    }
}

/// The unit vector of a direction; `None` for zero, and for one without any.
fn unit(v: Vector) -> Option<Vector> {
    // Scaled first, so that squares neither overflow nor vanish.
    let largest = v.iter().fold(0.0f64, |most, x| most.max(x.abs()));
    if !(largest > 0.0 && largest.is_finite()) {
        return None;
    }
    let v = v.map(|x| x / largest);
    let length = dot(&v, &v).sqrt();
    Some(v.map(|x| x / length))
}

fn normal(u: Vector, v: Vector) -> Vector {
    let (Some(u), Some(v)) = (unit(u), unit(v)) else {
        return [0.0; 3];
    };
    unit(cross(&u, &v)).unwrap_or([0.0; 3])
}
