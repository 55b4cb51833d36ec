//! Contacts from pairs: first the names of all corners, then the coordinates of each point, once.
//!
//! In: a scene and the pairs found in it. Out: [`Contacts`]. Cost: a few hundred nanoseconds per
//! pair for signs and coordinates, `O(n log n)` for the names; both in parallel, in chunks whose
//! results are concatenated in order.

use super::coordinates::{Definition, Rounding};
use super::meet::{Local, ends, meet};
use super::parts::ByBodies;
use super::{Contacts, Doubles, Feature, PointName, Shape, lowest};
use crate::answers::pairs::Pairs;
use crate::scene::elements::{Elements, Part};
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::index::VertexIx;
use crate::scene::positions::Positions;
use crate::scene::{Body, Scene};
use crate::search::sink::{self, grow, reserve};
use crate::search::work::{Equal, Work};
use impinge_exact::Point;

/// Pairs per task.
const CHUNK: usize = 256;
/// Chunks whose names are sorted by one task.
const CHUNKS_PER_RUN: usize = 32;
/// Faces whose vertices are sorted by position by one task.
const FACES: usize = 8 * 1024;
/// What memory is for.
const WHAT: &str = "contacts";

/// A list with room for so many.
fn with_capacity<T>(n: usize) -> Result<Vec<T>, Error> {
    sink::with_capacity(n, WHAT)
}

pub(super) fn contacts(scene: &Scene, pairs: &Pairs, work: Work<'_>) -> Result<Contacts, Error> {
    let bodies = ContactBodies::new(scene, pairs, work)?;
    let n = pairs.len();
    let mut rows: Vec<[u32; 4]> = sink::filled([0; 4], n, WHAT)?;
    let n_chunks = n.div_ceil(CHUNK);
    let mut met: Vec<ChunkContacts> = with_capacity(n_chunks)?;
    met.resize_with(n_chunks, ChunkContacts::default);
    let mut chunks: Vec<(&mut [[u32; 4]], &mut ChunkContacts)> = with_capacity(n_chunks)?;
    chunks.extend(rows.chunks_mut(CHUNK).zip(&mut met));
    work.each(&mut chunks, |chunk, (rows, met)| {
        reserve(&mut met.contacts, rows.len(), WHAT)?;
        for (ix, row) in (chunk * CHUNK..).zip(rows.iter_mut()) {
            *row = pairs.row(ix);
            met.add(&bodies, row)?;
        }
        Ok(())
    })?;
    drop(chunks);

    let names = names(&met, work)?;
    let corners = numbers(&met, &names, work)?;
    let points = points(&bodies, &names, work)?;
    let mut contacts = Contacts {
        rows,
        shapes: with_capacity(n)?,
        directed: with_capacity(n)?,
        starts: with_capacity(n + 1)?,
        corners,
        names,
        points,
        stamps: bodies.stamps(),
        gaps: pairs.gaps().clone(),
        doubles: bodies.doubles().into(),
        by_bodies: ByBodies::default(),
    };
    let mut start = 0;
    contacts.starts.push(0);
    for met in &met {
        work.step()?;
        for found in &met.contacts {
            start += found.n_corners;
            contacts.starts.push(start);
            contacts.shapes.push(found.shape);
            contacts.directed.push(found.directed);
        }
    }
    contacts.by_bodies = ByBodies::new(&contacts.rows, work)?;
    Ok(contacts)
}

/// The names of all corners, sorted, each once.
fn names(met: &[ChunkContacts], work: Work<'_>) -> Result<Vec<PointName>, Error> {
    let n_chunks = met.len();
    let mut runs: Vec<Vec<PointName>> = with_capacity(n_chunks.div_ceil(CHUNKS_PER_RUN))?;
    runs.resize_with(n_chunks.div_ceil(CHUNKS_PER_RUN), Vec::new);
    work.each(&mut runs, |ix, run| {
        let first = ix * CHUNKS_PER_RUN;
        let of_run = &met[first..n_chunks.min(first + CHUNKS_PER_RUN)];
        reserve(run, of_run.iter().map(|met| met.names.len()).sum(), WHAT)?;
        run.extend(of_run.iter().flat_map(|met| &met.names));
        run.sort_unstable();
        run.dedup();
        Ok(())
    })?;
    let names = work.merged(runs, Equal::Once, WHAT)?;
    match u32::try_from(names.len()) {
        Ok(_) => Ok(names),
        Err(_) => Err(Error::TooMany {
            what: "points of contact",
            given: names.len() as u64,
            limit: u64::from(u32::MAX),
        }),
    }
}

