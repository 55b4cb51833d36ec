//! Whether two parts share space, from the points where their faces meet.
//!
//! No vertex of either part is strictly inside the other. Then the parts share space if and only if
//! they do so near one of these points (for two sheets: pass through each other there):
//!
//! * a point of an edge of one and the inside of a face of the other: the edge passes through;
//! * a segment of two faces that is along no edge: the faces pass through each other;
//! * a segment along an edge: in the plane across it, faces are rays and solids are sectors. The
//!   sectors overlap, or a ray lies in a sector, or the rays of two sheets alternate;
//! * two faces in one plane, over an area: both normals point the same way;
//! * any point: an edge from there starts into the other solid, which is a half-space, a wedge or
//!   a cone there.
//!
//! Why that is all: let a face have a part inside the other solid. The border of that part in the
//! face is either a segment, so the third case or the second applies there; or it has points only.
//! Then edges of the face start at such points and lie inside, or in the other surface, along a
//! segment. If no face has such a part, the surfaces coincide where space is shared.
//!
//! All signs are exact: coordinates are integers over one power of two.

use std::cmp::Ordering;
use std::collections::HashSet;

use impinge::contact::{Contacts, Feature, Shape};
use impinge::exact::internal::{Integer, unit_of};
use impinge::exact::{Point, Sign};

use crate::by_vertex::ByVertex;
use crate::facets::{facets, groups};
use crate::surface::Surface;
use crate::volume;

/// An exact vector.
type Vector = [Integer; 3];

/// A part, and what is looked up in it.
pub struct Part {
    pub surface: Surface,
    pub low: Point,
    pub high: Point,
    /// The sign of the volume of a solid; zero for a sheet.
    sign: Sign,
    /// The faces of each vertex.
    around: ByVertex,
    /// Of all coordinates.
    unit: i64,
}

impl Part {
    pub fn new(surface: Surface) -> Self {
        let n = surface.n_vertices();
        let sorted = facets(&surface.faces, n);
        // As many faces along each edge as against it.
        let is_closed = groups(&sorted).all(|group| {
            let n_even = group.iter().filter(|facet| facet.is_even).count();
            2 * n_even == group.len()
        });
        let mut part = Part {
            sign: match is_closed {
                true => volume::sign(surface.faces.iter().map(|&face| surface.corners(face))),
                false => Sign::Zero,
            },
            around: ByVertex::of_faces(n, &surface.faces),
            surface,
            low: [f64::INFINITY; 3],
            high: [f64::NEG_INFINITY; 3],
            unit: i64::MAX,
        };
        for &vertex in part.surface.faces.as_flattened() {
            for (k, x) in part.surface.at(vertex).into_iter().enumerate() {
                part.low[k] = part.low[k].min(x);
                part.high[k] = part.high[k].max(x);
                part.unit = part.unit.min(unit_of(x).unwrap_or(i64::MAX));
            }
        }
        part
    }

    /// Whether it has an inside.
    pub fn is_solid(&self) -> bool {
        !self.sign.is_zero()
    }

    /// The positions of the vertices of faces.
    pub fn vertices(&self) -> impl Iterator<Item = Point> + '_ {
        let all = (0u32..).zip(self.around.iter());
        let used = all.filter(|(_, faces)| !faces.is_empty());
        used.map(|(vertex, _)| self.surface.at(vertex))
    }

    /// The faces at an edge.
    fn at_edge(&self, [u, v]: [u32; 2]) -> impl Iterator<Item = u32> + '_ {
        let has = move |face: &u32| self.surface.faces[*face as usize].contains(&v);
        self.around.of(u).iter().copied().filter(has)
    }
}

/// Whether two parts share space, of which no vertex is strictly inside the other. The contacts are
/// those of these two, the first one's faces first.
pub fn interpenetrate(parts: [&Part; 2], contacts: &Contacts) -> bool {
    let local = Local {
        parts,
        unit: parts[0].unit.min(parts[1].unit),
    };
    let passes = |name: &impinge::contact::PointName| {
        matches!(
            name.features,
            [Feature::Edge(_), Feature::Face(_)] | [Feature::Face(_), Feature::Edge(_)]
        )
    };
    contacts.names().iter().any(passes)
        || local.any_area_or_segment(contacts)
        || contacts
            .names()
            .iter()
            .any(|name| local.any_edge_starts_inside(name.features))
}

struct Local<'a> {
    parts: [&'a Part; 2],
    unit: i64,
}

/// A half-plane that begins at an axis: one side of a face.
struct Ray {
    owner: usize,
    direction: Vector,
    /// What the number of surfaces around grows by, turning counter-clockwise across the face.
    turn: i32,
}

