//! Checks of many meshes, and tiles: what the modules `impinge._check` and `impinge.tiles` are made
//! of.

use std::ffi::OsString;
use std::path::PathBuf;
use std::process::Command;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use impinge::{Backend, CancelToken, Control, Precision, Settings, SharedVertex, Start};
use impinge_check::{
    Finding, FixError, FixOptions, Limits, Options, Pool, PoolError, Repair, Report, Row,
    apply_limits, fix_mesh, serve,
};
use impinge_io::{Column, Elements, Holds, Mesh, Positions, TableFormat};
use impinge_tiles::{Ask, Error, Plan, PlanOptions, RunOptions, ScatterOptions};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::{PyOSError, PyRuntimeError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::arrays::{PositionArray, Rows, index_rows, positions_array};
use crate::errors::{Cancelled, invalid, raise, raise_as};
use crate::settings::{Argument, WHICH, choose_one, flags, length, number, words};

/// How often Python gets a look while work goes on in another thread.
const INTERVAL: Duration = Duration::from_millis(50);

/// Runs `work` in a thread of its own, with the interpreter released, and hands what it sends to
/// `each` here. Ctrl-C and exceptions of `each` cancel the work, which is waited for.
fn watched<M: Send, T: Send>(
    py: Python<'_>,
    mut each: impl FnMut(Python<'_>, M) -> PyResult<()> + Send,
    work: impl FnOnce(&CancelToken, &(dyn Fn(M) + Sync)) -> T + Send,
) -> PyResult<T> {
    let cancel = CancelToken::new();
    py.detach(|| {
        std::thread::scope(|scope| {
            let (sender, messages) = channel();
            let sender = std::sync::Mutex::new(sender);
            let token = &cancel;
            let worker = scope.spawn(move || {
                let send = |message| {
                    let sender = sender
                        .lock()
                        .unwrap_or_else(std::sync::PoisonError::into_inner);
                    // Nobody listens any more once an exception was raised.
                    let _ = sender.send(message);
                };
                work(token, &send)
            });
            let mut raised = None;
            loop {
                let looked = match messages.recv_timeout(INTERVAL) {
                    Ok(message) => Python::attach(|py| {
                        py.check_signals()?;
                        each(py, message)
                    }),
                    Err(RecvTimeoutError::Timeout) => Python::attach(|py| py.check_signals()),
                    Err(RecvTimeoutError::Disconnected) => break,
                };
                if let Err(error) = looked {
                    raised = Some(error);
                    cancel.cancel();
                    break;
                }
            }
            let done = worker
                .join()
                .unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            match raised {
                Some(error) => Err(error),
                None => Ok(done),
            }
        })
    })
}

/// Checks meshes in child processes and hands each row, as JSON, to ``row(number, json)``.
#[pyfunction]
pub fn _check(
    py: Python<'_>,
    paths: Vec<PathBuf>,
    command: Vec<OsString>,
    jobs: usize,
    #[pyo3(from_py_with = flags::weld)] weld: bool,
    timeout: Argument<'_, '_>,
    row: Py<PyAny>,
) -> PyResult<()> {
    let timeout = timeout.map(|given| {
        Duration::try_from_secs_f64(number(given, "timeout")?)
            .map_err(|error| invalid(format!("timeout: {error}")))
    });
    let timeout = timeout.transpose()?;
    let start = || {
        let mut child = Command::new(&command[0]);
        child.args(&command[1..]);
        child
    };
    let pool = Pool {
        command: &start,
        jobs,
        timeout,
        weld,
    };
    let each = |py: Python<'_>, (ix, json): (usize, String)| row.call1(py, (ix, json)).map(drop);
    let ran = watched(py, each, |cancel, send| {
        pool.run(&paths, cancel, |ix, row| {
            send((ix, row.to_json().to_string()))
        })
    })?;
    ran.map_err(|error| match error {
        PoolError::Cancelled => Cancelled::new_err("the check was cancelled"),
        error => PyRuntimeError::new_err(error.to_string()),
    })
}

/// Vertices, faces, and what was done as a line of JSON.
type FixedArrays<'py> = (Bound<'py, PyAny>, Bound<'py, PyArray2<u32>>, String);

/// Mends a mesh; `only` names the repairs.
#[pyfunction]
pub fn _fix<'py>(
    py: Python<'py>,
    vertices: &Bound<'py, PyAny>,
    faces: &Bound<'py, PyAny>,
    only: Vec<String>,
    close_holes: usize,
    threads: usize,
) -> PyResult<FixedArrays<'py>> {
    let positions = PositionArray::new(vertices, "vertices")?;
    let (indices, _) = index_rows(faces, "faces", &[3], positions.len())?;
    let mesh = Mesh {
        positions: match positions.rows()? {
            Rows::F32(rows) => Positions::F32(rows.to_vec()),
            Rows::F64(rows) => Positions::F64(rows.to_vec()),
        },
        elements: Elements::Triangles(indices.as_chunks().0.to_vec()),
    };
    let named = |repair: &Repair| only.iter().any(|name| name == repair.name());
    let options = FixOptions {
        repairs: Repair::ALL.into_iter().filter(named).collect(),
        close_holes,
        threads,
    };
    let fixed = py
        .detach(|| fix_mesh(mesh, &options))
        .map_err(|error| match error {
            FixError::Refused(source) => raise(source),
            other => invalid(other.to_string()),
        })?;
    let row = |counts, places: &[_], is_welded| {
        let row = Row {
            path: String::new(),
            is_welded,
            result: Ok(counts),
            places: places.to_vec(),
            marks: None,
            notes: Vec::new(),
        };
        let mut row = row.to_json();
        row.as_object_mut().map(|row| row.remove("path"));
        row
    };
    let numbers = |repair: Repair| {
        let numbers = fixed.numbers(repair).into_iter();
        let numbers = numbers.map(|(name, n)| (name.to_owned(), n.into()));
        (
            repair.name().to_owned(),
            serde_json::Value::Object(numbers.collect()),
        )
    };
    let welds = options.repairs.contains(&Repair::Weld);
    let done = serde_json::json!({
        "repairs": options.repairs.iter().copied().map(numbers).collect::<serde_json::Map<_, _>>(),
        "seams": fixed.has_seams(),
        "before": row(fixed.before, &fixed.places_before, welds),
        "after": row(fixed.after, &fixed.places_after, false),
    });
    let held = match fixed.mesh.positions {
        Positions::F32(positions) => positions.into(),
        Positions::F64(positions) => positions.into(),
    };
    let faces = match fixed.mesh.elements {
        Elements::Triangles(faces) => faces,
        // Meshes of triangles stay what they are.
        Elements::Tetrahedra(_) => Vec::new(),
    };
    let n = faces.len();
    let faces = PyArray1::from_vec(py, faces.into_flattened()).reshape([n, 3])?;
    Ok((positions_array(py, &held)?, faces, done.to_string()))
}

