//! `impinge safe`: how far each vertex may move on any path, so that nothing touches.

use std::io::Write;

use impinge::{BodyId, Bounds, CancelToken, SafeDistances};
use impinge_io::{Cell, Column, Holds, printable};
use impinge_render::ramp;

use crate::apart::Inputs;
use crate::args::SafeArgs;
use crate::asked::{Asked, Question, body, thicken};
use crate::detection::{Times, asked, detector, hit, query};
use crate::error::Error;
use crate::load::{Bodies, Loading};
use crate::output::{say, stage_table};
use crate::picture::Drawer;
use crate::text::{counted, exactly, grouped};
use crate::watch::Watch;
use crate::{colors, headline, output, palette, report, rows};

/// `impinge safe`.
pub fn safe(args: &SafeArgs, cancel: &CancelToken) -> Result<(), Error> {
    let ask = &args.ask;
    let inputs = Inputs::new(&args.meshes);
    for (option, path) in args.shown.outputs() {
        inputs.check(option, path)?;
    }
    let rows_file = args.rows.file(&inputs, ask.json)?;
    let mut bodies = Bodies::read(&args.meshes, Loading::new(ask, !args.no_self, cancel))?;
    thicken(&mut bodies.scene, &bodies.ids, &args.thickness)?;
    let fixed = args.fixed.iter();
    let fixed = fixed.map(|&number| body("--fixed", &bodies.ids, number));
    let fixed: Vec<BodyId> = fixed.collect::<Result<_, _>>()?;
    let mut detector = detector(&args.detector)?;
    if args.no_self && bodies.ids.len() < 2 {
        return Err(Error::Usage(
            "--no-self leaves nothing to test if there is only one body".to_owned(),
        ));
    }
    let asked = Asked {
        question: Question::Near,
        has_self: false,
        ..asked((bodies.ids.len() > 1, !args.no_self), ask)
    };
    let intersect = query(asked, &ask.exclude, &bodies.ids)?;

    let watch = Watch::detection(!args.detector.no_progress, "detecting");
    detector.set_control(watch.control(cancel));
    let safe =
        detector.safe_distances(&bodies.scene, args.most, &intersect.clone().fixed(fixed))?;
    // Edges that pass through faces may be far from what else there is of them.
    let intersects = !safe.touching().is_empty() || detector.any(&bodies.scene, &intersect)?;
    drop(watch);
    let answer = Answer {
        args,
        asked,
        bodies: &bodies,
        safe: &safe,
        intersects,
    };
    // Files are written first: if one can't be written, no answer is printed that looks like
    // success.
    if let Some(file) = &rows_file {
        let columns = [
            ("body", Holds::U32),
            ("vertex", Holds::U32),
            ("safe", Holds::F64),
        ];
        let columns = columns.map(|(name, holds)| Column::new(name, holds));
        let each = answer.bounds();
        let row =
            |(body, vertex, bound)| [rows::number(body), rows::number(vertex), Cell::Float(bound)];
        rows::write(
            file,
            columns.to_vec(),
            answer.bounds().count(),
            each.map(row),
        )?;
    }
    let named = bodies.names.iter().map(String::as_str);
    let named: Vec<(BodyId, &str)> = bodies.ids.iter().copied().zip(named).collect();
    let color = |body: usize, corners: &[u32]| answer.color(body, corners);
    if let Some(file) = &args.shown.out {
        colors::write(file, &bodies.scene, &named, color)?;
    }
    if let Some(png) = &args.shown.png {
        let device = args.detector.device.as_deref();
        // All that is near something else would show through.
        let color = |body: usize, corners: &[u32]| (color(body, corners).0, false);
        let surfaces = colors::surfaces(&bodies.scene, &named, color)?;
        Drawer::new(&args.shown.picture, device, 1)?.draw(&png.path, surfaces)?;
    }
    if ask.json {
        report::print(&answer.report()?)?;
    } else {
        let mut text = Vec::new();
        answer.print(&mut text)?;
        writeln!(
            text,
            "{}",
            asked.line_of_thick(&bodies.vertices, &bodies.nouns, &args.thickness)
        )?;
        say(&text, rows_file.as_ref())?;
    }
    hit(ask.fail_on_hit, intersects)
}

struct Answer<'a> {
    args: &'a SafeArgs,
    asked: Asked,
    bodies: &'a Bodies,
    safe: &'a SafeDistances,
    intersects: bool,
}

