//! `impinge.Detector`: settings, questions, the run.

use std::sync::atomic::{AtomicU32, Ordering};

use impinge::{Control, Query};
use pyo3::exceptions::{PyRuntimeError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBool;

use crate::errors::raise;
use crate::result::{Answer, Asked};
use crate::scene::Scene;
use crate::settings::{Argument, Told, shared_vertex, unexpected};
use crate::watch::{CancelToken, Watch};

/// Finds intersecting pairs, frame after frame. Scratch memory lives here and is used again.
///
/// The pairs depend on the scene alone: not on method, backend, threads, memory or any other
/// setting.
///
/// Parameters
/// ----------
/// method : {"clusters", "cells", "naive"}
///     How candidates are found. ``"clusters"``: groups fixed by topology, the fast one.
///     ``"cells"``: the two-level grid of the paper. ``"naive"``: every box against every box,
///     the oracle.
/// backend : {"auto", "cpu", "gpu"}
///     Where. ``"auto"`` takes a GPU where there is one.
/// device : str, optional
///     Part of a GPU's name, to choose among several.
/// threads : int, optional
///     CPU threads; by default one a core.
/// memory_budget : int, optional
///     Bytes that the detector may hold besides the answer; by default as many as it takes.
/// lambda_ : float
///     ``"cells"``: the density coefficient of the paper's equation (1), above 0.
/// group_size : int
///     ``"cells"``: the most primitives a group may hold, 1 to 64.
/// recluster : {"auto", "never"}
///     ``"clusters"``: whether a body that has flowed far from its rest pose is clustered anew.
/// instruction_set : {"avx512", "avx2", "portable"}
///     The widest vector instructions that the CPU may use, where it has them.
///
/// Raises
/// ------
/// ValueError
///     A setting out of its range.
/// RuntimeError
///     No GPU for ``backend="gpu"``, or threads that do not start.
///
/// Examples
/// --------
/// >>> import impinge
/// >>> impinge.Detector(method="cells", threads=1)
/// Detector(method="cells", backend="auto", threads=1)
#[pyclass(module = "impinge")]
pub struct Detector {
    inner: impinge::Detector,
}

#[pymethods]
impl Detector {
    #[new]
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    #[pyo3(
        signature = (
            method=None, backend=None, device=None, threads=None, memory_budget=None, *,
            lambda_=None, group_size=None, recluster=None, instruction_set=None,
        ),
        text_signature = "(method=\"clusters\", backend=\"auto\", device=None, threads=None, \
                          memory_budget=None, *, lambda_=1.0, group_size=64, \
                          recluster=\"auto\", instruction_set=\"avx512\")"
    )]
    fn new(
        py: Python<'_>,
        method: Argument<'_, '_>,
        backend: Argument<'_, '_>,
        device: Argument<'_, '_>,
        threads: Argument<'_, '_>,
        memory_budget: Argument<'_, '_>,
        lambda_: Argument<'_, '_>,
        group_size: Argument<'_, '_>,
        recluster: Argument<'_, '_>,
        instruction_set: Argument<'_, '_>,
    ) -> PyResult<Self> {
        check_process()?;
        let told = Told {
            method,
            backend,
            device,
            threads,
            memory_budget,
            lambda: lambda_,
            group_size,
            recluster,
            instruction_set,
        };
        let settings = told.settings()?;
        // Looking for a GPU and starting threads takes a while.
        let inner = py.detach(|| impinge::Detector::with_settings(settings));
        Ok(Detector {
            inner: inner.map_err(raise)?,
        })
    }

    /// Finds all pairs that are asked for, as things are in the scene now.
    ///
    /// Without `between` and `within`, the pairs of all different bodies whose filters let them
    /// meet. The interpreter is released meanwhile, and Ctrl-C stops a long run.
    ///
    /// Parameters
    /// ----------
    /// scene : Scene
    /// between : (Body, Body) or True, optional
    ///     Pairs of these two bodies, whatever their filters say; ``True`` for all bodies.
    /// within : Body or True, optional
    ///     Pairs of primitives of one body; ``True`` for every body. ``between=True`` and
    ///     ``within=True`` go together.
    /// ignore : sequence of (Body, Body)
    ///     Bodies whose pairs are left out; a body named twice leaves out its self-collision.
    /// shared_vertex : {"skip", "resolve"}
    ///     Primitives of one body that share a vertex are not reported, or reported when they
    ///     meet in more than what they share.
    /// progress : callable, optional
    ///     Called as ``progress(done, total)`` from this thread, about every 50 ms and at the end
    ///     of each stage. Units differ by stage. An exception stops the run and is raised.
    /// cancel : CancelToken, optional
    ///     Stops the run from another thread.
    ///
    /// Returns
    /// -------
    /// Result
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     A question that makes no sense, a handle of a removed body or of another scene.
    /// MemoryError
    ///     A memory budget too small for even one slab.
    /// Cancelled
    ///     Stopped by `cancel`. The detector stays usable.
    /// RuntimeError
    ///     A detector that is busy in another thread, a GPU failure.
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    #[pyo3(
        signature = (
            scene, *, between=None, within=None, ignore=None, shared_vertex=None, progress=None,
            cancel=None,
        ),
        text_signature = "($self, scene, *, between=None, within=None, ignore=None, \
                          shared_vertex=\"skip\", progress=None, cancel=None)"
    )]
    fn detect(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        between: Argument<'_, '_>,
        within: Argument<'_, '_>,
        ignore: Argument<'_, '_>,
        shared_vertex: Argument<'_, '_>,
        progress: Argument<'_, '_>,
        cancel: Argument<'_, '_>,
    ) -> PyResult<Answer> {
        let py = slf.py();
        let scene = scene
            .cast::<Scene>()
            .map_err(|_| unexpected(scene, "scene", "a Scene"))?;
        if let Some(progress) = progress
            && !progress.is_callable()
        {
            return Err(unexpected(progress, "progress", "a callable"));
        }
        let cancel = match cancel.map(|token| (token, token.cast::<CancelToken>())) {
            None => None,
            Some((_, Ok(token))) => Some(token.get().inner.clone()),
            Some((token, Err(_))) => return Err(unexpected(token, "cancel", "a CancelToken")),
        };
        let mut detector = slf.try_borrow_mut().map_err(|_| {
            PyRuntimeError::new_err("the detector is busy: give each thread one of its own")
        })?;
        let scene = scene
            .try_borrow()
            .map_err(|_| PyRuntimeError::new_err("the scene is being changed by another thread"))?;
        let (query, asked) = question(&scene, between, within, ignore, shared_vertex)?;
        let watch = Watch::new(progress.map(|progress| progress.clone().unbind()), cancel);
        let pairs = detector.run(py, &scene, &query, &watch);
        match (watch.raised(), pairs) {
            (Some(error), _) => Err(error),
            (None, pairs) => Ok(Answer::new(pairs?, scene.number, asked)),
        }
    }

    fn __repr__(&self) -> String {
        let settings = self.inner.settings();
        let backend = match settings.backend {
            impinge::Backend::Cpu => "cpu",
            impinge::Backend::Gpu => "gpu",
            _ => "auto",
        };
        let mut words = vec![
            format!("method={:?}", settings.method.name()),
            format!("backend={backend:?}"),
        ];
        if settings.threads > 0 {
            words.push(format!("threads={}", settings.threads));
        }
        if let Some(budget) = settings.memory_budget {
            words.push(format!("memory_budget={budget}"));
        }
        format!("Detector({})", words.join(", "))
    }
}

