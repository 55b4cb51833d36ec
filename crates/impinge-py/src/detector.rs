//! The compiled part of `impinge.Detector`: settings, questions, the run.

use std::ops::ControlFlow;
use std::sync::Arc;

use impinge::{Backend, BodyId, Control, Precision, Query};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::answers::{Advance, Candidates, Impacts, Pairs, Row, Truncation, collect, impact};
use crate::arrays::{PositionArray, Rows, with_rows};
use crate::bodies::Body;
use crate::closest::Closest;
use crate::contact::{Contacts, Penetration};
use crate::errors::{invalid, raise};
use crate::hits::Hits;
use crate::near::Near;
use crate::options::Options;
use crate::scene::Scene;
use crate::settings::{self, length, unexpected, unsigned};
use crate::solver::{Neighbours, SafeDistances};
use crate::statistics;
use crate::watch::Watch;

/// What `impinge.Detector` is made of.
#[pyclass(module = "impinge._impinge", subclass)]
pub struct DetectorBase {
    inner: impinge::Detector,
    /// The process that made it, whose threads a fork does not have.
    process: u32,
}

/// The fields of `impinge.Nearest`.
type Nearest<'py> = (f64, Body, u32, Body, u32, Bound<'py, PyArray2<f64>>);

/// Keywords of a question.
type Keywords<'a, 'py> = &'a Bound<'py, PyDict>;

/// Asks a method of detectors where points are in a body.
macro_rules! of_points {
    ($method:ident, $detector:expr, $asked:expr, $keywords:expr) => {
        ask_of_body(
            $detector,
            $asked,
            $keywords,
            |detector, scene, body, points| {
                with_rows!(points, |points| detector.$method(scene, body, points))
            },
        )?
    };
}

#[pymethods]
impl DetectorBase {
    #[new]
    fn new(py: Python<'_>, settings: Keywords<'_, '_>) -> PyResult<Self> {
        let settings = settings::read(settings)?;
        // Looking for a GPU and starting threads takes a while.
        let inner = py.detach(|| impinge::Detector::new(settings));
        Ok(DetectorBase {
            inner: inner.map_err(raise)?,
            process: std::process::id(),
        })
    }

    fn _detect(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        keywords: Keywords<'_, '_>,
    ) -> PyResult<Pairs> {
        let options = Options::new(keywords)?;
        let asked = ask(slf, scene, options, impinge::Detector::detect)?;
        Ok(Pairs::new(asked.answer, asked.scene))
    }

    fn _count(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        keywords: Keywords<'_, '_>,
    ) -> PyResult<u64> {
        let options = Options::new(keywords)?;
        let asked = ask(slf, scene, options, impinge::Detector::count)?;
        Ok(asked.answer)
    }

    fn _any(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        keywords: Keywords<'_, '_>,
    ) -> PyResult<bool> {
        let options = Options::new(keywords)?;
        let asked = ask(slf, scene, options, impinge::Detector::any)?;
        Ok(asked.answer)
    }

    fn _impacts(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        keywords: Keywords<'_, '_>,
    ) -> PyResult<Impacts> {
        let options = Options::new(keywords)?;
        let is_double = options.precision == Precision::F64;
        let asked = ask(slf, scene, options, impinge::Detector::impacts)?;
        Ok(Impacts::new(asked.answer, asked.scene, is_double))
    }

    fn _earliest(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        keywords: Keywords<'_, '_>,
    ) -> PyResult<Option<Row>> {
        let options = Options::new(keywords)?;
        let asked = ask(slf, scene, options, impinge::Detector::earliest)?;
        Ok(asked.answer.map(|found| impact(&found, asked.scene)))
    }

    fn _is_free(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        keywords: Keywords<'_, '_>,
    ) -> PyResult<bool> {
        let options = Options::new(keywords)?;
        let asked = ask(slf, scene, options, impinge::Detector::is_free)?;
        Ok(asked.answer)
    }

    fn _advance(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        keywords: Keywords<'_, '_>,
    ) -> PyResult<Advance> {
        let options = Options::new(keywords)?;
        let asked = ask(slf, scene, options, impinge::Detector::advance)?;
        Ok(Advance::new(asked.answer, asked.scene))
    }

    fn _truncate(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        keywords: Keywords<'_, '_>,
    ) -> PyResult<Truncation> {
        let options = Options::new(keywords)?;
        let asked = ask(slf, scene, options, impinge::Detector::truncate)?;
        Ok(Truncation::new(asked.answer, asked.scene))
    }

