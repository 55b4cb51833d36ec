//! `impinge bench paper`: the paper's benchmarks as a report.

use std::io::Write;

use impinge::CancelToken;
use impinge_paper::{Backends, Control, Options, Waving};

use crate::args::PaperArgs;
use crate::error::Error;
use crate::output::{counted, out};
use crate::values::BenchmarkMesh;
use crate::watch::Watch;

/// `impinge bench paper`.
pub fn paper(args: &PaperArgs, cancel: &CancelToken) -> Result<(), Error> {
    let options = options(args)?;
    let watch = Watch::parts(!args.no_progress);
    let outcome = impinge_paper::run(
        &options,
        &Control {
            cancel,
            progress: &|progress| watch.part(progress.what, progress.done, progress.total),
        },
    )?;
    drop(watch);
    outcome.write(&args.out)?;
    let report = args.out.join("report.md");
    let (surfaces, volumes) = (&outcome.report.surfaces, &outcome.report.volumes);
    writeln!(
        out(),
        "{} and {}: {}",
        counted(surfaces.len() as u64, "surface benchmark"),
        counted(volumes.len() as u64, "volume benchmark"),
        report.display()
    )?;
    match outcome.report.n_disagreements() {
        0 => Ok(()),
        n => Err(Error::Disagreements { n, report }),
    }
}

fn options(args: &PaperArgs) -> Result<Options, Error> {
    let named = |mesh: &BenchmarkMesh| match (mesh.scene, &args.scenes[..]) {
        (Some(scene), _) | (None, &[scene]) => Ok((scene, mesh.path.clone())),
        _ => Err(Error::Usage(format!(
            "--mesh {}: for which benchmark? Say --mesh NAME=FILE, or name one --scene",
            mesh.path.display()
        ))),
    };
    Ok(Options {
        scenes: args.scenes.clone(),
        meshes: args.meshes.iter().map(named).collect::<Result<_, _>>()?,
        is_quick: args.quick,
        n_frames: args.frames.map(|n| n as usize),
        lambda: args.lambda,
        n_threads: args.threads.map_or(0, Into::into),
        backends: args.backend.map_or(Backends::Found, Into::into),
        device: args.device.clone(),
        waving: Waving {
            amplitude: args.amplitude,
            wave_length: args.wave_length,
            speed: args.wave_speed,
        },
    })
}