impl Answer<'_> {
    fn of(&self, id: BodyId) -> Bounds<'_> {
        self.safe.of(id).unwrap_or(Bounds::F32(&[]))
    }

    /// The largest bound of a body: what was asked for, in the precision of its positions.
    fn most(&self, body: usize) -> f64 {
        let most = self.args.most;
        match self.of(self.bodies.ids[body]) {
            Bounds::F64(_) => most,
            Bounds::F32(_) => {
                let single = most as f32;
                match f64::from(single) > most {
                    true => single.next_down().into(),
                    false => single.into(),
                }
            }
        }
    }

    /// The number of the body, the vertex as its file numbers it, and its bound.
    fn bounds(&self) -> impl Iterator<Item = (usize, usize, f64)> {
        let bodies = self.bodies.ids.iter().enumerate();
        bodies.flat_map(|(number, &id)| {
            let bounds = self.of(id);
            let origin = self.bodies.origins.of(number).into_iter();
            let vertices = origin.flat_map(move |origin| origin.vertices(bounds.len()));
            vertices.map(move |(in_file, vertex)| (number, in_file, bounds.get(vertex)))
        })
    }

    /// Vertices that move, with their bounds: those of fixed bodies have none of their own.
    fn moving(&self) -> impl Iterator<Item = (usize, usize, f64)> {
        self.bounds()
            .filter(|(body, ..)| !self.args.fixed.contains(body))
    }

    /// The first vertex with the least bound of all that move.
    fn smallest(&self) -> Option<(usize, usize, f64)> {
        self.moving()
            .reduce(|least, next| if next.2 < least.2 { next } else { least })
    }

    fn n_bounded(&self) -> usize {
        self.moving()
            .filter(|(body, _, bound)| *bound < self.most(*body))
            .count()
    }

    fn report(&self) -> Result<report::Safe, Error> {
        let Bodies {
            scene,
            ids,
            names,
            vertices,
            ..
        } = self.bodies;
        let described = |ix: usize| {
            Ok(report::FixedBody {
                body: report::ThickBody::new(scene, ids[ix], &names[ix], &vertices[ix])?,
                fixed: self.args.fixed.contains(&ix),
            })
        };
        let described = (0..ids.len()).map(described);
        let smallest = self.smallest();
        let smallest =
            smallest.map(|(body, vertex, safe)| report::SafeVertex { body, vertex, safe });
        let stats = self.safe.stats();
        let times = Times::default().and(stats);
        Ok(report::Safe {
            most: self.args.most,
            asked: report::Asked::new(self.asked),
            vertices: self.moving().count(),
            bounded: self.n_bounded(),
            smallest,
            touching: self.safe.touching().len(),
            intersects: self.intersects,
            bodies: described.collect::<Result<_, Error>>()?,
            how: report::How::new(stats, report::Stages::new(&times)),
        })
    }

    /// The answer in the first line, then what touches.
    fn print(&self, to: &mut impl Write) -> Result<(), Error> {
        let Bodies { nouns, names, .. } = self.bodies;
        let subject = headline::subject(nouns, names);
        let most = exactly(self.args.most);
        let n = grouped(self.moving().count() as u64);
        let (n_bounded, smallest) = (self.n_bounded(), self.smallest());
        match smallest.filter(|_| n_bounded > 0) {
            None => writeln!(to, "{subject}: all {n} vertices may move by {most}")?,
            Some((body, vertex, bound)) => {
                let of = match names.len() {
                    1 => String::new(),
                    _ => format!(" of {}", printable(&names[body])),
                };
                writeln!(
                    to,
                    "{subject}: {} of {n} vertices may move by less than {most}, vertex {vertex}{of} by {} at most",
                    grouped(n_bounded as u64),
                    exactly(bound)
                )?;
            }
        }
        let touching = self.safe.touching().len() as u64;
        match (touching, self.intersects) {
            (0, false) => writeln!(to, "nothing touches")?,
            (0, true) => writeln!(to, "elements intersect: the bounds keep others apart")?,
            (n, _) => writeln!(
                to,
                "{} of elements touch and may not move",
                counted(n, "pair")
            )?,
        }
        let stats = self.safe.stats();
        let times = Times::default().and(stats);
        if self.args.ask.verbose {
            writeln!(to, "\n{}\n", stage_table(&times))?;
        }
        writeln!(to, "{}", output::how(stats, &times))?;
        Ok(())
    }

    /// The colour of an element: from red where nothing may move to yellow, and grey where all may
    /// move as far as was asked.
    fn color(&self, body: usize, corners: &[u32]) -> ([u8; 3], bool) {
        let bounds = self.of(self.bodies.ids[body]);
        let least = corners
            .iter()
            .map(|&corner| bounds.get(corner as usize))
            .fold(f64::INFINITY, f64::min);
        match least < self.most(body) && !self.args.fixed.contains(&body) {
            true => (ramp(least / self.args.most), true),
            false => (palette::body(body).other, false),
        }
    }
}
