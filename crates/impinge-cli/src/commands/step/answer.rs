//! The answer about a step, as JSON and as text.

use std::io::{self, Write};

use impinge::{Advance, Error, Impact, Impacts, PairKind, Stats, Truncation};
use impinge_io::printable;

use crate::args::StepHow;
use crate::asked::{Asked, kept};
use crate::detection::{Times, hit};
use crate::origins::Origins;
use crate::text::{self, counted, exactly, grouped, hex};
use crate::{output, report};

use super::load::Moving;

/// The kinds that a step may have, in their order.
const KINDS: [PairKind; 4] = [
    PairKind::VertexFace,
    PairKind::EdgeEdge,
    PairKind::EdgeVertex,
    PairKind::VertexVertex,
];

/// The answer: all impacts, or only the first one.
pub struct Found<'a> {
    /// With vertices as files number them.
    earliest: Option<Impact>,
    /// Whether elements intersect at the start, if that was asked.
    start_intersects: Option<bool>,
    all: Option<&'a Impacts>,
    origins: &'a Origins,
    /// The part of the step that can be taken, if that was asked.
    fraction: Option<f64>,
    /// How many vertices were stopped, how many pairs touch at the start, and in how many rounds
    /// that was found, if it was asked.
    truncated: Option<(u64, u64, u32)>,
    stats: &'a Stats,
    times: Times,
}

impl<'a> Found<'a> {
    /// `earlier` has the times of the same question, asked before.
    pub fn all(origins: &'a Origins, impacts: &'a Impacts, earlier: Times) -> Self {
        let (earliest, start) = (impacts.earliest(), impacts.start_intersects());
        Found {
            all: Some(impacts),
            ..Found::first(origins, earliest, start, impacts.stats(), earlier)
        }
    }

    pub fn first(
        origins: &'a Origins,
        earliest: Option<Impact>,
        start_intersects: Option<bool>,
        stats: &'a Stats,
        earlier: Times,
    ) -> Self {
        Found {
            earliest: earliest.map(|impact| origins.impact(impact)),
            start_intersects,
            all: None,
            origins,
            fraction: None,
            truncated: None,
            stats,
            times: earlier.and(stats),
        }
    }

    pub fn advance(origins: &'a Origins, advance: &Advance, stats: &'a Stats) -> Self {
        Found {
            fraction: Some(advance.fraction),
            ..Found::first(
                origins,
                advance.first,
                advance.start_intersects,
                stats,
                Times::default(),
            )
        }
    }

    pub fn truncation(
        origins: &'a Origins,
        earliest: Option<Impact>,
        truncation: &Truncation,
        stats: &'a Stats,
    ) -> Self {
        let (n_cut, n_touching) = (truncation.n_cut(), truncation.n_touching());
        let start = truncation.start_intersects();
        Found {
            truncated: Some((n_cut, n_touching, truncation.rounds())),
            ..Found::first(origins, earliest, start, stats, Times::default())
        }
    }

    /// Whether nothing touches on the way, and nothing was found to intersect at the start.
    pub fn is_free(&self) -> bool {
        self.earliest.is_none() && self.start_intersects != Some(true)
    }

    /// What the program ends with: the start counts more than what is found later.
    pub fn end(&self, fail_on_hit: bool) -> Result<(), crate::error::Error> {
        match self.start_intersects {
            Some(true) => Err(crate::error::Error::StartIntersects),
            _ => hit(fail_on_hit, !self.is_free()),
        }
    }

    pub fn report(
        &self,
        bodies: &Moving,
        how: &StepHow,
        asked: Asked,
    ) -> Result<report::Step, Error> {
        let truncated = self.truncated;
        Ok(report::Step {
            found: self.found(),
            fraction: self.fraction,
            cut: truncated.map(|(n_cut, ..)| n_cut),
            touching: truncated.map(|(_, n_touching, _)| n_touching),
            rounds: truncated.map(|(.., rounds)| rounds),
            bodies: described(bodies)?,
            ms: self.ms(),
            stats: report::Counters::new(self.stats),
            separation: how.separation,
            clearance: how.clearance,
            asked: report::AskedOfStep::new(asked),
        })
    }

    /// The hash of all impacts as they are written.
    pub fn hash(&self) -> Option<String> {
        self.all.map(|all| hex(self.origins.hash_of_impacts(all)))
    }

    /// What the lines of a sequence say too.
    pub fn found(&self) -> report::Found {
        let n = |all: &Impacts| report::KindsOfStep::new(|kind| all.of(kind).len() as u64);
        report::Found {
            free: self.is_free(),
            earliest: self.earliest.map(impact),
            impacts: self.all.map(Impacts::len),
            kinds: self.all.map(n),
            touching_at_start: self.all.map(n_at_start),
            start_intersects: self.start_intersects,
            hash: self.hash(),
            backend: self.stats.backend.as_str().to_owned(),
            method: self.stats.method,
        }
    }

    /// Times of the stages, and the total time.
    pub fn ms(&self) -> report::Stages {
        report::Stages::new(&self.times)
    }