impl Local<'_> {
    fn at(&self, side: usize, vertex: u32) -> Vector {
        let at = self.parts[side].surface.at(vertex);
        at.map(|x| Integer::of_multiple(x, self.unit))
    }

    fn corners(&self, side: usize, face: u32) -> [Vector; 3] {
        self.parts[side].surface.faces[face as usize].map(|vertex| self.at(side, vertex))
    }

    /// The normal of a face; of a part that is inside out, the opposite one.
    fn normal(&self, side: usize, face: u32) -> Vector {
        let [a, b, c] = self.corners(side, face);
        let normal = cross(&minus(&b, &a), &minus(&c, &a));
        match self.parts[side].sign {
            Sign::Negative => normal.map(|x| -&x),
            _ => normal,
        }
    }

    fn any_area_or_segment(&self, contacts: &Contacts) -> bool {
        let solids = self.parts.map(Part::is_solid);
        let mut seen = HashSet::new();
        for (ix, &[_, a, _, b]) in contacts.rows().iter().enumerate() {
            match contacts.shape(ix) {
                Shape::Polygon if solids == [true, true] => {
                    let along = dot(&self.normal(0, a), &self.normal(1, b));
                    if along.sign() == Sign::Positive {
                        return true;
                    }
                }
                Shape::Segment => {
                    let &[from, to] = contacts.corners(ix) else {
                        continue;
                    };
                    let names = [from, to].map(|corner| contacts.names()[corner as usize].features);
                    let edges = [(0, a), (1, b)].map(|(side, face)| {
                        self.edge_along(side, face, names.map(|name| name[side]))
                    });
                    let Some((side, axis)) = (0..2).find_map(|side| Some((side, edges[side]?)))
                    else {
                        return true;
                    };
                    let faces = [0, 1].map(|of| match edges[of] {
                        Some(edge) => Feature::Edge(edge),
                        None => Feature::Face([a, b][of]),
                    });
                    if seen.insert(faces) && self.overlap_around(side, axis, faces) {
                        return true;
                    }
                }
                _ => {}
            }
        }
        false
    }

    /// The edge of a face along which two of its points lie.
    fn edge_along(&self, side: usize, face: u32, points: [Feature; 2]) -> Option<[u32; 2]> {
        let [u, v, w] = self.parts[side].surface.faces[face as usize];
        [[u, v], [v, w], [w, u]]
            .map(|[a, b]| [a.min(b), a.max(b)])
            .into_iter()
            .find(|edge| {
                points.iter().all(|point| match point {
                    Feature::Vertex(vertex) => edge.contains(vertex),
                    Feature::Edge(held) => held == edge,
                    Feature::Face(_) => false,
                })
            })
    }

    /// Whether the parts share space around an edge of one of them. `features`: the edge or face of
    /// each part along which the axis lies.
    fn overlap_around(&self, side: usize, axis: [u32; 2], features: [Feature; 2]) -> bool {
        let [start, end] = axis.map(|vertex| self.at(side, vertex));
        let axis = minus(&end, &start);
        let mut rays = Vec::new();
        for (owner, feature) in features.into_iter().enumerate() {
            self.add_rays(owner, (owner, feature), &start, &axis, &mut rays);
        }
        overlap(&axis, rays, self.parts.map(Part::is_solid))
    }

    /// Adds the rays of a part around an axis through `start`, which is along an edge of the part
    /// or within a face.
    fn add_rays(
        &self,
        owner: usize,
        (side, feature): (usize, Feature),
        start: &Vector,
        axis: &Vector,
        rays: &mut Vec<Ray>,
    ) {
        let mut add = |direction: Vector, normal: &Vector| {
            let turn = match dot(&cross(axis, &direction), normal).sign() {
                Sign::Positive => -1,
                _ => 1,
            };
            rays.push(Ray {
                owner,
                direction,
                turn,
            });
        };
        match feature {
            Feature::Edge(edge) => {
                for face in self.parts[side].at_edge(edge) {
                    let corners = self.parts[side].surface.faces[face as usize];
                    let third = corners.into_iter().find(|vertex| !edge.contains(vertex));
                    if let Some(third) = third {
                        let direction = minus(&self.at(side, third), start);
                        add(direction, &self.normal(side, face));
                    }
                }
            }
            Feature::Face(face) => {
                let normal = self.normal(side, face);
                let aside = |at: Vector| {
                    let direction = minus(&at, start);
                    (!is_zero(&cross(axis, &direction))).then_some(direction)
                };
                if let Some(direction) = self.corners(side, face).into_iter().find_map(aside) {
                    let opposite = [0, 1, 2].map(|k| -&direction[k]);
                    add(direction, &normal);
                    add(opposite, &normal);
                }
            }
            Feature::Vertex(_) => {}
        }
    }

    /// Whether an edge of one part starts from a point of contact into the other one.
    fn any_edge_starts_inside(&self, features: [Feature; 2]) -> bool {
        [0, 1].into_iter().any(|side| {
            let other = 1 - side;
            self.parts[other].is_solid()
                && self
                    .starts(side, features[side])
                    .iter()
                    .any(|direction| self.goes_inside(other, features[other], direction))
        })
    }

    /// The directions of edges from a point of a part.
    fn starts(&self, side: usize, feature: Feature) -> Vec<Vector> {
        match feature {
            Feature::Vertex(vertex) => {
                let around = self.parts[side].around.of(vertex).iter();
                let corners =
                    around.flat_map(|&face| self.parts[side].surface.faces[face as usize]);
                let mut ends: Vec<u32> = corners.filter(|&end| end != vertex).collect();
                ends.sort_unstable();
                ends.dedup();
                let from = self.at(side, vertex);
                let to = |&end: &u32| minus(&self.at(side, end), &from);
                ends.iter().map(to).collect()
            }
            Feature::Edge([u, v]) => {
                let [u, v] = [u, v].map(|vertex| self.at(side, vertex));
                vec![minus(&v, &u), minus(&u, &v)]
            }
            Feature::Face(_) => Vec::new(),
        }
    }

    /// Whether a direction from a point of a solid leads strictly into it.
    fn goes_inside(&self, side: usize, feature: Feature, direction: &Vector) -> bool {
        match feature {
            Feature::Face(face) => {
                dot(&self.normal(side, face), direction).sign() == Sign::Negative
            }
            Feature::Edge(edge) => {
                let [start, end] = edge.map(|vertex| self.at(side, vertex));
                let axis = minus(&end, &start);
                if is_zero(&cross(&axis, direction)) {
                    return false;
                }
                let mut rays = Vec::new();
                self.add_rays(0, (side, feature), &start, &axis, &mut rays);
                rays.push(Ray {
                    owner: 1,
                    direction: direction.clone(),
                    turn: 0,
                });
                overlap(&axis, rays, [true, false])
            }
            Feature::Vertex(vertex) => self.cone_has(side, vertex, direction),
        }
    }

    /// Whether a direction is strictly inside the cone of a solid at a vertex: inside or outside is
    /// known just beside a face, and changes with each face that an arc from there crosses.
    fn cone_has(&self, side: usize, vertex: u32, direction: &Vector) -> bool {
        let part = self.parts[side];
        let tip = self.at(side, vertex);
        let sectors: Vec<[Vector; 3]> = part
            .around
            .of(vertex)
            .iter()
            .filter_map(|&face| {
                let corners = part.surface.faces[face as usize];
                let ix = corners.iter().position(|&held| held == vertex)?;
                let to = |step: usize| minus(&self.at(side, corners[(ix + step) % 3]), &tip);
                Some([to(1), to(2), self.normal(side, face)])
            })
            .collect();
        let is_on = |[b, c, normal]: &[Vector; 3]| {
            let plane = cross(b, c);
            dot(normal, direction).sign().is_zero()
                && dot(&cross(b, direction), &plane).sign() != Sign::Negative
                && dot(&cross(direction, c), &plane).sign() != Sign::Negative
        };
        if sectors.iter().any(is_on) {
            return false;
        }
        for (ix, [b, c, normal]) in sectors.iter().enumerate() {
            let from = dot(normal, direction).sign();
            if from.is_zero() {
                continue;
            }
            // An arc to some direction within the face that meets no ray of another face.
            for weight in 1..2 * sectors.len() as u64 + 4 {
                let weight = Integer::from(weight);
                let middle = [0, 1, 2].map(|k| &(&b[k] * &weight) + &c[k]);
                let others = sectors.iter().enumerate().filter(|(other, _)| *other != ix);
                let crossed: Option<Vec<bool>> = others
                    .map(|(_, [b, c, _])| crosses(direction, &middle, b, c))
                    .collect();
                if let Some(crossed) = crossed {
                    let n = crossed.into_iter().filter(|it| *it).count();
                    return (from == Sign::Negative) != (n % 2 == 1);
                }
            }
        }
        // Only if all faces lie in planes through one line, on which the direction is: then it lies
        // on the surface.
        false
    }
}

