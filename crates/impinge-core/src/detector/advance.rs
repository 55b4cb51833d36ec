//! A detector's answer how far a step can be taken.

use super::Detector;
use super::steps::StartAnswer;
use crate::answers::advance::Advance;
use crate::answers::impacts::Impact;
use crate::answers::reached::Reached;
use crate::plan::{Plan, TestId};
use crate::query::Query;
use crate::query::pair_kind::PairKind;
use crate::query::progress::Control;
use crate::query::settings::Method;
use crate::query::step::Start;
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::positions::Positions;
use crate::search::found::PairList;
use crate::search::narrow::{FirstContact, PairElement};

impl Detector {
    /// How far the step can be taken: a fraction of it, backed off from the first contact hardly
    /// more than the precision of positions asks for, for which the straight way from the start to
    /// the *rounded* positions is free.
    ///
    /// Positions that are stored are rounded, and rounding alone may make elements touch that did
    /// not. So each fraction is tried: positions are rounded first, and the way to those must be
    /// free in the sense of [`is_free`](Detector::is_free). A chain of such steps is free from the
    /// first to the last, whatever the rounding, if its start was free of intersections;
    /// [`Start::Verify`] asks that, and allows no step if it was not. The first fraction tried is
    /// that of the first contact; then the back-off doubles, from the last bit on, so it is less
    /// than twice what is needed.
    ///
    /// On the CPU all pairs are searched once, and rounded positions are tested on the pairs that
    /// rounding may bring together. On a GPU, with a separation, a thickness or a memory budget,
    /// and where too many pairs are that close, all pairs are searched again for rounded positions.
    ///
    /// With a [clearance](Query::clearance), every pair keeps what that says, and what floats can
    /// round besides. So the fraction holds for solvers too, which compute positions themselves: as
    /// `x0 + a * (x1 - x0)` or `x0 + a * dx` with `x1 = x0 + dx`, in the precision of the
    /// positions, for *every* `a` from 0 to the fraction, the straight way there is free and keeps
    /// the clearance. The fraction is rounded down to an `f32`, and a single search is enough. It
    /// is 0 if moving elements are nearer at the start than rounding can move them: about 25 unit
    /// roundoffs of their largest coordinate. Without a clearance, only the positions of the answer
    /// are proven.
    ///
    /// Pairs that touch at the start allow no step at all under [`Start::Report`], and are ignored
    /// under [`Start::Skip`]. The seams of a mesh that was not welded are such pairs: they are
    /// refused by name, because no step would ever be possible. Weld the mesh
    /// ([`Weld`](crate::Weld)), or skip what touches at the start.
    ///
    /// # Errors
    /// As [`impacts`](Detector::impacts), and [`Error::Seam`].
    pub fn advance(&mut self, scene: &Scene, query: &Query) -> Result<Advance, Error> {
        let control = &self.control.clone();
        refuse_cell(query)?;
        let with_close = self.lists_close_pairs();
        let plan = Plan::advance(scene, query, with_close, self.limits_of_steps())?;
        self.check_step(scene, &plan)?;
        let start = self.verify(scene, query)?;
        let seen = self.find_contacts(scene, &plan, control, (start, false))?;
        let contacts = self.steps.contacts.found();
        let touching = contacts.filter(|(_, found)| found.value.at_start);
        refuse_seams(
            scene,
            &plan,
            touching.map(|(kind, found)| (kind, found.key)),
        )?;
        let mut advance = Advance {
            fraction: 1.0,
            first: self.steps.contacts.first(plan.precision),
            start_intersects: start.map(|StartAnswer { intersects, .. }| intersects),
            n_tried: 1,
            reached: Reached::from_start(scene),
        };
        self.take_positions(scene, query, &plan, seen.close, control, &mut advance)?;
        Ok(advance)
    }

    /// Refuses positions that are not finite: of the bodies that are asked about, and of the others
    /// that take the step.
    pub(super) fn check_step(&self, scene: &Scene, plan: &Plan) -> Result<(), Error> {
        plan.check(scene, self.runner.workers())?;
        scene.check_moving()
    }

    /// Slots the bodies as far on their ways as they can be.
    fn take_positions(
        &mut self,
        scene: &Scene,
        query: &Query,
        plan: &Plan,
        close: Option<PairList>,
        control: &Control,
        advance: &mut Advance,
    ) -> Result<(), Error> {
        let start_intersects = advance.start_intersects;
        if start_intersects == Some(true) {
            advance.fraction = 0.0;
            advance.reached.positions = moving(scene).map(|(id, at, _)| (id, at.clone())).collect();
            return Ok(());
        }
        match advance.first {
            None => {
                let ends = moving(scene).map(|(id, _, end)| (id, end.clone()));
                advance.reached.positions = ends.collect();
                Ok(())
            }
            // Rounding is part of what the pairs keep.
            Some(first) if plan.has_clearance() => {
                advance.fraction = first.toi;
                advance.reached.positions = blended(scene, first.toi);
                Ok(())
            }
            Some(first) => {
                let known = (self.pairs_at(plan, first), close);
                self.back_off(scene, query, plan, known, control, advance)
            }
        }
    }

    /// The pairs of a contact, which probably touch on the way to rounded positions, too.
    fn pairs_at(&self, plan: &Plan, first: Impact) -> PairList {
        let contacts = &self.steps.contacts;
        let same = |&(kind, found): &(_, &_)| {
            contacts.impacts.impact(kind, plan.precision, found) == first
        };
        let found = contacts.found().filter(same);
        found.map(|(kind, found)| (kind, found.key)).collect()
    }

