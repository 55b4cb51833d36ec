//! The options of a question, from Python's keywords or a `Query`.

use impinge::{BodyId, Clearance, Hit, PairKind, Precision, Query, SharedVertex, Start};
use pyo3::exceptions::PyTypeError;
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};

use crate::arrays;
use crate::errors::invalid;
use crate::exclusion::Exclusion;
use crate::scene::Scene;
use crate::settings::{WHICH, choose_one, flag, length, number, unexpected, whole, words};
use crate::vertex_filter::VertexFilter;
use crate::watch::CancelToken;

/// The options that users may name, in the order of the documentation.
const NAMES: [&str; 21] = [
    "which",
    "between",
    "self_of",
    "of",
    "kinds",
    "shared_vertex",
    "exclude",
    "owned_by",
    "start",
    "separation",
    "clearance",
    "clearance_share",
    "precision",
    "distances",
    "closest_points",
    "hits",
    "n_nearest",
    "fixed",
    "query",
    "cancel",
    "progress",
];

/// Those of a question that is about no choice of pairs.
const CONTROL: [&str; 2] = ["cancel", "progress"];

/// What was said of a question. Its bodies are not looked up yet.
#[derive(Default)]
pub struct Options<'py> {
    scope: Option<Scope<'py>>,
    exclude: Vec<Excluded<'py>>,
    kinds: Option<Vec<PairKind>>,
    shared_vertex: SharedVertex,
    cell: Option<[[f64; 3]; 2]>,
    start: Start,
    separation: f64,
    clearance: f64,
    share: Option<f64>,
    pub precision: Precision,
    pub distances: bool,
    pub closest_points: bool,
    pub hits: Hit,
    n_nearest: Option<u32>,
    fixed: Vec<Bound<'py, PyAny>>,
    pub cancel: Option<impinge::CancelToken>,
    pub progress: Option<Py<PyAny>>,
    /// Of `impinge.ipc`.
    pub filter: Option<Bound<'py, VertexFilter>>,
}

