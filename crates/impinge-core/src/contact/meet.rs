//! Where two triangles meet: exact combinatorics, no coordinates.
//!
//! Two closed triangles are convex, so their intersection is empty, a point, a segment or a convex
//! polygon: the hull of its corners. A corner lies in the relative interior of exactly one feature
//! (vertex, edge, face) of each triangle, and the two features have only that point in common. So a
//! corner *is* a pair of features, and finding the intersection means finding these pairs:
//!
//! ```text
//! vertex of one, anything of the other     the vertex lies on it
//! edge, face                               the edge crosses the plane inside the triangle
//! edge, edge                               they cross, and are not on one line
//! ```
//!
//! All of these are decided by signs of `orient2d` and `orient3d`, which are exact. Degenerate
//! triangles are segments or points with fewer features, and need no other rules.
//!
//! Cost: 6 to 18 signs for triangles in general position.

use impinge_exact::internal::{Projection, collinear, strictly_between};
use impinge_exact::{Point, Sign, orient3d};

/// A feature of a triangle. Edge `k` leads from corner `k` to corner `k + 1`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Local {
    Vertex(usize),
    Edge(usize),
    Face,
}

/// A point of both triangles, named by the feature of each triangle in whose relative interior it
/// lies.
pub(super) type Corner = [Local; 2];

/// The intersection of two triangles.
#[derive(Debug, Clone, Copy)]
pub(super) struct TriangleMeeting {
    corners: [Corner; MOST_CORNERS],
    n_corners: usize,
    /// Whether a segment leads in the direction of the product of the two normals.
    pub directed: bool,
}

/// Two coplanar triangles meet in a hexagon at most.
const MOST_CORNERS: usize = 6;

impl TriangleMeeting {
    const EMPTY: Self = TriangleMeeting {
        corners: [[Local::Face; 2]; MOST_CORNERS],
        n_corners: 0,
        directed: false,
    };

    /// The corners: none, a point, a segment's ends, or a polygon in order, counter-clockwise as
    /// seen from the side from which the first triangle is.
    pub fn corners(&self) -> &[Corner] {
        &self.corners[..self.n_corners]
    }

    fn push(&mut self, corner: Corner) {
        if !self.corners().contains(&corner) {
            self.corners[self.n_corners] = corner;
            self.n_corners += 1;
        }
    }
}

/// A triangle as the convex set that it is: point, segment or triangle.
struct ConvexTriangle<'a> {
    points: &'a [Point; 3],
    shape: Degeneracy,
}

#[derive(Clone, Copy)]
enum Degeneracy {
    Point,
    /// The outermost corners, the edge between them, and a corner strictly between them.
    Segment {
        ends: [usize; 2],
        edge: usize,
        middle: Option<usize>,
    },
    /// A projection that is one-to-one on the plane, and how the triangle turns there.
    Triangle {
        projection: Projection,
        turn: Sign,
    },
}

/// The corner numbers of edge `k`.
pub(super) fn ends(edge: usize) -> [usize; 2] {
    [edge, (edge + 1) % 3]
}

impl<'a> ConvexTriangle<'a> {
    fn new(points: &'a [Point; 3]) -> Self {
        let [a, b, c] = points;
        let shape = match Projection::injective(a, b, c) {
            Some(projection) => Degeneracy::Triangle {
                projection,
                turn: projection.turn(a, b, c),
            },
            None => Self::degenerate(points),
        };
        ConvexTriangle { points, shape }
    }

    fn degenerate(points: &[Point; 3]) -> Degeneracy {
        let mut outermost = None;
        for edge in 0..3 {
            let [i, j] = ends(edge);
            let other = 3 - i - j;
            if points[i] == points[j] {
                continue;
            }
            let is_between = strictly_between(&points[other], &points[i], &points[j]);
            let at_an_end = points[other] == points[i] || points[other] == points[j];
            if is_between || (at_an_end && outermost.is_none()) {
                outermost = Some(Degeneracy::Segment {
                    // Of several corners at one place, the lowest stands for all.
                    ends: [i, j].map(|k| first_at(points, k)),
                    edge,
                    middle: is_between.then_some(other),
                });
            }
        }
        outermost.unwrap_or(Degeneracy::Point)
    }

    /// The corners of the hull.
    fn vertices(&self) -> ([usize; 3], usize) {
        match self.shape {
            Degeneracy::Point => ([0; 3], 1),
            Degeneracy::Segment { ends: [i, j], .. } => ([i, j, 0], 2),
            Degeneracy::Triangle { .. } => ([0, 1, 2], 3),
        }
    }

