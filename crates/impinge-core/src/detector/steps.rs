//! A detector's answers about a step: which elements touch while bodies move from their positions to their end positions,
//! when first, and how far the step can be taken.

mod near;
#[cfg(feature = "gpu")]
mod resident;
mod runs;

use crate::clock::Instant;

use super::Detector;
use crate::advance::Advance;
use crate::cpu::steps::{Asked, ByDevice, StepClusters, StepTest};
use crate::error::Error;
use crate::exact::{Contact, Keep};
use crate::frame::{Ask, Frame, TestId};
use crate::hull::Pose;
use crate::impacts::{
    Candidates, ContactAnswer, Found, FoundByKind, Impact, Impacts, KeyAnswer, Sought, StepAnswer,
};
use crate::index::pair_numbers;
use crate::naive;
use crate::narrow::{Element, FirstContact};
use crate::near::NearPairs;
use crate::pair_kind::PairKind;
use crate::positions::Positions;
use crate::progress::Control;
use crate::query::SharedVertex;
use crate::run::Job;
use crate::scene::Scene;
use crate::settings::{Method, Settings};
use crate::sink::{Limits, Wanted};
use crate::sort::Sorter;
use crate::stats::Statistics;
use crate::step::{CandidateQuery, Start, Step, Toi};

/// The memory kept from step to step.
pub(super) struct StepMemory {
    frame: Frame,
    impacts: Impacts,
    candidates: Candidates,
    near: NearPairs,
    clusters: StepClusters,
    contacts: ContactAnswer,
    keys: KeyAnswer,
    found: FoundByKind,
    /// The pairs that rounded positions may make touch, up to the earliest contact, by kind and key, if known.
    close: Option<Vec<(PairKind, u64)>>,
    sorter: Sorter,
}

impl StepMemory {
    pub fn new(settings: &Settings) -> Self {
        StepMemory {
            frame: Frame::default(),
            impacts: Impacts::default(),
            candidates: Candidates::default(),
            near: NearPairs::default(),
            clusters: StepClusters::new(settings.instruction_set),
            contacts: ContactAnswer::default(),
            keys: KeyAnswer::default(),
            found: FoundByKind::default(),
            close: None,
            sorter: Sorter::new(settings),
        }
    }

    /// All contacts found, as impacts.
    fn named(&self, toi: Toi) -> impl Iterator<Item = Impact> + '_ {
        let found = self.found();
        found.map(move |(kind, found)| self.impacts.impact(kind, toi, found))
    }

    /// What was found last, with the kind of the pair.
    fn found(&self) -> impl Iterator<Item = (PairKind, &Found<Contact>)> {
        let kinds = PairKind::ALL.into_iter().zip(&self.found);
        kinds.flat_map(|(kind, found)| found.iter().map(move |found| (kind, found)))
    }
}

impl Detector {
    /// All pairs of elements that touch during a step, each with the first time at which they do.
    ///
    /// In: a scene whose bodies have positions, and end positions if they move
    /// ([`Scene::set_end_positions`]). Every vertex moves on a straight line at constant speed, from time 0 to time 1. Pairs
    /// are a vertex and a face, or two edges. Between bodies of edges or points alone, they are also an edge and a vertex, and
    /// between bodies of points two vertices. Tetrahedra take part with their surface. Pairs of one body that share a vertex
    /// are not reported.
    ///
    /// The answer is exact: a pair is reported if and only if the two closed elements share a point at some time, and its
    /// time is that of the first contact, rounded down: `toi <= first < toi.next_up()`. With a
    /// [separation](Step::separation), the same holds of the first time at which their distance is at most that, and with a
    /// [clearance](Step::clearance), of the first time at which a pair is as near as it may come.
    ///
    /// On a GPU the device finds the pairs that may touch, and the CPU finds their times, on all threads: the answer is the same to the
    /// last bit. The CPU answers alone if there is a separation, a clearance or a filter, or if the device or the memory budget cannot hold the step; in a
    /// browser it always does. [`Statistics::backend`](crate::Statistics::backend) says who answered.
    ///
    /// ```
    /// use impinge::{Backend, Detector, PairKind, Scene, Step};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// scene.add_triangles(&[[0, 1, 2]], &[[0.0f32, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]])?;
    /// let point = scene.add_points(&[[1.0f32, 1.0, 1.0]])?;
    /// scene.set_end_positions(point, &[[1.0f32, 1.0, -3.0]])?;
    /// let mut detector = Detector::new(Backend::Cpu)?;
    /// let impacts = detector.impacts(&scene, &Step::default())?;
    /// assert_eq!(impacts.len(), 1);
    /// let impact = impacts.as_slice()[0];
    /// assert_eq!((impact.kind, impact.toi), (PairKind::VertexFace, 0.25));
    /// assert!(!detector.is_free(&scene, &Step::default())?);
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// A stale id, refused positions, more pairs than allowed, no memory for the answer, a memory budget too small for
    /// one slab and the answer.
    pub fn impacts(&mut self, scene: &Scene, step: &Step) -> Result<&Impacts, Error> {
        self.impacts_with(scene, step, &Control::new())
    }