/// What is left out.
enum Excluded<'py> {
    Bodies([Bound<'py, PyAny>; 2]),
    Ready(Bound<'py, Exclusion>),
}

/// Which pairs of bodies.
enum Scope<'py> {
    /// Whether pairs of different bodies count, and those of one body.
    Many([bool; 2]),
    Between([Bound<'py, PyAny>; 2]),
    SelfOf(Bound<'py, PyAny>),
    Of(Bound<'py, PyAny>),
    /// Of `CollisionManager`.
    Across(Vec<Bound<'py, PyAny>>),
}

impl<'py> Options<'py> {
    /// Reads keywords. Those that are `None` were not given.
    pub fn new(keywords: &Bound<'py, PyDict>) -> PyResult<Self> {
        let mut options = Options::default();
        if keywords.is_empty() {
            return Ok(options);
        }
        if let Some(query) = keywords.get_item(intern!(keywords.py(), "query"))?
            && !query.is_none()
        {
            let given = query.getattr("_given");
            let given = given.map_err(|_| unexpected(&query, "query", "a Query"))?;
            options.tell_all(given.cast()?)?;
        }
        options.tell_all(keywords)?;
        Ok(options)
    }

    /// Reads the keywords of a question that is not about a choice of pairs.
    pub fn control(keywords: &Bound<'py, PyDict>) -> PyResult<Self> {
        for name in keywords.keys() {
            let name = name.extract::<String>()?;
            if !CONTROL.contains(&name.as_str()) {
                return Err(unknown(&name, &CONTROL, "allowed"));
            }
        }
        Options::new(keywords)
    }

    fn tell_all(&mut self, keywords: &Bound<'py, PyDict>) -> PyResult<()> {
        let mut scope: Option<String> = None;
        for (name, value) in keywords {
            if value.is_none() {
                continue;
            }
            let name = name.extract::<String>()?;
            if matches!(name.as_str(), "which" | "between" | "self_of" | "of") {
                if let Some(other) = scope {
                    return Err(invalid(format!(
                        "{other} and {name}: two choices of pairs given, one of which, between, self_of and of allowed"
                    )));
                }
                scope = Some(name.clone());
            }
            self.tell(&name, value)?;
        }
        Ok(())
    }

    fn tell(&mut self, name: &str, value: Bound<'py, PyAny>) -> PyResult<()> {
        match name {
            "which" => self.scope = Some(Scope::Many(choose_one(&value, name, &WHICH)?)),
            "between" => self.scope = Some(Scope::Between(two_bodies(&value, name)?)),
            "self_of" => self.scope = Some(Scope::SelfOf(value)),
            "of" => self.scope = Some(Scope::Of(value)),
            "kinds" => self.kinds = Some(kinds(&value)?),
            "shared_vertex" => self.shared_vertex = choose_one(&value, name, words!(SharedVertex))?,
            "exclude" => self.exclude = exclusions(&value)?,
            "owned_by" => self.cell = Some(arrays::matrix(&value, name)?),
            "start" => self.start = choose_one(&value, name, words!(Start))?,
            "separation" => self.separation = length(&value, name)?,
            "clearance" => self.clearance = length(&value, name)?,
            "clearance_share" => self.share = Some(number(&value, name)?),
            "precision" => self.precision = choose_one(&value, name, words!(Precision))?,
            "distances" => self.distances = flag(&value, name)?,
            "closest_points" => self.closest_points = flag(&value, name)?,
            "hits" => self.hits = choose_one(&value, name, words!(Hit))?,
            "n_nearest" => {
                let n = whole(&value, name, 1..=u64::from(u32::MAX))?;
                self.n_nearest = Some(n as u32);
            }
            "fixed" => {
                let bodies = items(&value);
                self.fixed =
                    bodies.ok_or_else(|| unexpected(&value, name, "a sequence of bodies"))?;
            }
            "query" => {}
            "cancel" => {
                let token = value.cast::<CancelToken>();
                let token = token.map_err(|_| unexpected(&value, name, "a CancelToken"))?;
                self.cancel = Some(token.get().inner.clone());
            }
            "progress" if value.is_callable() => self.progress = Some(value.unbind()),
            "progress" => return Err(unexpected(&value, name, "a callable")),
            "_across" => {
                let bodies = items(&value);
                let bodies =
                    bodies.ok_or_else(|| unexpected(&value, "across", "a sequence of bodies"));
                self.scope = Some(Scope::Across(bodies?));
            }
            "_filter" => self.filter = Some(value.cast_into()?),
            _ => {
                return Err(unknown(
                    name,
                    &NAMES,
                    "are, each of questions with a use for it",
                ));
            }
        }
        Ok(())
    }

    /// Whether distances are asked for, and nearest points.
    pub fn has_measures(&self) -> [bool; 2] {
        [self.distances || self.closest_points, self.closest_points]
    }

    /// The same, about pairs of different bodies unless something else was said.
    pub fn between_all(mut self) -> Self {
        self.scope.get_or_insert(Scope::Many([true, false]));
        self
    }

    /// The question, about the bodies of a scene.
    pub fn query(&self, scene: &Scene) -> PyResult<Query> {
        let mut query = match &self.scope {
            None | Some(Scope::Many([true, true])) => Query::all(),
            Some(Scope::Many([true, false])) => Query::between_all(),
            Some(Scope::Many([false, _])) => Query::self_all(),
            Some(Scope::Between([a, b])) => {
                Query::between(scene.id(a, "between")?, scene.id(b, "between")?)
            }
            Some(Scope::SelfOf(body)) => Query::self_of(scene.id(body, "self_of")?),
            Some(Scope::Of(body)) => Query::of(scene.id(body, "of")?),
            Some(Scope::Across(bodies)) => {
                let ids = bodies.iter().map(|body| scene.id(body, "across"));
                Query::across(ids.collect::<PyResult<Vec<BodyId>>>()?)
            }
        };
        for (ix, excluded) in self.exclude.iter().enumerate() {
            query = match excluded {
                Excluded::Bodies([a, b]) => {
                    let name = format!("exclude[{ix}]");
                    query.exclude((scene.id(a, &name)?, scene.id(b, &name)?))
                }
                Excluded::Ready(exclusion) if !exclusion.get().is_of(scene.number) => {
                    return Err(invalid(format!("exclude[{ix}]: of another scene")));
                }
                Excluded::Ready(exclusion) => query.exclude(exclusion.get().inner.clone()),
            };
        }
        if let Some(kinds) = &self.kinds {
            query = query.kinds(kinds.iter().copied());
        }
        if let Some([low, high]) = self.cell {
            query = query.owned_by(low, high);
        }
        let mut clearance = Clearance::new(self.clearance);
        if let Some(share) = self.share {
            clearance = clearance.share(share);
        }
        query = query
            .shared_vertex(self.shared_vertex)
            .start(self.start)
            .separation(self.separation)
            .clearance(clearance)
            .precision(self.precision)
            .hits(self.hits);
        if let Some(n) = self.n_nearest {
            query = query.n_nearest(n);
        }
        let fixed = self.fixed.iter().enumerate();
        let fixed = fixed.map(|(ix, body)| scene.id(body, &format!("fixed[{ix}]")));
        query = query.fixed(fixed.collect::<PyResult<Vec<BodyId>>>()?);
        if let Some(filter) = &self.filter {
            query = query.filter(filter.get().inner.clone());
        }
        Ok(match (self.closest_points, self.distances) {
            (true, _) => query.closest_points(),
            (false, true) => query.distances(),
            (false, false) => query,
        })
    }
}

/// Refuses options that no question could take, before there is a scene.
#[pyfunction]
pub fn _check_options(options: &Bound<'_, PyDict>) -> PyResult<()> {
    Options::new(options).map(|_| ())
}

/// The names of options are told in Python's way of refusing a keyword.
fn unknown(name: &str, options: &[&str], end: &str) -> PyErr {
    PyTypeError::new_err(format!(
        "{name}: no such option, {} {end}",
        options.join(", ")
    ))
}

/// The items of a sequence that is no string.
fn items<'py>(value: &Bound<'py, PyAny>) -> Option<Vec<Bound<'py, PyAny>>> {
    if value.is_instance_of::<PyString>() {
        return None;
    }
    let items = value.try_iter().and_then(|items| items.collect());
    items.ok()
}

fn two_bodies<'py>(value: &Bound<'py, PyAny>, name: &str) -> PyResult<[Bound<'py, PyAny>; 2]> {
    let items = items(value).ok_or_else(|| {
        PyTypeError::new_err(format!("{name}: a pair of bodies expected, such as (a, b)"))
    })?;
    items.try_into().map_err(|items: Vec<_>| {
        invalid(format!(
            "{name}: two bodies expected, {} given",
            items.len()
        ))
    })
}

/// One pair of bodies, one `Exclusion`, or many of both.
fn exclusions<'py>(value: &Bound<'py, PyAny>) -> PyResult<Vec<Excluded<'py>>> {
    if let Ok(exclusion) = value.cast::<Exclusion>() {
        return Ok(vec![Excluded::Ready(exclusion.clone())]);
    }
    let expected = "a pair of bodies, an Exclusion, or a sequence of these,";
    let items = items(value).ok_or_else(|| unexpected(value, "exclude", expected))?;
    let is_body = |item: &Bound<'py, PyAny>| item.hasattr("__index__").unwrap_or(false);
    match <[Bound<'py, PyAny>; 2]>::try_from(items) {
        Ok(pair) if pair.iter().all(is_body) => Ok(vec![Excluded::Bodies(pair)]),
        Ok(two) => each_exclusion(&two),
        Err(many) => each_exclusion(&many),
    }
}

fn each_exclusion<'py>(items: &[Bound<'py, PyAny>]) -> PyResult<Vec<Excluded<'py>>> {
    let items = items.iter().enumerate();
    items
        .map(|(ix, item)| match item.cast::<Exclusion>() {
            Ok(exclusion) => Ok(Excluded::Ready(exclusion.clone())),
            Err(_) => two_bodies(item, &format!("exclude[{ix}]")).map(Excluded::Bodies),
        })
        .collect()
}

fn kinds(value: &Bound<'_, PyAny>) -> PyResult<Vec<PairKind>> {
    let choices = PairKind::ALL.map(|kind| (kind.name(), kind));
    // A string is a sequence of strings, too, of letters.
    if value.is_instance_of::<PyString>() {
        return Ok(vec![choose_one(value, "kinds", &choices)?]);
    }
    let expected = "a sequence of names such as (\"vf\", \"ee\")";
    let names = items(value).ok_or_else(|| unexpected(value, "kinds", expected))?;
    let names = names.iter().enumerate();
    names
        .map(|(ix, kind)| choose_one(kind, &format!("kinds[{ix}]"), &choices))
        .collect()
}

/// An argument that is one of the names of kinds of pairs.
pub fn pair_kind(value: &Bound<'_, PyAny>) -> PyResult<PairKind> {
    choose_one(
        value,
        "kind",
        &PairKind::ALL.map(|kind| (kind.name(), kind)),
    )
}
