//! Runs all benchmarks.

use crate::benchmark;
use crate::control::Control;
use crate::duplicates;
use crate::error::Error;
use crate::figures;
use crate::finders::Place;
use crate::machine::{Adapter, Machine};
use crate::options::{Backends, Options, SceneName};
use crate::pictures::{File, Painter};
use crate::report::Report;
use crate::scenes::Moving;
use crate::volumes::Recorded;

/// The report of a run, and its figures.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// The data of the figures and tables.
    pub report: Report,
    /// Plots and pictures.
    pub figures: Vec<File>,
}

/// Runs the benchmarks of the options. It writes no files.
///
/// # Errors
/// Options that do not fit together; a mesh that cannot be read; no GPU although one is requested;
/// a detection that fails or is cancelled. Different answers are not an error here: the report
/// counts them, see [`Report::n_disagreements`].
pub fn run(options: &Options, control: &Control<'_>) -> Result<Outcome, Error> {
    options.check()?;
    let (places, adapter, mut remarks) = places(options)?;
    let (mut painter, reason) = Painter::new(options.device.as_deref());
    remarks.extend(reason);
    let mut report = Report {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        is_quick: options.is_quick,
        has_debug_assertions: cfg!(debug_assertions),
        machine: Machine::of_this(options.n_threads),
        adapter,
        remarks,
        waving: options.waving,
        surfaces: Vec::new(),
        volumes: Vec::new(),
        duplicates: Vec::new(),
        table_sizes: None,
    };
    for name in SceneName::ALL
        .into_iter()
        .filter(|name| options.wants(*name))
    {
        control.go_on()?;
        match Recorded::new(name, options, control)? {
            None => {
                let mut course = Moving::new(name, options)?;
                let scene = benchmark::run(&mut course, options, &places, &mut painter, control)?;
                report.surfaces.push(scene);
                report
                    .duplicates
                    .extend(duplicates::table(&mut course, options, control)?);
                if name == SceneName::Bunny {
                    let sizes = duplicates::table_sizes(&mut course, options, control)?;
                    report.table_sizes = Some(sizes);
                }
            }
            Some(mut course) => {
                let scene = benchmark::run(&mut course, options, &places, &mut painter, control)?;
                report.volumes.push(crate::report::Scene {
                    simulation_ms: Some(course.simulation_ms),
                    ..scene
                });
            }
        }
    }
    let mut figures = painter.files;
    figures.extend(figures::plots(&report)?);
    Ok(Outcome { report, figures })
}

/// The places where contestants run, the GPU among them, and remarks about missing ones.
type Places = (Vec<Place>, Option<Adapter>, Vec<String>);

/// The requested places that exist.
fn places(options: &Options) -> Result<Places, Error> {
    let mut places = Vec::new();
    let mut remarks = Vec::new();
    if options.backends != Backends::Gpu {
        places.push(Place::Cpu {
            n_threads: options.n_threads,
        });
    }
    let adapter = match options.backends {
        Backends::Cpu => {
            remarks.push("There are no runs on a GPU: only the CPU was requested.".to_owned());
            None
        }
        backends => match (adapter(options.device.as_deref()), backends) {
            (Ok(adapter), _) => Some(adapter),
            (Err(reason), Backends::Found) => {
                remarks.push(format!("There are no runs on a GPU: {reason}."));
                None
            }
            (Err(found), _) => return Err(impinge::Error::NoAdapter { found }.into()),
        },
    };
    places.extend(adapter.clone().map(Place::Gpu));
    Ok((places, adapter, remarks))
}

/// The GPU of this name, or the first one, hardware before software; or the reason why there is
/// none.
#[cfg(feature = "gpu")]
fn adapter(device: Option<&str>) -> Result<Adapter, String> {
    let wanted = device.unwrap_or_default().to_lowercase();
    let fits = |info: &&impinge::DeviceInfo| info.name.to_lowercase().contains(&wanted);
    let devices = impinge::devices();
    match devices.iter().find(fits) {
        Some(info) => Ok(Adapter {
            name: info.name.clone(),
            driver: info.driver.clone(),
            is_software: info.is_software,
        }),
        None if devices.is_empty() => Err("there is no adapter on this machine".to_owned()),
        None => Err(format!("no adapter is called \"{wanted}\"")),
    }
}

#[cfg(not(feature = "gpu"))]
fn adapter(_: Option<&str>) -> Result<Adapter, String> {
    Err("the program was built without its feature `gpu`".to_owned())
}
