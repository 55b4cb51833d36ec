//! The answers that callers own: rows and columns, ready to be read.

use std::mem::offset_of;
use std::sync::OnceLock;

use impinge::exact::Feature;
use impinge::{
    Candidates, Exclusion, Impact, Impacts, NearPairs, PairKind, Pairs, Stats, hash_impact_rows,
    hash_rows,
};

use crate::arrays::{self, collect, reserve};
use crate::detector::asked;
use crate::stats::{Texts, fill};
use crate::status::{Failure, guard, held, put};
use crate::types::*;

/// An answer about intersections.
pub struct impinge_pairs {
    pub pairs: Pairs,
    rows: Vec<impinge_pair>,
    texts: Texts,
}

impl impinge_pairs {
    pub fn new(pairs: Pairs) -> Result<Self, Failure> {
        let rows = collect(pairs.rows().map(impinge_pair::from), "pairs")?;
        Ok(impinge_pairs {
            pairs,
            rows,
            texts: Texts::default(),
        })
    }
}

/// An answer about a step.
pub struct impinge_impacts {
    pub impacts: Impacts,
    rows: Vec<impinge_impact>,
    texts: Texts,
}

/// The row of an impact.
pub fn impact_row(impact: &Impact) -> impinge_impact {
    let [body_a, element_a, body_b, element_b] = impact.row();
    impinge_impact {
        toi: impact.toi,
        kind: bit(impact.kind),
        body_a,
        element_a,
        body_b,
        element_b,
        at_start: impact.at_start.into(),
    }
}

impl impinge_impacts {
    pub fn new(impacts: Impacts) -> Result<Self, Failure> {
        let rows = collect(impacts.iter().map(impact_row), "impacts")?;
        Ok(impinge_impacts {
            impacts,
            rows,
            texts: Texts::default(),
        })
    }
}

/// An answer about candidates.
pub struct impinge_candidates {
    candidates: Candidates,
    rows: Vec<impinge_pair>,
    kinds: Vec<u8>,
    texts: Texts,
}

impl impinge_candidates {
    pub fn new(candidates: Candidates) -> Result<Self, Failure> {
        let n = candidates.len();
        let (mut rows, mut kinds) = (Vec::new(), Vec::new());
        reserve(&mut rows, n, "candidates")?;
        reserve(&mut kinds, n, "candidates")?;
        for kind in PairKind::ALL {
            rows.extend(candidates.rows_of(kind).map(impinge_pair::from));
            kinds.resize(rows.len(), bit(kind) as u8);
        }
        Ok(impinge_candidates {
            candidates,
            rows,
            kinds,
            texts: Texts::default(),
        })
    }
}

/// An answer about distances.
pub struct impinge_near {
    pub near: NearPairs,
    rows: Vec<impinge_pair>,
    columns: NearColumns,
    /// The same pairs, to be left out of queries: made once, because it keeps their keys.
    exclusion: OnceLock<Exclusion>,
    texts: Texts,
}

#[derive(Default)]
struct NearColumns {
    kinds: Vec<u8>,
    features: Vec<[u8; 2]>,
    are_parallel: Vec<u8>,
    distances: Vec<f64>,
    points: Vec<[f64; 6]>,
}

/// A feature as one number: a vertex of the element, its edges from 8 on, its face.
pub fn code(feature: Feature) -> u8 {
    match feature {
        Feature::Vertex(ix) => ix,
        Feature::Edge(ix) => 8 + ix,
        Feature::Face => 16,
    }
}

impl impinge_near {
    pub fn new(near: NearPairs) -> Result<Self, Failure> {
        const WHAT: &str = "near pairs";
        let n = near.len();
        let first = near.iter().next();
        let mut of = NearColumns::default();
        let mut rows = Vec::new();
        reserve(&mut rows, n, WHAT)?;
        reserve(&mut of.kinds, n, WHAT)?;
        reserve(&mut of.features, n, WHAT)?;
        reserve(&mut of.are_parallel, n, WHAT)?;
        if first.is_some_and(|pair| pair.distance.is_some()) {
            reserve(&mut of.distances, n, WHAT)?;
        }
        if first.is_some_and(|pair| pair.closest.is_some()) {
            reserve(&mut of.points, n, WHAT)?;
        }
        for pair in near.iter() {
            rows.push(impinge_pair::from(pair.row()));
            of.kinds.push(bit(pair.kind) as u8);
            of.features.push(pair.features.map(code));
            of.are_parallel.push(pair.is_parallel.into());
            of.distances.extend(pair.distance);
            if let Some(closest) = pair.closest {
                let [[a, b, c], [d, e, f]] = closest.points;
                of.points.push([a, b, c, d, e, f]);
            }
        }
        Ok(impinge_near {
            near,
            rows,
            columns: of,
            exclusion: OnceLock::new(),
            texts: Texts::default(),
        })
    }