    /// [`impacts`](Detector::impacts) with a token to stop it and a callback to watch it.
    ///
    /// # Errors
    /// As `impacts`, and [`Error::Cancelled`].
    pub fn impacts_with(
        &mut self,
        scene: &Scene,
        step: &Step,
        control: &Control<'_>,
    ) -> Result<&Impacts, Error> {
        let start = Instant::now();
        self.begin(scene, step)?;
        self.verify(scene, step, control)?;
        self.find(
            scene,
            step,
            Sought::All,
            Pose::WHOLE,
            self.settings.max_pairs,
            control,
        )?;
        let StepMemory { impacts, found, .. } = &mut self.steps;
        impacts.stats_mut().time("collect", |_| {
            found
                .iter_mut()
                .for_each(|found| found.sort_unstable_by_key(|found| found.key));
        });
        impacts.fill(step.toi, found)?;
        let bytes = impacts.bytes();
        let stats = impacts.stats_mut();
        stats.bytes_held += bytes;
        stats.total_ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(&self.steps.impacts)
    }

    /// The earliest impact; of several at the same time, the one whose row comes first. `None` if the step is free.
    /// The same as [`Impacts::earliest`] of all impacts, but found faster.
    ///
    /// # Errors
    /// As [`impacts`](Detector::impacts).
    pub fn earliest(&mut self, scene: &Scene, step: &Step) -> Result<Option<Impact>, Error> {
        self.earliest_with(scene, step, &Control::new())
    }

    /// [`earliest`](Detector::earliest) with a token to stop it and a callback to watch it.
    ///
    /// # Errors
    /// As `earliest`, and [`Error::Cancelled`].
    pub fn earliest_with(
        &mut self,
        scene: &Scene,
        step: &Step,
        control: &Control<'_>,
    ) -> Result<Option<Impact>, Error> {
        let start = Instant::now();
        self.begin(scene, step)?;
        self.find_earliest(scene, step, control, start)
    }

    /// The earliest impact of a step that was begun at `start`.
    fn find_earliest(
        &mut self,
        scene: &Scene,
        step: &Step,
        control: &Control<'_>,
        start: Instant,
    ) -> Result<Option<Impact>, Error> {
        self.find(scene, step, Sought::Earliest, Pose::WHOLE, None, control)?;
        // The first contact and all whose times may round to the same time have been found, and some later ones.
        let first = self.steps.named(step.toi).reduce(Impact::earlier);
        self.steps.impacts.stats_mut().total_ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(first)
    }

    /// Resolves a step.
    fn begin(&mut self, scene: &Scene, step: &Step) -> Result<(), Error> {
        let StepMemory { frame, impacts, .. } = &mut self.steps;
        step.check()?;
        frame.resolve_for(scene, &step.query, Ask::Impacts)?;
        frame.set_keep(scene, step.keep());
        frame.set_filter(step.filter.as_ref());
        impacts.begin(frame);
        frame.check(scene)?;
        begin(
            impacts.stats_mut(),
            &self.settings,
            self.frames.workers().n(),
        );
        Ok(())
    }

