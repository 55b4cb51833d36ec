//! Where what is found about vertices, edges and faces goes, by kind of pair.

use crate::query::pair_kind::PairKind;
use crate::scene::error::Error;
use crate::search::key_ranges::{KeyRanges, Tally};
use crate::search::shares::Shares;
use crate::search::sink::{Answer, Ending};
use impinge_exact::Contact;

/// A key and its value.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Found<V> {
    pub key: u64,
    pub value: V,
}

/// Pairs by kind and key, in any order.
pub(crate) type PairList = Vec<(PairKind, u64)>;

/// Contacts found, by kind of pair.
pub(crate) type FoundByKind<V = Contact> = [Vec<Found<V>>; PairKind::ALL.len()];

/// Keys found, by kind of pair.
pub(crate) type KeysByKind = [Vec<u64>; PairKind::ALL.len()];

/// Where contacts go while a step is being answered, by kind of pair.
pub(crate) type ContactAnswer = Answer<Found<Contact>, { PairKind::ALL.len() }>;
/// The same for keys alone.
pub(crate) type KeyAnswer = Answer<u64, { PairKind::ALL.len() }>;

/// Where what is found in a step goes.
#[derive(Debug, Clone, Copy)]
pub(crate) enum StepAnswer<'a> {
    Contacts(&'a ContactAnswer),
    Keys(&'a KeyAnswer),
    /// Only keys of pairs that may lower some vertex's share.
    Lowering(&'a KeyAnswer, &'a Shares),
    /// Only keys in some ranges.
    KeysIn(&'a KeyAnswer, &'a KeyRanges),
    /// Keys are counted and forgotten.
    Counts(&'a Tally),
    /// Candidates that may come within the distance asked for, which the plan's exceeds by a
    /// margin, stay with the workers.
    Listed {
        margin: f64,
    },
}

impl<'a> StepAnswer<'a> {
    /// Takes contacts of one kind; the block is empty afterwards and keeps its memory.
    pub fn take(&self, kind: PairKind, block: &mut Vec<Found<Contact>>) {
        if let StepAnswer::Contacts(answer) = self {
            answer.extend(kind as usize, block.drain(..));
        }
    }

    /// The same for pairs without a time.
    pub fn take_keys(&self, kind: PairKind, block: &mut Vec<u64>) {
        match self {
            StepAnswer::Keys(answer) | StepAnswer::Lowering(answer, _) => {
                answer.extend(kind as usize, block.drain(..));
            }
            StepAnswer::KeysIn(answer, ranges) => {
                block.retain(|&key| ranges.hold(kind, key));
                answer.extend(kind as usize, block.drain(..));
            }
            StepAnswer::Counts(tally) => {
                tally.count(kind, block);
                block.clear();
            }
            StepAnswer::Contacts(_) | StepAnswer::Listed { .. } => {}
        }
    }

    /// The ranges that keys must be in, if not all keys are wanted.
    pub fn ranges(&self) -> Option<&'a KeyRanges> {
        match self {
            StepAnswer::KeysIn(_, ranges) => Some(ranges),
            StepAnswer::Counts(tally) => Some(tally.ranges()),
            StepAnswer::Contacts(_)
            | StepAnswer::Keys(_)
            | StepAnswer::Lowering(..)
            | StepAnswer::Listed { .. } => None,
        }
    }
}

impl Ending for StepAnswer<'_> {
    fn is_over(&self) -> bool {
        match self {
            StepAnswer::Contacts(answer) => answer.is_over(),
            StepAnswer::Keys(answer)
            | StepAnswer::Lowering(answer, _)
            | StepAnswer::KeysIn(answer, _) => answer.is_over(),
            StepAnswer::Counts(_) | StepAnswer::Listed { .. } => false,
        }
    }

    fn check(&self) -> Result<(), Error> {
        match self {
            StepAnswer::Contacts(answer) => answer.check(),
            StepAnswer::Keys(answer)
            | StepAnswer::Lowering(answer, _)
            | StepAnswer::KeysIn(answer, _) => answer.check(),
            StepAnswer::Counts(_) | StepAnswer::Listed { .. } => Ok(()),
        }
    }

    fn share(&self, held_by_finder: u64) {
        match self {
            StepAnswer::Contacts(answer) => answer.share(held_by_finder),
            StepAnswer::Keys(answer)
            | StepAnswer::Lowering(answer, _)
            | StepAnswer::KeysIn(answer, _) => answer.share(held_by_finder),
            StepAnswer::Counts(_) | StepAnswer::Listed { .. } => {}
        }
    }

    fn most_items(&self, room: usize) -> usize {
        room
    }
}