    /// The edges of the hull.
    fn edges(&self) -> std::ops::Range<usize> {
        match self.shape {
            Degeneracy::Point => 0..0,
            Degeneracy::Segment { edge, .. } => edge..edge + 1,
            Degeneracy::Triangle { .. } => 0..3,
        }
    }

    fn edge(&self, edge: usize) -> [&'a Point; 2] {
        ends(edge).map(|corner| &self.points[corner])
    }

    fn is_triangle(&self) -> bool {
        matches!(self.shape, Degeneracy::Triangle { .. })
    }

    /// On which side of the plane a point lies: positive where the triangle turns
    /// counter-clockwise.
    fn height(&self, point: &Point) -> Sign {
        let [a, b, c] = self.points;
        -orient3d(a, b, c, point)
    }

    /// The feature in whose relative interior a point of known height lies; `None` outside.
    fn locate(&self, point: &Point, height: Sign) -> Option<Local> {
        match self.shape {
            Degeneracy::Point => (*point == self.points[0]).then_some(Local::Vertex(0)),
            Degeneracy::Segment { ends, edge, middle } => {
                let at = |&corner: &usize| *point == self.points[corner];
                if let Some(corner) = ends.into_iter().chain(middle).find(at) {
                    return Some(Local::Vertex(corner));
                }
                let [p, q] = ends.map(|corner| &self.points[corner]);
                (collinear(p, q, point) && strictly_between(point, p, q))
                    .then_some(Local::Edge(edge))
            }
            Degeneracy::Triangle { projection, turn } => {
                if !height.is_zero() {
                    return None;
                }
                let sides = [0, 1, 2].map(|edge| {
                    let [p, q] = self.edge(edge);
                    projection.turn(p, q, point)
                });
                feature_by_sides(sides, turn)
            }
        }
    }
}

/// The first of the corners at the place of corner `k`.
fn first_at(points: &[Point; 3], k: usize) -> usize {
    (0..k)
        .find(|&other| points[other] == points[k])
        .unwrap_or(k)
}

/// The feature of a triangle that contains a point in the triangle's plane. `sides`: on which side
/// of each edge the point lies; `inside`: the inner side. `None` outside.
fn feature_by_sides(sides: [Sign; 3], inside: Sign) -> Option<Local> {
    if sides.iter().any(|side| side.strictly_opposite(inside)) {
        return None;
    }
    match sides.map(Sign::is_zero) {
        [false, false, false] => Some(Local::Face),
        [true, false, false] => Some(Local::Edge(0)),
        [false, true, false] => Some(Local::Edge(1)),
        [false, false, true] => Some(Local::Edge(2)),
        [true, false, true] => Some(Local::Vertex(0)),
        [true, true, false] => Some(Local::Vertex(1)),
        [false, true, true] => Some(Local::Vertex(2)),
        // No point lies on all three lines, unless the triangle is degenerate.
        [true, true, true] => None,
    }
}

/// The intersection of two closed triangles.
pub(super) fn meet(a: &[Point; 3], b: &[Point; 3]) -> TriangleMeeting {
    let hulls = [ConvexTriangle::new(a), ConvexTriangle::new(b)];
    let heights = [
        heights(&hulls[1], hulls[0].points),
        heights(&hulls[0], hulls[1].points),
    ];
    let mut meeting = TriangleMeeting::EMPTY;
    for side in 0..2 {
        let one = One {
            hull: &hulls[side],
            other: &hulls[1 - side],
            heights: heights[side],
            side,
        };
        if one.is_clear() {
            return TriangleMeeting::EMPTY;
        }
        one.find(&mut meeting);
    }
    name_middles(&hulls, heights, &mut meeting);
    match meeting.n_corners {
        2 => direct(&hulls, heights, &mut meeting),
        3.. => order(&hulls, &mut meeting),
        _ => {}
    }
    meeting
}

/// The heights of the points over the plane of a hull; zero if the hull has no plane.
fn heights(hull: &ConvexTriangle<'_>, points: &[Point; 3]) -> [Sign; 3] {
    if hull.is_triangle() {
        points.each_ref().map(|point| hull.height(point))
    } else {
        [Sign::Zero; 3]
    }
}

/// One of the two triangles, and the other one.
struct One<'a> {
    hull: &'a ConvexTriangle<'a>,
    other: &'a ConvexTriangle<'a>,
    /// The heights of its corners over the plane of the other.
    heights: [Sign; 3],
    side: usize,
}

