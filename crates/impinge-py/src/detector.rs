//! `impinge.Detector`: settings, questions, the run.

use std::ops::ControlFlow;

use impinge::{CandidateQuery, Clearance, Control, NearQuery, Query, Step, Toi};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::arrays;
use crate::contact::{Contacts, Penetration};
use crate::errors::raise;
use crate::near::{self, NearPairs};
use crate::proximity::Nearest;
use crate::question::{question, step_question};
use crate::result::{Answer, Asked};
use crate::scene::Scene;
use crate::settings::{self, Argument, Told, unexpected, unsigned};
use crate::steps::{self, Advance, Candidates, Impact, Impacts, Spare};
use crate::vertex_filter::VertexFilter;
use crate::watch::{CancelToken, Watch};

/// Finds intersecting pairs, frame after frame. Scratch memory lives here and is used again.
///
/// The pairs depend on the scene alone: not on method, backend, threads, memory or any other
/// setting.
///
/// Parameters
/// ----------
/// method : {"auto", "clusters", "cells", "naive"}
///     How candidates are found. ``"clusters"``: groups fixed by topology, the fast one for bodies that
///     come back. ``"cells"``: the two-level grid of the paper. ``"auto"``: cells for large bodies that are new,
///     clusters as soon as they come back. ``"naive"``: every box against every box, the oracle.
/// backend : {"auto", "cpu", "gpu"}
///     Where. ``"auto"`` takes a GPU where there is one. With the method "auto", large new bodies are first answered on the CPU.
/// device : str, optional
///     Part of a GPU's name, to choose among several.
/// threads : int, optional
///     CPU threads; by default one per core.
/// memory_budget : int, optional
///     Bytes that the detector may hold, the answer included; by default as many as it takes.
/// max_pairs : int, optional
///     The most pairs that an answer may have; by default any number.
/// lambda_ : float
///     ``"cells"``: the density coefficient of the paper's equation (1), above 0.
/// group_size : int
///     ``"cells"``: the most primitives a group may hold, 1 to 64.
/// recluster : {"auto", "never"}
///     ``"clusters"``: whether a body that has flowed far from its rest pose is clustered anew.
/// instruction_set : {"avx512", "avx2", "portable"}
///     The widest vector instructions that the CPU may use, where it has them.
/// placement : {"auto", "inherited"}
///     Which cores helper threads may run on. ``"auto"``: on Linux, with up to 8 threads, not the one on which the
///     calling thread is running. ``"inherited"``: the affinity of no thread is ever set, for programs that place
///     threads themselves (MPI, ``taskset``).
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
    /// The process that made it, whose threads a fork does not have.
    process: u32,
    /// None under a memory budget.
    spare: Option<Spare>,
}

