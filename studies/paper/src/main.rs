//! The program `impinge-paper`: the paper's benchmarks as a report.

mod args;

use std::io::{IsTerminal, stderr};
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use impinge::CancelToken;
use impinge_paper::{Control, Error, Options};
use indicatif::{ProgressBar, ProgressStyle};

use crate::args::Args;

fn main() -> ExitCode {
    #[cfg(all(feature = "gpu", target_os = "linux"))]
    keep_mesa_quiet();
    let args = Args::parse();
    match run(&args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("impinge-paper: {failure}");
            ExitCode::from(failure.exit_code())
        }
    }
}

/// As in the program `impinge`: without a desktop session, a Vulkan layer of Mesa complains on
/// standard error each time that a GPU is searched for. The program chooses the GPU itself, so the
/// layer is switched off.
#[cfg(all(feature = "gpu", target_os = "linux"))]
fn keep_mesa_quiet() {
    if std::env::var_os("XDG_RUNTIME_DIR").is_none() {
        // SAFETY: the program has just started, so no other thread can read the environment.
        unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
    }
}

/// An error that ends the program.
#[derive(Debug, thiserror::Error)]
enum Failure {
    #[error(transparent)]
    Run(#[from] Error),
    #[error("{n} answers in {} differ from the reference: please report this", .report.display())]
    Disagreements { n: usize, report: PathBuf },
    #[error("cannot listen to Ctrl-C: {0}")]
    Signal(#[from] ctrlc::Error),
}

impl Failure {
    fn exit_code(&self) -> u8 {
        match self {
            Failure::Run(Error::Options(_)) => 2,
            Failure::Run(error) if error.is_cancelled() => 130,
            _ => 1,
        }
    }
}

fn run(args: &Args) -> Result<(), Failure> {
    let options = Options::try_from(args)?;
    let cancel = CancelToken::new();
    let held = cancel.clone();
    ctrlc::set_handler(move || held.cancel())?;
    let bar = bar(!args.no_progress);
    let outcome = impinge_paper::run(
        &options,
        &Control {
            cancel: &cancel,
            progress: &|progress| {
                if bar.message() != progress.what {
                    bar.set_message(progress.what.to_owned());
                }
                bar.set_length(progress.total as u64);
                bar.set_position(progress.done as u64);
            },
        },
    );
    bar.finish_and_clear();
    let outcome = outcome?;
    outcome.write(&args.out)?;
    let report = args.out.join("report.md");
    println!(
        "{} surface benchmarks and {} volume benchmarks: {}",
        outcome.report.surfaces.len(),
        outcome.report.volumes.len(),
        report.display()
    );
    match outcome.report.n_disagreements() {
        0 => Ok(()),
        n => Err(Failure::Disagreements { n, report }),
    }
}

/// A progress bar on standard error, if that is a terminal and a bar is requested.
fn bar(is_wanted: bool) -> ProgressBar {
    if !(is_wanted && stderr().is_terminal()) {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len}")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(0).with_style(style)
}
