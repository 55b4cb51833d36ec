//! What an `impinge_query` asks, in the words of the crate `impinge`. The only place that knows
//! them.

use std::ffi::c_void;

use impinge::{
    BodyId, Clearance, Exclusion, Hit, PairFilter, PairKind, Precision, Query, SharedVertex, Start,
};

use crate::answers::impinge_near;
use crate::arrays::{collect, indices};
use crate::scene::Bodies;
use crate::sized::read_sized;
use crate::status::{Failure, held};
use crate::types::*;

/// A query of a caller, checked: its size, its flags and what this version does not know.
pub struct Asked<'a> {
    given: impinge_query,
    scene: &'a Bodies,
}

fn refuse<T>(field: &str, given: impl std::fmt::Display, allowed: &str) -> Result<T, Failure> {
    Err(Failure::invalid(format!(
        "{field}: {given} given, {allowed}"
    )))
}

impl<'a> Asked<'a> {
    /// # Safety
    /// `query` is NULL or points to a query as `impinge.h` describes it.
    #[inline(never)]
    pub unsafe fn read(query: *const impinge_query, scene: &'a Bodies) -> Result<Self, Failure> {
        // SAFETY: the caller's promise.
        let given = unsafe { read_sized(query) }?;
        let known = DISTANCES | CLOSEST_POINTS | CELL;
        if given.flags & !known != 0 {
            return refuse(
                "flags",
                given.flags,
                "IMPINGE_DISTANCES, IMPINGE_CLOSEST_POINTS and IMPINGE_CELL allowed in this version",
            );
        }
        for (field, given) in [("between", given.between), ("self", given.own)] {
            if given > 1 {
                return refuse(field, given, "0 or 1 allowed");
            }
        }
        Ok(Asked { given, scene })
    }

    /// What is asked of rays.
    pub fn hits(&self) -> Result<Hit, Failure> {
        match self.given.hits {
            HITS_FIRST => Ok(Hit::First),
            HITS_ANY => Ok(Hit::Any),
            HITS_ALL => Ok(Hit::All),
            other => refuse("hits", other, "IMPINGE_HITS_FIRST, _ANY or _ALL allowed"),
        }
    }

    /// The query of a question about a step.
    #[inline(never)]
    pub fn step(&self) -> Result<Query, Failure> {
        let query = self.how(self.bodies()?)?;
        Ok(match self.given.passes {
            None => query,
            Some(passes) => query.filter(pair_filter(passes, self.given.passes_user)),
        })
    }

    /// The query of any other question.
    #[inline(never)]
    pub fn query(&self) -> Result<Query, Failure> {
        match self.given.passes {
            None => self.how(self.bodies()?),
            Some(_) => refuse("passes", "a function", "NULL allowed but for steps"),
        }
    }

    fn bodies(&self) -> Result<Query, Failure> {
        let query = self.scope()?.shared_vertex(match self.given.shared_vertex {
            SKIP => SharedVertex::Skip,
            RESOLVE => SharedVertex::Resolve,
            other => {
                return refuse(
                    "shared_vertex",
                    other,
                    "IMPINGE_RESOLVE or IMPINGE_SKIP allowed",
                );
            }
        });
        let query = match self.given.flags & CELL {
            0 => query,
            _ => query.owned_by(self.given.cell_low, self.given.cell_high),
        };
        let query = match self.given.kinds {
            0 => query,
            bits if bits >> PairKind::ALL.len() == 0 => query.kinds(listed(bits)),
            bits => {
                return refuse(
                    "kinds",
                    bits,
                    "a sum of IMPINGE_VF, _EE, _EV, _VV, _EF and _FF allowed",
                );
            }
        };
        let mut query = query;
        let exclusions = list("exclusions", self.given.exclusions, self.given.n_exclusions)?;
        for (ix, exclusion) in exclusions.iter().enumerate() {
            query = query.exclude(self.exclusion(ix, exclusion)?);
        }
        let rest_pairs = list("rest_pairs", self.given.rest_pairs, self.given.n_rest_pairs)?;
        for (ix, &near) in rest_pairs.iter().enumerate() {
            // SAFETY: the caller's handles, which live during the call.
            let near = unsafe { held(near.cast::<impinge_near>(), &format!("rest_pairs[{ix}]")) }?;
            query = query.exclude(near.exclusion());
        }
        Ok(query)
    }

    fn exclusion(&self, ix: usize, given: &impinge_exclusion) -> Result<Exclusion, Failure> {
        match given.kind {
            EXCLUDE_BODIES => {
                let [a, b] = [given.a, given.b].map(|body| self.scene.id(body));
                Ok((a?, b?).into())
            }
            EXCLUDE_RINGS => Ok(Exclusion::rings(given.n)),
            EXCLUDE_GROUPS => Ok(Exclusion::groups(given.a, given.b)),
            EXCLUDE_VERTICES => {
                let [a, b] = [given.a, given.b].map(|body| self.scene.id(body));
                let numbers = |of, name| {
                    // SAFETY: the caller's arrays, which live during the call.
                    let rows = unsafe { indices::<1>(of, &format!("exclusions[{ix}].{name}")) }?;
                    Ok::<_, Failure>(rows.into_flattened())
                };
                let offsets = numbers(&given.offsets, "offsets")?;
                let offsets = collect(offsets.into_iter().map(u64::from), "offsets")?;
                let vertices = numbers(&given.vertices, "vertices")?;
                Ok(Exclusion::vertices(a?, b?, offsets, vertices))
            }
            other => refuse(
                &format!("exclusions[{ix}].kind"),
                other,
                "IMPINGE_EXCLUDE_BODIES, _RINGS, _GROUPS and _VERTICES allowed",
            ),
        }
    }

