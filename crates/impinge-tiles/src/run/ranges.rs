//! Lists of ranges of elements.

use std::ops::Range;

/// The elements of two pieces, which may be the same one.
pub fn both(a: &Range<usize>, b: &Range<usize>) -> Vec<Range<usize>> {
    match a == b {
        true => vec![a.clone()],
        false => vec![a.clone(), b.clone()],
    }
}

/// The parts of `ranges` that lie in `whole`.
pub fn within<'a>(
    ranges: &'a [Range<usize>],
    whole: &'a Range<usize>,
) -> impl Iterator<Item = Range<usize>> + 'a {
    let parts = ranges
        .iter()
        .map(|range| range.start.max(whole.start)..range.end.min(whole.end));
    parts.filter(|part| !part.is_empty())
}