    fn _candidates(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        inflation: &Bound<'_, PyAny>,
        keywords: Keywords<'_, '_>,
    ) -> PyResult<Candidates> {
        let inflation = length(inflation, "inflation")?;
        let options = Options::new(keywords)?;
        let asked = ask(slf, scene, options, |detector, scene, query| {
            detector.candidates(scene, inflation, query)
        })?;
        Ok(Candidates::new(asked.answer))
    }

    fn _candidates_in_runs(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        each: &Bound<'_, PyAny>,
        inflation: &Bound<'_, PyAny>,
        most: &Bound<'_, PyAny>,
        keywords: Keywords<'_, '_>,
    ) -> PyResult<u64> {
        let inflation = length(inflation, "inflation")?;
        let most = unsigned(most, "most", u64::MAX)?;
        if !each.is_callable() {
            return Err(unexpected(each, "each", "a callable"));
        }
        let each = each.clone().unbind();
        let asked = ask(
            slf,
            scene,
            Options::new(keywords)?,
            |detector, scene, query| {
                // Called on the thread that called from Python.
                let hand_over = |run: impinge::Candidates| {
                    let called = Python::attach(|py| each.call1(py, (Candidates::new(run),)));
                    match called {
                        Ok(_) => ControlFlow::Continue(()),
                        Err(error) => ControlFlow::Break(error),
                    }
                };
                detector.candidates_in_runs(scene, inflation, query, most, hand_over)
            },
        )?;
        match asked.answer {
            ControlFlow::Continue(n) => Ok(n),
            ControlFlow::Break(error) => Err(error),
        }
    }

    fn _near(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        distance: &Bound<'_, PyAny>,
        keywords: Keywords<'_, '_>,
    ) -> PyResult<Near> {
        let distance = length(distance, "distance")?;
        let options = Options::new(keywords)?;
        let has = options.has_measures();
        let asked = ask(slf, scene, options, |detector, scene, query| {
            detector.near(scene, distance, query)
        })?;
        Ok(Near::new(asked.answer, has))
    }

    fn _safe_distances(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        most: &Bound<'_, PyAny>,
        keywords: Keywords<'_, '_>,
    ) -> PyResult<SafeDistances> {
        let most = length(most, "most")?;
        let options = Options::new(keywords)?;
        let has = options.has_measures();
        let asked = ask(slf, scene, options, |detector, scene, query| {
            detector.safe_distances(scene, most, query)
        })?;
        Ok(SafeDistances::new(asked.answer, asked.scene, has))
    }

    fn _neighbours(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        distance: &Bound<'_, PyAny>,
        keywords: Keywords<'_, '_>,
    ) -> PyResult<Neighbours> {
        let distance = length(distance, "distance")?;
        let options = Options::new(keywords)?;
        let asked = ask(slf, scene, options, |detector, scene, query| {
            detector.neighbours(scene, distance, query)
        })?;
        Ok(Neighbours::new(asked.answer, asked.scene))
    }

