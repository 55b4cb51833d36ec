//! How parts of an assembly lie to each other: as a matrix of letters, and in words.

use impinge_check::{Assembly, PartPair, Relation};

use super::args::{CheckArgs, Touching};
use crate::text::{counted, several};

/// The letters of pairs that are not apart, with their meaning.
pub const LEGEND: [&str; 7] = [
    "X share space",
    "I inside",
    "O around",
    "i partly inside",
    "o partly around",
    "t touch",
    "n near",
];

/// What a pair is, seen from one of its parts, as a letter of the matrix.
fn letter(relation: Relation) -> char {
    match relation {
        Relation::Interpenetrating => 'X',
        Relation::Inside => 'I',
        Relation::Around => 'O',
        Relation::PartlyInside => 'i',
        Relation::PartlyAround => 'o',
        Relation::Touching => 't',
        Relation::Near => 'n',
    }
}

/// A row of letters per part: `.` for parts that are apart, `-` for the part itself.
pub fn matrix(answer: &Assembly) -> Vec<Vec<char>> {
    let n = answer.parts.len();
    let mut rows = vec![vec!['.'; n]; n];
    for (ix, row) in rows.iter_mut().enumerate() {
        row[ix] = '-';
    }
    for PartPair {
        parts, relation, ..
    } in &answer.pairs
    {
        let [a, b] = *parts;
        rows[a][b] = letter(*relation);
        rows[b][a] = letter(match relation {
            Relation::Inside => Relation::Around,
            Relation::Around => Relation::Inside,
            Relation::PartlyInside => Relation::PartlyAround,
            Relation::PartlyAround => Relation::PartlyInside,
            same => *same,
        });
    }
    rows
}

/// What a pair is, in words, from the names of its parts.
pub fn said([a, b]: [&str; 2], pair: &PartPair) -> String {
    let [x, y, z] = pair.point;
    let faces = several(pair.n_pairs, "pair of faces", "pairs of faces");
    let at = format!("near ({x}, {y}, {z})");
    let apart = pair.distance;
    match pair.relation {
        Relation::Interpenetrating => format!("{a} and {b} interpenetrate: {faces}, {at}"),
        Relation::Inside => format!("{a} is inside {b}, {apart} from the surface, {at}"),
        Relation::Around => format!("{b} is inside {a}, {apart} from the surface, {at}"),
        Relation::PartlyInside => {
            format!("{a} is partly inside {b}, {apart} from the surface, {at}")
        }
        Relation::PartlyAround => {
            format!("{b} is partly inside {a}, {apart} from the surface, {at}")
        }
        Relation::Touching => format!("{a} and {b} touch: {faces}, {at}"),
        Relation::Near => format!("{a} and {b} are {apart} apart, {at}"),
    }
}

pub fn summary(args: &CheckArgs, answer: &Assembly) -> String {
    let n = |is: fn(Relation) -> bool| {
        let found = answer.pairs.iter().filter(|pair| is(pair.relation));
        found.count() as u64
    };
    let mut said = vec![several(
        n(Relation::shares_space),
        "pair shares space",
        "pairs share space",
    )];
    if args.touching == Touching::Report {
        let n = n(|relation| relation == Relation::Touching);
        said.push(several(n, "only touches", "only touch"));
    }
    if let Some(clearance) = args.clearance {
        let n = n(|relation| relation == Relation::Near);
        let words = several(n, "is at most", "are at most");
        said.push(format!("{words} {clearance} apart"));
    }
    let n_parts = answer.parts.len() as u64;
    let n_sheets = answer.parts.iter().filter(|part| !part.is_solid).count() as u64;
    let sheets = match n_sheets {
        0 => String::new(),
        n => format!(", {} not closed", several(n, "is", "are")),
    };
    format!("{}{sheets}: {}", counted(n_parts, "part"), said.join(", "))
}