    /// The pairs, for queries that leave them out.
    pub fn exclusion(&self) -> Exclusion {
        self.exclusion.get_or_init(|| (&self.near).into()).clone()
    }
}

/// What all answers have.
pub trait Answer {
    type Row: Copy;
    const NAME: &'static str;
    fn rows(&self) -> &[Self::Row];
    fn column(&self, column: u32) -> Option<impinge_array>;
    fn stats(&self) -> (&Stats, &Texts);
}

/// A column that an answer has only if it was asked for.
pub fn asked_for<T>(
    list: &[T],
    n: usize,
    view: impl FnOnce() -> impinge_array,
) -> Option<impinge_array> {
    (list.len() == n).then(view)
}

impl Answer for impinge_pairs {
    type Row = impinge_pair;
    const NAME: &'static str = "pairs";
    fn rows(&self) -> &[impinge_pair] {
        &self.rows
    }
    fn column(&self, column: u32) -> Option<impinge_array> {
        (column == COLUMN_ROWS).then(|| arrays::field::<_, u32>(&self.rows, 0))
    }
    fn stats(&self) -> (&Stats, &Texts) {
        (self.pairs.stats(), &self.texts)
    }
}

impl Answer for impinge_impacts {
    type Row = impinge_impact;
    const NAME: &'static str = "impacts";
    fn rows(&self) -> &[impinge_impact] {
        &self.rows
    }
    fn column(&self, column: u32) -> Option<impinge_array> {
        let of = |offset| arrays::field::<_, u32>(&self.rows, offset);
        Some(match column {
            COLUMN_KIND => of(offset_of!(impinge_impact, kind)),
            COLUMN_ROWS => of(offset_of!(impinge_impact, body_a)),
            COLUMN_TOI => arrays::field::<_, f64>(&self.rows, offset_of!(impinge_impact, toi)),
            COLUMN_AT_START => of(offset_of!(impinge_impact, at_start)),
            _ => return None,
        })
    }
    fn stats(&self) -> (&Stats, &Texts) {
        (self.impacts.stats(), &self.texts)
    }
}

impl Answer for impinge_candidates {
    type Row = impinge_pair;
    const NAME: &'static str = "candidates";
    fn rows(&self) -> &[impinge_pair] {
        &self.rows
    }
    fn column(&self, column: u32) -> Option<impinge_array> {
        Some(match column {
            COLUMN_KIND => arrays::view_of(&self.kinds),
            COLUMN_ROWS => arrays::field::<_, u32>(&self.rows, 0),
            _ => return None,
        })
    }
    fn stats(&self) -> (&Stats, &Texts) {
        (self.candidates.stats(), &self.texts)
    }
}

impl Answer for impinge_near {
    type Row = impinge_pair;
    const NAME: &'static str = "near_pairs";
    fn rows(&self) -> &[impinge_pair] {
        &self.rows
    }
    fn column(&self, column: u32) -> Option<impinge_array> {
        let of = &self.columns;
        let n = self.rows.len();
        Some(match column {
            COLUMN_KIND => arrays::view_of(&of.kinds),
            COLUMN_ROWS => arrays::field::<_, u32>(&self.rows, 0),
            COLUMN_FEATURES => arrays::view(&of.features),
            COLUMN_PARALLEL => arrays::view_of(&of.are_parallel),
            COLUMN_DISTANCE => {
                return asked_for(&of.distances, n, || arrays::view_of(&of.distances));
            }
            COLUMN_POINTS => return asked_for(&of.points, n, || arrays::view(&of.points)),
            _ => return None,
        })
    }
    fn stats(&self) -> (&Stats, &Texts) {
        (self.near.stats(), &self.texts)
    }
}