#[pymethods]
impl Detector {
    #[new]
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    #[pyo3(
        signature = (
            method=None, backend=None, device=None, threads=None, memory_budget=None, *,
            max_pairs=None, lambda_=None, group_size=None, recluster=None, instruction_set=None,
            placement=None,
        ),
        text_signature = "(method=\"auto\", backend=\"auto\", device=None, threads=None, \
                          memory_budget=None, *, max_pairs=None, lambda_=1.0, group_size=64, \
                          recluster=\"auto\", instruction_set=\"avx512\", placement=\"auto\")"
    )]
    fn new(
        py: Python<'_>,
        method: Argument<'_, '_>,
        backend: Argument<'_, '_>,
        device: Argument<'_, '_>,
        threads: Argument<'_, '_>,
        memory_budget: Argument<'_, '_>,
        max_pairs: Argument<'_, '_>,
        lambda_: Argument<'_, '_>,
        group_size: Argument<'_, '_>,
        recluster: Argument<'_, '_>,
        instruction_set: Argument<'_, '_>,
        placement: Argument<'_, '_>,
    ) -> PyResult<Self> {
        let told = Told {
            method,
            backend,
            device,
            threads,
            memory_budget,
            max_pairs,
            lambda: lambda_,
            group_size,
            recluster,
            instruction_set,
            placement,
        };
        let settings = told.settings()?;
        let spare = settings.memory_budget.is_none().then(Spare::default);
        // Looking for a GPU and starting threads takes a while.
        let inner = py.detach(|| impinge::Detector::with_settings(settings));
        Ok(Detector {
            inner: inner.map_err(raise)?,
            process: std::process::id(),
            spare,
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
    /// shared_vertex : {"resolve", "skip"}
    ///     Primitives of one body that share a vertex are reported when they meet in more than
    ///     what they share, or never.
    /// owned_by : (low, high), optional
    ///     Only the pairs that belong to the half-open box between these two corners, three numbers each: a pair belongs
    ///     to the cell that holds the larger of the lower corners of its two bounding boxes, axis by axis. For programs
    ///     that cut space into cells themselves; corners may be infinite.
    /// progress : callable, optional
    ///     Called as ``progress(done, total)`` from this thread, about every 50 ms and at the end
    ///     of each stage. Units differ by stage. An exception stops the run and is raised.
    /// cancel : CancelToken, optional
    ///     Stops the run from another thread.
    /// filter : callable, optional
    ///     Which pairs are kept: called once, after all pairs were found, as ``filter(rows)`` with the sorted rows
    ///     ``(n, 4)`` of all of them, as in `Result.rows`; returns ``(n,)`` bool. So the answer stays the same on
    ///     every method, backend and thread count. Filters by face or vertex are masks of it.
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
    ///     No memory for the answer, or a memory budget too small for it.
    /// TooManyPairs
    ///     More pairs than `max_pairs` allows, as soon as that is certain.
    /// Cancelled
    ///     Stopped by `cancel`. The detector stays usable.
    /// RuntimeError
    ///     A detector that is busy in another thread, a GPU failure.
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    #[pyo3(
        signature = (
            scene, *, between=None, within=None, ignore=None, shared_vertex=None, owned_by=None,
            progress=None, cancel=None, filter=None,
        ),
        text_signature = "($self, scene, *, between=None, within=None, ignore=None, \
                          shared_vertex=\"resolve\", owned_by=None, progress=None, cancel=None, filter=None)"
    )]
    fn detect(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        between: Argument<'_, '_>,
        within: Argument<'_, '_>,
        ignore: Argument<'_, '_>,
        shared_vertex: Argument<'_, '_>,
        owned_by: Argument<'_, '_>,
        progress: Argument<'_, '_>,
        cancel: Argument<'_, '_>,
        filter: Argument<'_, '_>,
    ) -> PyResult<Answer> {
        if let Some(filter) = filter
            && !filter.is_callable()
        {
            return Err(unexpected(filter, "filter", "a callable"));
        }
        let watched = (scene, progress, cancel);
        let ask = |scene: &Scene| question(scene, between, within, ignore, shared_vertex, owned_by);
        let answer = |detector: &mut impinge::Detector,
                      scene: &impinge::Scene,
                      (query, _): &(Query, _),
                      control: &Control<'_>| {
            detector.detect_with(scene, query, control)?;
            Ok(detector.take_pairs())
        };
        let (pairs, (_, asked), number) = Detector::watched(slf, watched, ask, answer)?;
        let mut answer = Answer::new(pairs, number, asked);
        if let Some(filter) = filter {
            let keep = filter.call1((answer.rows(slf.py())?,))?;
            answer.retain(&arrays::mask(&keep, "filter", answer.len())?);
        }
        Ok(answer)
    }

    /// Counts the pairs that `detect` would find. None of them is held, so there may be more than memory has room
    /// for.
    ///
    /// Parameters
    /// ----------
    /// scene, between, within, ignore, shared_vertex, owned_by, progress, cancel
    ///     As for `detect`.
    ///
    /// Returns
    /// -------
    /// int
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError, MemoryError, TooManyPairs, Cancelled, RuntimeError
    ///     As `detect`.
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    #[pyo3(
        signature = (
            scene, *, between=None, within=None, ignore=None, shared_vertex=None, owned_by=None,
            progress=None, cancel=None,
        ),
        text_signature = "($self, scene, *, between=None, within=None, ignore=None, \
                          shared_vertex=\"resolve\", owned_by=None, progress=None, cancel=None)"
    )]
    fn count(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        between: Argument<'_, '_>,
        within: Argument<'_, '_>,
        ignore: Argument<'_, '_>,
        shared_vertex: Argument<'_, '_>,
        owned_by: Argument<'_, '_>,
        progress: Argument<'_, '_>,
        cancel: Argument<'_, '_>,
    ) -> PyResult<u64> {
        let watched = (scene, progress, cancel);
        let ask = |scene: &Scene| {
            Ok(question(scene, between, within, ignore, shared_vertex, owned_by)?.0)
        };
        let answer = impinge::Detector::count_with;
        Ok(Detector::watched(slf, watched, ask, answer)?.0)
    }

    /// Says whether `detect` would find any pair. The search ends with the first one that is certain.
    ///
    /// Parameters
    /// ----------
    /// scene, between, within, ignore, shared_vertex, owned_by, progress, cancel
    ///     As for `detect`.
    ///
    /// Returns
    /// -------
    /// bool
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError, MemoryError, Cancelled, RuntimeError
    ///     As `detect`.
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    #[pyo3(
        signature = (
            scene, *, between=None, within=None, ignore=None, shared_vertex=None, owned_by=None,
            progress=None, cancel=None,
        ),
        text_signature = "($self, scene, *, between=None, within=None, ignore=None, \
                          shared_vertex=\"resolve\", owned_by=None, progress=None, cancel=None)"
    )]
    fn any(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        between: Argument<'_, '_>,
        within: Argument<'_, '_>,
        ignore: Argument<'_, '_>,
        shared_vertex: Argument<'_, '_>,
        owned_by: Argument<'_, '_>,
        progress: Argument<'_, '_>,
        cancel: Argument<'_, '_>,
    ) -> PyResult<bool> {
        let watched = (scene, progress, cancel);
        let ask = |scene: &Scene| {
            Ok(question(scene, between, within, ignore, shared_vertex, owned_by)?.0)
        };
        let answer = impinge::Detector::any_with;
        Ok(Detector::watched(slf, watched, ask, answer)?.0)
    }

    /// Finds all pairs of elements that touch during a step, each with the first time at which it does.
    ///
    /// Every vertex moves on a straight line, from its position at time 0 to its end position
    /// (`Scene.set_end_positions`) at time 1. Pairs are of a vertex and a face (``"vf"``) and of two edges
    /// (``"ee"``); where a body is made of edges or points alone also of an edge and a vertex (``"ev"``) and of
    /// two vertices (``"vv"``). Of tetrahedra the surface takes part. Pairs of one body that share a vertex
    /// are left out. The answer is exact: a pair is reported if and only if the two closed elements share a
    /// point at some time, and its time is that of the first contact, rounded down.
    ///
    /// Parameters
    /// ----------
    /// scene : Scene
    /// between, within, ignore
    ///     As for `detect`, but for the default, which is all pairs of all bodies, those within a body included.
    /// start : {"report", "skip", "verify"}
    ///     Pairs that touch at the start: reported with the time 0, or left out whatever they do later. ``"verify"``
    ///     reports them and asks whether elements intersect at the start, neighbours resolved: an edge inside a face
    ///     touches nothing until it comes to a border. Then ``start_intersects`` says so, `is_free` is false, and
    ///     `advance` allows no step.
    /// toi : {"f32", "f64"}
    ///     To which precision times are rounded down.
    /// separation : float
    ///     The distance that elements must keep, 0 or more. A pair is then reported with the first time at which its
    ///     distance is at most `separation`, decided exactly; with 0, elements must touch.
    /// clearance, clearance_share : float
    ///     What the step leaves, a length: every pair keeps ``separation + min(clearance, clearance_share * (d - separation))``, with
    ///     d its distance at the start. A pair is then reported with the first time at which its distance is at most that. With
    ///     1e-4 and 0.2 this is ipc-toolkit's ``conservative_rescaling=0.8``.
    /// owned_by : (low, high), optional
    ///     As for `detect`, with boxes that hold their elements from the start to the end. If a distance is asked for as well, a
    ///     program needs the elements whose boxes touch its cell when inflated by it, by twice the distance of `candidates`.
    /// progress, cancel
    ///     As for `detect`.
    ///
    /// Returns
    /// -------
    /// Impacts
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError, MemoryError, Cancelled, RuntimeError
    ///     As `detect`; a separation or a clearance that is negative or not finite; a share that is not from 0 to less than 1.
    ///
    /// Examples
    /// --------
    /// >>> import impinge
    /// >>> scene = impinge.Scene()
    /// >>> floor = scene.add([[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]])
    /// >>> point = scene.add_points([[1, 1, 1]])
    /// >>> scene.set_end_positions(point, [[1, 1, -3]])
    /// >>> impacts = impinge.Detector(backend="cpu").impacts(scene)
    /// >>> impacts[0]
    /// Impact("vf", 0 of body 1 and 0 of body 0, toi=0.25)
    /// >>> float(impacts.toi.min())
    /// 0.25
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    #[pyo3(
        signature = (
            scene, *, between=None, within=None, ignore=None, start=None, toi=None, separation=None,
            clearance=None, clearance_share=None, owned_by=None, progress=None, cancel=None,
        ),
        text_signature = "($self, scene, *, between=None, within=None, ignore=None, \
                          start=\"report\", toi=\"f32\", separation=0.0, clearance=0.0, clearance_share=0.2, \
                          owned_by=None, progress=None, cancel=None)"
    )]
    fn impacts(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        between: Argument<'_, '_>,
        within: Argument<'_, '_>,
        ignore: Argument<'_, '_>,
        start: Argument<'_, '_>,
        toi: Argument<'_, '_>,
        separation: Argument<'_, '_>,
        clearance: Argument<'_, '_>,
        clearance_share: Argument<'_, '_>,
        owned_by: Argument<'_, '_>,
        progress: Argument<'_, '_>,
        cancel: Argument<'_, '_>,
    ) -> PyResult<Impacts> {
        let toi = settings::toi(toi)?;
        let ask = step(
            [between, within, ignore, owned_by],
            start,
            toi,
            [separation, clearance, clearance_share],
        )?;
        let answer = |detector: &mut impinge::Detector,
                      scene: &impinge::Scene,
                      step: &Step,
                      control: &Control<'_>| {
            detector.impacts_with(scene, step, control)?;
            Ok(detector.take_impacts())
        };
        let watched = (scene, progress, cancel);
        let (impacts, _, number) = Detector::watched(slf, watched, ask, answer)?;
        Ok(Impacts::new(impacts, number, toi == Toi::F64))
    }

    /// Finds the first contact of a step: the impact with the least time, of several the first row. It is the
    /// one that ``impacts(...).earliest()`` finds, but found faster.
    ///
    /// Parameters
    /// ----------
    /// scene, between, within, ignore, start, toi, separation, clearance, clearance_share, owned_by, progress, cancel
    ///     As for `impacts`.
    ///
    /// Returns
    /// -------
    /// Impact or None
    ///     ``None`` where nothing touches. With ``start="verify"``, `start_intersects` then says whether elements intersect at
    ///     the start, which need not touch.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError, MemoryError, Cancelled, RuntimeError
    ///     As `detect`.
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    #[pyo3(
        signature = (
            scene, *, between=None, within=None, ignore=None, start=None, toi=None, separation=None,
            clearance=None, clearance_share=None, owned_by=None, progress=None, cancel=None,
        ),
        text_signature = "($self, scene, *, between=None, within=None, ignore=None, \
                          start=\"report\", toi=\"f32\", separation=0.0, clearance=0.0, clearance_share=0.2, \
                          owned_by=None, progress=None, cancel=None)"
    )]
    fn earliest(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        between: Argument<'_, '_>,
        within: Argument<'_, '_>,
        ignore: Argument<'_, '_>,
        start: Argument<'_, '_>,
        toi: Argument<'_, '_>,
        separation: Argument<'_, '_>,
        clearance: Argument<'_, '_>,
        clearance_share: Argument<'_, '_>,
        owned_by: Argument<'_, '_>,
        progress: Argument<'_, '_>,
        cancel: Argument<'_, '_>,
    ) -> PyResult<Option<Impact>> {
        let ask = step(
            [between, within, ignore, owned_by],
            start,
            settings::toi(toi)?,
            [separation, clearance, clearance_share],
        )?;
        let watched = (scene, progress, cancel);
        let answer = impinge::Detector::earliest_with;
        let (first, _, number) = Detector::watched(slf, watched, ask, answer)?;
        Ok(first.map(|impact| Impact::new(impact, number)))
    }

    /// bool or None : whether elements intersect at the start of the step that was asked about last; ``None`` if that was not
    /// asked, which only ``start="verify"`` does.
    #[getter]
    fn start_intersects(&self) -> Option<bool> {
        self.inner.start_intersects()
    }

    /// Whether nothing touches during a step; with ``start="skip"``, but for pairs that touch at its start. If the start was
    /// free of intersections, so is each moment of a free step; ``start="verify"`` asks that, too.
    ///
    /// Parameters
    /// ----------
    /// scene, between, within, ignore, start, separation, clearance, clearance_share, owned_by, progress, cancel
    ///     As for `impacts`.
    ///
    /// Returns
    /// -------
    /// bool
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError, MemoryError, Cancelled, RuntimeError
    ///     As `detect`.
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    #[pyo3(
        signature = (
            scene, *, between=None, within=None, ignore=None, start=None, separation=None,
            clearance=None, clearance_share=None, owned_by=None, progress=None, cancel=None, _filter=None,
        ),
        text_signature = "($self, scene, *, between=None, within=None, ignore=None, \
                          start=\"report\", separation=0.0, clearance=0.0, clearance_share=0.2, \
                          owned_by=None, progress=None, cancel=None)"
    )]
    fn is_free(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        between: Argument<'_, '_>,
        within: Argument<'_, '_>,
        ignore: Argument<'_, '_>,
        start: Argument<'_, '_>,
        separation: Argument<'_, '_>,
        clearance: Argument<'_, '_>,
        clearance_share: Argument<'_, '_>,
        owned_by: Argument<'_, '_>,
        progress: Argument<'_, '_>,
        cancel: Argument<'_, '_>,
        _filter: Option<&Bound<'_, VertexFilter>>,
    ) -> PyResult<bool> {
        let ask = step(
            [between, within, ignore, owned_by],
            start,
            Toi::F32,
            [separation, clearance, clearance_share],
        )?;
        let watched = (scene, progress, cancel);
        let answer = impinge::Detector::is_free_with;
        let is_free = Detector::watched(slf, watched, filtered(ask, _filter), answer)?.0;
        _filter.map_or(Ok(()), |filter| filter.get().check())?;
        Ok(is_free)
    }

    /// How far a step can be taken: a fraction of it, backed off from the first contact hardly more than the
    /// precision of positions asks for, for which the straight way from the start to the *rounded* positions is free.
    ///
    /// Rounding alone may make elements touch that did not. So for each fraction that is tried positions are
    /// rounded first, and the way to those is asked about. A chain of such steps is free from the first to the
    /// last, if its start was free of intersections, which ``start="verify"`` asks. Pairs that touch at the start allow
    /// no step at all, or are not looked at with ``start="skip"``. The seams of a mesh that was not welded are refused by
    /// name: weld it (`weld`), or skip them.
    ///
    /// With a `clearance`, the fraction holds for positions that you compute, too: by ``x0 + a * (x1 - x0)`` or by ``x0 + a * dx`` with
    /// ``x1 = x0 + dx``, in the precision of the positions, for every ``a`` from 0 to the fraction, the straight way there is free and
    /// keeps the clearance, rounding included. Without one, only `Advance.positions` are proven.
    ///
    /// Parameters
    /// ----------
    /// scene, between, within, ignore, start, separation, clearance, clearance_share, progress, cancel
    ///     As for `impacts`.
    ///
    /// Returns
    /// -------
    /// Advance
    ///     ``advance.apply(scene)`` takes the step.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError, MemoryError, Cancelled, RuntimeError
    ///     As `detect`; vertices of one body at one position that are not shared.
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    #[pyo3(
        signature = (
            scene, *, between=None, within=None, ignore=None, start=None, separation=None,
            clearance=None, clearance_share=None, progress=None, cancel=None, _filter=None,
        ),
        text_signature = "($self, scene, *, between=None, within=None, ignore=None, \
                          start=\"report\", separation=0.0, clearance=0.0, clearance_share=0.2, \
                          progress=None, cancel=None)"
    )]
    fn advance(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        between: Argument<'_, '_>,
        within: Argument<'_, '_>,
        ignore: Argument<'_, '_>,
        start: Argument<'_, '_>,
        separation: Argument<'_, '_>,
        clearance: Argument<'_, '_>,
        clearance_share: Argument<'_, '_>,
        progress: Argument<'_, '_>,
        cancel: Argument<'_, '_>,
        _filter: Option<&Bound<'_, VertexFilter>>,
    ) -> PyResult<Advance> {
        let ask = step(
            [between, within, ignore, None],
            start,
            Toi::F64,
            [separation, clearance, clearance_share],
        )?;
        let watched = (scene, progress, cancel);
        let answer = impinge::Detector::advance_with;
        let asked = Detector::watched(slf, watched, filtered(ask, _filter), answer)?;
        let (advance, _, number) = asked;
        _filter.map_or(Ok(()), |filter| filter.get().check())?;
        Ok(Advance::new(advance, number))
    }

    /// Finds the pairs of elements whose boxes over the whole step, each inflated by `distance` on all sides,
    /// overlap: for those who bring a test of their own. Sorted and complete; decided exactly. Pairs of one
    /// body that share a vertex are left out.
    ///
    /// Parameters
    /// ----------
    /// scene, between, within, ignore, owned_by, progress, cancel
    ///     As for `impacts`.
    /// kinds : sequence of {"vf", "ee", "ev", "vv", "ef", "ff"}
    ///     Which kinds of pairs; ``("vf", "ee")`` by default.
    /// distance : float
    ///     By how much boxes are inflated, 0 or more.
    ///
    /// Returns
    /// -------
    /// Candidates
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError, MemoryError, Cancelled, RuntimeError
    ///     As `detect`; a distance that is negative or not finite.
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    #[pyo3(
        signature = (
            scene, *, between=None, within=None, ignore=None, kinds=None, distance=None,
            owned_by=None, progress=None, cancel=None,
        ),
        text_signature = "($self, scene, *, between=None, within=None, ignore=None, \
                          kinds=(\"vf\", \"ee\"), distance=0.0, owned_by=None, progress=None, cancel=None)"
    )]
    fn candidates(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        between: Argument<'_, '_>,
        within: Argument<'_, '_>,
        ignore: Argument<'_, '_>,
        kinds: Argument<'_, '_>,
        distance: Argument<'_, '_>,
        owned_by: Argument<'_, '_>,
        progress: Argument<'_, '_>,
        cancel: Argument<'_, '_>,
    ) -> PyResult<Candidates> {
        let ask = candidate_question([between, within, ignore, owned_by], kinds, distance)?;
        // A detector that is in use is refused below.
        let detector = slf.try_borrow().ok();
        let spare = detector.and_then(|detector| detector.spare.clone());
        let answer = |detector: &mut impinge::Detector,
                      scene: &impinge::Scene,
                      query: &CandidateQuery,
                      control: &Control<'_>| {
            if let Some(candidates) = spare.as_ref().and_then(Spare::take) {
                detector.reuse_candidates(candidates);
            }
            detector.candidates_with(scene, query, control)?;
            Ok(detector.take_candidates())
        };
        let watched = (scene, progress, cancel);
        let (candidates, ..) = Detector::watched(slf, watched, ask, answer)?;
        Ok(Candidates::new(candidates, spare.clone()))
    }

    /// All `candidates` in sorted runs, one after the other, so that memory need not hold all of them. Run after
    /// run they are the rows of `candidates`, each once and in the same order, whatever `most`, the memory budget
    /// and the number of threads.
    ///
    /// Candidates are counted first, and then each run is searched for alone, so short runs cost time. A run takes
    /// 8 bytes per candidate, 12 without a memory budget. The budget makes runs as short as it needs.
    ///
    /// Parameters
    /// ----------
    /// scene, between, within, ignore, kinds, distance, owned_by, progress, cancel
    ///     As for `candidates`.
    /// each : callable
    ///     Called with each run, which is never empty. An exception ends the search and is raised.
    /// most : int
    ///     Candidates per run at most.
    ///
    /// Returns
    /// -------
    /// int
    ///     The number of all candidates.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError, MemoryError, Cancelled, RuntimeError
    ///     As `candidates`; a ``most`` of 0.
    ///
    /// Examples
    /// --------
    /// >>> import impinge
    /// >>> scene = impinge.Scene()
    /// >>> for _ in range(2):
    /// ...     _ = scene.add_points([[x, 0, 0] for x in range(5)])
    /// >>> detector = impinge.Detector(backend="cpu")
    /// >>> detector.candidates_in_runs(scene, lambda run: print(run.rows("vv").tolist()), kinds="vv", most=3)
    /// [[0, 0, 1, 0], [0, 1, 1, 1], [0, 2, 1, 2]]
    /// [[0, 3, 1, 3], [0, 4, 1, 4]]
    /// 5
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    #[pyo3(
        signature = (
            scene, each, *, between=None, within=None, ignore=None, kinds=None, distance=None,
            most=None, owned_by=None, progress=None, cancel=None,
        ),
        text_signature = "($self, scene, each, *, between=None, within=None, ignore=None, \
                          kinds=(\"vf\", \"ee\"), distance=0.0, most=4194304, owned_by=None, progress=None, cancel=None)"
    )]
    fn candidates_in_runs(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        each: &Bound<'_, PyAny>,
        between: Argument<'_, '_>,
        within: Argument<'_, '_>,
        ignore: Argument<'_, '_>,
        kinds: Argument<'_, '_>,
        distance: Argument<'_, '_>,
        most: Argument<'_, '_>,
        owned_by: Argument<'_, '_>,
        progress: Argument<'_, '_>,
        cancel: Argument<'_, '_>,
    ) -> PyResult<u64> {
        let ask = candidate_question([between, within, ignore, owned_by], kinds, distance)?;
        let most = match most {
            Some(most) => unsigned(most, "most", u64::MAX)?,
            None => 1 << 22,
        };
        if !each.is_callable() {
            return Err(unexpected(each, "each", "a callable"));
        }
        let each = each.clone().unbind();
        let answer = |detector: &mut impinge::Detector,
                      scene: &impinge::Scene,
                      query: &CandidateQuery,
                      control: &Control<'_>| {
            // Called on the thread that called from Python.
            let hand_over = |run: impinge::Candidates| {
                let called = Python::attach(|py| each.call1(py, (Candidates::new(run, None),)));
                match called {
                    Ok(_) => ControlFlow::Continue(()),
                    Err(error) => ControlFlow::Break(error),
                }
            };
            detector.candidates_in_runs_with(scene, query, most, hand_over, control)
        };
        let watched = (scene, progress, cancel);
        match Detector::watched(slf, watched, ask, answer)?.0 {
            ControlFlow::Continue(n) => Ok(n),
            ControlFlow::Break(error) => Err(error),
        }
    }

    /// Pickles and copies are new detectors with the same settings.
    fn __getnewargs_ex__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyTuple>, Bound<'py, PyDict>)> {
        let given = self.inner.settings();
        let all = PyDict::new(py);
        all.set_item("method", given.method.name())?;
        all.set_item("backend", settings::backend_name(given.backend))?;
        all.set_item("device", &given.device)?;
        if given.threads > 0 {
            all.set_item("threads", given.threads)?;
        }
        all.set_item("memory_budget", given.memory_budget)?;
        if let Some(limit) = given.max_pairs {
            all.set_item("max_pairs", limit)?;
        }
        all.set_item("lambda_", given.lambda)?;
        all.set_item("group_size", given.group_size)?;
        all.set_item("placement", settings::placement_name(given.placement))?;
        all.set_item("recluster", settings::recluster_name(given.recluster))?;
        all.set_item(
            "instruction_set",
            settings::instruction_set_name(given.instruction_set),
        )?;
        Ok((PyTuple::empty(py), all))
    }

    /// Finds the pairs of elements whose distance is at most `distance`, or the thickness of both bodies, at the
    /// positions that bodies have. Exact: decided without rounding. Pairs of one body that share a vertex are left
    /// out. Without `between` and `within`, all pairs of all bodies.
    ///
    /// Parameters
    /// ----------
    /// scene, between, within, ignore, owned_by, progress, cancel
    ///     As for `impacts`.
    /// distance : float
    ///     The distance in the unit of the scene, 0 or more.
    /// kinds : sequence of {"vf", "ee", "ev", "vv", "ef", "ff"}, optional
    ///     Which kinds of pairs; by default vertices and faces, edges and edges, edges that meet faces, and where bodies
    ///     are made of edges or points alone also edges and vertices, vertices and vertices. An edge and a face
    ///     (``"ef"``) are reported if they meet, whatever the distance: else pairs of their parts say that they are near.
    /// thickness : dict of Body to float, optional
    ///     How thick bodies are: what either body of a pair adds to the distance, of one body twice. The sum is not
    ///     rounded.
    /// distances : bool
    ///     Whether to find distances, too.
    /// closest_points : bool
    ///     Whether to find distances and nearest points, too.
    ///
    /// Returns
    /// -------
    /// NearPairs
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError, MemoryError, Cancelled, RuntimeError
    ///     As `detect`; a distance or thickness that is negative or not finite.
    ///
    /// Examples
    /// --------
    /// >>> import impinge
    /// >>> scene = impinge.Scene()
    /// >>> floor = scene.add([[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]])
    /// >>> point = scene.add_points([[1, 1, 0.5]])
    /// >>> near = impinge.Detector(backend="cpu").within_distance(scene, 0.5, closest_points=True)
    /// >>> near
    /// NearPairs(vf: 1)
    /// >>> impinge.TYPES[near.types[0]], near.distances.tolist(), near.points.tolist()
    /// ('P_T', [0.5], [[[1.0, 1.0, 0.5], [1.0, 1.0, 0.0]]])
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    #[pyo3(
        signature = (
            scene, distance=None, *, between=None, within=None, ignore=None, kinds=None,
            thickness=None, distances=false, closest_points=false, owned_by=None, progress=None,
            cancel=None,
        ),
        text_signature = "($self, scene, distance=0.0, *, between=None, within=None, ignore=None, \
                          kinds=None, thickness=None, distances=False, closest_points=False, owned_by=None, \
                          progress=None, cancel=None)"
    )]
    fn within_distance(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        distance: Argument<'_, '_>,
        between: Argument<'_, '_>,
        within: Argument<'_, '_>,
        ignore: Argument<'_, '_>,
        kinds: Argument<'_, '_>,
        thickness: Argument<'_, '_>,
        distances: bool,
        closest_points: bool,
        owned_by: Argument<'_, '_>,
        progress: Argument<'_, '_>,
        cancel: Argument<'_, '_>,
    ) -> PyResult<NearPairs> {
        let kinds = kinds.map(|kinds| steps::kinds(Some(kinds))).transpose()?;
        let distance = steps::distance(distance, "distance")?;
        let ask = |scene: &Scene| {
            let query = NearQuery::new(step_question(scene, [between, within, ignore, owned_by])?);
            let mut query = query.distance(distance);
            if let Some(kinds) = kinds {
                query = query.kinds(kinds);
            }
            for (body, thickness) in near::thickness(scene, thickness)? {
                query = query.thickness(body, thickness);
            }
            Ok(match (closest_points, distances) {
                (true, _) => query.closest_points(),
                (false, true) => query.distances(),
                (false, false) => query,
            })
        };
        let answer = |detector: &mut impinge::Detector,
                      scene: &impinge::Scene,
                      query: &NearQuery,
                      control: &Control<'_>| {
            detector.within_distance_with(scene, query, control)?;
            Ok(detector.take_near())
        };
        let watched = (scene, progress, cancel);
        let (pairs, ..) = Detector::watched(slf, watched, ask, answer)?;
        Ok(NearPairs::new(
            pairs,
            distances || closest_points,
            closest_points,
        ))
    }

    /// The smallest distance of two bodies at the positions that they have, and the pair of primitives that has it. Tetrahedra
    /// are solid. Trees and the last pair are kept, so that later calls for bodies that move cost little.
    ///
    /// Parameters
    /// ----------
    /// scene : Scene
    /// a, b : Body or int
    /// progress, cancel
    ///     As for `detect`.
    ///
    /// Returns
    /// -------
    /// Nearest or None
    ///     ``None`` where one of them has no primitive. Its distance is 0 if and only if they share a point.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     A body that the scene does not have, twice the same body.
    /// RuntimeError
    ///     A scene or a detector that is busy in another thread.
    /// Cancelled
    ///     By `cancel`.
    ///
    /// Examples
    /// --------
    /// >>> import impinge
    /// >>> scene = impinge.Scene()
    /// >>> floor = scene.add([[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]])
    /// >>> other = scene.add([[0, 0, 3], [4, 0, 3], [0, 4, 5]], [[0, 1, 2]])
    /// >>> impinge.Detector(backend="cpu").distance(scene, floor, other)
    /// Nearest(3.0, primitives (0, 0))
    #[pyo3(signature = (scene, a, b, *, progress=None, cancel=None))]
    fn distance(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        a: &Bound<'_, PyAny>,
        b: &Bound<'_, PyAny>,
        progress: Argument<'_, '_>,
        cancel: Argument<'_, '_>,
    ) -> PyResult<Option<Nearest>> {
        let ask = |scene: &Scene| Ok([scene.id(a, "a")?, scene.id(b, "b")?]);
        let answer =
            |detector: &mut impinge::Detector,
             scene: &impinge::Scene,
             &[a, b]: &[impinge::BodyId; 2],
             control: &Control<'_>| { detector.distance_with(scene, a, b, control) };
        let watched = (scene, progress, cancel);
        let (inner, _, number) = Detector::watched(slf, watched, ask, answer)?;
        Ok(inner.map(|inner| Nearest::new(inner, number)))
    }

    /// The two bodies that are nearest to each other of all whose filters let them meet, and the pair of primitives that has
    /// their distance. Pairs of bodies whose boxes are farther apart than the nearest two are never looked at.
    ///
    /// Parameters
    /// ----------
    /// scene : Scene
    /// across : sequence of Body, optional
    ///     Only pairs of one of these and one that is not among them, whatever their filters say.
    /// progress, cancel
    ///     As for `detect`.
    ///
    /// Returns
    /// -------
    /// Nearest or None
    ///     ``None`` where there are no two bodies that have primitives. Of several pairs at one distance the lowest.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError, RuntimeError, Cancelled
    ///     As `distance`.
    ///
    /// Examples
    /// --------
    /// >>> import impinge
    /// >>> scene = impinge.Scene()
    /// >>> points = [scene.add_points([[x, 0, 0]]) for x in (0, 5, 7)]
    /// >>> nearest = impinge.Detector(backend="cpu").nearest(scene)
    /// >>> nearest.distance, nearest.bodies == (points[1], points[2])
    /// (2.0, True)
    #[pyo3(signature = (scene, *, across=None, progress=None, cancel=None))]
    fn nearest(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        across: Argument<'_, '_>,
        progress: Argument<'_, '_>,
        cancel: Argument<'_, '_>,
    ) -> PyResult<Option<Nearest>> {
        let answer = impinge::Detector::nearest_with;
        let watched = (scene, progress, cancel);
        let (inner, _, number) = Detector::watched(slf, watched, many(across), answer)?;
        Ok(inner.map(|inner| Nearest::new(inner, number)))
    }

    /// Whether bodies meet, of all or across some; for `CollisionManager`.
    #[pyo3(signature = (scene, across=None))]
    fn _any(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        across: Argument<'_, '_>,
    ) -> PyResult<bool> {
        let answer = impinge::Detector::any_with;
        Ok(Detector::watched(slf, (scene, None, None), many(across), answer)?.0)
    }

    /// Pairs of all bodies or across some; for `CollisionManager`.
    #[pyo3(signature = (scene, across=None))]
    fn _detect(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        across: Argument<'_, '_>,
    ) -> PyResult<Answer> {
        let answer = |detector: &mut impinge::Detector,
                      scene: &impinge::Scene,
                      query: &Query,
                      control: &Control<'_>| {
            detector.detect_with(scene, query, control)?;
            Ok(detector.take_pairs())
        };
        let watched = (scene, None, None);
        let (pairs, _, number) = Detector::watched(slf, watched, many(across), answer)?;
        Ok(Answer::new(pairs, number, Asked::Many))
    }

    /// Where the triangles of each pair meet: points, segments, polygons, and the curves in which surfaces cross.
    ///
    /// Parameters
    /// ----------
    /// scene : Scene
    ///     As it was when the pairs were found.
    /// pairs : Result
    ///     Of `detect`.
    /// progress, cancel
    ///     As for `detect`.
    ///
    /// Returns
    /// -------
    /// Contacts
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     A result of another scene, or a body that is gone or has fewer primitives.
    /// MemoryError, Cancelled, RuntimeError
    ///     As `detect`.
    ///
    /// Examples
    /// --------
    /// >>> import impinge
    /// >>> scene = impinge.Scene()
    /// >>> floor = scene.add([[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]])
    /// >>> blade = scene.add([[1, 1, -1], [2, 1, -1], [1, 1, 1]], [[0, 1, 2]])
    /// >>> detector = impinge.Detector(backend="cpu")
    /// >>> contacts = detector.contacts(scene, detector.detect(scene))
    /// >>> contacts.shapes.tolist(), contacts.points.tolist()
    /// (['segment'], [[1.0, 1.0, 0.0], [1.5, 1.0, 0.0]])
    /// >>> [curve.tolist() for curve in contacts.curves()]
    /// [[0, 1]]
    #[pyo3(signature = (scene, pairs, *, progress=None, cancel=None))]
    fn contacts(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        pairs: &Bound<'_, PyAny>,
        progress: Argument<'_, '_>,
        cancel: Argument<'_, '_>,
    ) -> PyResult<Contacts> {
        let result = pairs
            .cast::<Answer>()
            .map_err(|_| unexpected(pairs, "pairs", "a Result"))?;
        let (pairs, of_scene) = result.get().parts();
        let ask = |scene: &Scene| match of_scene == scene.number {
            true => Ok(pairs),
            false => Err(PyValueError::new_err("pairs: of another scene")),
        };
        let answer =
            |detector: &mut impinge::Detector,
             scene: &impinge::Scene,
             pairs: &&impinge::Pairs,
             control: &Control<'_>| { detector.contacts_with(scene, pairs, control) };
        let watched = (scene, progress, cancel);
        let (contacts, _, number) = Detector::watched(slf, watched, ask, answer)?;
        Ok(Contacts::new(contacts, number))
    }

    /// How deep two closed bodies of triangles are in each other: vertices inside, and connected regions with normal, depth and
    /// volume. The body with the lower number is the first, whichever argument it is.
    ///
    /// Parameters
    /// ----------
    /// scene : Scene
    ///     As it was when the contacts were found.
    /// contacts : Contacts
    ///     Among them all of these two bodies.
    /// a, b : Body or int
    /// progress, cancel
    ///     As for `detect`.
    ///
    /// Returns
    /// -------
    /// Penetration
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     A body that the scene does not have or that is not made of triangles, twice the same body, a surface that is not
    ///     closed, contacts of another scene.
    /// MemoryError, Cancelled, RuntimeError
    ///     As `detect`.
    #[pyo3(signature = (scene, contacts, a, b, *, progress=None, cancel=None))]
    fn penetration(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        contacts: &Bound<'_, PyAny>,
        a: &Bound<'_, PyAny>,
        b: &Bound<'_, PyAny>,
        progress: Argument<'_, '_>,
        cancel: Argument<'_, '_>,
    ) -> PyResult<Penetration> {
        let contacts = contacts
            .cast::<Contacts>()
            .map_err(|_| unexpected(contacts, "contacts", "Contacts"))?
            .get();
        let ask = |scene: &Scene| match contacts.scene == scene.number {
            true => Ok([scene.id(a, "a")?, scene.id(b, "b")?]),
            false => Err(PyValueError::new_err("contacts: of another scene")),
        };
        let answer = |detector: &mut impinge::Detector,
                      scene: &impinge::Scene,
                      &[a, b]: &[impinge::BodyId; 2],
                      control: &Control<'_>| {
            detector.penetration_with(scene, &contacts.inner, a, b, control)
        };
        let watched = (scene, progress, cancel);
        let (inner, ..) = Detector::watched(slf, watched, ask, answer)?;
        Ok(Penetration { inner })
    }

    fn __repr__(&self) -> String {
        let settings = self.inner.settings();
        let backend = settings::backend_name(settings.backend).unwrap_or("auto");
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
        if let Some(limit) = settings.max_pairs {
            words.push(format!("max_pairs={limit}"));
        }
        format!("Detector({})", words.join(", "))
    }
}