    fn _distance<'py>(
        slf: &Bound<'py, Self>,
        scene: &Bound<'_, PyAny>,
        a: &Bound<'_, PyAny>,
        b: &Bound<'_, PyAny>,
        keywords: Keywords<'_, '_>,
    ) -> PyResult<Option<Nearest<'py>>> {
        let options = Options::control(keywords)?;
        let bodies = |scene: &Scene, _: &Options<'_>| Ok([scene.id(a, "a")?, scene.id(b, "b")?]);
        let asked = ask_about(
            slf,
            scene,
            options,
            bodies,
            |detector, scene, &[a, b]: &[BodyId; 2]| detector.distance(scene, a, b),
        )?;
        nearest(slf.py(), asked)
    }

    fn _nearest<'py>(
        slf: &Bound<'py, Self>,
        scene: &Bound<'_, PyAny>,
        keywords: Keywords<'_, '_>,
    ) -> PyResult<Option<Nearest<'py>>> {
        let options = Options::new(keywords)?.between_all();
        let asked = ask(slf, scene, options, impinge::Detector::nearest)?;
        nearest(slf.py(), asked)
    }

    fn _contains<'py>(
        slf: &Bound<'py, Self>,
        scene: &Bound<'_, PyAny>,
        body: &Bound<'_, PyAny>,
        points: &Bound<'py, PyAny>,
        keywords: Keywords<'_, '_>,
    ) -> PyResult<Bound<'py, PyArray1<i8>>> {
        let places = of_points!(contains, slf, (scene, body, points), keywords);
        Ok(PyArray1::from_vec(slf.py(), places))
    }

    fn _signed_distance<'py>(
        slf: &Bound<'py, Self>,
        scene: &Bound<'_, PyAny>,
        body: &Bound<'_, PyAny>,
        points: &Bound<'py, PyAny>,
        keywords: Keywords<'_, '_>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let distances = of_points!(signed_distance, slf, (scene, body, points), keywords);
        Ok(PyArray1::from_vec(slf.py(), distances))
    }

    fn _winding_numbers<'py>(
        slf: &Bound<'py, Self>,
        scene: &Bound<'_, PyAny>,
        body: &Bound<'_, PyAny>,
        points: &Bound<'py, PyAny>,
        keywords: Keywords<'_, '_>,
    ) -> PyResult<Bound<'py, PyArray1<i32>>> {
        let found = of_points!(winding_numbers, slf, (scene, body, points), keywords);
        let numbers = found.iter().map(|winding| winding.unwrap_or(i32::MIN));
        Ok(PyArray1::from_vec(slf.py(), collect(found.len(), numbers)?))
    }

    fn _locate<'py>(
        slf: &Bound<'py, Self>,
        scene: &Bound<'_, PyAny>,
        body: &Bound<'_, PyAny>,
        points: &Bound<'py, PyAny>,
        keywords: Keywords<'_, '_>,
    ) -> PyResult<Bound<'py, PyArray1<i64>>> {
        let found = of_points!(locate, slf, (scene, body, points), keywords);
        let numbers = found.iter().map(|found| found.map_or(-1, i64::from));
        Ok(PyArray1::from_vec(slf.py(), collect(found.len(), numbers)?))
    }

    fn _closest(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        points: &Bound<'_, PyAny>,
        most: &Bound<'_, PyAny>,
        keywords: Keywords<'_, '_>,
    ) -> PyResult<Closest> {
        let points = PositionArray::new(points, "points")?;
        let points = points.rows()?;
        let most = length(most, "most")?;
        let options = Options::new(keywords)?;
        let asked = ask(slf, scene, options, |detector, scene, query| {
            with_rows!(points, |points| detector
                .closest(scene, points, most, query))
        })?;
        Ok(Closest {
            inner: asked.answer,
        })
    }

    fn _cast(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        origins: &Bound<'_, PyAny>,
        directions: &Bound<'_, PyAny>,
        most: &Bound<'_, PyAny>,
        keywords: Keywords<'_, '_>,
    ) -> PyResult<Hits> {
        let origins = PositionArray::new(origins, "origins")?;
        let directions = PositionArray::new(directions, "directions")?;
        let rays = [origins.rows()?, directions.rows()?];
        let most = length(most, "most")?;
        let options = Options::new(keywords)?;
        let hits = options.hits;
        let asked = ask(slf, scene, options, |detector, scene, query| match rays {
            [Rows::F32(origins), Rows::F32(directions)] => {
                detector.cast(scene, origins, directions, most, query)
            }
            mixed => {
                let [origins, directions] = mixed.map(Rows::widened);
                detector.cast(scene, &origins, &directions, most, query)
            }
        })?;
        Ok(Hits {
            inner: asked.answer,
            hits,
        })
    }

    fn _contacts(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        pairs: &Bound<'_, Pairs>,
        keywords: Keywords<'_, '_>,
    ) -> PyResult<Contacts> {
        let (pairs, of_scene) = pairs.get().parts();
        let known = |scene: &Scene, _: &Options<'_>| match of_scene == scene.number {
            true => Ok(pairs),
            false => Err(invalid("pairs: of another scene")),
        };
        let options = Options::control(keywords)?;
        let asked = ask_about(slf, scene, options, known, |detector, scene, pairs| {
            detector.contacts(scene, pairs)
        })?;
        Ok(Contacts::new(asked.answer, asked.scene))
    }

    fn _penetration(
        slf: &Bound<'_, Self>,
        scene: &Bound<'_, PyAny>,
        contacts: &Bound<'_, PyAny>,
        a: &Bound<'_, PyAny>,
        b: &Bound<'_, PyAny>,
        keywords: Keywords<'_, '_>,
    ) -> PyResult<Penetration> {
        let contacts = contacts
            .cast::<Contacts>()
            .map_err(|_| unexpected(contacts, "contacts", "Contacts"))?
            .get();
        let bodies = |scene: &Scene, _: &Options<'_>| match contacts.scene == scene.number {
            true => Ok([scene.id(a, "a")?, scene.id(b, "b")?]),
            false => Err(invalid("contacts: of another scene")),
        };
        let options = Options::control(keywords)?;
        let asked = ask_about(
            slf,
            scene,
            options,
            bodies,
            |detector, scene, &[a, b]: &[BodyId; 2]| {
                detector.penetration(scene, &contacts.inner, a, b)
            },
        )?;
        Ok(Penetration {
            inner: asked.answer,
        })
    }

    fn _stats<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        statistics::to_dict(py, self.inner.stats())
    }

    fn _start_intersects(&self) -> Option<bool> {
        self.inner.start_intersects()
    }

    fn _settings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        settings::to_dict(py, self.inner.settings())
    }
}

