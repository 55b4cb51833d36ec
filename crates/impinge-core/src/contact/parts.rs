//! The contacts of two bodies out of those of all bodies.
//!
//! Contacts are sorted by the first body and its element, so those of one pair of bodies are
//! scattered. Their numbers are grouped by pairs of bodies once. Cost: `O(n log n)` for all pairs
//! together, and then `O(n)` in the contacts of one pair.

use std::ops::Range;

use super::{Contacts, PointName};
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::search::sink::{filled, with_capacity};
use crate::search::work::Work;

/// What memory is for.
const WHAT: &str = "contacts by bodies";

/// The numbers of contacts by the two bodies.
#[derive(Debug, Clone, Default)]
pub(super) struct ByBodies {
    /// The bodies, sorted, and where their contacts are in `contacts`.
    bodies: Vec<([u32; 2], Range<usize>)>,
    contacts: Vec<u32>,
}

impl ByBodies {
    pub fn new(rows: &[[u32; 4]], work: Work<'_>) -> Result<Self, Error> {
        let bodies_of = |contact: u32| {
            let [a, _, b, _] = rows[contact as usize];
            [a, b]
        };
        // A list per first body, whose rows are consecutive: sorting is stable, so numbers ascend.
        let mut contacts: Vec<u32> = with_capacity(rows.len(), WHAT)?;
        contacts.extend((0u32..).take(rows.len()));
        for of_first in contacts.chunk_by_mut(|&x, &y| bodies_of(x)[0] == bodies_of(y)[0]) {
            work.step()?;
            if !of_first.is_sorted_by_key(|&contact| bodies_of(contact)) {
                of_first.sort_by_key(|&contact| bodies_of(contact));
            }
        }
        let mut bodies = Vec::new();
        let mut start = 0;
        for same in contacts.chunk_by(|&x, &y| bodies_of(x) == bodies_of(y)) {
            bodies.push((bodies_of(same[0]), start..start + same.len()));
            start += same.len();
        }
        Ok(ByBodies { bodies, contacts })
    }

    /// The contacts of two bodies, the lower number first.
    fn of(&self, bodies: [u32; 2]) -> &[u32] {
        let found = self.bodies.binary_search_by_key(&bodies, |held| held.0);
        found.map_or(&[], |ix| &self.contacts[self.bodies[ix].1.clone()])
    }
}

impl Contacts {
    /// Whether there are contacts of two bodies, the lower first.
    pub(crate) fn are_any_of(&self, bodies: [BodyId; 2]) -> bool {
        let bodies = bodies.map(|id| id.index() as u32);
        !self.by_bodies.of(bodies).is_empty()
    }

    /// The contacts of two bodies alone, the lower number first, and their numbers among all
    /// contacts.
    pub(super) fn part(&self, bodies: [u32; 2]) -> Result<(Contacts, &[u32]), Error> {
        let numbers = self.by_bodies.of(bodies);
        let at = |name: &PointName| name.bodies;
        let first = self.names.partition_point(|name| at(name) < bodies);
        let end = self.names.partition_point(|name| at(name) <= bodies);
        let mut part = Contacts {
            rows: with_capacity(numbers.len(), WHAT)?,
            shapes: with_capacity(numbers.len(), WHAT)?,
            directed: with_capacity(numbers.len(), WHAT)?,
            starts: filled(0, 1, WHAT)?,
            names: self.names[first..end].to_vec(),
            points: self.points[first..end].to_vec(),
            doubles: self.doubles.clone(),
            ..Contacts::default()
        };
        for contact in numbers.iter().map(|&contact| contact as usize) {
            part.rows.push(self.rows[contact]);
            part.shapes.push(self.shapes[contact]);
            part.directed.push(self.directed[contact]);
            let corners = self.corners(contact).iter();
            part.corners
                .extend(corners.map(|&point| point - first as u32));
            part.starts.push(part.corners.len());
        }
        Ok((part, numbers))
    }
}