    /// Asks whether elements intersect at the start of a step that was begun, if it says so. The answer stands in the impacts.
    fn verify(
        &mut self,
        scene: &Scene,
        step: &Step,
        control: &Control<'_>,
    ) -> Result<Option<bool>, Error> {
        if step.start != Start::Verify {
            return Ok(None);
        }
        let start = Instant::now();
        let query = step.query.clone().shared_vertex(SharedVertex::Resolve);
        let intersects = Some(self.any_with(scene, &query, control)?);
        let impacts = &mut self.steps.impacts;
        impacts.set_start_intersects(intersects);
        let ms = start.elapsed().as_secs_f64() * 1e3;
        impacts.stats_mut().add_ms("start", ms);
        Ok(intersects)
    }

    /// Finds what is sought, in any order. Returns whether a device has found that something touches; then the list of contacts may be
    /// empty.
    fn find(
        &mut self,
        scene: &Scene,
        step: &Step,
        sought: Sought,
        pose: Pose,
        max_pairs: Option<u64>,
        control: &Control<'_>,
    ) -> Result<bool, Error> {
        let StepMemory {
            frame,
            impacts,
            clusters,
            contacts,
            found,
            close,
            ..
        } = &mut self.steps;
        *close = None;
        let stats = impacts.stats_mut();
        let limits = Limits {
            max_pairs,
            besides: match sought {
                Sought::All => size_of::<Impact>() as u64,
                _ => 0,
            },
            ..self.settings.limits()
        };
        contacts.begin(limits, Wanted::Pairs, std::mem::take(found));
        if self.settings.method == Method::Naive {
            stats.time("naive", |stats| {
                let emit = |test, key, value: Contact| match test {
                    TestId::Elements(kind)
                        if !(step.start == Start::Skip && value.at_start)
                            && frame.counts(scene, key) =>
                    {
                        contacts.extend(kind as usize, [Found { key, value }].into_iter());
                        contacts.check()
                    }
                    _ => Ok(()),
                };
                naive::run(&FirstContact, scene, frame, control, stats, emit)
            })?;
            (*found, _) = contacts.finish()?;
            return Ok(false);
        }
        let _shift = self.frames.workers().shift(frame.n_primitives());
        let job = Job {
            scene,
            frame,
            workers: self.frames.workers(),
            control,
        };
        let asked = Asked {
            sought,
            start: step.start,
            toi: step.toi,
        };
        let asked = (StepTest::Contacts(asked), pose);
        let answer = StepAnswer::Contacts(contacts);
        #[cfg(feature = "gpu")]
        let on_device = super::gpu::find_in_step(
            &mut self.gpu,
            clusters,
            (job, &self.settings),
            (asked, answer),
            stats,
        );
        #[cfg(not(feature = "gpu"))]
        let on_device = Ok(ByDevice::Not);
        let result = match on_device {
            Ok(ByDevice::Done) => Ok(false),
            Ok(ByDevice::Touches) => Ok(true),
            Ok(ByDevice::Not) => {
                contacts.forget();
                let result = clusters.run(job, &self.settings, asked, answer, stats);
                if frame.is_rounded() {
                    *close = clusters.close();
                }
                result.map(|()| false)
            }
            Err(error) => Err(error),
        };
        let finished = contacts.finish();
        let touches = result?;
        (*found, _) = finished?;
        self.frames.workers().report(&mut stats.ways);
        let n: usize = found.iter().map(Vec::capacity).sum();
        stats.bytes_held += (size_of::<Found<Contact>>() * n) as u64;
        Ok(touches)
    }

    /// Whether nothing touches during the step. With [`Start::Skip`], pairs that touch at its start do not count.
    ///
    /// If the start was free of intersections, so is each moment of a free step. Of bodies that already pass through each other it
    /// says nothing, unless [`Start::Verify`] asks: then a step whose start intersects is not free.
    ///
    /// # Errors
    /// As [`impacts`](Detector::impacts).
    pub fn is_free(&mut self, scene: &Scene, step: &Step) -> Result<bool, Error> {
        self.is_free_with(scene, step, &Control::new())
    }

