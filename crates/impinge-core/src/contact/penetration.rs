//! Which parts of two closed bodies lie inside the other, region by region: normals, depths,
//! volumes.
//!
//! 1. Vertices inside: exact winding numbers (see `inside`).
//! 2. Each edge that crosses the other surface is cut at its crossings. The signs of the crossed
//!    faces say which pieces are inside. The two ends of a piece inside belong to one region,
//!    whether they are crossings, vertices inside or vertices on the other surface. Where an edge
//!    meets the other surface in its edges or vertices, or has both ends on it, the pieces are not
//!    known: all its points and ends count as one region.
//! 3. The border of the overlap consists of the parts of faces that lie inside. Each part is a
//!    polygon whose sides are segments of contact and pieces of edges. So the volume is a sum over
//!    these sides, and no polygon is ever assembled (divergence theorem, then Stokes' theorem on
//!    each face).
//!
//! All decisions are exact except one: crossings along an edge are ordered by their rounded
//! coordinates. Crossings that round to one place may be swapped; the piece between them is then no
//! longer than the rounding error.

use super::crossings::{Crossings, EdgeVertices};
use super::curves::Curves;
use super::inside::{Asked, ConnectedParts};
use super::orientation::orientations;
use super::regions::{NO_REGION, Region, WHAT, join_contacts, regions};
use super::topology::EdgesAround;
use super::{Contacts, Feature, PointName, Shape};
use crate::boxes::scale::Scale;
use crate::scene::by_body::ByBody;
use crate::scene::elements::{BodyKind, Elements};
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::index::VertexIx;
use crate::scene::vector::{cross, dot, sub};
use crate::scene::{Body, Scene};
use crate::search::sets::Sets;
use crate::search::sink::grow;
use crate::search::work::Work;
use impinge_exact::{Point, Sign, orient3d};

/// The topologies of closed bodies, from call to call.
#[derive(Debug, Default)]
pub(crate) struct Topologies {
    /// By the number of the body; the first of the pair is the stamp of the topology.
    edges: ByBody<(u64, EdgesAround)>,
}

/// How deep two closed bodies are in each other:
/// [`Detector::penetration`](crate::Detector::penetration).
#[derive(Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct Penetration {
    /// Vertices of the first body strictly inside the second, and of the second strictly inside the
    /// first: sorted. The body with the lower number comes first.
    pub inside: [Vec<u32>; 2],
    /// Connected regions: first those with contacts, in the order of the contacts, then shells
    /// wholly inside the other body.
    pub regions: Vec<Region>,
}

impl std::fmt::Debug for Penetration {
    /// The numbers of vertices and regions, however many there are.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut short = f.debug_struct("Penetration");
        short.field("n_inside", &self.inside.each_ref().map(Vec::len));
        short.field("n_regions", &self.regions.len());
        short.field("first", &self.regions.first());
        short.finish_non_exhaustive()
    }
}

impl Penetration {
    /// The volume of all regions together; `None` if the volume of any region is unknown. Infinite
    /// if larger than all `f64`, unknown if infinite regions cancel. Of a body that crosses itself,
    /// volume, area, normal, depth and regions mean nothing.
    pub fn volume(&self) -> Option<f64> {
        let volumes = self.regions.iter().map(|region| region.volume);
        let sum = volumes.sum::<Option<f64>>().filter(|sum| !sum.is_nan());
        // The sum of nothing is -0.
        sum.map(|volume| volume + 0.0)
    }
}

impl Topologies {
    /// The overlap of two closed bodies, from contacts among which are all of these two.
    pub fn penetration(
        &mut self,
        scene: &Scene,
        contacts: &Contacts,
        [a, b]: [BodyId; 2],
        work: Work<'_>,
    ) -> Result<Penetration, Error> {
        if a == b {
            return Err(Error::SameBody { body: a });
        }
        self.edges.forget_removed(scene);
        let ids = [a.min(b), a.max(b)];
        for id in ids {
            self.know(scene, id, work)?;
        }
        let known = |id: BodyId| self.edges.get(id).expect("known now");
        let bodies = [scene.body(ids[0])?, scene.body(ids[1])?];
        let topologies = ids.map(|id| &known(id).1);
        let numbers = ids.map(|id| id.index() as u32);
        let (contacts, contact_numbers) = &contacts.part(numbers)?;
        let crossings = [
            Crossings::new(contacts, numbers, 0)?,
            Crossings::new(contacts, numbers, 1)?,
        ];
        let parts = |side: usize| {
            let crossings = &crossings[side];
            let asked = Asked {
                body: bodies[side],
                topology: topologies[side],
                is_on: &|vertex| crossings.is_on(vertex),
                is_crossed: &|edge| crossings.is_crossed(edge),
            };
            ConnectedParts::new(&asked, bodies[1 - side], work)
        };
        let parts = [parts(0)?, parts(1)?];
        let orientations = |side: usize| orientations(bodies[side], topologies[side], work);
        let overlap = OverlapWork {
            contacts,
            bodies,
            topologies,
            orientations: [orientations(0)?, orientations(1)?],
            crossings,
            parts,
        };
        let mut found = overlap.overlap(work)?;
        for contact in found
            .regions
            .iter_mut()
            .flat_map(|region| &mut region.contacts)
        {
            *contact = contact_numbers[*contact as usize];
        }
        Ok(found)
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        let edges = self.edges.values().map(|(_, edges)| edges.bytes());
        edges.sum::<usize>() as u64
    }