impl Detector {
    /// Runs with the interpreter released.
    pub fn run(
        &mut self,
        py: Python<'_>,
        scene: &Scene,
        query: &Query,
        watch: &Watch,
    ) -> PyResult<impinge::Pairs> {
        check_process()?;
        let (inner, scene) = (&mut self.inner, &scene.inner);
        py.detach(|| {
            let step = |at| watch.step(at);
            let control = Control::new().cancel(&watch.stop).progress(&step);
            inner.detect_with(scene, query, &control).cloned()
        })
        .map_err(raise)
    }
}

/// A forked child inherits none of the threads, and would wait for them for ever.
fn check_process() -> PyResult<()> {
    static FIRST_USED_BY: AtomicU32 = AtomicU32::new(0);
    let this = std::process::id();
    match FIRST_USED_BY.compare_exchange(0, this, Ordering::Relaxed, Ordering::Relaxed) {
        Err(first) if first != this => Err(PyRuntimeError::new_err(
            "this process was forked from one that had started impinge's threads, and they do not \
             survive a fork: start workers with multiprocessing.get_context(\"spawn\"), or before \
             the first Detector",
        )),
        _ => Ok(()),
    }
}

/// What the keywords ask.
fn question(
    scene: &Scene,
    between: Argument<'_, '_>,
    within: Argument<'_, '_>,
    ignore: Argument<'_, '_>,
    rule: Argument<'_, '_>,
) -> PyResult<(Query, Asked)> {
    let (query, asked) = match (Scope::new(between), Scope::new(within)) {
        (Scope::Nothing | Scope::All, Scope::Nothing) => (Query::all(), Asked::Many),
        (Scope::Nothing, Scope::All) => (Query::all_within(), Asked::Many),
        (Scope::All, Scope::All) => (Query::everything(), Asked::Many),
        (Scope::One(pair), Scope::Nothing) => {
            let (a, b) = two_bodies(scene, pair, "between")?;
            (Query::between(a, b), Asked::Between(a, b))
        }
        (Scope::Nothing, Scope::One(body)) => {
            let body = scene.id(body, "within")?;
            (Query::within(body), Asked::Within(body))
        }
        _ => {
            return Err(PyValueError::new_err(
                "between and within: two questions; ask one of them, or between=True and \
                 within=True for all pairs of all bodies",
            ));
        }
    };
    let mut query = query.shared_vertex(shared_vertex(rule)?);
    if let Some(ignore) = ignore {
        let pairs = ignore
            .try_iter()
            .map_err(|_| unexpected(ignore, "ignore", "a sequence of pairs of bodies"))?;
        for (ix, pair) in pairs.enumerate() {
            let (a, b) = two_bodies(scene, &pair?, &format!("ignore[{ix}]"))?;
            query = query.ignore(a, b);
        }
    }
    Ok((query, asked))
}