/// Pairs of different bodies: of all, or across some.
fn many<'a, 'py>(
    across: Argument<'a, 'py>,
) -> impl FnOnce(&Scene) -> PyResult<Query> + use<'a, 'py> {
    move |scene: &Scene| {
        let Some(bodies) = across else {
            return Ok(Query::all());
        };
        let each = bodies
            .try_iter()
            .map_err(|_| unexpected(bodies, "across", "a sequence of bodies"))?;
        let ids: PyResult<Vec<impinge::BodyId>> =
            each.map(|body| scene.id(&body?, "across")).collect();
        Ok(Query::across(ids?))
    }
}

/// A step question as the keywords ask it: those of [`step_question`], what touches at the start, the precision of times, and the
/// separation, the clearance and its share.
fn step<'a, 'py>(
    bodies: [Argument<'a, 'py>; 4],
    start: Argument<'a, 'py>,
    toi: Toi,
    [separation, clearance, share]: [Argument<'_, '_>; 3],
) -> PyResult<impl FnOnce(&Scene) -> PyResult<Step>> {
    let start = settings::start(start)?;
    let separation = steps::distance(separation, "separation")?;
    let mut kept = Clearance::new(steps::distance(clearance, "clearance")?);
    if share.is_some() {
        kept = kept.share(steps::distance(share, "clearance_share")?);
    }
    Ok(move |scene: &Scene| {
        let query = step_question(scene, bodies)?;
        let step = Step::new(query).start(start).toi(toi);
        Ok(step.separation(separation).clearance(kept))
    })
}

