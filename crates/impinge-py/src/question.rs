//! Which bodies a question is about, from the keywords that all questions share.

use impinge::Query;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBool;

use crate::arrays;
use crate::result::Asked;
use crate::scene::Scene;
use crate::settings::{Argument, shared_vertex, unexpected};

/// What the keywords ask of the pairs of a scene. Without `between` and `within`, those of different bodies.
pub fn question(
    scene: &Scene,
    between: Argument<'_, '_>,
    within: Argument<'_, '_>,
    ignore: Argument<'_, '_>,
    rule: Argument<'_, '_>,
    owned_by: Argument<'_, '_>,
) -> PyResult<(Query, Asked)> {
    let rule = shared_vertex(rule)?;
    let (query, asked) = scope(scene, between, within, ignore, &Query::all())?;
    let query = query.shared_vertex(rule);
    Ok((of_cell(query, owned_by)?, asked))
}

/// Only the pairs of a cell, if there is one.
fn of_cell(query: Query, owned_by: Argument<'_, '_>) -> PyResult<Query> {
    let Some(cell) = owned_by else {
        return Ok(query);
    };
    let [low, high] = arrays::matrix(cell, "owned_by")?;
    Ok(query.owned_by(low, high))
}

/// What the keywords `between`, `within`, `ignore` and `owned_by` ask of a step. Without the first two, all pairs of all bodies.
pub fn step_question(
    scene: &Scene,
    [between, within, ignore, owned_by]: [Argument<'_, '_>; 4],
) -> PyResult<Query> {
    let (query, _) = scope(scene, between, within, ignore, &Query::everything())?;
    of_cell(query, owned_by)
}

fn scope(
    scene: &Scene,
    between: Argument<'_, '_>,
    within: Argument<'_, '_>,
    ignore: Argument<'_, '_>,
    default: &Query,
) -> PyResult<(Query, Asked)> {
    let (mut query, asked) = match (Scope::new(between), Scope::new(within)) {
        (Scope::Nothing, Scope::Nothing) => (default.clone(), Asked::Many),
        (Scope::All, Scope::Nothing) => (Query::all(), Asked::Many),
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