/// One of the keywords `between` and `within`.
enum Scope<'a, 'py> {
    Nothing,
    All,
    One(&'a Bound<'py, PyAny>),
}

impl<'a, 'py> Scope<'a, 'py> {
    fn new(argument: Argument<'a, 'py>) -> Self {
        match argument.map(|argument| (argument, argument.cast::<PyBool>())) {
            None => Scope::Nothing,
            Some((_, Ok(all))) if all.is_true() => Scope::All,
            Some((_, Ok(_))) => Scope::Nothing,
            Some((one, Err(_))) => Scope::One(one),
        }
    }
}

fn two_bodies(
    scene: &Scene,
    pair: &Bound<'_, PyAny>,
    name: &str,
) -> PyResult<(impinge::BodyId, impinge::BodyId)> {
    let pair: Vec<Bound<'_, PyAny>> =
        pair.try_iter()
            .and_then(|items| items.collect())
            .map_err(|_| {
                PyTypeError::new_err(format!("{name}: a pair of bodies expected, such as (a, b)"))
            })?;
    match &pair[..] {
        [a, b] => Ok((scene.id(a, name)?, scene.id(b, name)?)),
        _ => Err(PyValueError::new_err(format!(
            "{name}: two bodies expected, {} given",
            pair.len()
        ))),
    }
}
