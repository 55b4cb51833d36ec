//! A detector's answers about a step: which elements touch while bodies move from their positions
//! to their end positions, and when first.

use super::Detector;
use super::in_step::{InStep, Keys, Seen};
use crate::answers::impacts::{Impact, Impacts};
use crate::answers::pairs::Element;
use crate::clusterings::Clusterings;
use crate::cpu::steps::{StepClusters, VerletList};
use crate::plan::Plan;
use crate::query::goal::{Goal, Limits};
use crate::query::pair_kind::PairKind;
use crate::query::progress::Control;
use crate::query::settings::Settings;
use crate::query::step::{Precision, Start};
use crate::query::{Query, SharedVertex};
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::search::found::{Found, FoundByKind};
use crate::search::moved::Moved;
use crate::search::runner::{Job, Outcome, ready};
use crate::search::stats::Stats;
use crate::workers::clock::Instant;
use impinge_exact::Contact;

/// The memory kept from step to step.
pub(super) struct StepMemory {
    pub contacts: StepContacts,
    /// Whether the start of the last step intersects, if that was asked.
    start_intersects: Option<bool>,
    pub clusters: StepClusters,
    /// The last lists of near pairs, the newest last.
    pub lists: Vec<NearList>,
}

/// The near pairs of a question, and what they depend on besides positions.
pub(super) struct NearList {
    pub arrangement: u64,
    pub query: Query,
    pub distance: f64,
    pub list: VerletList,
}

impl StepMemory {
    pub fn new(settings: &Settings, clusterings: Clusterings) -> Self {
        StepMemory {
            contacts: StepContacts::default(),
            start_intersects: None,
            clusters: StepClusters::new(settings.instruction_set, clusterings),
            lists: Vec::new(),
        }
    }
}

/// The answer about contacts.
#[derive(Default)]
pub(super) struct StepContacts {
    pub impacts: Impacts,
    found: FoundByKind,
    /// Whether all that is found gets its name.
    names: bool,
    start: Option<StartAnswer>,
}

/// Whether elements intersect at the start of a step, and how long it took to find out.
#[derive(Clone, Copy)]
pub(super) struct StartAnswer {
    pub intersects: bool,
    ms: f64,
}

impl StepContacts {
    /// All contacts found, by the kind of the pair.
    pub fn lists(&self) -> impl Iterator<Item = (PairKind, &[Found<Contact>])> {
        PairKind::ALL
            .into_iter()
            .zip(self.found.iter().map(Vec::as_slice))
    }

    /// All contacts found, with the kind of the pair.
    pub fn found(&self) -> impl Iterator<Item = (PairKind, &Found<Contact>)> {
        self.lists()
            .flat_map(|(kind, found)| found.iter().map(move |found| (kind, found)))
    }

    /// The earliest of them.
    pub fn first(&self, precision: Precision) -> Option<Impact> {
        let named = self
            .found()
            .map(|(kind, found)| self.impacts.impact(kind, precision, found));
        named.reduce(Impact::earlier)
    }
}

impl Outcome<Found<Contact>, { PairKind::ALL.len() }> for StepContacts {
    fn begin(&mut self, plan: &Plan) {
        self.impacts.begin(plan);
        if let Some(start) = self.start {
            self.impacts.set_start_intersects(Some(start.intersects));
            self.stats_mut().add_ms("start", start.ms);
        }
    }

    fn stats_mut(&mut self) -> &mut Stats {
        self.impacts.stats_mut()
    }

    fn take_buffers(&mut self) -> FoundByKind {
        std::mem::take(&mut self.found)
    }

    fn fill(&mut self, job: Job<'_>, found: FoundByKind) -> Result<(), Error> {
        self.found = found;
        match self.names {
            true => self.impacts.fill(job, &self.found),
            false => Ok(()),
        }
    }

    fn bytes(&self) -> u64 {
        let n: usize = self.found.iter().map(Vec::capacity).sum();
        (size_of::<Found<Contact>>() * n) as u64 + self.impacts.bytes()
    }
}