impl DetectorBase {
    /// Refuses a detector with threads or a GPU in a fork of the process that made it.
    fn check_process(&self) -> PyResult<()> {
        let settings = self.inner.settings();
        let is_alone = settings.threads == 1 && settings.backend == Backend::Cpu;
        if is_alone || self.process == std::process::id() {
            return Ok(());
        }
        Err(PyRuntimeError::new_err(
            "this detector was made before this process was forked, and threads and a GPU do not survive a fork: \
             make one here",
        ))
    }
}

fn nearest<'py>(
    py: Python<'py>,
    asked: Asked<Option<impinge::proximity::Nearest>>,
) -> PyResult<Option<Nearest<'py>>> {
    let Asked {
        answer: Some(found),
        scene,
    } = asked
    else {
        return Ok(None);
    };
    let body = |id| Body { id, scene };
    let (a, b) = (found.a, found.b);
    let points = PyArray1::from_slice(py, found.points.as_flattened());
    Ok(Some((
        found.distance,
        body(a.body),
        a.element,
        body(b.body),
        b.element,
        points.reshape([2, 3])?,
    )))
}

/// An answer, and the number of its scene.
struct Asked<T> {
    answer: T,
    scene: u64,
}

/// Asks about a choice of pairs.
fn ask<T: Send>(
    detector: &Bound<'_, DetectorBase>,
    scene: &Bound<'_, PyAny>,
    options: Options<'_>,
    answer: impl FnOnce(&mut impinge::Detector, &impinge::Scene, &Query) -> Result<T, impinge::Error>
    + Send,
) -> PyResult<Asked<T>> {
    let query = |scene: &Scene, options: &Options<'_>| options.query(scene);
    ask_about(detector, scene, options, query, answer)
}

/// Asks where points are in a body.
fn ask_of_body<'py, T: Send>(
    detector: &Bound<'py, DetectorBase>,
    (scene, body, points): (&Bound<'py, PyAny>, &Bound<'py, PyAny>, &Bound<'py, PyAny>),
    keywords: Keywords<'_, 'py>,
    ask: impl FnOnce(
        &mut impinge::Detector,
        &impinge::Scene,
        impinge::BodyId,
        Rows<'_>,
    ) -> Result<T, impinge::Error>
    + Send,
) -> PyResult<T> {
    let points = PositionArray::new(points, "points")?;
    let points = points.rows()?;
    let options = Options::control(keywords)?;
    let body = |scene: &Scene, _: &Options<'_>| scene.id(body, "body");
    let asked = ask_about(detector, scene, options, body, |detector, scene, &body| {
        ask(detector, scene, body, points)
    })?;
    Ok(asked.answer)
}

/// Asks about a scene and answers with the interpreter released, watched for Ctrl-C, progress and
/// cancellation. `question` is made when the scene is known.
fn ask_about<'py, Q: Sync + Send, T: Send>(
    detector: &Bound<'py, DetectorBase>,
    scene: &Bound<'py, PyAny>,
    mut options: Options<'py>,
    question: impl FnOnce(&Scene, &Options<'py>) -> PyResult<Q>,
    answer: impl FnOnce(&mut impinge::Detector, &impinge::Scene, &Q) -> Result<T, impinge::Error> + Send,
) -> PyResult<Asked<T>> {
    let py = detector.py();
    let scene = scene
        .cast::<Scene>()
        .map_err(|_| unexpected(scene, "scene", "a Scene"))?;
    let mut detector = detector.try_borrow_mut().map_err(|_| {
        PyRuntimeError::new_err("the detector is busy: give each thread one of its own")
    })?;
    let scene = scene
        .try_borrow()
        .map_err(|_| PyRuntimeError::new_err("the scene is being changed by another thread"))?;
    let question = question(&scene, &options)?;
    detector.check_process()?;
    let watch = Arc::new(Watch::new(options.progress.take(), options.cancel.take()));
    let (inner, bodies) = (&mut detector.inner, &scene.inner);
    let answer = py.detach(|| {
        let step = Arc::clone(&watch);
        let control = Control::new().cancel(&watch.stop);
        inner.set_control(control.progress(move |at| step.step(at)));
        answer(inner, bodies, &question)
    });
    if let Some(error) = watch.raised() {
        return Err(error);
    }
    if let Some(filter) = &options.filter {
        filter.get().check()?;
    }
    Ok(Asked {
        answer: answer.map_err(raise)?,
        scene: scene.number,
    })
}
