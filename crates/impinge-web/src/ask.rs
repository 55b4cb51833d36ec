//! Questions as lists of numbers, which the package writes, and answers as flat lists, which it
//! gives their shapes.

use impinge::contact::Contacts;
use impinge::{
    Clearance, Control, Detector, Exclusion, Hit, PairKind, Precision, Query, Settings,
    SharedVertex, Start, Stats,
};

use crate::error::Error;
use crate::world::World;

/// What a detector can be asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Question {
    /// [`Detector::detect`].
    Detect,
    /// [`Detector::count`].
    Count,
    /// [`Detector::any`].
    Any,
    /// [`Detector::impacts`].
    Impacts,
    /// [`Detector::earliest`].
    Earliest,
    /// [`Detector::is_free`].
    IsFree,
    /// [`Detector::advance`].
    Advance,
    /// [`Detector::candidates`].
    Candidates,
    /// [`Detector::near`].
    Near,
    /// [`Detector::distance`].
    Distance,
    /// [`Detector::contacts`].
    Contacts,
    /// [`Detector::penetration`].
    Penetration,
    /// [`Detector::contains`].
    Contains,
    /// [`Detector::closest`].
    Closest,
    /// [`Detector::cast`].
    Cast,
    /// [`Detector::safe_distances`].
    SafeDistances,
    /// [`Detector::truncate`].
    Truncate,
    /// [`Detector::neighbours`].
    Neighbours,
    /// [`Detector::nearest`].
    Nearest,
    /// [`Detector::locate`].
    Locate,
    /// [`Detector::signed_distance`].
    SignedDistance,
    /// [`Detector::winding_numbers`].
    WindingNumbers,
}

impl Question {
    /// All of them, by their number in the package.
    pub const ALL: [Question; 22] = [
        Question::Detect,
        Question::Count,
        Question::Any,
        Question::Impacts,
        Question::Earliest,
        Question::IsFree,
        Question::Advance,
        Question::Candidates,
        Question::Near,
        Question::Distance,
        Question::Contacts,
        Question::Penetration,
        Question::Contains,
        Question::Closest,
        Question::Cast,
        Question::SafeDistances,
        Question::Truncate,
        Question::Neighbours,
        Question::Nearest,
        Question::Locate,
        Question::SignedDistance,
        Question::WindingNumbers,
    ];
}

/// A query as the package writes it.
///
/// `words`: which pairs (0 all, 1 of different bodies, 2 of one body, 3 between `a` and `b`, 4 of
/// `a` with itself, 5 all of `a`), `a`, `b`, the rule of shared vertices, the rule of the start,
/// the precision (0 is the default of each), kinds as bits with 64 if they were said, flags (1
/// distances, 2 nearest points, 4 a cell; from 8 on which hits of rays; from 32 on how many bodies
/// are fixed), how many nearest elements, the fixed bodies, and three words for each exclusion: 0
/// and two bodies, 1 and rings, 2 and two groups, 3 and the number of pairs that the scene keeps. `numbers`:
/// separation, clearance, its share, the low and the high corner of the cell, and the question's
/// own length.
///
/// # Errors
/// No such body; lists that are not as described.
pub fn query(world: &World, words: &[u32], numbers: &[f64; 10]) -> Result<Query, Error> {
    let Some((head, rest)) = words.split_first_chunk() else {
        return Err(Error::Foreign);
    };
    let &[
        which,
        a,
        b,
        shared_vertex,
        start,
        precision,
        kinds,
        flags,
        n_nearest,
    ] = head;
    let [separation, clearance, share, x, y, z, to_x, to_y, to_z, _] = *numbers;
    let id = |number| world.id(number);
    let mut query = match which {
        0 => Query::all(),
        1 => Query::between_all(),
        2 => Query::self_all(),
        3 => Query::between(id(a)?, id(b)?),
        4 => Query::self_of(id(a)?),
        _ => Query::of(id(a)?),
    };
    if shared_vertex == 1 {
        query = query.shared_vertex(SharedVertex::Skip);
    }
    if kinds & 64 != 0 {
        let all = PairKind::ALL.into_iter();
        query = query.kinds(all.filter(|&kind| kinds >> kind as u32 & 1 == 1));
    }
    if flags & 1 != 0 {
        query = query.distances();
    }
    if flags & 2 != 0 {
        query = query.closest_points();
    }
    if flags & 4 != 0 {
        query = query.owned_by([x, y, z], [to_x, to_y, to_z]);
    }
    query = query.hits(match flags >> 3 & 3 {
        0 => Hit::First,
        1 => Hit::Any,
        _ => Hit::All,
    });
    let (fixed, excluded) = rest
        .split_at_checked((flags >> 5) as usize)
        .ok_or(Error::Foreign)?;
    let fixed: Result<Vec<_>, Error> = fixed.iter().map(|&body| id(body)).collect();
    query = query.fixed(fixed?);
    for &[kind, a, b] in excluded.as_chunks().0 {
        query = query.exclude(match kind {
            0 => (id(a)?, id(b)?).into(),
            1 => Exclusion::rings(a),
            2 => Exclusion::groups(a, b),
            _ => world.pairs_of(a)?,
        });
    }
    Ok(query
        .n_nearest(n_nearest)
        .start(match start {
            0 => Start::Report,
            1 => Start::Skip,
            _ => Start::Verify,
        })
        .precision(match precision {
            0 => Precision::F32,
            _ => Precision::F64,
        })
        .separation(separation)
        .clearance(Clearance::new(clearance).share(share)))
}

/// A detector that is asked in lists of numbers.
pub struct Asker {
    pub(crate) detector: Detector,
    /// The contacts that were found last, with their number: how deep bodies are in each other is
    /// asked about these.
    pub(crate) known: Option<(u32, Contacts)>,
}

impl Asker {
    /// A detector with these settings.
    ///
    /// # Errors
    /// Those of [`Detector::new`].
    pub fn new(settings: Settings) -> Result<Self, Error> {
        Ok(Asker {
            detector: Detector::new(settings)?,
            known: None,
        })
    }

    /// What the next questions heed.
    pub fn set_control(&mut self, control: Control) {
        self.detector.set_control(control);
    }

    /// How the last question was answered.
    pub fn stats(&self) -> &Stats {
        self.detector.stats()
    }
}