/// Whether two solids, a solid and a sheet, or two sheets share space around an axis, from the rays
/// of both.
fn overlap(axis: &Vector, mut rays: Vec<Ray>, solids: [bool; 2]) -> bool {
    let Some(reference) = rays.first().map(|ray| ray.direction.clone()) else {
        return false;
    };
    let turned = |a: &Vector, b: &Vector| dot(&cross(axis, a), b).sign();
    // Where a ray lies in the turn that begins at the reference: with it (0), in the first half
    // (1), opposite (2), in the second half (3).
    let half = |direction: &Vector| match turned(&reference, direction) {
        Sign::Positive => 1,
        Sign::Negative => 3,
        Sign::Zero => {
            let along = dot(&cross(axis, &reference), &cross(axis, direction));
            if along.sign() == Sign::Negative { 2 } else { 0 }
        }
    };
    let order = |a: &Ray, b: &Ray| {
        let halves = [a, b].map(|ray| half(&ray.direction));
        halves[0].cmp(&halves[1]).then_with(|| match halves[0] {
            1 | 3 => match turned(&a.direction, &b.direction) {
                Sign::Positive => Ordering::Less,
                Sign::Zero => Ordering::Equal,
                Sign::Negative => Ordering::Greater,
            },
            _ => Ordering::Equal,
        })
    };
    rays.sort_by(order);
    // Surfaces around, after each direction that has rays, and who has rays there.
    let mut sums = [0, 0];
    let turns: Vec<([i32; 2], [bool; 2])> = rays
        .chunk_by(|a, b| order(a, b) == Ordering::Equal)
        .map(|same| {
            let mut has = [false; 2];
            for ray in same {
                sums[ray.owner] += ray.turn;
                has[ray.owner] = true;
            }
            (sums, has)
        })
        .collect();
    let least = [0, 1].map(|owner| turns.iter().map(|(sums, _)| sums[owner]).min().unwrap_or(0));
    let is_in = |owner: usize, sums: &[i32; 2]| sums[owner] > least[owner];
    match solids {
        [true, true] => turns
            .iter()
            .any(|(sums, _)| is_in(0, sums) && is_in(1, sums)),
        [false, false] => {
            // Rays of one alone.
            let alone = turns.iter().filter(|(_, has)| has[0] != has[1]);
            let mut owners: Vec<bool> = alone.map(|(_, has)| has[0]).collect();
            owners.dedup();
            if owners.len() > 1 && owners.first() == owners.last() {
                owners.pop();
            }
            owners.len() >= 4
        }
        _ => {
            let solid = usize::from(solids[1]);
            let sheet = 1 - solid;
            turns
                .iter()
                .any(|(sums, has)| has[sheet] && !has[solid] && is_in(solid, sums))
        }
    }
}

