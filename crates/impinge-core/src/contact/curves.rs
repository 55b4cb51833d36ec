//! Curves: segments chained at the points that they share.
//!
//! In: contacts. Out: chains of points. A segment that several pairs have in common counts once: an
//! edge that lies in a face is found from both of its triangles. At most points no more than two
//! segments meet, and a chain continues there. Where three or more meet (surfaces that touch in an
//! edge, three sheets at one point), all chains end: a junction. Two closed surfaces in general
//! position have closed chains only.
//!
//! Only the names of points are compared, so no tolerance decides what is connected. Cost:
//! `O(n log n)`.

use super::{Contacts, Shape};
use crate::boxes::scale::Scale;
use crate::scene::error::Error;
use crate::scene::vector::dot;
use crate::search::sink::{filled, grow, with_capacity};
use crate::search::sparse_rows::SparseRows;

/// What memory is for.
const WHAT: &str = "curves of contact";

/// Intersection curves as chains of points.
#[derive(Clone, Default)]
pub struct Curves {
    /// Where each curve's points start, and one past the last.
    starts: Vec<usize>,
    points: Vec<u32>,
    closed: Vec<bool>,
    directed: Vec<bool>,
    lengths: Vec<f64>,
    isolated: Vec<u32>,
}

impl std::fmt::Debug for Curves {
    /// The numbers of curves and points, however many there are.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut short = f.debug_struct("Curves");
        short.field("len", &self.lengths.len());
        short.field("n_points", &self.points.len());
        short.field("n_isolated", &self.isolated.len());
        short.finish_non_exhaustive()
    }
}

/// A segment between two different points, and its direction: 1 from the lower point to the higher,
/// -1 the other way, 0 if it has none or pairs disagree.
#[derive(Clone, Copy)]
struct Link {
    ends: [u32; 2],
    direction: i8,
}

impl Curves {
    pub(super) fn new(contacts: &Contacts) -> Result<Self, Error> {
        let links = links(contacts)?;
        let mut curves = Curves {
            starts: vec![0],
            isolated: isolated(contacts)?,
            ..Curves::default()
        };
        let at = links_at_points(contacts.points().len(), &links)?;
        let mut is_used = filled(false, links.len(), WHAT)?;
        // Open chains first, from each end or junction; then loops, each from its lowest segment.
        for point in 0..contacts.points().len() {
            if at.of(point).len() != 2 {
                for &link in at.of(point) {
                    if !is_used[link as usize] {
                        let start = point as u32;
                        let chain = Chain::follow(&links, &at, &mut is_used, link, start)?;
                        curves.push(contacts, chain)?;
                    }
                }
            }
        }
        for link in 0..links.len() {
            if !is_used[link] {
                let Link { ends, direction } = links[link];
                let start = ends[usize::from(direction < 0)];
                let chain = Chain::follow(&links, &at, &mut is_used, link as u32, start)?;
                curves.push(contacts, chain)?;
            }
        }
        Ok(curves)
    }

    fn push(&mut self, contacts: &Contacts, chain: Chain) -> Result<(), Error> {
        let Chain {
            mut points,
            n_forward,
            n_backward,
        } = chain;
        let n_links = points.len() - 1;
        let is_closed = n_links > 1 && points[0] == points[n_links];
        if n_backward == n_links {
            points.reverse();
        }
        if is_closed {
            points.pop();
        }
        let position = |ix: usize| contacts.points()[points[ix % points.len()] as usize];
        let length = (0..n_links)
            .map(|ix| distance(position(ix), position(ix + 1)))
            .sum();
        grow(&mut self.lengths, 1, WHAT)?;
        grow(&mut self.closed, 1, WHAT)?;
        grow(&mut self.directed, 1, WHAT)?;
        grow(&mut self.starts, 1, WHAT)?;
        grow(&mut self.points, points.len(), WHAT)?;
        self.lengths.push(length);
        self.closed.push(is_closed);
        self.directed
            .push(n_forward == n_links || n_backward == n_links);
        self.points.extend(points);
        self.starts.push(self.points.len());
        Ok(())
    }

    /// The number of curves.
    pub fn len(&self) -> usize {
        self.closed.len()
    }

    /// Whether there are no curves.
    pub fn is_empty(&self) -> bool {
        self.closed.is_empty()
    }

    /// The points of a curve in order, as numbers of [`Contacts::points`]. A closed one does not
    /// repeat its first point.
    pub fn points(&self, curve: usize) -> &[u32] {
        &self.points[self.starts[curve]..self.starts[curve + 1]]
    }