    /// [`is_free`](Detector::is_free) with a token to stop it and a callback to watch it.
    ///
    /// # Errors
    /// As `is_free`, and [`Error::Cancelled`].
    pub fn is_free_with(
        &mut self,
        scene: &Scene,
        step: &Step,
        control: &Control<'_>,
    ) -> Result<bool, Error> {
        let start = Instant::now();
        self.begin(scene, step)?;
        let is_free = self.verify(scene, step, control)? != Some(true) && {
            let touches = self.find(scene, step, Sought::Any, Pose::WHOLE, None, control)?;
            !touches && self.steps.found.iter().all(Vec::is_empty)
        };
        self.steps.impacts.stats_mut().total_ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(is_free)
    }

    /// How far the step can be taken: a fraction of it, backed off from the first contact hardly more than the precision of positions
    /// asks for, for which the straight way from the start to the *rounded* positions is free.
    ///
    /// Positions that are stored are rounded, and rounding alone may make elements touch that did not. So each fraction is
    /// tried: positions are rounded first, and the way to those must be free in the sense of [`is_free`](Detector::is_free). A chain of such
    /// steps is free from the first to the last, whatever the rounding, if its start was free of intersections; [`Start::Verify`] asks
    /// that, and allows no step if it was not. The first fraction tried is that of the first
    /// contact; then the back-off doubles, from the last bit on, so it is less than twice what is needed.
    ///
    /// On the CPU all pairs are searched once, and rounded positions are tested on the pairs that rounding may bring together. On a GPU, with
    /// a separation or a memory budget, and where too many pairs are that close, all pairs are searched again for rounded positions.
    ///
    /// With a [clearance](Step::clearance), every pair keeps what that says, and what floats can round besides. So the fraction holds for
    /// solvers too, which compute positions themselves: as `x0 + a * (x1 - x0)` or `x0 + a * dx` with `x1 = x0 + dx`, in the precision
    /// of the positions, for *every* `a` from 0 to the fraction, the straight way there is free and keeps the clearance. The fraction is
    /// rounded down to an `f32`, and a single search is enough. It is 0 if moving elements are nearer at the start than rounding
    /// can move them: about 25 unit roundoffs of their largest coordinate. Without a clearance, only the positions of the answer
    /// are proven.
    ///
    /// Pairs that touch at the start allow no step at all under [`Start::Report`], and are ignored under
    /// [`Start::Skip`]. The seams of a mesh that was not welded are such pairs: they are refused by name, because no step would ever be
    /// possible. Weld the mesh ([`Weld`](crate::Weld)), or skip what touches at the start.
    ///
    /// # Errors
    /// As [`impacts`](Detector::impacts), and [`Error::Seam`].
    pub fn advance(&mut self, scene: &Scene, step: &Step) -> Result<Advance, Error> {
        self.advance_with(scene, step, &Control::new())
    }

