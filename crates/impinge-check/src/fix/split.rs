//! Splits edges of more than two faces, and vertices of several fans.
//!
//! Corners of faces are joined across edges; the corners at a vertex that hang together are a fan,
//! and each fan after the first gets a vertex of its own at the same position. At an edge of more
//! than two faces, only faces that are paired are joined: going around the edge, one after whose
//! front matter begins with the one where it ends. So two boxes that share an edge become two
//! boxes. The order around the edge is decided by signs of `orient3d`. Faces without a partner get
//! a border there.
//!
//! Faces that cannot bound matter, or need not, are set aside first ([`Pieces`]), so that a fin takes
//! no partner from the solid on which it hangs. They are paired among themselves.

use std::cmp::Ordering;
use std::collections::HashMap;

use impinge::exact::{Point, Sign, orient2d, orient3d};

use super::{Repairs, Surface};
use crate::analysis::is_flat_triangle;
use crate::facets::{Facet, facets, groups, is_simplex};
use crate::union_find::UnionFind;

/// Rounds after which all edges that are still shared by more than two faces are cut.
const MOST_ROUNDS: u32 = 8;

/// How the faces at an edge of more than two faces are paired.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Pairing {
    /// Faces with matter between them.
    AroundMatter,
    /// Faces with nothing between them: where the other pairing leaves the edge as it is, because
    /// the surface comes back to it.
    AroundHollow,
    /// None: each face has a border there.
    Cut,
}

/// Splits edges, vertices, or both. Returns the vertices of which the added ones are copies.
pub fn split(
    surface: &mut Surface,
    (edges, vertices): (bool, bool),
    repairs: &mut Repairs,
) -> Vec<u32> {
    if !edges && !vertices {
        return Vec::new();
    }
    let sorted = facets(&surface.faces, surface.n_vertices());
    let crowded: Vec<&[Facet]> = groups(&sorted).filter(|group| group.len() > 2).collect();
    let mut on_crowded = vec![false; surface.n_vertices()];
    for vertex in crowded.iter().flat_map(|group| group[0].vertices) {
        on_crowded[vertex as usize] = true;
    }
    let pieces = Pieces::new(surface.faces.len(), &sorted, &crowded);
    let mut pairings = vec![Pairing::AroundMatter; crowded.len()];
    let mut round = 0;
    let mut corners = loop {
        let mut corners = UnionFind::new(3 * surface.faces.len() as u32);
        for group in groups(&sorted).filter(|group| group.len() == 2) {
            join(surface, &mut corners, &group[0], &group[1]);
        }
        for (group, &pairing) in crowded.iter().zip(&pairings) {
            if edges {
                for [a, b] in pairs(surface, &pieces, group, pairing) {
                    join(surface, &mut corners, &group[a], &group[b]);
                }
            } else {
                for other in &group[1..] {
                    join(surface, &mut corners, &group[0], other);
                }
            }
        }
        if !edges {
            break corners;
        }
        round += 1;
        let mut again = false;
        for (group, pairing) in crowded.iter().zip(&mut pairings) {
            if *pairing != Pairing::Cut && is_crowded(surface, group, &mut corners) {
                *pairing = match *pairing {
                    Pairing::AroundMatter if round < MOST_ROUNDS => Pairing::AroundHollow,
                    _ => Pairing::Cut,
                };
                again = true;
            }
        }
        if !again {
            break corners;
        }
        if round >= MOST_ROUNDS {
            pairings.fill(Pairing::Cut);
        }
    };
    if edges {
        repairs.split_edges = crowded.len() as u64;
    }
    drop(crowded);
    drop(sorted);
    copy_vertices(
        surface,
        &mut corners,
        (edges, vertices),
        &on_crowded,
        repairs,
    )
}

/// Gives each fan after the first at a vertex a copy of it. Returns the vertices of the copies.
fn copy_vertices(
    surface: &mut Surface,
    corners: &mut UnionFind,
    (edges, vertices): (bool, bool),
    on_crowded: &[bool],
    repairs: &mut Repairs,
) -> Vec<u32> {
    let mut origins = Vec::new();
    let n_vertices = surface.n_vertices();
    let mut first_fans = vec![u32::MAX; n_vertices];
    let mut was_split = vec![false; n_vertices];
    // The vertices of further fans, by the root of their corners.
    let mut copies: HashMap<u32, u32> = HashMap::new();
    for face in 0..surface.faces.len() {
        if !is_simplex(&surface.faces[face]) {
            continue;
        }
        for corner in 0..3 {
            let vertex = surface.faces[face][corner];
            let is_on_crowded = on_crowded[vertex as usize];
            if !(if is_on_crowded { edges } else { vertices }) {
                continue;
            }
            let fan = corners.root(3 * face as u32 + corner as u32);
            let first = &mut first_fans[vertex as usize];
            if *first == u32::MAX {
                *first = fan;
            }
            if *first == fan {
                continue;
            }
            let copy = *copies.entry(fan).or_insert_with(|| {
                if is_on_crowded {
                    repairs.split_edges_added += 1;
                } else {
                    repairs.split_vertices_added += 1;
                    repairs.split_vertices += u64::from(!was_split[vertex as usize]);
                    was_split[vertex as usize] = true;
                }
                origins.push(vertex);
                surface.copy_vertex(vertex)
            });
            surface.faces[face][corner] = copy;
        }
    }
    origins
}