    /// Caches the topology of a body.
    ///
    /// # Errors
    /// A body not made of triangles, a surface that is not closed, cancellation.
    pub fn know(&mut self, scene: &Scene, id: BodyId, work: Work<'_>) -> Result<(), Error> {
        let body = scene.body(id)?;
        let stamp = body.topology_stamp();
        let known = self.edges.get(id);
        if known.is_some_and(|(known, _)| *known == stamp) {
            return Ok(());
        }
        let Elements::Triangles(faces) = body.elements() else {
            return Err(Error::WrongKind {
                body: id,
                kind: body.kind().name(),
                expected: BodyKind::Triangles.name(),
            });
        };
        let edges = EdgesAround::new(id, faces, body.n_vertices(), work)?;
        *self.edges.entry(id) = Some((stamp, edges));
        Ok(())
    }
}

/// A piece of an edge that is inside the other body, from the end nearer to the lower vertex, and a
/// member of its region's set.
struct Piece {
    edge: EdgeVertices,
    from: Point,
    to: Point,
    node: u32,
}

struct OverlapWork<'a> {
    contacts: &'a Contacts,
    bodies: [&'a Body; 2],
    topologies: [&'a EdgesAround; 2],
    /// See [`orientations`].
    orientations: [Vec<f64>; 2],
    crossings: [Crossings<'a>; 2],
    parts: [ConnectedParts; 2],
}

impl OverlapWork<'_> {
    fn overlap(&self, work: Work<'_>) -> Result<Penetration, Error> {
        let n_points = self.contacts.points().len();
        let n_parts = self.parts.each_ref().map(ConnectedParts::n_parts);
        let mut sets = Sets::new(n_points + n_parts[0] + n_parts[1], WHAT)?;
        join_contacts(self.contacts, &mut sets);
        let pieces = [self.pieces(0, &mut sets)?, self.pieces(1, &mut sets)?];
        self.join_at_vertices(0, &mut sets);
        self.join_at_vertices(1, &mut sets);
        work.step()?;
        let curves = Curves::new(self.contacts)?;
        work.step()?;
        let orientations = |contact| self.orientations_of(contact);
        let (mut regions, mut region_of) =
            regions(self.contacts, &curves, &mut sets, orientations)?;
        let numbers = [0, 1].map(|side| self.crossings[side].body);
        let mut inside = [Vec::new(), Vec::new()];
        for (side, inside) in inside.iter_mut().enumerate() {
            for vertex in VertexIx::up_to(self.bodies[side].n_vertices()) {
                let Some(node) = self.node(side, vertex) else {
                    continue;
                };
                inside.push(vertex.raw());
                let at = self.position(side, vertex);
                let region = &mut region_of[sets.find(node) as usize];
                if *region == NO_REGION {
                    // A shell of one body that has no contact with the other.
                    if self.orientation_at(side, vertex) == 0.0 {
                        continue;
                    }
                    *region = regions.len() as u32;
                    regions.push(Region::at(numbers, at));
                }
                let region = &mut regions[*region as usize];
                region.inside[side].push(vertex.raw());
                region.cover(at);
            }
        }
        work.step()?;
        let mut region = |node: u32| region_of[sets.find(node) as usize] as usize;
        let volumes = self.volumes(&regions, &pieces, &mut region);
        let is_asked = |region: &Region| region.bodies == numbers;
        for (region, volume) in regions.iter_mut().zip(volumes).filter(|(r, _)| is_asked(r)) {
            region.volume = self.is_generic(region).then_some(volume);
            region.depth = region.normal.map(|normal| self.extent(region, normal));
            if region.contacts.is_empty() {
                let scale = region.scale();
                region.position = scale.point_back(region.origin(scale));
            }
        }
        regions.retain(is_asked);
        Ok(Penetration { inside, regions })
    }

    /// Of the faces at a vertex: see [`orientations`].
    fn orientation_at(&self, side: usize, vertex: VertexIx) -> f64 {
        self.orientations[side][self.topologies[side].piece(vertex)]
    }

    fn orientation(&self, side: usize, face: u32) -> f64 {
        let corner = self.bodies[side].elements().corners(face as usize)[0];
        self.orientation_at(side, VertexIx::new(corner))
    }

    /// The same of the faces of a contact.
    fn orientations_of(&self, contact: u32) -> [f64; 2] {
        let [_, a, _, b] = self.contacts.rows()[contact as usize];
        [self.orientation(0, a), self.orientation(1, b)]
    }

    /// The number, among the members of the sets, of a vertex that is inside.
    fn node(&self, side: usize, vertex: VertexIx) -> Option<u32> {
        let n_before = match side {
            0 => 0,
            _ => self.parts[0].n_parts(),
        };
        let part = self.parts[side].inside(vertex)?;
        Some((self.contacts.points().len() + n_before) as u32 + part)
    }

    /// The same of a vertex that is inside or on the other surface.
    fn member(&self, side: usize, vertex: VertexIx) -> Option<u32> {
        let on = || self.crossings[side].point_on(vertex);
        self.node(side, vertex).or_else(on)
    }

    fn position(&self, side: usize, vertex: VertexIx) -> Point {
        self.bodies[side].positions().point(vertex.index())
    }

    /// The pieces of crossed edges that are inside, sorted by edge. Joins the sets of each piece's
    /// two ends.
    fn pieces(&self, side: usize, sets: &mut Sets) -> Result<Vec<Piece>, Error> {
        let mut pieces = Vec::new();
        for crossed in self.crossings[side].on_edges.chunk_by(|x, y| x.0 == y.0) {
            let edge = crossed[0].0;
            let mut points: Vec<u32> = crossed.iter().map(|&(_, point)| point).collect();
            self.sort_along(side, edge, &mut points);
            match self.cut(side, edge, &points) {
                Some(cut) => {
                    for (piece, ends) in cut {
                        sets.join(ends[0], ends[1]);
                        grow(&mut pieces, 1, WHAT)?;
                        pieces.push(piece);
                    }
                }
                None => {
                    let ends = edge.map(|vertex| self.member(side, vertex));
                    let nodes: Vec<u32> = points
                        .into_iter()
                        .chain(ends.into_iter().flatten())
                        .collect();
                    for pair in nodes.windows(2) {
                        sets.join(pair[0], pair[1]);
                    }
                }
            }
        }
        Ok(pieces)
    }

    /// Joins each point at a vertex on the other surface with other points there, and with the far
    /// ends of edges that lead inside and are not crossed.
    fn join_at_vertices(&self, side: usize, sets: &mut Sets) {
        let crossings = &self.crossings[side];
        if crossings.on_vertices.is_empty() {
            return;
        }
        for at_one in crossings.on_vertices.chunk_by(|x, y| x.0 == y.0) {
            for pair in at_one.windows(2) {
                sets.join(pair[0].1, pair[1].1);
            }
        }
        for (contact, row) in self.contacts.rows().iter().enumerate() {
            let face = self.bodies[side]
                .elements()
                .corners(row[1 + 2 * side] as usize);
            let face = || face.iter().map(|&corner| VertexIx::new(corner));
            for from in face() {
                let Some(point) = crossings.point_on(from) else {
                    continue;
                };
                if !self.contacts.corners(contact).contains(&point) {
                    continue;
                }
                for to in face().filter(|&to| !crossings.is_crossed([from, to])) {
                    let end = self.node(side, to).or_else(|| {
                        let end = crossings.point_on(to)?;
                        let leads_in = self.may_lead_inside(side, point, to)
                            && self.may_lead_inside(side, end, from);
                        leads_in.then_some(end)
                    });
                    if let Some(end) = end {
                        sets.join(point, end);
                    }
                }
            }
        }
    }

    /// Whether an edge from the point of a vertex towards another vertex may begin inside. It is
    /// known where the point lies within a face.
    fn may_lead_inside(&self, side: usize, point: u32, towards: VertexIx) -> bool {
        let Feature::Face(face) = self.contacts.names()[point as usize].features[1 - side] else {
            return true;
        };
        let turned = self.orientation(1 - side, face);
        let below = -self.step(side, towards, face);
        turned == 0.0 && below != 0 || f64::from(below) * turned > 0.0
    }

    /// Puts points in their order along an edge.
    fn sort_along(&self, side: usize, edge: EdgeVertices, points: &mut [u32]) {
        let [from, to] = edge.map(|vertex| self.position(side, vertex));
        let along = sub(to, from);
        let axis = (1..3).fold(0, |best, k| {
            if along[k].abs() > along[best].abs() {
                k
            } else {
                best
            }
        });
        let height =
            |point: u32| self.contacts.points()[point as usize][axis] * along[axis].signum();
        points.sort_by(|&p, &q| height(p).total_cmp(&height(q)).then(p.cmp(&q)));
    }

    /// The pieces of one edge that are inside, each with the two set members that it joins; `None`
    /// if the edge does not just cross faces.
    fn cut(
        &self,
        side: usize,
        edge: EdgeVertices,
        points: &[u32],
    ) -> Option<Vec<(Piece, [u32; 2])>> {
        let [low, high] = edge;
        let step = |point: u32| match self.contacts.names()[point as usize].features[1 - side] {
            Feature::Face(face) => Some(self.step(side, low, face)),
            _ => None,
        };
        // Next to each end; unknown next to one that is on the other surface.
        let [first, end] = edge.map(|vertex| {
            let is_on = self.crossings[side].is_on(vertex);
            (!is_on).then(|| self.parts[side].winding(vertex))
        });
        let mut winding = match (first, end) {
            (Some(first), _) => first,
            (None, Some(end)) => {
                let steps = points.iter().map(|&point| step(point));
                end - steps.sum::<Option<i32>>()?
            }
            (None, None) => return None,
        };
        let mut pieces = Vec::new();
        let mut last = (self.member(side, low), self.position(side, low));
        let ends = points.iter().map(|&point| Some(point)).chain([None]);
        for end in ends {
            let next = match end {
                Some(point) => (Some(point), self.contacts.points()[point as usize]),
                None => (self.member(side, high), self.position(side, high)),
            };
            if winding != 0 {
                let (from, to) = (last.0?, next.0?);
                let piece = Piece {
                    edge,
                    from: last.1,
                    to: next.1,
                    node: from,
                };
                pieces.push((piece, [from, to]));
            }
            if let Some(point) = end {
                winding += step(point)?;
            }
            last = next;
        }
        end.is_none_or(|end| end == winding).then_some(pieces)
    }

    /// By how much the winding number grows where an edge, coming from vertex `from`, crosses a
    /// face of the other body.
    fn step(&self, side: usize, from: VertexIx, face: u32) -> i32 {
        let corners = self.bodies[1 - side].elements().corners(face as usize);
        let [a, b, c] = [0, 1, 2].map(|k| self.position(1 - side, VertexIx::new(corners[k])));
        match orient3d(&a, &b, &c, &self.position(side, from)) {
            // The vertex is beneath the face: the edge leaves through it.
            Sign::Positive => -1,
            Sign::Zero => 0,
            Sign::Negative => 1,
        }
    }

    /// Whether all contacts of a region are segments between points where an edge crosses a face.
    fn is_generic(&self, region: &Region) -> bool {
        region.contacts.iter().all(|&contact| {
            let contact = contact as usize;
            let is_crossing = |point: &u32| {
                let PointName { features, .. } = self.contacts.names()[*point as usize];
                matches!(
                    features,
                    [Feature::Edge(_), Feature::Face(_)] | [Feature::Face(_), Feature::Edge(_)]
                )
            };
            self.contacts.shape(contact) == Shape::Segment
                && self.contacts.is_directed(contact)
                && self.contacts.corners(contact).iter().all(is_crossing)
        })
    }

    /// How far a region extends along a direction.
    fn extent(&self, region: &Region, normal: Point) -> f64 {
        let corners = region.contacts.iter().flat_map(|&contact| {
            let corners = self.contacts.corners(contact as usize).iter();
            corners.map(|&point| self.contacts.points()[point as usize])
        });
        let inside = (0..2).flat_map(|side| {
            let vertices = region.inside[side].iter();
            vertices.map(move |&vertex| self.position(side, VertexIx::new(vertex)))
        });
        let scale = region.scale();
        let heights = corners
            .chain(inside)
            .map(|point| dot(scale.point(point), normal));
        let (low, high) = heights
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), height| {
                (low.min(height), high.max(height))
            });
        scale.length_back((high - low).max(0.0))
    }

    /// The volume of each region: see [`VolumeSums`].
    fn volumes(
        &self,
        regions: &[Region],
        pieces: &[Vec<Piece>; 2],
        region: &mut dyn FnMut(u32) -> usize,
    ) -> Vec<f64> {
        let mut sums = VolumeSums::new(regions);
        for (number, held) in regions.iter().enumerate() {
            if held.bodies == [0, 1].map(|side| self.crossings[side].body) {
                for &contact in &held.contacts {
                    self.add_contact(contact, number, &mut sums);
                }
            }
        }
        for (side, pieces) in pieces.iter().enumerate() {
            self.add_edges(side, pieces, region, &mut sums);
        }
        sums.volumes()
    }

    /// Adds the segment of a contact as a side of the parts of both faces.
    fn add_contact(&self, contact: u32, region: usize, sums: &mut VolumeSums) {
        let &[from, to] = self.contacts.corners(contact as usize) else {
            return;
        };
        let [from, to] = [from, to].map(|point| self.contacts.points()[point as usize]);
        let [_, a, _, b] = self.contacts.rows()[contact as usize];
        let on = |side: usize, face: u32| {
            let corners = self.bodies[side].elements().corners(face as usize);
            self.position(side, VertexIx::new(corners[0]))
        };
        // The part inside lies to the left as seen from outside a, to the right as seen from
        // outside b. Where faces of one are turned inwards, so is the segment.
        let [of_a, of_b] = self.orientations_of(contact);
        sums.add_side(region, on(0, a), [from, to], of_a * of_b);
        sums.add_side(region, on(1, b), [to, from], of_a * of_b);
    }

    /// Adds the edges and pieces of edges inside as sides of the parts of faces.
    fn add_edges(
        &self,
        side: usize,
        pieces: &[Piece],
        region: &mut dyn FnMut(u32) -> usize,
        sums: &mut VolumeSums,
    ) {
        let Elements::Triangles(faces) = self.bodies[side].elements() else {
            return;
        };
        let crossings = &self.crossings[side];
        for face in faces.iter().map(|face| face.map(VertexIx::new)) {
            let is_touched = |vertex: &VertexIx| {
                self.parts[side].inside(*vertex).is_some() || crossings.is_touched(*vertex)
            };
            if !face.iter().any(is_touched) {
                continue;
            }
            let on = self.position(side, face[0]);
            let weight = self.orientation_at(side, face[0]);
            if weight == 0.0 {
                continue;
            }
            for k in 0..3 {
                let (from, to) = (face[k], face[(k + 1) % 3]);
                if !crossings.is_crossed([from, to]) {
                    if let (Some(node), Some(_)) = (self.node(side, from), self.node(side, to)) {
                        let (p, q) = (self.position(side, from), self.position(side, to));
                        sums.add_side(region(node), on, [p, q], weight);
                    }
                    continue;
                }
                let name = crossings.name([from, to]);
                let is_forward = crossings.lowest(from) == name[0];
                let first = pieces.partition_point(|piece| piece.edge < name);
                for piece in pieces[first..]
                    .iter()
                    .take_while(|piece| piece.edge == name)
                {
                    let (p, q) = if is_forward {
                        (piece.from, piece.to)
                    } else {
                        (piece.to, piece.from)
                    };
                    sums.add_side(region(piece.node), on, [p, q], weight);
                }
            }
        }
    }
}