/// A report about rows, each as JSON: ``text``, ``github``, ``markdown``, or a table as ``csv`` or
/// ``jsonl``; and why the run fails: a message, and whether a mesh has what ``fail_on`` names.
#[pyfunction]
pub fn _report(
    rows: Vec<String>,
    fail_on: Vec<String>,
    format: &str,
) -> PyResult<(String, Option<(String, bool)>)> {
    let read = |row: &String| Row::from_json(&serde_json::from_str(row).ok()?);
    let rows: Option<Vec<Row>> = rows.iter().map(read).collect();
    let rows = rows.ok_or_else(|| invalid("rows: one of them is no row of a check"))?;
    let fail_on: Result<Vec<Finding>, String> = fail_on.iter().map(|name| name.parse()).collect();
    let report = Report {
        rows: &rows,
        fail_on: &fail_on.map_err(invalid)?,
    };
    let table = |format| String::from_utf8_lossy(&report.table(format)).into_owned();
    let text = match format {
        "github" => report.github(),
        "markdown" => report.markdown(),
        "csv" => table(TableFormat::Csv),
        "jsonl" => table(TableFormat::Jsonl),
        _ => report.text(),
    };
    let failed = report.failure();
    Ok((
        text,
        failed.map(|failed| (failed.message, failed.is_finding)),
    ))
}