/// The pieces that edges of two faces hold together, and which of them are set aside.
///
/// A piece is loose if it has a border, or is left alone at an edge when other loose pieces are gone:
/// it bounds no matter, whatever the orientations. No closed surface loses a face by this, because
/// at each of its edges are two of its faces or more.
///
/// A piece is a wall if, at each edge where it meets others, more faces pass the edge in its
/// direction than in the other one: some face stays alone there, and the others are paired better
/// without the wall. Of pieces that could be the wall, the one of the fewest faces is.
struct Pieces {
    /// The piece of each face, named by one of its faces.
    of_face: Vec<u32>,
    /// By piece; faces of one rank are paired.
    ranks: Vec<Rank>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Rank {
    Bounds,
    Wall,
    Loose,
    LooseWall,
}

impl Pieces {
    fn new(n_faces: usize, sorted: &[Facet], crowded: &[&[Facet]]) -> Self {
        if crowded.is_empty() {
            return Pieces {
                of_face: Vec::new(),
                ranks: Vec::new(),
            };
        }
        let mut joined = UnionFind::new(n_faces as u32);
        let mut on_border = Vec::new();
        for group in groups(sorted) {
            match group {
                [only] => on_border.push(only.element),
                [a, b] => joined.join(a.element, b.element),
                _ => {}
            }
        }
        let of_face: Vec<u32> = (0..n_faces as u32).map(|face| joined.root(face)).collect();
        let mut meetings: Vec<Meeting> = Vec::new();
        for (edge, group) in crowded.iter().enumerate() {
            meetings.extend(group.iter().map(|facet| Meeting {
                piece: of_face[facet.element as usize],
                edge,
                n_faces: 1,
                excess: if facet.is_even { 1 } else { -1 },
            }));
        }
        meetings.sort_unstable_by_key(|it| (it.piece, it.edge));
        meetings.dedup_by(|next, held| {
            let is_same = (next.piece, next.edge) == (held.piece, held.edge);
            if is_same {
                held.n_faces += next.n_faces;
                held.excess += next.excess;
            }
            is_same
        });
        let mut pieces = Pieces {
            of_face,
            ranks: vec![Rank::Bounds; n_faces],
        };
        pieces.set_loose(&on_border, crowded, &meetings);
        for (rank, wall) in [(Rank::Bounds, Rank::Wall), (Rank::Loose, Rank::LooseWall)] {
            pieces.set_walls((rank, wall), crowded.len(), &meetings);
        }
        pieces
    }

    fn rank(&self, facet: &Facet) -> Rank {
        self.ranks[self.of_face[facet.element as usize] as usize]
    }

    fn set_loose(&mut self, on_border: &[u32], crowded: &[&[Facet]], meetings: &[Meeting]) {
        let mut n_left: Vec<usize> = crowded.iter().map(|group| group.len()).collect();
        let mut next: Vec<u32> = on_border
            .iter()
            .map(|&face| self.of_face[face as usize])
            .collect();
        while let Some(piece) = next.pop() {
            let rank = &mut self.ranks[piece as usize];
            if std::mem::replace(rank, Rank::Loose) == Rank::Loose {
                continue;
            }
            let first = meetings.partition_point(|it| it.piece < piece);
            for meeting in meetings[first..].iter().take_while(|it| it.piece == piece) {
                let edge = meeting.edge;
                n_left[edge] -= meeting.n_faces;
                if n_left[edge] == 1 {
                    let mut facets = crowded[edge].iter();
                    let left = facets.find(|facet| self.rank(facet) == Rank::Bounds);
                    next.extend(left.map(|facet| self.of_face[facet.element as usize]));
                }
            }
        }
    }