/// The number of each corner's name.
fn numbers(met: &[ChunkContacts], names: &[PointName], work: Work<'_>) -> Result<Vec<u32>, Error> {
    let number = |name: &PointName| names.partition_point(|held| held < name) as u32;
    let n_corners = met.iter().map(|met| met.names.len()).sum();
    let mut corners: Vec<u32> = sink::filled(0, n_corners, WHAT)?;
    let mut rest = &mut corners[..];
    let mut of_chunks: Vec<(&ChunkContacts, &mut [u32])> = with_capacity(met.len())?;
    for met in met {
        let (of_chunk, others) = rest.split_at_mut(met.names.len());
        of_chunks.push((met, of_chunk));
        rest = others;
    }
    work.each(&mut of_chunks, |_, (met, corners)| {
        for (corner, name) in corners.iter_mut().zip(&met.names) {
            *corner = number(name);
        }
        Ok(())
    })?;
    Ok(corners)
}

/// The point of each name.
fn points(
    bodies: &ContactBodies<'_>,
    names: &[PointName],
    work: Work<'_>,
) -> Result<Vec<[f64; 3]>, Error> {
    let mut points: Vec<[f64; 3]> = sink::filled([0.0; 3], names.len(), WHAT)?;
    let mut of_chunks: Vec<(&[PointName], &mut [[f64; 3]])> =
        with_capacity(names.len().div_ceil(CHUNK))?;
    of_chunks.extend(names.chunks(CHUNK).zip(points.chunks_mut(CHUNK)));
    work.each(&mut of_chunks, |_, (names, points)| {
        for (point, name) in points.iter_mut().zip(*names) {
            let precision = bodies.precision(name.bodies);
            *point = bodies.definition(name).rounded(precision);
        }
        Ok(())
    })?;
    Ok(points)
}

/// The contacts of a chunk of pairs.
#[derive(Default)]
struct ChunkContacts {
    contacts: Vec<FoundContact>,
    names: Vec<PointName>,
}

struct FoundContact {
    shape: Shape,
    n_corners: usize,
    directed: bool,
}

impl ChunkContacts {
    fn add(
        &mut self,
        bodies: &ContactBodies<'_>,
        &[body_a, a, body_b, b]: &[u32; 4],
    ) -> Result<(), Error> {
        let sides = [(body_a, a), (body_b, b)].map(|(body, face)| bodies.triangle(body, face));
        let [Some(a), Some(b)] = sides else {
            self.contacts.push(FoundContact {
                shape: Shape::Solid,
                n_corners: 0,
                directed: false,
            });
            return Ok(());
        };
        let meeting = meet(&a.points, &b.points);
        let corners = meeting.corners();
        grow(&mut self.names, corners.len(), WHAT)?;
        self.names.extend(corners.iter().map(|&[in_a, in_b]| {
            let mut features = [a.feature(in_a), b.feature(in_b)];
            if body_a == body_b {
                features.sort_unstable();
            }
            PointName {
                bodies: [body_a, body_b],
                features,
            }
        }));
        self.contacts.push(FoundContact {
            shape: match corners.len() {
                0 => Shape::Apart,
                1 => Shape::Point,
                2 => Shape::Segment,
                _ => Shape::Polygon,
            },
            n_corners: corners.len(),
            directed: meeting.directed,
        });
        Ok(())
    }
}

/// A triangle and the names of its features.
struct Triangle {
    points: [Point; 3],
    vertices: [VertexIx; 3],
    face: u32,
}

impl Triangle {
    fn feature(&self, local: Local) -> Feature {
        match local {
            Local::Vertex(corner) => Feature::Vertex(self.vertices[corner].raw()),
            Local::Edge(edge) => {
                let mut vertices = ends(edge).map(|corner| self.vertices[corner].raw());
                vertices.sort_unstable();
                Feature::Edge(vertices)
            }
            Local::Face => Feature::Face(self.face),
        }
    }
}

/// The bodies of the pairs, by number.
struct ContactBodies<'a> {
    bodies: Vec<Option<Taking<'a>>>,
}

struct Taking<'a> {
    /// Of the positions for which the pairs were found.
    stamp: (BodyId, u64),
    body: &'a Body,
    /// Of the triangles in contact. Empty for most meshes.
    doubles: Doubles,
}

impl<'a> ContactBodies<'a> {
    fn new(scene: &'a Scene, pairs: &Pairs, work: Work<'_>) -> Result<Self, Error> {
        let mut bodies: Vec<Option<Taking<'a>>> = Vec::new();
        let mut colliding = pairs.all_colliding().into_iter().peekable();
        for (id, [numbers_stamp, positions_stamp]) in pairs.stamped() {
            let body = scene.body(id)?;
            let own = colliding.next_if(|(of, _)| *of == id);
            let own = own.map_or(Vec::new(), |(_, own)| own);
            if !own.is_empty() && body.numbers_stamp(Part::Given) != numbers_stamp {
                return Err(Error::Remeshed { body: id });
            }
            body.check_once(id)?;
            bodies.resize_with(bodies.len().max(id.index() + 1), || None);
            bodies[id.index()] = Some(Taking {
                stamp: (id, positions_stamp),
                body,
                doubles: doubles(body, &own, work)?,
            });
        }
        Ok(ContactBodies { bodies })
    }