/// The names of what a check can fail on.
#[pyfunction]
pub fn _findings() -> Vec<&'static str> {
    Finding::ALL.map(Finding::name).to_vec()
}

/// The columns of a table of meshes: their names, and what they hold.
#[pyfunction]
pub fn _check_columns() -> Vec<(&'static str, &'static str)> {
    let of = |column: Column| {
        let holds = match column.holds {
            Holds::Line => "text",
            Holds::Bool => "flag",
            Holds::Count => "count",
            _ => "number",
        };
        (column.name, holds)
    };
    Row::COLUMNS.map(of).to_vec()
}

/// The child's side of `_check`: answers paths on standard input by rows on standard output.
#[pyfunction]
pub fn _serve_check(
    py: Python<'_>,
    weld: bool,
    threads: usize,
    memory: Option<u64>,
    min_thickness: Option<f64>,
) -> PyResult<()> {
    let options = Options {
        weld,
        threads,
        min_thickness,
        ..Options::default()
    };
    py.detach(|| {
        apply_limits(&Limits { memory })?;
        serve(std::io::stdin().lock(), std::io::stdout().lock(), &options)
    })
    .map_err(PyErr::from)
}

fn refuse(error: Error) -> PyErr {
    match error {
        Error::Cancelled => Cancelled::new_err("the step was cancelled; what is done stays done"),
        Error::Io { .. } => PyOSError::new_err(error.to_string()),
        Error::Detection { tile, source } => match source {
            impinge::Error::Cancelled => raise(impinge::Error::Cancelled),
            source => {
                let message = format!("tile {tile}: {source}");
                raise_as(source, message)
            }
        },
        error => invalid(error.to_string()),
    }
}

fn call_progress(py: Python<'_>, progress: Option<&Py<PyAny>>, at: (u64, u64)) -> PyResult<()> {
    match progress {
        Some(progress) => progress.call1(py, at).map(drop),
        None => Ok(()),
    }
}

/// `impinge.tiles.plan`.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
pub fn _tiles_plan<'py>(
    py: Python<'py>,
    folder: PathBuf,
    files: Vec<PathBuf>,
    cap: u64,
    chunk: u64,
    #[pyo3(from_py_with = flags::weld)] weld: bool,
    #[pyo3(from_py_with = flags::step)] step: bool,
    separation: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = flags::replace)] replace: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let options = PlanOptions {
        cap,
        chunk,
        weld,
        step,
        separation: length(separation, "separation")?,
        cells: None,
        replace,
    };
    let each = |py: Python<'_>, at| call_progress(py, progress.as_ref(), at);
    let plan = watched(py, each, |cancel, send| {
        Plan::make(&folder, &files, &options, cancel, &mut |done, total| {
            send((done, total));
        })
    })?
    .map_err(refuse)?;
    describe(py, &plan)
}

/// `impinge.tiles.describe`.
#[pyfunction]
pub fn _tiles_describe(py: Python<'_>, folder: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    describe(py, &Plan::open(&folder).map_err(refuse)?)
}

fn describe<'py>(py: Python<'py>, plan: &Plan) -> PyResult<Bound<'py, PyDict>> {
    let files = plan.files().iter().map(|file| file.path.clone());
    let n: u64 = plan.files().iter().map(|file| file.n_elements).sum();
    let all = PyDict::new(py);
    all.set_item("plan", format!("{:016x}", plan.id()))?;
    all.set_item("files", PyList::new(py, files)?)?;
    all.set_item("step", plan.is_step())?;
    all.set_item("separation", plan.separation())?;
    all.set_item("elements", n)?;
    all.set_item("tiles", plan.n_tiles())?;
    all.set_item("units", plan.n_units())?;
    Ok(all)
}

