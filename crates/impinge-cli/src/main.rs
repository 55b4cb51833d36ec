//! The program `impinge`: the library from the command line.

mod apart;
mod args;
mod asked;
mod colors;
mod commands;
mod contacts;
mod detection;
mod error;
mod files;
mod headline;
mod load;
mod meshes;
mod one_mesh;
mod origins;
mod output;
mod palette;
mod picture;
mod regions;
mod report;
mod rows;
mod stop;
mod text;
mod values;
mod watch;

use std::process::ExitCode;

use crate::args::Command;
use crate::error::Error;

fn main() -> ExitCode {
    #[cfg(all(feature = "gpu", target_os = "linux"))]
    keep_mesa_quiet();
    let cli = args::parse();
    let listening = stop::cancel_on_signal().map_err(Error::Signal);
    let result = listening.and_then(|cancel| match cli.command {
        Command::Demo(args) => commands::demo(&args, &cancel),
        Command::Distance(args) => commands::distance(&args, &cancel),
        Command::Near(args) => commands::near(&args, &cancel),
        Command::Safe(args) => commands::safe(&args, &cancel),
        Command::Probe(args) => commands::probe(&args, &cancel),
        Command::Cast(args) => commands::cast(&args, &cancel),
        Command::Pairs(args) => commands::pairs(&args, &cancel),
        Command::Within(args) => commands::within(&args, &cancel),
        Command::Sequence(args) => commands::sequence(&args, &cancel),
        Command::Step(args) => commands::step(&args, &cancel),
        Command::Check(args) => commands::check(&args, &cancel),
        Command::Fix(args) => commands::fix(&args),
        Command::CheckWorker(args) => commands::check_worker(&args),
        Command::Tiles(args) => commands::tiles(&args, &cancel),
        Command::Render(args) => commands::render(&args, &cancel),
        #[cfg(feature = "view")]
        Command::View(args) => commands::view(&args, &cancel),
        #[cfg(feature = "gpu")]
        Command::Devices(args) => commands::devices(&args),
        #[cfg(not(feature = "view"))]
        Command::View(_) => Err(Error::NotBuilt("the window", "view", ", with Rust 1.95")),
        #[cfg(not(feature = "gpu"))]
        Command::Devices(_) => Err(Error::NotBuilt("the GPU backend", "gpu", "")),
    });
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let code = error.exit_code();
            if !error.is_silent() {
                stop::say(&error.line());
            }
            ExitCode::from(code)
        }
    }
}

/// Without a desktop session, a Vulkan layer of Mesa complains on standard error that it finds no
/// display by which to choose a GPU. The program chooses the GPU itself, so the layer is switched
/// off.
#[cfg(all(feature = "gpu", target_os = "linux"))]
fn keep_mesa_quiet() {
    if std::env::var_os("XDG_RUNTIME_DIR").is_none() {
        // SAFETY: the program has just started, so no other thread can read the environment.
        unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
    }
}