    /// Backs off from the first contact until the way to rounded positions is free. `known`: pairs
    /// that may touch on such ways, and all others, if they were listed.
    fn back_off(
        &mut self,
        scene: &Scene,
        query: &Query,
        plan: &Plan,
        (mut known, close): (PairList, Option<PairList>),
        control: &Control,
        advance: &mut Advance,
    ) -> Result<(), Error> {
        let Some(first) = advance.first else {
            return Ok(());
        };
        let single = moving(scene).any(|(_, start, _)| matches!(start, Positions::F32(_)));
        let last_bit = f64::from(if single { f32::EPSILON } else { 0.0 }).max(f64::EPSILON);
        let are_all_known = close.is_some();
        known.extend(close.unwrap_or_default());
        let mut trial = None;
        let mut back_off = 0.0;
        loop {
            let fraction = first.toi * (1.0 - back_off);
            advance.fraction = fraction;
            let is_known = |&pair: &_| touch(scene, plan, pair, fraction);
            let touches = fraction > 0.0 && known.iter().any(is_known);
            let n_known = known.len();
            if !touches {
                advance.reached.positions = blended(scene, fraction);
                let mut moved = moving(scene).zip(&advance.reached.positions);
                if moved.all(|((_, start, _), (_, at))| start == at) {
                    advance.fraction = 0.0;
                    return Ok(());
                }
            }
            if !touches && !are_all_known {
                let trial = trial.get_or_insert_with(|| scene.clone());
                set_end_positions(trial, &advance.reached.positions)?;
                let plan = Plan::trial(trial, query, fraction, self.limits_of_steps())?;
                self.find_contacts(trial, &plan, control, (None, false))?;
                let found = self.steps.contacts.found();
                known.extend(found.map(|(kind, found)| (kind, found.key)));
            }
            advance.n_tried += 1;
            if !touches && known.len() == n_known {
                return Ok(());
            }
            back_off = if back_off == 0.0 {
                last_bit
            } else {
                f64::min(2.0 * back_off, 1.0)
            };
        }
    }

    /// Whether the search for the earliest contact also lists the pairs that rounding may bring
    /// together.
    fn lists_close_pairs(&mut self) -> bool {
        #[cfg(feature = "gpu")]
        self.open_gpu();
        #[cfg(feature = "gpu")]
        let is_on_device = self.gpu.is_some();
        #[cfg(not(feature = "gpu"))]
        let is_on_device = false;
        // The budget has no share for the list.
        !is_on_device
            && self.settings.memory_budget.is_none()
            && self.settings.method != Method::Naive
    }
}

/// Refuses elements of one body, among pairs that touch at the start, that do so at vertices with
/// equal positions.
pub(super) fn refuse_seams(
    scene: &Scene,
    plan: &Plan,
    touching: impl IntoIterator<Item = (PairKind, u64)>,
) -> Result<(), Error> {
    let seams = touching.into_iter().filter_map(|(kind, key)| {
        let [a, b] = plan.located(key);
        let [of_a, of_b] = [a.0, b.0].map(|part| plan.part(part));
        if of_a.id != of_b.id {
            return None;
        }
        let body = plan.body(scene, a.0);
        let at = body.positions();
        let [a, b] = [(of_a.part, a.1), (of_b.part, b.1)]
            .map(|(part, element)| body.corners(part, &element).to_vec());
        let both = a.iter().flat_map(|&a| b.iter().map(move |&b| [a, b]));
        let coincide = |&[a, b]: &[u32; 2]| at.point(a as usize) == at.point(b as usize);
        let vertices = both.filter(coincide).min()?;
        Some(((kind, key), of_a.id, vertices))
    });
    // Pairs come in any order.
    let Some((_, body, vertices)) = seams.min_by_key(|(pair, ..)| *pair) else {
        return Ok(());
    };
    Err(Error::Seam {
        body,
        vertices,
        n_coincident: scene.body(body)?.positions().n_coincident(),
    })
}

/// Bodies that move, with their positions at the start and at the end.
pub(super) fn moving(scene: &Scene) -> impl Iterator<Item = (BodyId, &Positions, &Positions)> {
    let bodies = scene.bodies();
    bodies.filter_map(|(id, body)| Some((id, body.positions(), body.end_positions()?)))
}

/// Has bodies end elsewhere.
pub(super) fn set_end_positions(
    scene: &mut Scene,
    ends: &[(BodyId, Positions)],
) -> Result<(), Error> {
    ends.iter()
        .try_for_each(|(id, positions)| scene.set_end_positions(*id, positions))
}

/// Their positions at a fraction of the step, rounded.
fn blended(scene: &Scene, fraction: f64) -> Vec<(BodyId, Positions)> {
    let blended = moving(scene).map(|(id, start, end)| (id, start.blend(end, fraction)));
    blended.collect()
}

/// Whether two elements touch on the way to the rounded positions at a fraction of the step; with
/// [`Start::Skip`], not at its start.
fn touch(scene: &Scene, plan: &Plan, (kind, key): (PairKind, u64), fraction: f64) -> bool {
    if !plan.counts(scene, key) {
        return false;
    }
    let located = plan.located(key);
    let [a, b] = (located.each_ref()).map(|located| PairElement::new(scene, plan, located));
    let contact = FirstContact::decide_part(TestId::Elements(kind), a, b, fraction);
    contact.is_some_and(|contact| !(plan.start == Start::Skip && contact.at_start))
}

pub(super) fn refuse_cell(query: &Query) -> Result<(), Error> {
    match query.cell {
        None => Ok(()),
        Some(_) => Err(Error::Setting {
            setting: "owned_by",
            given: "a cell for the way that a step can be taken".to_owned(),
            allowed: "only all of space (each process may ask for its earliest contact instead, and the least of these counts)",
        }),
    }
}