/// Whether the sector from b to c crosses the arc from d to m; `None` if the arc passes through an
/// end of the sector, or ends on it.
fn crosses(d: &Vector, m: &Vector, b: &Vector, c: &Vector) -> Option<bool> {
    let plane = cross(d, m);
    if is_zero(&plane) {
        return None;
    }
    // How a direction of the plane lies to both ends of the arc.
    let ends = |x: &Vector| {
        [
            dot(&cross(d, x), &plane).sign(),
            dot(&cross(x, m), &plane).sign(),
        ]
    };
    let (over_b, over_c) = (dot(&plane, b), dot(&plane, c));
    match [over_b.sign(), over_c.sign()] {
        [Sign::Zero, Sign::Zero] => None,
        // The sector has one end in the plane, and nothing else.
        [Sign::Zero, _] => ends(b).contains(&Sign::Negative).then_some(false),
        [_, Sign::Zero] => ends(c).contains(&Sign::Negative).then_some(false),
        [of_b, of_c] if of_b == of_c => Some(false),
        [of_b, _] => {
            let (by_b, by_c) = match of_b {
                Sign::Positive => (-&over_c, over_b),
                _ => (over_c, -&over_b),
            };
            let x = [0, 1, 2].map(|k| &(&b[k] * &by_b) + &(&c[k] * &by_c));
            match ends(&x) {
                [Sign::Positive, Sign::Positive] => Some(true),
                found if found.contains(&Sign::Negative) => Some(false),
                _ => None,
            }
        }
    }
}

fn minus(a: &Vector, b: &Vector) -> Vector {
    [0, 1, 2].map(|k| &a[k] - &b[k])
}

fn cross(a: &Vector, b: &Vector) -> Vector {
    [(1, 2), (2, 0), (0, 1)].map(|(u, v)| &(&a[u] * &b[v]) - &(&a[v] * &b[u]))
}

fn dot(a: &Vector, b: &Vector) -> Integer {
    &(&(&a[0] * &b[0]) + &(&a[1] * &b[1])) + &(&a[2] * &b[2])
}

fn is_zero(a: &Vector) -> bool {
    a.iter().all(Integer::is_zero)
}