    /// [`advance`](Detector::advance) with a token to stop it and a callback to watch it.
    ///
    /// # Errors
    /// As `advance`, and [`Error::Cancelled`].
    pub fn advance_with(
        &mut self,
        scene: &Scene,
        step: &Step,
        control: &Control<'_>,
    ) -> Result<Advance, Error> {
        if step.query.cell.is_some() {
            return Err(Error::Setting {
                setting: "owned_by",
                given: "a cell for the way that a step can be taken".to_owned(),
                allowed: "all pairs; or let each process ask for its earliest contact, and take the least of them",
            });
        }
        let has_clearance = !step.keep().is_plain();
        // With a clearance, a time in single precision is as good, and settled by filters.
        let step = step
            .clone()
            .toi(if has_clearance { Toi::F32 } else { Toi::F64 });
        let moving = || {
            let bodies = scene.bodies();
            bodies.filter_map(|(id, body)| Some((id, body.positions(), body.end_positions()?)))
        };
        let start = Instant::now();
        self.begin(scene, &step)?;
        let start_intersects = self.verify(scene, &step, control)?;
        if has_clearance {
            let keep = Keep {
                is_rounded: true,
                ..step.keep()
            };
            self.steps.frame.set_keep(scene, keep);
        } else if step.separation == 0.0 && self.lists_close_pairs() {
            self.steps.frame.set_rounding(scene);
        }
        let first = self.find_earliest(scene, &step, control, start)?;
        self.refuse_seams(scene)?;
        let mut advance = Advance {
            fraction: 1.0,
            first,
            start_intersects,
            positions: Vec::new(),
            n_tried: 1,
        };
        if start_intersects == Some(true) {
            advance.fraction = 0.0;
            advance.positions = moving().map(|(id, at, _)| (id, at.clone())).collect();
            return Ok(advance);
        }
        let Some(first) = first else {
            advance.positions = moving().map(|(id, _, end)| (id, end.clone())).collect();
            return Ok(advance);
        };
        if has_clearance {
            // Rounding is part of what the pairs keep.
            let blended = moving().map(|(id, start, end)| (id, start.blend(end, first.toi)));
            advance.positions = blended.collect();
            advance.fraction = first.toi;
            return Ok(advance);
        }
        let single = moving().any(|(_, start, _)| matches!(start, Positions::F32(_)));
        let last_bit = f64::from(if single { f32::EPSILON } else { 0.0 }).max(f64::EPSILON);
        // Pairs that may touch on the way to rounded positions: at first the pair of the contact, which probably does.
        let same =
            |&(kind, found): &(_, &_)| self.steps.impacts.impact(kind, Toi::F64, found) == first;
        let mut known: Vec<(PairKind, u64)> = Vec::new();
        known.extend(
            self.steps
                .found()
                .filter(same)
                .map(|(kind, found)| (kind, found.key)),
        );
        let are_all_known = self.steps.close.is_some();
        known.extend(self.steps.close.take().unwrap_or_default());
        // Times are not needed.
        let step = step.toi(Toi::F32);
        let mut trial = None;
        let mut back_off = 0.0;
        loop {
            let fraction = first.toi * (1.0 - back_off);
            advance.fraction = fraction;
            let is_known = |&pair: &_| self.touch(scene, &step, pair, fraction);
            let touches = fraction > 0.0 && known.iter().any(is_known);
            let n_known = known.len();
            if !touches {
                let blended = moving().map(|(id, start, end)| (id, start.blend(end, fraction)));
                advance.positions = blended.collect();
                let mut moved = moving().zip(&advance.positions);
                if moved.all(|((_, start, _), (_, at))| start == at) {
                    advance.fraction = 0.0;
                    return Ok(advance);
                }
            }
            if !touches && !are_all_known {
                let trial = trial.get_or_insert_with(|| scene.clone());
                for (id, positions) in &advance.positions {
                    match positions {
                        Positions::F32(positions) => trial.set_end_positions(*id, positions)?,
                        Positions::F64(positions) => trial.set_end_positions(*id, positions)?,
                    }
                }
                self.begin(trial, &step)?;
                let pose = Pose {
                    is_swept: fraction <= Pose::NEARLY_STILL,
                    ..Pose::WHOLE
                };
                self.find(trial, &step, Sought::All, pose, None, control)?;
                known.extend(self.steps.found().map(|(kind, found)| (kind, found.key)));
            }
            advance.n_tried += 1;
            if !touches && known.len() == n_known {
                return Ok(advance);
            }
            back_off = if back_off == 0.0 {
                last_bit
            } else {
                f64::min(2.0 * back_off, 1.0)
            };
        }
    }

    /// Refuses elements of one body, among the contacts found, that touch at the start at vertices with equal positions.
    fn refuse_seams(&self, scene: &Scene) -> Result<(), Error> {
        let StepMemory { frame, .. } = &self.steps;
        let at_start = self.steps.found().filter(|(_, found)| found.value.at_start);
        let seams = at_start.filter_map(|(kind, found)| {
            let [a, b] = pair_numbers(found.key).map(|number| frame.locate(number));
            let [of_a, of_b] = [a.0, b.0].map(|layer| frame.layer(layer));
            if of_a.id != of_b.id {
                return None;
            }
            let body = frame.body(scene, a.0);
            let at = body.positions();
            let [a, b] = [(of_a.part, a.1), (of_b.part, b.1)]
                .map(|(part, element)| body.corners(part, &element).to_vec());
            let both = a.iter().flat_map(|&a| b.iter().map(move |&b| [a, b]));
            let coincide = |&[a, b]: &[u32; 2]| at.point(a as usize) == at.point(b as usize);
            let vertices = both.filter(coincide).min()?;
            Some(((kind, found.key), of_a.id, vertices))
        });
        // Contacts come in any order.
        let Some((_, body, vertices)) = seams.min_by_key(|(pair, ..)| *pair) else {
            return Ok(());
        };
        Err(Error::Seam {
            body,
            vertices,
            n_coincident: scene.body(body)?.positions().n_coincident(),
        })
    }