impl Detector {
    /// All pairs of elements that touch during a step, each with the first time at which they do.
    ///
    /// In: a scene whose bodies have positions, and end positions if they move
    /// ([`Scene::set_end_positions`]). Every vertex moves on a straight line at constant speed,
    /// from time 0 to time 1. Pairs are a vertex and a face, or two edges. Between bodies of edges
    /// or points alone, they are also an edge and a vertex, and between bodies of points two
    /// vertices. Tetrahedra take part with their surface. Pairs of one body that share a vertex are
    /// not reported.
    ///
    /// The answer is exact: a pair is reported if and only if the two closed elements share a point
    /// at some time, and its time is that of the first contact, rounded down:
    /// `toi <= first < toi.next_up()`. With a [separation](Query::separation), the same holds of
    /// the first time at which their distance is at most that, and with a
    /// [clearance](Query::clearance), of the first time at which a pair is as near as it may come.
    ///
    /// On a GPU the device finds the pairs that may touch, and the CPU finds their times, on all
    /// threads: the answer is the same to the last bit. The CPU answers alone if there is a
    /// clearance or a filter, or if the device or the memory budget cannot hold the step; in a
    /// browser it always does. [`Stats::backend`](crate::Stats::backend) says who
    /// answered.
    ///
    /// ```
    /// use impinge::{Backend, Detector, PairKind, Query, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// scene.add_triangles(&[[0, 1, 2]], &[[0.0f32, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]])?;
    /// let point = scene.add_points(&[[1.0f32, 1.0, 1.0]])?;
    /// scene.set_end_positions(point, &[[1.0f32, 1.0, -3.0]])?;
    /// let mut detector = Detector::new(Backend::Cpu)?;
    /// let impacts = detector.impacts(&scene, &Query::all())?;
    /// assert_eq!(impacts.len(), 1);
    /// let impact = impacts.of(PairKind::VertexFace)[0];
    /// assert_eq!((impact.kind, impact.toi), (PairKind::VertexFace, 0.25));
    /// assert!(!detector.is_free(&scene, &Query::all())?);
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// A stale id, refused positions, more pairs than allowed, no memory for the answer, a memory
    /// budget too small for one batch and the answer.
    pub fn impacts(&mut self, scene: &Scene, query: &Query) -> Result<Impacts, Error> {
        let control = &self.control.clone();
        let plan = Plan::contacts(scene, query, Goal::All, self.limits_of_impacts())?;
        let start = self.verify(scene, query)?;
        self.steps.contacts.impacts = self.homes.impacts.take();
        let found = self.find_contacts(scene, &plan, control, (start, true));
        let impacts = std::mem::take(&mut self.steps.contacts.impacts);
        found.map(|_| impacts)
    }

    /// The earliest impact; of several at the same time, the one whose row comes first. `None` if
    /// the step is free. The same as [`Impacts::earliest`] of all impacts, but found faster.
    ///
    /// # Errors
    /// As [`impacts`](Detector::impacts).
    pub fn earliest(&mut self, scene: &Scene, query: &Query) -> Result<Option<Impact>, Error> {
        let control = &self.control.clone();
        let plan = Plan::contacts(scene, query, Goal::Earliest, self.limits_of_steps())?;
        let start = self.verify(scene, query)?;
        self.find_contacts(scene, &plan, control, (start, false))?;
        // The first contact and all whose times may round to the same time have been found, and
        // some later ones.
        Ok(self.steps.contacts.first(plan.precision))
    }

    /// Whether elements intersect at the start of the step that was asked about last; `None` if
    /// that was not asked, which only [`Start::Verify`] does.
    pub fn start_intersects(&self) -> Option<bool> {
        self.steps.start_intersects
    }

    /// Whether nothing touches during the step. With [`Start::Skip`], pairs that touch at its start
    /// do not count.
    ///
    /// If the start was free of intersections, so is each moment of a free step. Of bodies that
    /// already pass through each other it says nothing, unless [`Start::Verify`] asks: then a step
    /// whose start intersects is not free. Tetrahedra that the step inverts are not noticed, see
    /// [`add_tetrahedra`](Scene::add_tetrahedra).
    ///
    /// # Errors
    /// As [`impacts`](Detector::impacts).
    pub fn is_free(&mut self, scene: &Scene, query: &Query) -> Result<bool, Error> {
        let control = &self.control.clone();
        let plan = Plan::contacts(scene, query, Goal::Any, self.limits_of_steps())?;
        let start = self.verify(scene, query)?;
        if start.is_some_and(|start| start.intersects) {
            self.note_start(&plan, start);
            return Ok(false);
        }
        let seen = self.find_contacts(scene, &plan, control, (start, false))?;
        Ok(!seen.touches && self.steps.contacts.found().next().is_none())
    }

