//! `impinge check`: checks one mesh, or a million.

mod args;
mod assembly;
mod ending;
mod html;
mod relations;
mod rows;
mod shown;

use std::collections::BTreeMap;
use std::io::{self, BufRead, ErrorKind, Write, stdin, stdout};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use impinge::CancelToken;
use impinge_check::{
    Finding, Options, Pool, PoolError, Report, Row, RowStore, apply_limits, serve,
};
use impinge_io::printable;

pub use self::args::{CHECK_EXAMPLES, CheckArgs, CheckWorkerArgs, FailOn};
pub use self::ending::{fail, quoted};
use crate::apart::Inputs;
use crate::error::Error;
use crate::load::{STDIN, tell};
use crate::output;
use crate::stop::Patience;
use crate::text::grouped;
use crate::watch::Watch;

/// `impinge check`.
pub fn check(args: &CheckArgs, cancel: &CancelToken) -> Result<(), Error> {
    if args.meshes.iter().any(|path| path == Path::new(STDIN)) {
        let text = "-: check reads meshes from files only, not from standard input";
        return Err(Error::Usage(text.to_owned()));
    }
    if args.assembly || args.clearance.is_some() {
        return assembly::check(args, cancel);
    }
    assembly::refuse_alone(args)?;
    let paths = paths(args)?;
    let inputs = Inputs::new(paths.iter().chain(&args.list));
    if let Some(file) = &args.rows {
        rows::refuse(file)?;
        inputs.check("--rows", &file.path)?;
    }
    for (option, path) in args.outputs() {
        inputs.check(option, path)?;
    }
    if args.keep_seams && matches!(args.out, Some(args::Out::Folder(_))) {
        // Rows do not say by which of the two rules an unwelded mesh was checked.
        let text = "--keep-seams: its rows are printed, not kept in a folder: use --json";
        return Err(Error::Usage(text.to_owned()));
    }
    if args.min_thickness.is_some() && matches!(args.out, Some(args::Out::Folder(_))) {
        // A run that goes on in the folder could ask for another thickness.
        let text = "--min-thickness: its rows are printed, not kept in a folder: use --json";
        return Err(Error::Usage(text.to_owned()));
    }
    if args.fail_on.contains(&FailOn::Mesh(Finding::Thin)) && args.min_thickness.is_none() {
        let text = "--fail-on thin: --min-thickness T says how thin";
        return Err(Error::Usage(text.to_owned()));
    }
    let mine: Vec<usize> = share(args, paths.len()).collect();
    let watch = Watch::things(
        !args.no_progress,
        mine.len(),
        "meshes",
        args.json || args.format != args::Format::Text,
    );
    let mut rows = match &args.out {
        Some(args::Out::Folder(folder)) => kept(args, folder, &paths, &watch, cancel)?,
        _ => {
            let mut rows = Ordered::new(args.json, &mine);
            run((args, args.keep_seams), &paths, &mine, cancel, |ix, row| {
                watch.frame_done();
                rows.put(ix, row)
            })?;
            rows.finish()
        }
    };
    drop(watch);
    for row in &rows {
        tell(&row.path, &row.notes);
    }
    if args.shows() {
        mark(args, &mut rows, cancel)?;
    }
    if let Some(args::Out::Mesh(file)) = &args.out {
        shown::write_mesh(file, &rows)?;
    }
    let fail_on = FailOn::findings(&args.fail_on);
    let report = Report {
        rows: &rows,
        fail_on: &fail_on,
    };
    if !args.json {
        let text = match args.format {
            args::Format::Text => report.text(),
            args::Format::Sarif => format!("{}\n", report.sarif(env!("CARGO_PKG_VERSION"))),
            args::Format::Junit => report.junit(),
            args::Format::Github => report.github(),
        };
        output::out().write_all(text.as_bytes())?;
        if args.format == args::Format::Text {
            if matches!(args.out, Some(args::Out::Mesh(_))) {
                shown::print_legend()?;
            }
            let keeps = seams_keep_apart(args, &rows, cancel)?;
            ending::print_next(&rows, keeps, args)?;
        }
    }
    if let Some(file) = &args.rows {
        rows::write(file, &rows)?;
    }
    if let Some(path) = &args.summary {
        append(path, &report.markdown())?;
    }
    if let Some(file) = &args.html {
        html::write(&file.path, &report, args)?;
        say_wrote(&file.path, args)?;
    }
    // The picture comes last, so that the answer is printed even without an adapter.
    if let Some(png) = &args.png {
        shown::draw(&png.path, &rows, args)?;
        say_wrote(&png.path, args)?;
    }
    ending::fail(&report)
}

/// Names a file that was written, where people read the answer.
fn say_wrote(path: &Path, args: &CheckArgs) -> Result<(), Error> {
    if !args.json && args.format == args::Format::Text {
        writeln!(output::out(), "wrote {}", printable(path))?;
    }
    Ok(())
}

/// Appends text to a file: each step of a workflow adds to its summary.
fn append(path: &Path, text: &str) -> Result<(), Error> {
    let mut file = std::fs::OpenOptions::new();
    let opened = file.append(true).create(true).open(path);
    let written = opened.and_then(|mut file| file.write_all(text.as_bytes()));
    written.map_err(|source| Error::Write {
        path: path.to_owned(),
        source,
    })
}