    /// Whether the search for the earliest contact also lists the pairs that rounding may bring together.
    fn lists_close_pairs(&self) -> bool {
        #[cfg(feature = "gpu")]
        let is_on_device = self.gpu.is_some();
        #[cfg(not(feature = "gpu"))]
        let is_on_device = false;
        // The budget has no share for the list.
        !is_on_device
            && self.settings.memory_budget.is_none()
            && self.settings.method != Method::Naive
    }

    /// Whether two elements touch on the way to the rounded positions at a fraction of the step; with [`Start::Skip`], not at
    /// its start. The scene has the bodies of the last one.
    fn touch(
        &self,
        scene: &Scene,
        step: &Step,
        (kind, key): (PairKind, u64),
        fraction: f64,
    ) -> bool {
        let frame = &self.steps.frame;
        if !frame.counts(scene, key) {
            return false;
        }
        let located = pair_numbers(key).map(|number| frame.locate(number));
        let [a, b] = located.each_ref().map(|(layer, element)| Element {
            scene,
            frame,
            layer: *layer,
            corners: frame
                .body(scene, *layer)
                .corners(frame.layer(*layer).part, element),
        });
        let contact = FirstContact::settle_part(TestId::Elements(kind), a, b, fraction);
        contact.is_some_and(|contact| !(step.start == Start::Skip && contact.at_start))
    }

    /// Pairs of elements whose boxes overlap during a step, each box inflated by a distance: for callers with their own test.
    /// Sorted and complete. Always found on the CPU. [`candidates_in_runs`](Detector::candidates_in_runs) gives them piece by
    /// piece, for answers larger than memory.
    ///
    /// # Errors
    /// As [`impacts`](Detector::impacts), and a distance that is negative or not finite.
    pub fn candidates(
        &mut self,
        scene: &Scene,
        query: &CandidateQuery,
    ) -> Result<&Candidates, Error> {
        self.candidates_with(scene, query, &Control::new())
    }

    /// [`candidates`](Detector::candidates) with a token to stop it and a callback to watch it.
    ///
    /// # Errors
    /// As `candidates`, and [`Error::Cancelled`].
    pub fn candidates_with(
        &mut self,
        scene: &Scene,
        query: &CandidateQuery,
        control: &Control<'_>,
    ) -> Result<&Candidates, Error> {
        let limits = self.settings.limits();
        let (mut search, candidates) = self.search(scene, query, control)?;
        search.find_all(candidates, limits)?;
        Ok(&self.steps.candidates)
    }

    /// Moves the impacts found last out of the detector, without a copy. It holds none until the next question.
    pub fn take_impacts(&mut self) -> Impacts {
        std::mem::take(&mut self.steps.impacts)
    }

    /// Moves the candidates found last out of the detector, without a copy. It holds none until the next question.
    pub fn take_candidates(&mut self) -> Candidates {
        std::mem::take(&mut self.steps.candidates)
    }

    /// Takes back candidates that are no longer needed: the next answer uses their memory. New memory for millions of
    /// candidates costs a tenth of the time to find them.
    pub fn reuse_candidates(&mut self, candidates: Candidates) {
        self.steps.candidates = candidates;
    }

    /// Statistics of the last answer about a step: by [`impacts`](Detector::impacts),
    /// [`earliest`](Detector::earliest), [`is_free`](Detector::is_free) or [`advance`](Detector::advance).
    pub fn step_stats(&self) -> &Statistics {
        self.steps.impacts.stats()
    }
}

fn begin(stats: &mut Statistics, settings: &Settings, n_threads: usize) {
    stats.method = match settings.method {
        Method::Naive => Method::Naive,
        // The grid is for intersections.
        Method::Auto | Method::Clusters | Method::Cells => Method::Clusters,
    }
    .name();
    stats.n_threads = n_threads;
    stats.backend.push_str("cpu");
}