/// `impinge.tiles.scatter`.
#[pyfunction]
pub fn _tiles_scatter(
    py: Python<'_>,
    folder: PathBuf,
    rank: usize,
    world_size: usize,
    threads: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'_, PyDict>> {
    let options = ScatterOptions {
        rank,
        world_size,
        threads,
    };
    let plan = Plan::open(&folder).map_err(refuse)?;
    let each = |py: Python<'_>, at| call_progress(py, progress.as_ref(), at);
    let scattered = watched(py, each, |cancel, send| {
        plan.scatter(&options, cancel, &|done, total| send((done, total)))
    })?
    .map_err(refuse)?;
    let all = PyDict::new(py);
    all.set_item("written", scattered.n_written)?;
    all.set_item("kept", scattered.n_kept)?;
    all.set_item("elements", scattered.n_elements)?;
    all.set_item("records", scattered.n_records)?;
    Ok(all)
}

/// `impinge.tiles.run`.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
pub fn _tiles_run<'py>(
    py: Python<'py>,
    folder: PathBuf,
    tiles: Vec<u32>,
    which: &Bound<'_, PyAny>,
    shared_vertex: &Bound<'_, PyAny>,
    start: &Bound<'_, PyAny>,
    precision: &Bound<'_, PyAny>,
    threads: usize,
    memory_budget: Option<u64>,
    #[pyo3(from_py_with = flags::again)] again: bool,
    done: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyList>> {
    let [between, within] = choose_one(which, "which", &WHICH)?;
    let options = RunOptions {
        ask: Ask {
            between,
            within,
            shared_vertex: choose_one(shared_vertex, "shared_vertex", words!(SharedVertex))?,
            start: choose_one(start, "start", words!(Start))?,
            precision: choose_one(precision, "precision", words!(Precision))?,
        },
        settings: Settings::new()
            .backend(Backend::Cpu)
            .threads(threads)
            .memory_budget(memory_budget),
        again,
    };
    let plan = Plan::open(&folder).map_err(refuse)?;
    let mut results = Vec::new();
    let each = |py: Python<'_>, result| {
        results.push(result);
        match &done {
            Some(done) => done.call0(py).map(drop),
            None => Ok(()),
        }
    };
    watched(py, each, |cancel, send| {
        let control = Control::new().cancel(cancel);
        plan.run(tiles, &options, control, &mut |result| send(result.clone()))
    })?
    .map_err(refuse)?;
    let rows = results.iter().map(|result: &impinge_tiles::TileResult| {
        let row = PyDict::new(py);
        row.set_item("tile", result.tile)?;
        row.set_item("elements", result.n_elements)?;
        row.set_item("pairs", result.n_pairs)?;
        row.set_item("hash", format!("{:016x}", result.hash))?;
        row.set_item("elsewhere", result.n_elsewhere)?;
        row.set_item("pieces", result.n_pieces)?;
        row.set_item("kept", result.was_kept)?;
        Ok(row)
    });
    PyList::new(py, rows.collect::<PyResult<Vec<_>>>()?)
}

/// `impinge.tiles.merge`.
#[pyfunction]
pub fn _tiles_merge(py: Python<'_>, folder: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let plan = Plan::open(&folder).map_err(refuse)?;
    let nothing = |_: Python<'_>, ()| Ok(());
    let merged = watched(py, nothing, |_, _| plan.merge())?.map_err(refuse)?;
    let all = PyDict::new(py);
    all.set_item("pairs", merged.n_pairs)?;
    all.set_item("hash", format!("{:016x}", merged.hash))?;
    all.set_item("asked", merged.asked)?;
    all.set_item("tiles", plan.n_tiles())?;
    all.set_item("records", merged.n_records)?;
    all.set_item("uncut_tiles", merged.n_uncut)?;
    all.set_item("rows", merged.rows)?;
    if let Some(step) = merged.step {
        let kinds = PyDict::new(py);
        for (kind, n) in step.kinds {
            kinds.set_item(kind.name(), n)?;
        }
        let earliest = step
            .earliest
            .map(|(kind, [body_a, a, body_b, b], toi)| (kind.name(), (body_a, a, body_b, b), toi));
        all.set_item("kinds", kinds)?;
        all.set_item("touching_at_start", step.touching_at_start)?;
        all.set_item("earliest", earliest)?;
    }
    Ok(all)
}
