//! `impinge pairs` and `impinge self`: one answer for one set of meshes.

use std::io::Write;
use std::path::PathBuf;

use impinge::{BodyId, CancelToken, Control, Detector};
use impinge_io::{Cell, ELEMENTS, printable};

use crate::apart::Inputs;
use crate::args::{AnswerArgs, AskArgs, DetectorArgs, PairsArgs, WithinArgs};
use crate::asked::Asked;
use crate::detection::{Times, asked, hit, query, repeat, settings};
use crate::error::Error;
use crate::load::{Bodies, Loading, Vertices};
use crate::picture::Drawer;
use crate::text::counted;
use crate::values::RowsFile;
use crate::watch::Watch;
use crate::{contacts, headline, meshes, output, regions, report, rows};

/// `impinge pairs`.
pub fn pairs(args: &PairsArgs, cancel: &CancelToken) -> Result<(), Error> {
    answer(
        Bodies::read,
        Asked {
            only: args.between,
            ..asked((true, args.within), &args.ask)
        },
        &args.meshes,
        &args.ask,
        &args.answer,
        &args.detector,
        cancel,
    )
}

/// `impinge self`.
pub fn within(args: &WithinArgs, cancel: &CancelToken) -> Result<(), Error> {
    // The answer about one mesh does not depend on the others.
    answer(
        Bodies::read_readable,
        asked((false, true), &args.ask),
        &args.meshes,
        &args.ask,
        &args.answer,
        &args.detector,
        cancel,
    )
}

