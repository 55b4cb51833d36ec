//! The answer in the first line, and its places below.

use std::io::{self, Write};

use impinge::{BodyId, Pairs, Scene};
use impinge_io::printable;

use crate::error::Error;
use crate::load::Nouns;
use crate::regions::Region;
use crate::text::{counted, grouped};

/// The most lines of places, and of bodies; the rest is only counted.
const MOST_LINES: usize = 8;

/// Writes the answer: `cow.off: 83 pairs of 5,804 triangles in 3 places, near (0.1, 0.2, 0.3)`. For
/// several bodies, the first line is the total, and one line per two bodies that meet follows.
pub fn write(
    to: &mut impl Write,
    (scene, nouns): (&Scene, &Nouns),
    bodies: &[(BodyId, &str)],
    pairs: &Pairs,
    regions: Option<&[Region]>,
) -> Result<(), Error> {
    let (subject, of) = of_whom(scene, nouns, bodies)?;
    if pairs.is_empty() {
        writeln!(to, "{subject}: no pairs of {of}")?;
        return Ok(());
    }
    let n_pairs = counted(pairs.len() as u64, "pair");
    let Some(regions) = regions else {
        writeln!(to, "{subject}: {n_pairs} of {of}")?;
        return Ok(());
    };
    let near = regions.first().map_or(String::new(), |largest| {
        format!(", near {}", point(largest.center()))
    });
    writeln!(
        to,
        "{subject}: {n_pairs} of {of} in {}{near}",
        counted(regions.len() as u64, "place")
    )?;
    // Whose pairs they are, unless the subject says so.
    let all = [0, bodies.len().saturating_sub(1)];
    if bodies.len() > 2 || regions.iter().any(|region| region.bodies != all) {
        meetings(to, bodies, regions)?;
    }
    if regions.len() > 1 {
        places(to, bodies, regions)?;
    }
    Ok(())
}

/// The one line of an answer that holds no pairs: `cow.off: 83 pairs of 5,804 triangles`.
pub fn write_count(
    to: &mut impl Write,
    (scene, nouns): (&Scene, &Nouns),
    bodies: &[(BodyId, &str)],
    n_pairs: &str,
) -> Result<(), Error> {
    let (subject, of) = of_whom(scene, nouns, bodies)?;
    writeln!(to, "{subject}: {n_pairs} of {of}")?;
    Ok(())
}

/// Who was asked about, by the names of the bodies.
pub fn subject(nouns: &Nouns, names: &[impl AsRef<str>]) -> String {
    match (&nouns.file, names) {
        (Some(file), _) => printable(file),
        (None, [one]) => printable(one.as_ref()),
        (None, [a, b]) => format!("{} and {}", printable(a.as_ref()), printable(b.as_ref())),
        (None, many) => format!("{} {}", many.len(), nouns.many),
    }
}

/// Who was asked about, and how many elements of each kind they have.
fn of_whom(
    scene: &Scene,
    nouns: &Nouns,
    bodies: &[(BodyId, &str)],
) -> Result<(String, String), Error> {
    // A file that could not be read is a body without elements.
    let mut read = Vec::with_capacity(bodies.len());
    for &(id, name) in bodies {
        if scene.body(id)?.n_elements() > 0 {
            read.push((id, name));
        }
    }
    let names: Vec<&str> = read.iter().map(|&(_, name)| name).collect();
    let subject = subject(nouns, &names);
    let mut kinds: Vec<(&'static str, usize)> = Vec::new();
    for &(id, _) in &read {
        let body = scene.body(id)?;
        let kind = body.kind().name();
        match kinds.iter_mut().find(|(name, _)| *name == kind) {
            Some((_, n)) => *n += body.n_elements(),
            None => kinds.push((kind, body.n_elements())),
        }
    }
    let of: Vec<String> = kinds
        .iter()
        .map(|&(kind, n)| {
            let noun = match (n, kind) {
                (1, "tetrahedra") => "tetrahedron",
                (1, _) => kind.trim_end_matches('s'),
                _ => kind,
            };
            format!("{} {noun}", grouped(n as u64))
        })
        .collect();
    Ok((subject, of.join(" and ")))
}

/// Writes one line per two bodies that meet, and per body that meets itself.
fn meetings(to: &mut impl Write, bodies: &[(BodyId, &str)], regions: &[Region]) -> io::Result<()> {
    let mut meetings: Vec<([usize; 2], usize, u64)> = Vec::new();
    for region in regions {
        match meetings.iter_mut().find(|(of, ..)| *of == region.bodies) {
            Some((_, n_pairs, n_places)) => {
                *n_pairs += region.n_pairs;
                *n_places += 1;
            }
            None => meetings.push((region.bodies, region.n_pairs, 1)),
        }
    }
    for &(of, n_pairs, n_places) in meetings.iter().take(MOST_LINES) {
        writeln!(
            to,
            "  {}: {} in {}",
            who(bodies, of),
            counted(n_pairs as u64, "pair"),
            counted(n_places, "place")
        )?;
    }
    more(to, meetings.len())
}

fn places(to: &mut impl Write, bodies: &[(BodyId, &str)], regions: &[Region]) -> io::Result<()> {
    for region in regions.iter().take(MOST_LINES) {
        let of = match bodies.len() {
            1 => String::new(),
            _ => format!("{}, ", who(bodies, region.bodies)),
        };
        let [a, b] = region.first;
        writeln!(
            to,
            "  near {}, size {}: {of}{}, such as {a} and {b}",
            point(region.center()),
            short(region.size()),
            counted(region.n_pairs as u64, "pair"),
        )?;
    }
    more(to, regions.len())
}

fn more(to: &mut impl Write, n: usize) -> io::Result<()> {
    match n.saturating_sub(MOST_LINES) {
        0 => Ok(()),
        n => writeln!(to, "  and {} more", grouped(n as u64)),
    }
}

fn who(bodies: &[(BodyId, &str)], [a, b]: [usize; 2]) -> String {
    match a == b {
        true => format!("{} with itself", printable(bodies[a].1)),
        false => format!("{} and {}", printable(bodies[a].1), printable(bodies[b].1)),
    }
}

fn point(position: [f64; 3]) -> String {
    format!("({})", position.map(short).join(", "))
}

/// A number with four significant digits.
fn short(x: f64) -> String {
    let magnitude = x.abs().log10().floor();
    if x == 0.0 {
        "0".to_owned()
    } else if (-4.0..7.0).contains(&magnitude) {
        // 0 to 7 digits after the decimal point.
        let digits = (3.0 - magnitude).max(0.0) as usize;
        let text = format!("{x:.digits$}");
        match text.contains('.') {
            true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
            false => text,
        }
    } else {
        format!("{x:.3e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        for (x, text) in [
            (0.0, "0"),
            (-0.0, "0"),
            (1.0, "1"),
            (-0.123456, "-0.1235"),
            (12.5, "12.5"),
            (123456.7, "123457"),
            (0.00012345, "0.0001234"),
            (1e-9, "1.000e-9"),
            (1.5e20, "1.500e20"),
        ] {
            assert_eq!(short(x), text, "{x}");
        }
    }
}