    /// Prints the answer in the first line, then counts.
    pub fn print(&self, to: &mut impl Write, bodies: &Moving, how: &StepHow) -> io::Result<()> {
        let StepHow {
            separation,
            clearance,
            ..
        } = *how;
        let kept = kept(&bodies.scene, separation);
        let besides = kept.as_ref().map(|kept| format!(" besides {kept}"));
        let besides = besides.unwrap_or_default();
        let name = |body: impinge::BodyId| printable(&bodies.names[body.index()][0]);
        let nothing = if clearance > 0.0 {
            format!(
                "every pair keeps its clearance of {}{besides} from start to end, or a fifth of its distance",
                exactly(clearance)
            )
        } else if let Some(kept) = &kept {
            format!("nothing comes within {kept} from start to end")
        } else {
            "nothing touches from start to end".to_owned()
        };
        match self.earliest {
            None => writeln!(
                to,
                "{}",
                match self.start_intersects {
                    Some(true) => "not free: elements intersect at the start".to_owned(),
                    Some(false) => format!("free: {nothing}"),
                    None => format!("free if the start is, which was not asked: {nothing}"),
                }
            )?,
            Some(first) => writeln!(
                to,
                "not free: {}{} and {} of {} {} first, {}",
                element(first.kind, first.a.element, true),
                match first.a.body == first.b.body {
                    true => String::new(),
                    false => format!(" of {}", name(first.a.body)),
                },
                element(first.kind, first.b.element, false),
                name(first.b.body),
                match (&kept, clearance > 0.0) {
                    (_, true) if !first.at_start => {
                        let clearance = exactly(clearance);
                        format!("come as near as a clearance of {clearance}{besides} lets them")
                    }
                    (Some(kept), _) => format!("come within {kept}"),
                    (None, _) => "touch".to_owned(),
                },
                match first.at_start {
                    true => "at the start".to_owned(),
                    false => format!("at time {:?}", first.toi),
                }
            )?,
        }
        if self.earliest.is_some() && self.start_intersects == Some(true) {
            writeln!(to, "elements intersect at the start")?;
        }
        if let Some(fraction) = self.fraction {
            writeln!(to, "{fraction:?} of the step can be taken")?;
        }
        if let Some((n_cut, n_touching, _)) = self.truncated {
            let n: usize = bodies.vertices_that_move();
            match self.start_intersects {
                Some(true) => writeln!(to, "no vertex was moved")?,
                _ => writeln!(
                    to,
                    "{} of {} vertices stop before their ends{}",
                    grouped(n_cut),
                    grouped(n as u64),
                    match n_touching {
                        0 => String::new(),
                        n => format!("; {} touch at the start", counted(n, "pair")),
                    }
                )?,
            }
        }
        if let Some(all) = self.all.filter(|all| !all.is_empty()) {
            writeln!(
                to,
                "{} ({}), {} touching at the start, hash {}",
                counted(all.len() as u64, "impact"),
                text::kinds(counts(all)),
                grouped(n_at_start(all) as u64),
                hex(self.origins.hash_of_impacts(all))
            )?;
        }
        writeln!(to, "{}", ways(bodies))?;
        writeln!(to, "{}", output::how(self.stats, &self.times))
    }
}

/// The most bodies of which an answer says where they go.
const MOST_WAYS: usize = 4;

/// Which files are whose ends: two files of different meshes would be one mesh that moves.
fn ways(bodies: &Moving) -> String {
    let names = bodies.names.iter().take(MOST_WAYS);
    let way = |names: &[String; 2]| {
        let [start, end] = names.each_ref().map(printable);
        match start == end {
            true => format!("{start} stays"),
            false => format!("{start} moves to {end}"),
        }
    };
    let mut ways: Vec<String> = names.map(way).collect();
    if let Some(n @ 1..) = bodies.names.len().checked_sub(MOST_WAYS) {
        ways.push(format!("{n} more bodies"));
    }
    ways.join(", ")
}

fn counts(impacts: &Impacts) -> [(PairKind, u64); KINDS.len()] {
    KINDS.map(|kind| (kind, impacts.of(kind).len() as u64))
}

fn n_at_start(impacts: &Impacts) -> usize {
    impacts.iter().filter(|impact| impact.at_start).count()
}

/// The bodies of a report.
pub fn described(bodies: &Moving) -> Result<Vec<report::MovingBody>, Error> {
    let all = bodies.ids.iter().zip(&bodies.names).zip(&bodies.vertices);
    all.map(|((&id, [start, end]), vertices)| {
        Ok(report::MovingBody {
            body: report::ThickBody::new(&bodies.scene, id, start, vertices)?,
            end: end.clone(),
        })
    })
    .collect()
}

/// An element in words.
fn element(kind: PairKind, number: u32, is_first: bool) -> String {
    let name = match (kind, is_first) {
        (PairKind::VertexFace, true)
        | (PairKind::VertexVertex, _)
        | (PairKind::EdgeVertex, false) => "vertex",
        (PairKind::EdgeEdge, _) | (PairKind::EdgeVertex | PairKind::EdgeFace, true) => "edge",
        _ => "face",
    };
    format!("{name} {number}")
}

fn impact(impact: Impact) -> report::Impact {
    report::Impact::new(impact.kind, impact.row(), impact.toi)
}