    fn stamps(&self) -> Vec<(BodyId, u64)> {
        let taking = self.bodies.iter().flatten();
        taking.map(|taking| taking.stamp).collect()
    }

    /// The doubles of all bodies that have any.
    fn doubles(self) -> Vec<(u32, Doubles)> {
        (0u32..)
            .zip(self.bodies)
            .filter_map(|(number, taking)| Some((number, taking?.doubles)))
            .filter(|(_, doubles)| !doubles.is_empty())
            .collect()
    }

    fn taking(&self, body: u32) -> &Taking<'a> {
        self.bodies[body as usize]
            .as_ref()
            .expect("rows name bodies that take part")
    }

    /// A triangle by its body and number; `None` if the body is not made of triangles.
    fn triangle(&self, body: u32, face: u32) -> Option<Triangle> {
        let taking = self.taking(body);
        let Elements::Triangles(faces) = taking.body.elements() else {
            return None;
        };
        let corners = faces[face as usize];
        Some(Triangle {
            points: corners.map(|vertex| taking.body.positions().point(vertex as usize)),
            vertices: corners.map(|vertex| lowest(&taking.doubles, VertexIx::new(vertex))),
            face,
        })
    }

    fn precision(&self, bodies: [u32; 2]) -> Rounding {
        let is_single = |body: u32| matches!(self.taking(body).body.positions(), Positions::F32(_));
        if bodies.into_iter().all(is_single) {
            Rounding::Single
        } else {
            Rounding::Double
        }
    }

    /// The points that define a corner.
    fn definition(&self, name: &PointName) -> Definition {
        let point = |side: usize, vertex: u32| {
            let body = self.taking(name.bodies[side]).body;
            body.positions().point(vertex as usize)
        };
        let edge = |side: usize, vertices: [u32; 2]| vertices.map(|vertex| point(side, vertex));
        let face = |side: usize, face: u32| {
            let body = self.taking(name.bodies[side]).body;
            let corners = body.elements().corners(face as usize);
            [0, 1, 2].map(|k| point(side, corners[k]))
        };
        match name.features {
            [Feature::Vertex(vertex), _] => Definition::Vertex(point(0, vertex)),
            [_, Feature::Vertex(vertex)] => Definition::Vertex(point(1, vertex)),
            [Feature::Edge(a), Feature::Face(b)] => Definition::OnPlane(edge(0, a), face(1, b)),
            [Feature::Face(a), Feature::Edge(b)] => Definition::OnPlane(edge(1, b), face(0, a)),
            [Feature::Edge(a), Feature::Edge(b)] => Definition::OnLine(edge(0, a), edge(1, b)),
            [Feature::Face(a), Feature::Face(_)] => Definition::Vertex(face(0, a)[0]),
        }
    }
}

/// The vertices of some triangles that are not the lowest one at their position, each with the
/// lowest.
///
/// Meshes that repeat their vertices for each face would fall apart into single triangles
/// otherwise.
fn doubles(body: &Body, colliding: &[u32], work: Work<'_>) -> Result<Doubles, Error> {
    let Elements::Triangles(faces) = body.elements() else {
        return Ok(Vec::new());
    };
    let bits = |vertex: VertexIx| {
        let point = body.positions().point(vertex.index());
        // Turns minus zero into zero.
        point.map(|x| (x + 0.0).to_bits())
    };
    let mut runs: Vec<Vec<([u64; 3], VertexIx)>> = Vec::new();
    runs.resize_with(colliding.len().div_ceil(FACES), Vec::new);
    work.each(&mut runs, |ix, run| {
        let of_run = colliding.chunks(FACES).nth(ix).unwrap_or_default();
        let named = of_run.iter().flat_map(|&face| faces[face as usize]);
        let named = named.map(VertexIx::new);
        run.extend(named.map(|vertex| (bits(vertex), vertex)));
        run.sort_unstable();
        run.dedup();
        Ok(())
    })?;
    let at = work.merged(runs, Equal::Once, WHAT)?;
    let mut doubles: Doubles = at
        .chunk_by(|(x, _), (y, _)| x == y)
        .flat_map(|same| same[1..].iter().map(|&(_, vertex)| (vertex, same[0].1)))
        .collect();
    doubles.sort_unstable();
    Ok(doubles)
}