/// The same question, of the pairs that a filter lets pass.
fn filtered(
    ask: impl FnOnce(&Scene) -> PyResult<Step>,
    filter: Option<&Bound<'_, VertexFilter>>,
) -> impl FnOnce(&Scene) -> PyResult<Step> {
    let filter = filter.map(|filter| filter.get().inner.clone());
    move |scene: &Scene| {
        let step = ask(scene)?;
        Ok(match filter {
            Some(filter) => step.filter(filter),
            None => step,
        })
    }
}

impl Detector {
    /// Asks about a scene and answers with the interpreter released, watched for Ctrl-C, progress and cancellation.
    /// Returns the answer, the question and the number of the scene.
    fn watched<Q: Sync + Send, T: Send>(
        slf: &Bound<'_, Self>,
        (scene, progress, cancel): (&Bound<'_, PyAny>, Argument<'_, '_>, Argument<'_, '_>),
        ask: impl FnOnce(&Scene) -> PyResult<Q>,
        answer: impl FnOnce(
            &mut impinge::Detector,
            &impinge::Scene,
            &Q,
            &Control<'_>,
        ) -> Result<T, impinge::Error>
        + Send,
    ) -> PyResult<(T, Q, u64)> {
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
        let question = ask(&scene)?;
        if detector.process != std::process::id() {
            return Err(PyRuntimeError::new_err(
                "this detector was made before this process was forked, and its threads do not survive a fork: make \
                 one here",
            ));
        }
        let watch = Watch::new(progress.map(|progress| progress.clone().unbind()), cancel);
        let (inner, bodies) = (&mut detector.inner, &scene.inner);
        let answer = py.detach(|| {
            let step = |at| watch.step(at);
            let control = Control::new().cancel(&watch.stop).progress(&step);
            answer(inner, bodies, &question, &control)
        });
        match (watch.raised(), answer) {
            (Some(error), _) => Err(error),
            (None, answer) => Ok((answer.map_err(raise)?, question, scene.number)),
        }
    }
}

/// What the keywords ask about candidates; `bodies` are the keywords of [`step_question`].
fn candidate_question<'a, 'py>(
    bodies: [Argument<'a, 'py>; 4],
    kinds: Argument<'_, '_>,
    distance: Argument<'_, '_>,
) -> PyResult<impl FnOnce(&Scene) -> PyResult<CandidateQuery> + use<'a, 'py>> {
    let kinds = steps::kinds(kinds)?;
    let distance = steps::distance(distance, "distance")?;
    Ok(move |scene: &Scene| {
        let query = step_question(scene, bodies)?;
        Ok(CandidateQuery::new(query).kinds(kinds).distance(distance))
    })
}
