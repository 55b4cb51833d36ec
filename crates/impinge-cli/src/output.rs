//! Text output.

use std::io::{self, StdoutLock, Write, stderr, stdout};

use comfy_table::{CellAlignment, Table, presets};
use impinge::{BodyId, Pairs, Scene, Stats};
use impinge_io::printable;

use crate::detection::Times;
use crate::error::Error;
use crate::text::{counted, grouped, hash, shown_bytes};
use crate::values::RowsFile;

/// Standard output. Its reader may close it when it has what it wanted (`| head`): what is written
/// then goes nowhere. Files are still written, and the exit code is that of the whole answer.
pub struct Out(StdoutLock<'static>);

/// Standard output.
pub fn out() -> Out {
    Out(stdout().lock())
}

impl Write for Out {
    fn write(&mut self, text: &[u8]) -> io::Result<usize> {
        unless_closed(self.0.write(text), text.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        unless_closed(self.0.flush(), ())
    }
}

fn unless_closed<T>(done: io::Result<T>, closed: T) -> io::Result<T> {
    match done {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(closed),
        done => done,
    }
}

/// Prints the text of an answer: on standard error, if its rows have standard output.
pub fn say(text: &[u8], rows: Option<&RowsFile>) -> Result<(), Error> {
    if rows.is_some_and(RowsFile::is_stdout) {
        // If standard error is closed, nobody reads the summary.
        let _ = stderr().write_all(text);
        return Ok(());
    }
    Ok(out().write_all(text)?)
}

/// How an answer was found, in one line:
/// `clusters on cpu, 2 threads; 10 candidates, 0 unsure; 0.365 ms`.
pub fn how(stats: &Stats, times: &Times) -> String {
    let of = match times.n_frames() {
        1 => String::new(),
        n => format!(", median of {n}"),
    };
    format!("{}; {:.3} ms{of}", method(stats), times.total_ms(50))
}

/// The same of a question that counts no candidates: `on cpu, 2 threads; 0.365 ms`.
pub fn how_alone(stats: &Stats, ms: f64) -> String {
    let threads = counted(stats.n_threads as u64, "thread");
    format!("on {}, {threads}; {ms:.3} ms", stats.backend)
}

fn method(stats: &Stats) -> String {
    format!(
        "{} on {}, {}; {}, {} unsure",
        stats.method,
        stats.backend,
        counted(stats.n_threads as u64, "thread"),
        counted(stats.n_candidates, "candidate"),
        grouped(stats.n_unsure),
    )
}

/// A table without lines; the columns in `text` are aligned left, all others right.
pub fn table(
    header: &[&str],
    text: &[usize],
    rows: impl IntoIterator<Item = Vec<String>>,
) -> String {
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    table.set_header(header.to_vec());
    table.add_rows(rows);
    for (ix, column) in table.column_iter_mut().enumerate() {
        column.set_padding((0, 2));
        if !text.contains(&ix) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table.trim_fmt()
}

/// Prints bodies, stages, counters and the hash.
pub fn print_details(
    to: &mut impl Write,
    scene: &Scene,
    bodies: &[(BodyId, &str)],
    pairs: &Pairs,
    times: &Times,
) -> Result<(), Error> {
    writeln!(to, "\n{}\n", body_table(scene, bodies, pairs)?)?;
    writeln!(to, "{}\n", stage_table(times))?;
    print_summary(to, pairs)?;
    Ok(())
}

/// One row per body.
pub fn body_table(
    scene: &Scene,
    bodies: &[(BodyId, &str)],
    pairs: &Pairs,
) -> Result<String, Error> {
    let mut rows = Vec::with_capacity(bodies.len());
    for (ix, &(id, name)) in bodies.iter().enumerate() {
        let body = scene.body(id)?;
        rows.push(vec![
            ix.to_string(),
            printable(name),
            body.kind().name().to_owned(),
            grouped(body.n_elements() as u64),
            grouped(body.n_vertices() as u64),
            grouped(pairs.colliding(id).len() as u64),
        ]);
    }
    let header = ["body", "name", "kind", "elements", "vertices", "colliding"];
    Ok(table(&header, &[1, 2], rows))
}

/// One row per stage, with the median over the frames.
pub fn stage_table(times: &Times) -> String {
    let shown = |ms: f64| format!("{ms:.3}");
    let rows = times
        .stages_ms()
        .map(|(name, ms)| vec![name.to_owned(), shown(ms)])
        .chain([vec!["total".to_owned(), shown(times.total_ms(50))]]);
    let ms = match times.n_frames() {
        1 => "ms".to_owned(),
        n => format!("ms, median of {n}"),
    };
    table(&["stage", &ms], &[0], rows)
}

fn print_summary(to: &mut impl Write, pairs: &Pairs) -> io::Result<()> {
    let stats = pairs.stats();
    writeln!(
        to,
        "{}, hash {}",
        counted(pairs.len() as u64, "pair"),
        hash(pairs)
    )?;
    writeln!(
        to,
        "{}; {} held",
        method(stats),
        shown_bytes(stats.bytes_held)
    )
}
