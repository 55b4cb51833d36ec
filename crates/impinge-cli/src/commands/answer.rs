//! `impinge pairs` and `impinge self`: one answer about one set of meshes.

use std::io::Write;
use std::path::PathBuf;

use impinge::contact::Contacts;
use impinge::{BodyId, CancelToken, Query};
use serde_json::Value;

use crate::args::{AnswerArgs, AskArgs, DetectorArgs, PairsArgs, WithinArgs};
use crate::detection::{detector, query, repeat};
use crate::error::Error;
use crate::load::{Bodies, Loading};
#[cfg(feature = "gpu")]
use crate::picture;
use crate::watch::Watch;
use crate::{apart, contacts, json, meshes, output, rows};

/// `impinge pairs`.
pub fn pairs(args: &PairsArgs, cancel: &CancelToken) -> Result<(), Error> {
    let asked = if args.within {
        Query::everything()
    } else {
        Query::all()
    };
    answer(
        asked,
        &args.meshes,
        &args.ask,
        &args.answer,
        &args.detector,
        cancel,
    )
}

/// `impinge self`.
pub fn within(args: &WithinArgs, cancel: &CancelToken) -> Result<(), Error> {
    answer(
        Query::all_within(),
        &args.meshes,
        &args.ask,
        &args.answer,
        &args.detector,
        cancel,
    )
}

fn answer(
    asked: Query,
    paths: &[PathBuf],
    ask: &AskArgs,
    answer: &AnswerArgs,
    how: &DetectorArgs,
    cancel: &CancelToken,
) -> Result<(), Error> {
    apart::check(answer.outputs(), paths)?;
    let mut detector = detector(how)?;
    let loading = Loading {
        weld: ask.weld,
        notes: !ask.json,
        cancel,
    };
    let Bodies {
        mut scene,
        ids,
        names,
    } = Bodies::read(paths, loading)?;
    let query = query(asked, ask, &ids)?;

    let watch = Watch::detection(!how.no_progress, "detecting");
    let n_frames = answer.repeat.get();
    let (pairs, times) = repeat(&mut detector, &mut scene, &query, n_frames, cancel, &watch)?;
    drop(watch);

    let bodies: Vec<(BodyId, &str)> = ids
        .into_iter()
        .zip(names.iter().map(String::as_str))
        .collect();
    // Files come first: where one can't be written, no answer is printed that looks like success.
    if let Some(file) = &answer.pairs {
        rows::write(file, pairs)?;
    }
    if let Some(file) = &answer.out {
        meshes::write(file, &scene, &bodies, pairs)?;
    }
    let met = if answer.contacts.is_some() || answer.curves.is_some() {
        let contacts = Contacts::new(&scene, pairs)?;
        let curves = contacts.curves();
        Some((contacts, curves))
    } else {
        None
    };
    if let Some((found, curves)) = &met {
        if let Some(file) = &answer.contacts {
            contacts::write(file, found)?;
        }
        if let Some(file) = &answer.curves {
            contacts::write_curves(file, found, curves)?;
        }
    }
    if ask.json {
        let mut object = json::answer(&scene, &bodies, pairs, &times)?;
        if let Some((found, curves)) = &met {
            object.insert("contacts".into(), contacts::object(found, curves));
        }
        writeln!(output::out(), "{}", Value::Object(object))?;
    } else {
        output::print_answer(&scene, &bodies, pairs, &times)?;
        if let Some((found, curves)) = &met {
            writeln!(output::out(), "{}", contacts::summary(found, curves))?;
        }
    }
    // Last: whoever has no adapter has the answer.
    #[cfg(feature = "gpu")]
    if let Some(png) = &answer.png {
        let device = how.device.as_deref();
        picture::write(&png.0, &answer.picture, device, &scene, &bodies, pairs)?;
    }
    Ok(())
}