/// The volume of each region: a sixth of the sum of `(x - o) · ((p - o) × (q - o))` over the sides
/// pq of the parts of faces that lie inside, where x is any point of the face and o is one point
/// for all. Coordinates are scaled, with one power of two per region.
struct VolumeSums {
    origins: Vec<(Scale, Point)>,
    sums: Vec<f64>,
}

impl VolumeSums {
    fn new(regions: &[Region]) -> Self {
        let origin = |region: &Region| {
            let scale = region.scale();
            (scale, region.origin(scale))
        };
        VolumeSums {
            origins: regions.iter().map(origin).collect(),
            sums: vec![0.0; regions.len()],
        }
    }

    /// Adds a side of a part of a face, of which one point is given.
    fn add_side(&mut self, region: usize, on: Point, [from, to]: [Point; 2], weight: f64) {
        let (scale, origin) = self.origins[region];
        let [x, p, q] = [on, from, to].map(|point| sub(scale.point(point), origin));
        self.sums[region] += weight * dot(x, cross(p, q)) / 6.0;
    }

    fn volumes(self) -> Vec<f64> {
        let scaled = self.sums.into_iter().zip(self.origins);
        let volumes = scaled.map(|(volume, (scale, _))| scale.volume_back(volume));
        volumes.collect()
    }
}