    /// Asks whether elements intersect at the start of a step, if it says so.
    pub(super) fn verify(
        &mut self,
        scene: &Scene,
        query: &Query,
    ) -> Result<Option<StartAnswer>, Error> {
        self.steps.start_intersects = None;
        if query.start != Start::Verify {
            return Ok(None);
        }
        let start = Instant::now();
        let at_start = Query {
            kinds: None,
            filter: None,
            ..query.clone().shared_vertex(SharedVertex::Resolve)
        };
        let intersects = match &query.filter {
            None => self.any(scene, &at_start)?,
            Some(filter) => {
                let corners = |of: Element| {
                    let body = scene.body(of.body)?;
                    Ok::<_, Error>((of.body, body.elements().corners(of.element as usize)))
                };
                let pairs = self.detect(scene, &at_start)?;
                pairs.iter().try_fold(false, |any, (a, b)| {
                    Ok::<_, Error>(any || filter.passes([corners(a)?, corners(b)?]))
                })?
            }
        };
        self.steps.start_intersects = Some(intersects);
        let ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(Some(StartAnswer { intersects, ms }))
    }

    /// Takes note of a step that was not examined because of its start.
    fn note_start(&mut self, plan: &Plan, start: Option<StartAnswer>) {
        let contacts = &mut self.steps.contacts;
        contacts.start = start;
        contacts.begin(plan);
        contacts.stats_mut().total_ms = plan.since.elapsed().as_secs_f64() * 1e3;
        self.stats.clone_from(contacts.impacts.stats());
    }

    /// Finds the contacts that are sought, in any order unless all are. `names`: whether they are
    /// the impacts of an answer.
    pub(super) fn find_contacts(
        &mut self,
        scene: &Scene,
        plan: &Plan,
        control: &Control,
        (start, names): (Option<StartAnswer>, bool),
    ) -> Result<Seen, Error> {
        self.find_contacts_by((scene, plan), control, (start, names), Keys::All)
    }

    /// Finds all contacts on the CPU, without names; where `moved` is given, of pairs with a vertex
    /// that has moved, and perhaps others.
    pub(super) fn find_contacts_of(
        &mut self,
        (scene, plan): (&Scene, &Plan),
        moved: Option<Moved<'_>>,
    ) -> Result<(), Error> {
        let control = &self.control.clone();
        let keys = Keys::Moved(moved);
        self.find_contacts_by((scene, plan), control, (None, false), keys)?;
        Ok(())
    }

    fn find_contacts_by(
        &mut self,
        (scene, plan): (&Scene, &Plan),
        control: &Control,
        (start, names): (Option<StartAnswer>, bool),
        keys: Keys<'_>,
    ) -> Result<Seen, Error> {
        #[cfg(feature = "gpu")]
        self.open_gpu();
        let contacts = &mut self.steps.contacts;
        (contacts.start, contacts.names) = (start, names);
        let mut finder = InStep {
            clusters: &mut self.steps.clusters,
            settings: &self.settings,
            #[cfg(feature = "gpu")]
            gpu: &mut self.gpu,
            keys,
            list: None,
            seen: Seen::default(),
        };
        let found = ready(self.runner.run(scene, plan, control, &mut finder, contacts));
        self.stats.clone_from(contacts.impacts.stats());
        found.map(|_| finder.seen)
    }

    /// What an answer of contacts may be that are not handed out.
    pub(super) fn limits_of_steps(&self) -> Limits {
        Limits {
            max_pairs: None,
            ..self.settings.limits()
        }
    }

    /// What an answer of impacts may be.
    fn limits_of_impacts(&self) -> Limits {
        Limits {
            besides: size_of::<Impact>() as u64,
            ..self.settings.limits()
        }
    }
}