fn answer(
    read: fn(&[PathBuf], Loading<'_>) -> Result<Bodies, Error>,
    asked: Asked,
    paths: &[PathBuf],
    ask: &AskArgs,
    answer: &AnswerArgs,
    how: &DetectorArgs,
    cancel: &CancelToken,
) -> Result<(), Error> {
    let inputs = Inputs::new(paths);
    for (option, path) in answer.outputs() {
        inputs.check(option, path)?;
    }
    let rows_file = answer.rows.file(&inputs, ask.json)?;
    for (option, file) in [("contacts", &answer.contacts), ("regions", &answer.regions)] {
        if file.as_ref().is_some_and(RowsFile::is_stdout) {
            let text = format!("--{option}: {option} are written to files");
            return Err(Error::Usage(text));
        }
    }
    let holds_no_pairs = answer.count || answer.any;
    let is_one_frame = answer.repeat.get() == 1;
    if holds_no_pairs {
        let does = match answer.count {
            true => "--count counts pairs and keeps none",
            false => "--any stops at the first pair and keeps none",
        };
        let written = answer.outputs().first().map(|(option, _)| *option);
        let written = rows_file.as_ref().map(|_| "--rows").or(written);
        let text = match written {
            Some(option) => format!("{does}: there is nothing for {option} to write"),
            None => format!("{does}: --repeat is for questions that do"),
        };
        if written.is_some() || !is_one_frame {
            return Err(Error::Usage(text));
        }
    }
    let mut loading = Loading::new(ask, asked.within, cancel);
    if asked.between {
        loading = loading.splitting_one();
    }
    let Bodies {
        mut scene,
        ids,
        names,
        vertices,
        origins,
        nouns,
        unread,
    } = read(paths, loading)?;
    // Only they name vertices.
    let origins = answer.contacts.is_some().then_some(origins);
    let is_read = |(ix, _): &(usize, _)| unread.iter().all(|(body, _)| body != ix);
    let read = vertices.iter().copied().enumerate().filter(is_read);
    let read: Vec<Vertices> = read.map(|(_, of)| of).collect();
    if ids.len() == 1 && !asked.within {
        let text = format!(
            "{}: one body meets no other: `impinge self` finds where it meets itself",
            printable(&names[0])
        );
        return Err(Error::Usage(text));
    }
    let query = query(asked, &ask.exclude, &ids)?;
    // The detector comes last, because opening a GPU takes time and some drivers print messages.
    let mut settings = settings(how);
    if !is_one_frame {
        // Median times are of one method.
        settings.method = settings.method.in_the_long_run();
    }
    let threads = settings.threads;
    let mut detector = Detector::new(settings)?;

    let watch = Watch::detection(!how.no_progress, "detecting");
    detector.set_control(watch.control(cancel));
    let named = ids.iter().copied().zip(names.iter().map(String::as_str));
    let bodies: Vec<(BodyId, &str)> = named.collect();
    if holds_no_pairs {
        let (pairs, any, text) = if answer.count {
            let n = detector.count(&scene, &query)?;
            let text = match n {
                0 => "no pairs".to_owned(),
                n => counted(n, "pair"),
            };
            (Some(n), None, text)
        } else {
            let any = detector.any(&scene, &query)?;
            let text = if any { "at least one pair" } else { "no pairs" };
            (None, Some(any), text.to_owned())
        };
        drop(watch);
        if ask.json {
            let stats = detector.stats();
            report::print(&report::Count {
                pairs,
                any,
                asked: report::Asked::new(asked),
                how: report::How::new(stats, report::Total::new(stats.total_ms)),
                unread: report::Unread::all(&unread, &names),
            })?;
        } else {
            let mut line = Vec::new();
            headline::write_count(&mut line, (&scene, &nouns), &bodies, &text)?;
            if ask.verbose {
                let times = Times::default().and(detector.stats());
                writeln!(line, "\n{}\n", output::stage_table(&times))?;
                writeln!(line, "{}", output::how(detector.stats(), &times))?;
            }
            writeln!(line, "{}", asked.line(&read, &nouns))?;
            output::out().write_all(&line)?;
        }
        let is_found = pairs > Some(0) || any == Some(true);
        return end(ask, is_found, &unread, paths.len());
    }
    let n_frames = answer.repeat.get();
    let (pairs, times) = repeat(&mut detector, &mut scene, &query, n_frames)?;
    let pairs = &pairs;
    drop(watch);
    detector.set_control(Control::new().cancel(cancel));

    // Files are written first: if one can't be written, no answer is printed that looks like
    // success.
    if let Some(file) = &rows_file {
        rows::write(
            file,
            ELEMENTS.into(),
            pairs.len(),
            pairs.rows().map(|row| row.map(Cell::Number)),
        )?;
    }
    if let Some(file) = &answer.shown.out {
        meshes::write(file, &scene, &bodies, pairs)?;
    }
    let wants_contacts = answer.contacts.is_some() || answer.curves.is_some();
    let met = if wants_contacts || answer.regions.is_some() {
        let contacts = detector.contacts(&scene, pairs)?;
        let curves = contacts.curves()?;
        Some((contacts, curves))
    } else {
        None
    };
    if let Some((found, curves)) = &met {
        if let (Some(file), Some(origins)) = (&answer.contacts, &origins) {
            contacts::write(file, origins, found)?;
        }
        if let Some(file) = &answer.curves {
            contacts::write_curves(file, found, curves)?;
        }
        if let Some(file) = &answer.regions {
            contacts::write_regions(file, &mut detector, &scene, &bodies, found)?;
        }
    }
    let regions = regions::regions(&scene, &bodies, pairs)?;
    let regions = regions.as_deref();
    if ask.json {
        let asked = (asked, &scene);
        let found = report::Pairs::new(asked, &bodies, &vertices, pairs, regions, &times)?;
        let met = met.as_ref();
        report::print(&report::Pairs {
            contacts: met.map(|(found, curves)| contacts::report(found, curves)),
            unread: report::Unread::all(&unread, &names),
            ..found
        })?;
    } else {
        let mut text = Vec::new();
        headline::write(&mut text, (&scene, &nouns), &bodies, pairs, regions)?;
        if let Some((found, curves)) = &met {
            writeln!(text, "{}", contacts::summary(found, curves))?;
        }
        if ask.verbose {
            output::print_details(&mut text, &scene, &bodies, pairs, &times)?;
        }
        writeln!(text, "{}", asked.line(&read, &nouns))?;
        output::say(&text, rows_file.as_ref())?;
    }
    // The picture comes last, so that the answer is printed even without an adapter.
    if let Some(png) = &answer.shown.png {
        let mut drawer = Drawer::new(&answer.shown.picture, how.device.as_deref(), threads)?;
        drawer.write(&png.path, &scene, &bodies, pairs)?;
    }
    end(ask, !pairs.is_empty(), &unread, paths.len())
}

/// Fails if anything was found and that is to fail, or if files could not be read.
fn end(
    ask: &AskArgs,
    is_found: bool,
    unread: &[(usize, String)],
    n_files: usize,
) -> Result<(), Error> {
    if unread.is_empty() {
        return hit(ask.fail_on_hit, is_found);
    }
    let what = format!("{} of {n_files} meshes could not be read", unread.len());
    match ask.fail_on_hit && is_found {
        true => Err(Error::CheckFailed(format!("pairs were found; {what}"))),
        false => Err(Error::Unread(what)),
    }
}