    fn fixed(&self) -> Result<Vec<BodyId>, Failure> {
        let fixed = list("fixed", self.given.fixed, self.given.n_fixed)?;
        fixed.iter().map(|&body| self.scene.id(body)).collect()
    }

    fn scope(&self) -> Result<Query, Failure> {
        let impinge_query {
            a, b, between, own, ..
        } = self.given;
        match (a, b, between, own) {
            (ANY_BODY, ANY_BODY, 1, 1) => Ok(Query::all()),
            (ANY_BODY, ANY_BODY, 1, 0) => Ok(Query::between_all()),
            (ANY_BODY, ANY_BODY, 0, 1) => Ok(Query::self_all()),
            (_, _, 0, 0) => refuse("between and self", "0", "one of them needed"),
            (ANY_BODY, b, _, _) => refuse("b", b, "without a: name one body by a alone"),
            (a, ANY_BODY, 1, 0) => Ok(Query::across([self.scene.id(a)?])),
            (a, ANY_BODY, 0, _) => Ok(Query::self_of(self.scene.id(a)?)),
            (a, ANY_BODY, _, _) => Ok(Query::of(self.scene.id(a)?)),
            (a, b, _, _) => Ok(Query::between(self.scene.id(a)?, self.scene.id(b)?)),
        }
    }

    /// Adds what is not about which pairs.
    fn how(&self, query: Query) -> Result<Query, Failure> {
        let impinge_query {
            separation,
            clearance,
            clearance_share,
            flags,
            ..
        } = self.given;
        let query = match flags & (DISTANCES | CLOSEST_POINTS) {
            0 => query,
            DISTANCES => query.distances(),
            _ => query.closest_points(),
        };
        Ok(query
            .fixed(self.fixed()?)
            .hits(self.hits()?)
            .n_nearest(self.given.n_nearest)
            .start(match self.given.start {
                START_REPORT => Start::Report,
                START_SKIP => Start::Skip,
                START_VERIFY => Start::Verify,
                other => {
                    return refuse(
                        "start",
                        other,
                        "IMPINGE_START_REPORT, _SKIP or _VERIFY allowed",
                    );
                }
            })
            .precision(match self.given.precision {
                F32 => Precision::F32,
                F64 => Precision::F64,
                other => return refuse("precision", other, "IMPINGE_F32 or IMPINGE_F64 allowed"),
            })
            .separation(separation)
            .clearance(Clearance::new(clearance).share(clearance_share)))
    }
}

/// A list of a caller.
fn list<'a, T>(field: &str, items: *const T, n: usize) -> Result<&'a [T], Failure> {
    match n {
        0 => Ok(&[]),
        _ if items.is_null() => refuse(field, "NULL", &format!("{n} needed")),
        _ if !items.is_aligned() => Err(Failure::misaligned(items, field)),
        // SAFETY: the caller says how many there are, and that they are there during the call.
        _ => Ok(unsafe { std::slice::from_raw_parts(items, n) }),
    }
}

/// A filter that asks a function of the caller.
fn pair_filter(passes: PassesCallback, user: *mut c_void) -> PairFilter {
    struct User(*mut c_void);
    // SAFETY: `impinge.h` says that threads call the function at the same time.
    unsafe impl Send for User {}
    // SAFETY: as above.
    unsafe impl Sync for User {}
    impl User {
        fn get(&self) -> *mut c_void {
            self.0
        }
    }
    let user = User(user);
    PairFilter::new(move |pair| {
        let [a, b] = pair.map(|(body, vertices)| impinge_element {
            vertices: vertices.as_ptr(),
            n_vertices: vertices.len() as u32,
            body: body.index() as u32,
        });
        // SAFETY: the caller's function, with the caller's argument and elements that live as long
        // as the call.
        unsafe { passes(user.get(), &a, &b) != 0 }
    })
}

/// Refuses a length that is negative or not finite.
pub fn check_length(name: &str, length: f64) -> Result<(), Failure> {
    match length.is_finite() && length >= 0.0 {
        true => Ok(()),
        false => refuse(
            name,
            format_args!("{length:?}"),
            "a finite number that is not below 0 allowed",
        ),
    }
}

/// The kinds of a bit mask.
fn listed(bits: u32) -> impl Iterator<Item = PairKind> {
    PairKind::ALL
        .into_iter()
        .filter(move |&kind| bits & bit(kind) != 0)
}