/// The functions that answers have in common.
macro_rules! answer {
    ($handle:ident, $count:ident, $data:ident, $column:ident, $stats:ident, $destroy:ident) => {
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $count(answer: *const $handle) -> usize {
            // SAFETY: `impinge.h` says what pointers are, here and in all functions below.
            unsafe { answer.as_ref() }
                .map_or(0, |answer| $crate::answers::Answer::rows(answer).len())
        }

        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $data(
            answer: *const $handle,
        ) -> *const <$handle as $crate::answers::Answer>::Row {
            // SAFETY: as above.
            match unsafe { answer.as_ref() }.map($crate::answers::Answer::rows) {
                None | Some([]) => std::ptr::null(),
                Some(rows) => rows.as_ptr(),
            }
        }

        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $column(
            answer: *const $handle,
            column: u32,
            view: *mut impinge_array,
        ) -> Status {
            // SAFETY: as above.
            unsafe { $crate::answers::show_column(answer, column, view) }
        }

        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $stats(
            answer: *const $handle,
            stats: *mut impinge_stats,
        ) -> Status {
            // SAFETY: as above.
            unsafe { $crate::answers::show_stats(answer, stats) }
        }

        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $destroy(answer: *mut $handle) {
            // SAFETY: as above.
            unsafe { $crate::status::destroy(answer) }
        }
    };
}
pub(crate) use answer;

/// # Safety
/// As `impinge.h` says of `_column`.
pub unsafe fn show_column<A: Answer>(
    answer: *const A,
    column: u32,
    view: *mut impinge_array,
) -> Status {
    guard(|| {
        // SAFETY: the caller's promise.
        let answer = unsafe { held(answer, A::NAME) }?;
        let found = answer.column(column).ok_or_else(|| {
            let name = A::NAME;
            Failure::invalid(format!(
                "column: {name} have no column {column}, or the query did not ask for it"
            ))
        })?;
        // SAFETY: the caller's promise.
        unsafe { put(view, "view", found) }
    })
}

/// # Safety
/// As `impinge.h` says of `_stats`.
pub unsafe fn show_stats<A: Answer>(answer: *const A, stats: *mut impinge_stats) -> Status {
    guard(|| {
        // SAFETY: the caller's promise.
        let (of, texts) = unsafe { held(answer, A::NAME) }?.stats();
        // SAFETY: the caller's promise.
        unsafe { fill(of, texts, stats) }
    })
}

answer!(
    impinge_pairs,
    impinge_pairs_count,
    impinge_pairs_data,
    impinge_pairs_column,
    impinge_pairs_stats,
    impinge_pairs_destroy
);
answer!(
    impinge_impacts,
    impinge_impacts_count,
    impinge_impacts_data,
    impinge_impacts_column,
    impinge_impacts_stats,
    impinge_impacts_destroy
);
answer!(
    impinge_candidates,
    impinge_candidates_count,
    impinge_candidates_data,
    impinge_candidates_column,
    impinge_candidates_stats,
    impinge_candidates_destroy
);
answer!(
    impinge_near,
    impinge_near_count,
    impinge_near_data,
    impinge_near_column,
    impinge_near_stats,
    impinge_near_destroy
);

/// The hash of an answer; 0 for NULL.
macro_rules! hash {
    ($function:ident, $handle:ident, $field:ident) => {
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $function(answer: *const $handle) -> u64 {
            // SAFETY: see `answer!`.
            unsafe { answer.as_ref() }.map_or(0, |answer| answer.$field.hash())
        }
    };
}
hash!(impinge_pairs_hash, impinge_pairs, pairs);
hash!(impinge_impacts_hash, impinge_impacts, impacts);
hash!(impinge_candidates_hash, impinge_candidates, candidates);
hash!(impinge_near_hash, impinge_near, near);

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_impacts_start_intersects(impacts: *const impinge_impacts) -> i32 {
    // SAFETY: see `answer!`.
    let impacts = unsafe { impacts.as_ref() };
    asked(impacts.and_then(|held| held.impacts.start_intersects()))
}

/// Rows of a caller, aligned or not.
///
/// # Safety
/// `rows` has `n` rows, or is NULL.
unsafe fn rows_of<T: Copy>(rows: *const T, n: usize) -> impl Iterator<Item = T> {
    let n = if rows.is_null() { 0 } else { n };
    // SAFETY: the caller's promise.
    (0..n).map(move |ix| unsafe { rows.add(ix).read_unaligned() })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_hash_pairs(rows: *const impinge_pair, n: usize) -> u64 {
    // SAFETY: see `answer!`.
    hash_rows(unsafe { rows_of(rows, n) }.map(|row| row.row()))
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_hash_impacts(rows: *const impinge_impact, n: usize) -> u64 {
    // SAFETY: see `answer!`.
    let rows = unsafe { rows_of(rows, n) };
    hash_impact_rows(rows.filter_map(|row| {
        let of = [row.body_a, row.element_a, row.body_b, row.element_b];
        Some((kind_of(row.kind)?, of, row.toi))
    }))
}