    fn set_walls(&mut self, (rank, wall): (Rank, Rank), n_edges: usize, meetings: &[Meeting]) {
        let mut excess = vec![0i64; n_edges];
        let mut n_faces = vec![0u32; self.ranks.len()];
        for meeting in meetings {
            if self.ranks[meeting.piece as usize] == rank {
                excess[meeting.edge] += meeting.excess;
            }
        }
        for &piece in &self.of_face {
            n_faces[piece as usize] += 1;
        }
        let mut all: Vec<&[Meeting]> = meetings
            .chunk_by(|a, b| a.piece == b.piece)
            .filter(|of_piece| self.ranks[of_piece[0].piece as usize] == rank)
            .collect();
        all.sort_by_key(|of_piece| {
            let piece = of_piece[0].piece;
            (n_faces[piece as usize], std::cmp::Reverse(piece))
        });
        for of_piece in all {
            let is_wall = of_piece.iter().all(|it| {
                let excess = excess[it.edge];
                (excess - it.excess).abs() < excess.abs()
            });
            if is_wall {
                self.ranks[of_piece[0].piece as usize] = wall;
                for it in of_piece {
                    excess[it.edge] -= it.excess;
                }
            }
        }
    }
}

/// The faces of one piece at one edge.
struct Meeting {
    piece: u32,
    edge: usize,
    n_faces: usize,
    /// How many more pass the edge in one direction than in the other.
    excess: i64,
}

fn corner(surface: &Surface, face: u32, vertex: u32) -> u32 {
    let held = surface.faces[face as usize];
    let ix = held.iter().position(|&held| held == vertex);
    3 * face + ix.unwrap_or_default() as u32
}

fn join(surface: &Surface, corners: &mut UnionFind, a: &Facet, b: &Facet) {
    for vertex in &a.vertices[..2] {
        corners.join(
            corner(surface, a.element, *vertex),
            corner(surface, b.element, *vertex),
        );
    }
}

/// Whether more than two of the faces still have both ends of the edge in common.
fn is_crowded(surface: &Surface, group: &[Facet], corners: &mut UnionFind) -> bool {
    let mut ends: Vec<[u32; 2]> = Vec::with_capacity(group.len());
    for facet in group {
        let [u, v, _] = facet.vertices;
        ends.push([u, v].map(|vertex| corners.root(corner(surface, facet.element, vertex))));
    }
    ends.sort_unstable();
    ends.chunk_by(|a, b| a == b).any(|same| same.len() > 2)
}

/// Pairs of the faces at an edge, by their places in the group.
fn pairs(surface: &Surface, pieces: &Pieces, group: &[Facet], pairing: Pairing) -> Vec<[usize; 2]> {
    if pairing == Pairing::Cut {
        return Vec::new();
    }
    let [u, v] = [group[0].vertices[0], group[0].vertices[1]];
    let ends = [u, v].map(|vertex| surface.at(vertex));
    // A face of zero area has no side and stays alone.
    let mut around: Vec<Side> = (0..group.len())
        .filter_map(|place| {
            let face = surface.faces[group[place].element as usize];
            let from = face.iter().position(|&vertex| vertex == u)?;
            let is_forward = face[(from + 1) % 3] == v;
            let third = face
                .into_iter()
                .find(|&vertex| vertex != u && vertex != v)?;
            let third = surface.at(third);
            (!is_flat_triangle(&[ends[0], ends[1], third])).then_some(Side {
                place,
                rank: pieces.rank(&group[place]),
                third,
                opens: is_forward == (pairing == Pairing::AroundMatter),
            })
        })
        .collect();
    let Some(reference) = around.first().map(|side| side.third) else {
        return Vec::new();
    };
    around.sort_by(|a, b| {
        let halves = [a, b].map(|side| half(&ends, &reference, &side.third));
        let within = || match halves[0] {
            1 | 3 => match orient3d(&ends[0], &ends[1], &a.third, &b.third) {
                Sign::Positive => Ordering::Less,
                Sign::Zero => Ordering::Equal,
                Sign::Negative => Ordering::Greater,
            },
            _ => Ordering::Equal,
        };
        // Of coincident faces, one that closes comes first, so that two walls in one place bound
        // what is on either side.
        halves[0]
            .cmp(&halves[1])
            .then_with(within)
            .then(a.opens.cmp(&b.opens))
            .then(a.place.cmp(&b.place))
    });
    [Rank::Bounds, Rank::Wall, Rank::Loose, Rank::LooseWall]
        .into_iter()
        .flat_map(|rank| matched(around.iter().filter(move |side| side.rank == rank)))
        .collect()
}

/// Matches sides in their order around an edge, as parentheses around a circle.
fn matched<'a>(sides: impl Iterator<Item = &'a Side>) -> Vec<[usize; 2]> {
    let (mut open, mut early, mut found) = (Vec::new(), Vec::new(), Vec::new());
    for side in sides {
        if side.opens {
            open.push(side.place);
        } else if let Some(opened) = open.pop() {
            found.push([opened, side.place]);
        } else {
            early.push(side.place);
        }
    }
    found.extend(
        early
            .into_iter()
            .zip(open.into_iter().rev())
            .map(|(a, b)| [a, b]),
    );
    found
}

/// One face at an edge.
struct Side {
    place: usize,
    rank: Rank,
    third: Point,
    /// Whether what the pairing goes around begins behind the face.
    opens: bool,
}

/// Where a point lies in the turn around an edge that begins at a reference: with it (0), in the
/// first half (1), opposite (2), in the second half (3). Looking from the end of the edge to its
/// start, the turn is clockwise: behind a face that passes the edge forward, matter begins.
fn half([u, v]: &[Point; 2], reference: &Point, point: &Point) -> u8 {
    match orient3d(u, v, reference, point) {
        Sign::Positive => 1,
        Sign::Negative => 3,
        Sign::Zero => {
            // All four lie in one plane; a projection in which the edge and the reference do not
            // fall together tells the sides apart.
            let opposite = [[0, 1], [1, 2], [2, 0]].iter().any(|&[x, y]| {
                let side = |p: &Point| orient2d([u[x], u[y]], [v[x], v[y]], [p[x], p[y]]);
                side(reference).strictly_opposite(side(point))
            });
            if opposite { 2 } else { 0 }
        }
    }
}
