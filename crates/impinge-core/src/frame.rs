//! One question about one scene, resolved: who takes part, in what order, who meets whom.
//!
//! The primitives of all participants are numbered through, body after body in slot order:
//! primitive `i` of participant `p` has the global number `first(p) + i`. A pair is then one
//! 64-bit key, `lower << 32 | higher`, and sorting keys sorts rows
//! `(body_a, primitive_a, body_b, primitive_b)`.
//!
//! ```text
//!  63            32 31             0
//! +----------------+----------------+
//! | global number  | global number  |   key of a pair, lower number first
//! +----------------+----------------+
//! ```

use std::collections::BTreeSet;

use crate::error::Error;
use crate::query::{Query, Scope, SharedVertex};
use crate::scene::{Body, BodyId, Filter, Kind, Positions, Scene, check_positions};

/// One body that takes part in a frame.
#[derive(Debug, Clone, Copy)]
pub struct Participant {
    /// The body.
    pub id: BodyId,
    /// Global number of its first primitive.
    pub first: u32,
    /// How many primitives it has.
    pub n_primitives: u32,
    /// What they are.
    pub kind: Kind,
    /// Whether its self-collision is asked for.
    pub within: bool,
    filter: Filter,
}

/// Participants and rules; the memory is kept from frame to frame.
#[derive(Debug, Default)]
pub struct Frame {
    /// In slot order.
    pub participants: Vec<Participant>,
    /// The adjacency rule of self-collision.
    pub shared_vertex: SharedVertex,
    between: bool,
    ignored: BTreeSet<(BodyId, BodyId)>,
}

impl Frame {
    /// Resolves a query. Positions that were written in place are not checked yet.
    pub fn resolve(&mut self, scene: &Scene, query: &Query) -> Result<(), Error> {
        self.participants.clear();
        self.shared_vertex = query.shared_vertex;
        if self.ignored != query.ignored {
            self.ignored.clone_from(&query.ignored);
        }
        match query.scope {
            Scope::Between(a, b) => {
                scene.body(a)?;
                scene.body(b)?;
                if a == b {
                    return Err(Error::SameBody { body: a });
                }
                self.between = true;
                for id in [a.min(b), a.max(b)] {
                    self.push(scene, id, false, Some(Filter::default()))?;
                }
            }
            Scope::Within(body) => {
                self.between = false;
                self.push(scene, body, true, None)?;
            }
            Scope::All { between, within } => {
                self.between = between;
                for (id, _) in scene.bodies() {
                    self.push(scene, id, within, None)?;
                }
            }
        }
        Ok(())
    }

    /// Refuses positions that were written in place and are not finite or out of range.
    pub fn check(&self, scene: &Scene) -> Result<(), Error> {
        (0..self.participants.len()).try_for_each(|ix| self.check_one(scene, ix))
    }

    /// As [`check`](Frame::check), for one participant.
    pub fn check_one(&self, scene: &Scene, participant_ix: usize) -> Result<(), Error> {
        let body = self.body(scene, participant_ix);
        if body.is_checked() {
            return Ok(());
        }
        let id = self.participants[participant_ix].id;
        match body.positions() {
            Positions::F32(positions) => check_positions(id, positions),
            Positions::F64(positions) => check_positions(id, positions),
        }
    }

    fn push(
        &mut self,
        scene: &Scene,
        id: BodyId,
        within: bool,
        filter: Option<Filter>,
    ) -> Result<(), Error> {
        let body = scene.body(id)?;
        let first = self.n_primitives();
        let n = body.n_primitives() as u64;
        let limit = u64::from(u32::MAX);
        if first + n > limit {
            return Err(Error::TooMany {
                what: "primitives in one query",
                given: first + n,
                limit,
            });
        }
        self.participants.push(Participant {
            id,
            first: first as u32,
            n_primitives: n as u32,
            kind: body.kind(),
            within: within && !self.ignored.contains(&(id, id)),
            filter: filter.unwrap_or(body.filter()),
        });
        Ok(())
    }

    /// Primitives of all participants together.
    pub fn n_primitives(&self) -> u64 {
        self.participants.last().map_or(0, |last| {
            u64::from(last.first) + u64::from(last.n_primitives)
        })
    }

    /// Whether pairs of two different participants are asked for at all.
    pub fn between(&self) -> bool {
        self.between && self.participants.len() > 1
    }

    /// Whether pairs of these two different participants are asked for.
    #[inline]
    pub fn meets(&self, a_ix: usize, b_ix: usize) -> bool {
        let (a, b) = (&self.participants[a_ix], &self.participants[b_ix]);
        self.between
            && a.filter.meets(b.filter)
            && (self.ignored.is_empty()
                || !self.ignored.contains(&(a.id.min(b.id), a.id.max(b.id))))
    }

    /// Who a participant meets.
    #[cfg(feature = "gpu")]
    pub fn filter(&self, participant_ix: usize) -> Filter {
        self.participants[participant_ix].filter
    }

    /// Pairs of participants, lower first and sorted, that do not meet whatever their filters say.
    #[cfg(feature = "gpu")]
    pub fn ignored_pairs(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let find = |id: BodyId| {
            self.participants
                .binary_search_by_key(&id, |participant| participant.id)
                .ok()
        };
        self.ignored
            .iter()
            .filter(|(a, b)| a != b)
            .filter_map(move |&(a, b)| Some((find(a)?, find(b)?)))
    }

    /// The body behind a participant.
    #[inline]
    pub fn body<'a>(&self, scene: &'a Scene, participant_ix: usize) -> &'a Body {
        scene.body_in(self.participants[participant_ix].id.slot())
    }

    /// The participant that a global primitive number belongs to.
    #[inline]
    pub fn owner(&self, global: u32) -> usize {
        owner_by_first(&self.participants, global, |participant| participant.first)
    }
}

/// Index of the last entry whose `first` is at most `global`. Empty bodies share the `first`
/// of their successor; the last one of the run is the one that holds the primitive.
#[inline]
pub(crate) fn owner_by_first<T>(entries: &[T], global: u32, first: impl Fn(&T) -> u32) -> usize {
    entries.partition_point(|entry| first(entry) <= global) - 1
}

/// The key of a pair of global primitive numbers, lower number first.
#[inline(always)]
pub fn pair_key(a: u32, b: u32) -> u64 {
    let (low, high) = if a < b { (a, b) } else { (b, a) };
    u64::from(low) << 32 | u64::from(high)
}