    /// The two points of each segment of a curve in order, as numbers of [`Contacts::points`]. A
    /// closed curve's last segment ends at its first point.
    pub fn segments(&self, curve: usize) -> impl Iterator<Item = [u32; 2]> + '_ {
        let points = self.points(curve);
        let n_segments = points.len() - usize::from(!self.is_closed(curve));
        (0..n_segments).map(|ix| [points[ix], points[(ix + 1) % points.len()]])
    }

    /// The points of all curves, one curve after the other.
    pub fn all_points(&self) -> &[u32] {
        &self.points
    }

    /// Where each curve's points start in [`all_points`](Curves::all_points), and one past the
    /// last.
    pub fn starts(&self) -> &[usize] {
        &self.starts
    }

    /// Whether a curve is a loop.
    pub fn is_closed(&self, curve: usize) -> bool {
        self.closed[curve]
    }

    /// Whether all segments of a curve point the same way along it, which is then its direction:
    /// seen from outside the first body, the part of it that is beneath the second body's surface
    /// lies to the left. True between bodies whose faces are oriented. Within one body the order of
    /// a pair means nothing, so this means nothing either.
    pub fn is_directed(&self, curve: usize) -> bool {
        self.directed[curve]
    }

    /// The length of a curve in the unit of the scene: the sum of the distances of its rounded
    /// points in `f64`.
    pub fn length(&self, curve: usize) -> f64 {
        self.lengths[curve]
    }

    /// The number of curves that are loops.
    pub fn n_closed(&self) -> usize {
        self.closed.iter().filter(|&&closed| closed).count()
    }

    /// The total length of all curves.
    pub fn total_length(&self) -> f64 {
        // The sum of nothing is -0.
        self.lengths.iter().sum::<f64>() + 0.0
    }

    /// Points of contact that are not a corner of any segment or polygon: two bodies touch there
    /// and nowhere nearby. Sorted.
    pub fn isolated(&self) -> &[u32] {
        &self.isolated
    }
}

pub(super) fn distance(p: [f64; 3], q: [f64; 3]) -> f64 {
    length([0, 1, 2].map(|k| q[k] - p[k]))
}

/// The length of a vector, also where squares overflow or underflow.
pub(super) fn length(vector: [f64; 3]) -> f64 {
    let scale = Scale::of_points([vector]);
    let vector = scale.point(vector);
    scale.length_back(dot(vector, vector).sqrt())
}

/// All segments, each once, sorted.
fn links(contacts: &Contacts) -> Result<Vec<Link>, Error> {
    let segments = || (0..contacts.len()).filter(|&ix| contacts.shape(ix) == Shape::Segment);
    let mut links: Vec<Link> = with_capacity(segments().count(), WHAT)?;
    links.extend(segments().filter_map(|contact| {
        let &[from, to] = contacts.corners(contact) else {
            return None;
        };
        let (ends, direction) = if from < to {
            ([from, to], 1)
        } else {
            ([to, from], -1)
        };
        Some(Link {
            ends,
            direction: if contacts.is_directed(contact) {
                direction
            } else {
                0
            },
        })
    }));
    links.sort_unstable_by_key(|link| (link.ends, link.direction));
    let mut once = with_capacity(links.chunk_by(|x, y| x.ends == y.ends).count(), WHAT)?;
    once.extend(links.chunk_by(|x, y| x.ends == y.ends).map(|same| {
        // Pairs without a direction do not count where other pairs have one.
        let has = |direction: i8| same.iter().any(|link| link.direction == direction);
        Link {
            ends: same[0].ends,
            direction: i8::from(has(1)) - i8::from(has(-1)),
        }
    }));
    Ok(once)
}

fn isolated(contacts: &Contacts) -> Result<Vec<u32>, Error> {
    let mut is_corner = filled(false, contacts.points().len(), WHAT)?;
    for contact in 0..contacts.len() {
        if matches!(contacts.shape(contact), Shape::Segment | Shape::Polygon) {
            for &point in contacts.corners(contact) {
                is_corner[point as usize] = true;
            }
        }
    }
    let mut isolated = with_capacity(
        is_corner.iter().filter(|&&is_corner| !is_corner).count(),
        WHAT,
    )?;
    let points = (0u32..).zip(is_corner);
    isolated.extend(points.filter_map(|(point, is_corner)| (!is_corner).then_some(point)));
    Ok(isolated)
}

/// The links at each point.
fn links_at_points(n_points: usize, links: &[Link]) -> Result<SparseRows<u32>, Error> {
    let ends = || {
        let numbered = (0u32..).zip(links);
        numbered.flat_map(|(number, link)| link.ends.map(|end| (end, number)))
    };
    SparseRows::new(n_points, ends, WHAT)
}

/// A chain of points; a loop ends with its first point.
struct Chain {
    points: Vec<u32>,
    n_forward: usize,
    n_backward: usize,
}

impl Chain {
    /// Follows links from a point to an end, to a junction, or back to the start.
    fn follow(
        links: &[Link],
        at: &SparseRows<u32>,
        is_used: &mut [bool],
        first: u32,
        start: u32,
    ) -> Result<Chain, Error> {
        let mut chain = Chain {
            points: vec![start],
            n_forward: 0,
            n_backward: 0,
        };
        let (mut link, mut here) = (first, start);
        loop {
            is_used[link as usize] = true;
            let Link {
                ends: [low, high],
                direction,
            } = links[link as usize];
            let (next, along) = if here == low {
                (high, direction)
            } else {
                (low, -direction)
            };
            chain.n_forward += usize::from(along > 0);
            chain.n_backward += usize::from(along < 0);
            grow(&mut chain.points, 1, WHAT)?;
            chain.points.push(next);
            here = next;
            let onward = at.of(here as usize);
            let unused = onward.iter().find(|&&other| !is_used[other as usize]);
            match unused {
                Some(&other) if onward.len() == 2 && here != start => link = other,
                _ => return Ok(chain),
            }
        }
    }
}