impl One<'_> {
    /// Whether it lies strictly on one side of the other's plane.
    fn is_clear(&self) -> bool {
        let [a, b, c] = self.heights;
        a.strictly_same(b) && b.strictly_same(c)
    }

    fn corner(&self, here: Local, there: Local) -> Corner {
        match self.side {
            0 => [here, there],
            _ => [there, here],
        }
    }

    /// Finds the corners at its vertices and along its edges.
    fn find(&self, meeting: &mut TriangleMeeting) {
        let (vertices, n) = self.hull.vertices();
        for &vertex in &vertices[..n] {
            let there = self
                .other
                .locate(&self.hull.points[vertex], self.heights[vertex]);
            if let Some(there) = there {
                meeting.push(self.corner(Local::Vertex(vertex), there));
            }
        }
        for edge in self.hull.edges() {
            let [i, j] = ends(edge);
            let (p, q) = (self.heights[i], self.heights[j]);
            if p.strictly_opposite(q) {
                if let Some(there) = self.crossed(edge) {
                    meeting.push(self.corner(Local::Edge(edge), there));
                }
            } else if p.is_zero() && q.is_zero() {
                for other_edge in self.other.edges() {
                    if edges_cross(self.hull.edge(edge), self.other.edge(other_edge)) {
                        meeting.push(self.corner(Local::Edge(edge), Local::Edge(other_edge)));
                    }
                }
            }
        }
    }

    /// The feature of the other triangle that an edge crosses. The ends of the edge are strictly on
    /// different sides of that triangle's plane.
    fn crossed(&self, edge: usize) -> Option<Local> {
        let [p, q] = self.hull.edge(edge);
        let sides = [0, 1, 2].map(|edge| {
            let [r, s] = self.other.edge(edge);
            orient3d(p, q, r, s)
        });
        let inside = sides.into_iter().find(|side| !side.is_zero())?;
        feature_by_sides(sides, inside)
    }
}

/// Whether two segments cross in a point that is strictly inside of both, and lie on different
/// lines.
fn edges_cross([p, q]: [&Point; 2], [r, s]: [&Point; 2]) -> bool {
    if !orient3d(p, q, r, s).is_zero() {
        return false;
    }
    let Some(projection) = Projection::injective(p, q, r) else {
        // r lies on the line through p and q. So rs meets that line only in r, or lies on it.
        return false;
    };
    let turn = |x: &Point, y: &Point, z: &Point| projection.turn(x, y, z);
    turn(p, q, r).strictly_opposite(turn(p, q, s)) && turn(r, s, p).strictly_opposite(turn(r, s, q))
}