/// `impinge check-worker`.
pub fn check_worker(args: &CheckWorkerArgs) -> Result<(), Error> {
    let limits = impinge_check::Limits {
        memory: args.memory,
    };
    apply_limits(&limits)?;
    let options = Options {
        weld: !args.no_weld && !args.keep_seams,
        keep_seams: args.keep_seams,
        places: args.places,
        faces: args.faces,
        min_thickness: args.min_thickness,
        marks: args.marks,
        threads: args.threads,
    };
    match serve(stdin().lock(), stdout().lock(), &options) {
        // The process that asked is gone, and nobody waits for the rows.
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        served => Ok(served?),
    }
}

/// The meshes of the command line and of the list.
fn paths(args: &CheckArgs) -> Result<Vec<PathBuf>, Error> {
    let mut paths = args.meshes.clone();
    if let Some(list) = &args.list {
        let read = |source| Error::Read {
            path: list.clone(),
            source,
        };
        let lines: Box<dyn BufRead> = if list == Path::new("-") {
            Box::new(stdin().lock())
        } else {
            let file = std::fs::File::open(list).map_err(read)?;
            Box::new(std::io::BufReader::new(file))
        };
        for (ix, line) in lines.split(b'\n').enumerate() {
            let line = line.map_err(read)?;
            // Some editors put a byte order mark before UTF-8.
            let mark: &[u8] = if ix == 0 { b"\xef\xbb\xbf" } else { b"" };
            let line = line.strip_prefix(mark).unwrap_or(&line);
            let line = line.strip_suffix(b"\r").unwrap_or(line);
            if !matches!(line.trim_ascii_start(), [] | [b'#', ..]) {
                paths.push(path_of(line).map_err(read)?);
            }
        }
    }
    if let (Some(list), true) = (&args.list, paths.is_empty()) {
        let text = format!("--list {}: it names no mesh", printable(list));
        return Err(Error::Usage(text));
    }
    if args.rank >= args.world_size.get() {
        return Err(Error::Usage(format!(
            "--rank {} of --world-size {}: ranks start at 0",
            args.rank, args.world_size
        )));
    }
    Ok(paths)
}

/// A path of a list, of any bytes where the system has such names.
#[cfg(unix)]
fn path_of(line: &[u8]) -> io::Result<PathBuf> {
    use std::os::unix::ffi::OsStrExt;
    Ok(std::ffi::OsStr::from_bytes(line).into())
}

/// A path of a list.
#[cfg(not(unix))]
fn path_of(line: &[u8]) -> io::Result<PathBuf> {
    let text = std::str::from_utf8(line);
    let text = text.map_err(|error| io::Error::new(ErrorKind::InvalidData, error))?;
    Ok(text.into())
}

/// The numbers of this process's meshes: whole batches, dealt to processes in turn.
fn share(args: &CheckArgs, n: usize) -> impl Iterator<Item = usize> {
    let (batch, rank, world_size) = (args.batch.get(), args.rank, args.world_size.get());
    (0..n).filter(move |ix| ix / batch % world_size == rank)
}

/// Checks the meshes numbered `wanted`.
fn run(
    (args, keep_seams): (&CheckArgs, bool),
    paths: &[PathBuf],
    wanted: &[usize],
    cancel: &CancelToken,
    mut put: impl FnMut(usize, Row) -> Result<(), Error>,
) -> Result<(), Error> {
    let n_cores = std::thread::available_parallelism().map_or(1, usize::from);
    let jobs = args
        .jobs
        .map_or(n_cores, usize::from)
        .clamp(1, wanted.len().max(1));
    let threads = (n_cores / jobs).max(1);
    let program = std::env::current_exe()?;
    let command = || {
        let mut command = Command::new(&program);
        command
            .arg("check-worker")
            .arg("--threads")
            .arg(threads.to_string());
        if args.no_weld {
            command.arg("--no-weld");
        }
        if keep_seams {
            command.arg("--keep-seams");
        }
        command.arg("--places").arg(args.places.to_string());
        if args.faces {
            command.arg("--faces");
        }
        if let Some(thickness) = args.min_thickness {
            command.arg("--min-thickness").arg(format!("{thickness:?}"));
        }
        if args.shows() {
            command.arg("--marks");
        }
        if let Some(memory) = args.memory {
            command.arg("--memory").arg(memory.to_string());
        }
        command
    };
    let pool = Pool {
        command: &command,
        jobs,
        timeout: args.timeout.map(Duration::from_secs_f64),
        weld: !args.no_weld && !keep_seams,
    };
    let chosen: Vec<PathBuf> = wanted.iter().map(|&ix| paths[ix].clone()).collect();
    // A row that can't be printed or stored stops the run.
    let stop = CancelToken::new();
    let mut result = Ok(());
    let ran = std::thread::scope(|scope| {
        let (done, over) = std::sync::mpsc::channel::<()>();
        let stop_too = &stop;
        scope.spawn(move || {
            while over.recv_timeout(Duration::from_millis(50))
                == Err(std::sync::mpsc::RecvTimeoutError::Timeout)
            {
                if cancel.is_cancelled() {
                    stop_too.cancel();
                }
            }
        });
        let ran = pool.run(&chosen, &stop, |ix, mut row| {
            say_limit(args, &mut row);
            if result.is_ok() {
                result = put(wanted[ix], row);
                if result.is_err() {
                    stop.cancel();
                }
            }
        });
        drop(done);
        ran
    });
    result?;
    match ran {
        Err(PoolError::Cancelled) => Err(impinge::Error::Cancelled.into()),
        other => Ok(other?),
    }
}