/// Names a corner at the middle corner of a flat triangle by that vertex, not by the edge: the
/// triangle's neighbours name it by the vertex too.
fn name_middles(
    hulls: &[ConvexTriangle<'_>; 2],
    heights: [[Sign; 3]; 2],
    meeting: &mut TriangleMeeting,
) {
    for side in 0..2 {
        let Degeneracy::Segment {
            middle: Some(middle),
            ..
        } = hulls[side].shape
        else {
            continue;
        };
        let there = hulls[1 - side].locate(&hulls[side].points[middle], heights[side][middle]);
        let found = std::mem::replace(meeting, TriangleMeeting::EMPTY);
        for &corner in found.corners() {
            let mut corner = corner;
            // The edge and the other feature have only this corner in common, and the middle is in
            // both.
            if matches!(corner[side], Local::Edge(_)) && there == Some(corner[1 - side]) {
                corner[side] = Local::Vertex(middle);
            }
            meeting.push(corner);
        }
    }
}

/// Turns a segment in the direction of the product of the normals, if both triangles have one.
///
/// The line of both planes enters triangle a where a's boundary goes up through b's plane, and
/// leaves a where the boundary goes down; for b it is the other way round. (With d = n_a × n_b and
/// an edge e of a, n_a × e leads into a, and d · (n_a × e) = |n_a|² (n_b · e).)
fn direct(hulls: &[ConvexTriangle<'_>; 2], heights: [[Sign; 3]; 2], meeting: &mut TriangleMeeting) {
    if !hulls.iter().all(ConvexTriangle::is_triangle) {
        return;
    }
    let rise = |side: usize, local: Local| -> i8 {
        let height = |corner: usize| heights[side][corner % 3] as i8;
        match local {
            Local::Edge(k) => height(k + 1) - height(k),
            Local::Vertex(k) => height(k + 1) - height(k + 2),
            Local::Face => 0,
        }
    };
    for ix in 0..2 {
        let [a, b] = meeting.corners[ix];
        let (up, down) = (rise(0, a), rise(1, b));
        let forward = if up != 0 { up } else { -down };
        if forward != 0 {
            let is_start = forward > 0;
            if is_start != (ix == 0) {
                meeting.corners.swap(0, 1);
            }
            meeting.directed = true;
            return;
        }
    }
}

/// Puts the corners of a polygon in order: counter-clockwise as seen from above the first triangle.
///
/// Every side of the polygon lies on an edge of one of the triangles. The line of an edge holds two
/// corners if a side lies on it, and fewer otherwise. So two corners are neighbours if and only if
/// some edge has both.
fn order(hulls: &[ConvexTriangle<'_>; 2], meeting: &mut TriangleMeeting) {
    let found = *meeting;
    let n = found.n_corners;
    let are_neighbours = |i: usize, j: usize| {
        (0..2).any(|side| {
            (0..3).any(|edge| [i, j].iter().all(|&k| is_on(found.corners[k][side], edge)))
        })
    };
    // Start with two neighbours in the right direction, then step to the other neighbour each time.
    let Some((mut last, mut here)) = first_side(hulls, &found) else {
        return;
    };
    meeting.corners[0] = found.corners[last];
    for place in 1..n {
        meeting.corners[place] = found.corners[here];
        let next = (0..n).find(|&k| k != last && k != here && are_neighbours(here, k));
        (last, here) = (here, next.unwrap_or(here));
    }
}

/// Whether a feature lies on the closed edge.
fn is_on(feature: Local, edge: usize) -> bool {
    match feature {
        Local::Vertex(k) => ends(edge).contains(&k),
        Local::Edge(k) => k == edge,
        Local::Face => false,
    }
}

/// Two neighbouring corners in counter-clockwise order.
fn first_side(hulls: &[ConvexTriangle<'_>; 2], found: &TriangleMeeting) -> Option<(usize, usize)> {
    let Degeneracy::Triangle { projection, turn } = hulls[0].shape else {
        return None;
    };
    let Degeneracy::Triangle { .. } = hulls[1].shape else {
        return None;
    };
    let [p, q, r] = hulls[1].points;
    let agree = projection.turn(p, q, r) == turn;
    for side in 0..2 {
        for edge in 0..3 {
            let on: Vec<usize> = (0..found.n_corners)
                .filter(|&k| is_on(found.corners[k][side], edge))
                .collect();
            if let [i, j] = on[..] {
                // In the direction of the edge, or against it if its triangle turns the other way
                // than the first.
                let forward = comes_first(hulls, side, edge, found.corners[i], found.corners[j]);
                return Some(if forward == (side == 0 || agree) {
                    (i, j)
                } else {
                    (j, i)
                });
            }
        }
    }
    None
}

/// Whether `x` comes before `y`, two different corners on an edge.
fn comes_first(
    hulls: &[ConvexTriangle<'_>; 2],
    side: usize,
    edge: usize,
    x: Corner,
    y: Corner,
) -> bool {
    let [start, end] = ends(edge);
    for (corner, is_first) in [(x, true), (y, false)] {
        match corner[side] {
            Local::Vertex(k) if k == start => return is_first,
            Local::Vertex(k) if k == end => return !is_first,
            _ => {}
        }
    }
    // Both lie strictly inside the edge, so each is at a vertex of the other triangle or crosses
    // one of its edges. The corner where the edge enters that triangle is the first.
    let (here, there) = (&hulls[side], &hulls[1 - side]);
    let Degeneracy::Triangle { projection, turn } = there.shape else {
        return true;
    };
    for (corner, is_first) in [(x, true), (y, false)] {
        if let Local::Edge(crossed) = corner[1 - side] {
            let [r, s] = there.edge(crossed);
            let enters = projection
                .turn(r, s, &here.points[start])
                .strictly_opposite(turn);
            return enters == is_first;
        }
    }
    match (x[1 - side], y[1 - side]) {
        (Local::Vertex(i), Local::Vertex(j)) => {
            let [from, to] = here.edge(edge);
            let (i, j) = (&there.points[i], &there.points[j]);
            (0..3)
                .find(|&axis| from[axis] != to[axis])
                .is_some_and(|axis| (i[axis] < j[axis]) == (from[axis] < to[axis]))
        }
        _ => true,
    }
}