/// Says of a mesh for which there was no memory under `--memory` what to do. What the child said is
/// of no use.
fn say_limit(args: &CheckArgs, row: &mut Row) {
    if let (Some(memory), Err(failure)) = (args.memory, &mut row.result)
        && failure.kind == impinge_check::ErrorKind::Memory
    {
        failure.message = format!(
            "it needs more memory than --memory allows, {} bytes: give more, or leave the limit out",
            grouped(memory)
        );
    }
}

/// Marks the rows that an earlier run has kept, which have no marks: their meshes are checked once
/// more, within the same limits. A row whose mesh has another answer now stays as it is.
fn mark(args: &CheckArgs, rows: &mut [Row], cancel: &CancelToken) -> Result<(), Error> {
    let is_bare = |row: &&mut Row| row.result.is_ok() && row.marks.is_none();
    let mut bare: Vec<&mut Row> = rows.iter_mut().filter(is_bare).collect();
    let paths: Vec<PathBuf> = bare.iter().map(|row| PathBuf::from(&row.path)).collect();
    let all: Vec<usize> = (0..paths.len()).collect();
    run((args, args.keep_seams), &paths, &all, cancel, |ix, row| {
        if row.result == bare[ix].result {
            bare[ix].marks = row.marks;
        }
        Ok(())
    })
}

/// Whether the first mesh that `fix` would mend needs no mending if vertices at one position stay
/// apart, as in what `fix` has split. It is checked once more, within the same limits, if that may
/// be: a vertex of a closed mesh belongs to about six faces, one of a soup to one.
fn seams_keep_apart(args: &CheckArgs, rows: &[Row], cancel: &CancelToken) -> Result<bool, Error> {
    let Some(row) = ending::mendable(rows, args).filter(|row| ending::may_have_seams(row)) else {
        return Ok(false);
    };
    let mut keeps = false;
    run(
        (args, true),
        &[PathBuf::from(&row.path)],
        &[0],
        cancel,
        |_, again| {
            keeps = again.result.is_ok() && !ending::is_mendable(&again);
            Ok(())
        },
    )?;
    Ok(keeps)
}

/// Checks the meshes without a row in the folder; returns all rows of this process.
fn kept(
    args: &CheckArgs,
    folder: &Path,
    paths: &[PathBuf],
    watch: &Watch,
    cancel: &CancelToken,
) -> Result<Vec<Row>, Error> {
    let share = (args.rank, args.world_size.get());
    let batch = args.batch.get();
    let mut store = RowStore::open(folder, paths, !args.no_weld, batch, share, args.retry)?;
    let missing = store.missing();
    let mut printed = Ordered::new(args.json, &share_of(args, paths.len()));
    for (ix, row) in store.rows() {
        watch.frame_done();
        printed.put(ix, row.clone())?;
    }
    // A request to stop waits until all finished rows are written.
    let _patience = Patience::new();
    let ran = run(
        (args, args.keep_seams),
        paths,
        &missing,
        cancel,
        |ix, row| {
            watch.frame_done();
            printed.put(ix, row.clone())?;
            Ok(store.put(ix, row)?)
        },
    );
    store.flush()?;
    ran?;
    Ok(printed.finish())
}

fn share_of(args: &CheckArgs, n: usize) -> Vec<usize> {
    share(args, n).collect()
}

/// Rows in the order of the list, printed as soon as all before them are there.
struct Ordered {
    prints: bool,
    /// The place of each mesh in this process's share.
    places: BTreeMap<usize, usize>,
    rows: Vec<Option<Row>>,
    n_printed: usize,
}

impl Ordered {
    fn new(prints: bool, meshes: &[usize]) -> Self {
        Ordered {
            prints,
            places: meshes
                .iter()
                .enumerate()
                .map(|(place, &ix)| (ix, place))
                .collect(),
            rows: vec![None; meshes.len()],
            n_printed: 0,
        }
    }

    fn put(&mut self, ix: usize, row: Row) -> Result<(), Error> {
        if let Some(&place) = self.places.get(&ix) {
            self.rows[place] = Some(row);
        }
        while let Some(Some(row)) = self.rows.get(self.n_printed) {
            if self.prints {
                let mut to = output::out();
                writeln!(to, "{}", row.to_json())?;
                to.flush()?;
            }
            self.n_printed += 1;
        }
        Ok(())
    }

    fn finish(self) -> Vec<Row> {
        self.rows.into_iter().flatten().collect()
    }
}
