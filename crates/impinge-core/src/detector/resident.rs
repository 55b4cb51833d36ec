//! What stays on the device of a detector.

use std::collections::BTreeSet;
use std::sync::Arc;

use super::Detector;
use crate::answers::pairs::Pairs;
use crate::bvh::clusters::Clustering;
use crate::gpu::{Engine, MOST_KEPT, ResidentPairs, ResidentSafe, ResidentStep};
use crate::plan::Plan;
use crate::query::Query;
use crate::query::goal::Goal;
use crate::query::pair_kind::{PairKind, PairKinds};
use crate::query::progress::Control;
use crate::query::step::Clearance;
use crate::scene::Scene;
use crate::scene::error::{Error, shown};
use crate::scene::ids::BodyId;
use crate::search::runner::Job;
use crate::search::stats::Stats;

/// The device of a detector, for frames whose positions and pairs stay there: [`Detector::gpu`].
///
/// # What is encoded, and when it is submitted
///
/// What is encoded for the caller reads and writes buffers of the detector when its commands run.
/// So submit it, or drop it, before the detector is asked anything else or encodes into another
/// encoder. Otherwise what it leaves may belong to other positions or to another question, and
/// nothing says so. Later answers are right even then.
///
/// One submission may have one frame ([`encode`](Gpu::encode)), one step
/// ([`encode_step`](Gpu::encode_step)) or question about safe distances
/// ([`encode_safe_distances`](Gpu::encode_safe_distances)), and truncations
/// ([`encode_truncate`](Gpu::encode_truncate)), in one encoder. Each has the buffers that it was
/// given. Do not change the scene between these calls: all may get its positions as they are at the
/// last one.
///
/// Kernels are compiled once per detector, by the first question that needs them. So keep it:
/// several detectors on one device of the caller's compile them each for itself.
///
/// # Buffers that are given, and buffers that are returned
///
/// Each body has a buffer of its own, in which its coordinates are tightly packed from the first
/// byte on; there are neither offsets nor strides. A body that is named twice in one list is
/// refused. Buffers of bodies that do not take part in the query are ignored.
///
/// Returned buffers have the usages `STORAGE`, `COPY_SRC` and `COPY_DST`, but are to be read only.
/// They are the detector's: the next question of the same kind, also one of the host, writes into
/// them or replaces them. So encode what reads them before that, in the same submission or a later
/// one.
pub struct Gpu<'a> {
    detector: &'a mut Detector,
}

impl std::fmt::Debug for Gpu<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Gpu").finish_non_exhaustive()
    }
}

impl Detector {
    /// The device, if the detector works on one: for frames whose positions and pairs stay there.
    ///
    /// Nothing can be encoded for a detector that opened a device of its own, because nobody else
    /// can make encoders and buffers on that: give it one of yours with
    /// [`Settings::on_device`](crate::Settings::on_device). Nor can anybody else poll that device,
    /// so its frames can be [awaited](Gpu::detect_async) in a browser alone.
    pub fn gpu(&mut self) -> Option<Gpu<'_>> {
        self.open_gpu();
        self.gpu.is_some().then_some(Gpu { detector: self })
    }
}

impl Gpu<'_> {
    /// [`detect`](Detector::detect) without blocking: the future waits for the device, which must
    /// be polled meanwhile (a browser does that; natively call `wgpu::Device::poll`, in the loop
    /// that polls the future or on another thread).
    ///
    /// # Errors
    /// As `detect`.
    pub async fn detect_async(&mut self, scene: &Scene, query: &Query) -> Result<Pairs, Error> {
        let detector = &mut *self.detector;
        let plan = Plan::intersections(scene, query, Goal::All, detector.settings.limits())?;
        let control = &detector.control.clone();
        let mut pairs = detector.homes.pairs.take();
        detector.answer(scene, &plan, control, &mut pairs).await?;
        Ok(pairs)
    }

    /// Encodes a whole frame into the caller's encoder: positions come from buffers on the device
    /// and pairs stay there. Nothing is read back.
    ///
    /// `positions` names bodies whose positions are taken from a buffer: `(v, 3)` f32 tightly
    /// packed, with the usage `COPY_SRC`, copied when the encoder's commands run; other bodies'
    /// positions come from the scene. For the named bodies, the scene's positions only serve to
    /// find clusters, once. Positions on the device are not checked: if one is not finite, the
    /// pairs of its elements are unspecified.
    ///
    /// At most one frame of a detector may be encoded per submission, and it must be submitted
    /// before the detector is asked anything else or encodes into another encoder: see [`Gpu`].
    /// Pairs of which the filter on the device is unsure come in a separate list. If there is not
    /// enough room, here or in an earlier stage, the lists are incomplete and their counts are
    /// larger than their capacities, see [`ResidentPairs`]; [`grow`](Gpu::grow) then makes room.
    ///
    /// # Errors
    /// Those of [`detect`](Detector::detect) about the query; a body with two buffers, a buffer
    /// that is too small or lacks its usage; a query for [one cell](Query::owned_by); a detector
    /// without a device of the caller's, a lost one; a frame larger than the device or the memory
    /// budget can hold. Device errors go to the device's owner, and so do those of kernels, which
    /// the first frame compiles.
    pub fn encode(
        &mut self,
        scene: &Scene,
        query: &Query,
        positions: &[(BodyId, &wgpu::Buffer)],
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<ResidentPairs, Error> {
        if query.cell.is_some() {
            return Err(Error::Setting {
                setting: "owned_by",
                given: "a cell in a frame that stays on a device".to_owned(),
                allowed: "only detect, count and any",
            });
        }
        query.check_without_pairs()?;
        let plan = Plan::intersections(scene, query, Goal::All, self.detector.settings.limits())?;
        let control = Control::new();
        let job = self.detector.runner.job(scene, &plan, &control)?;
        on_callers_device(&mut self.detector.gpu)?.encode(job, positions, encoder)
    }

    /// Encodes a whole step into the caller's encoder: positions at the start and at the end come
    /// from buffers on the device, and the pairs of elements that may touch stay there. Nothing is
    /// read back.
    ///
    /// The pairs are those of [`impacts`](Detector::impacts), and others that the filter on the
    /// device does not prove free: a superset of the impacts, for a solver that treats every pair
    /// of the list as one that may touch. Whether pairs touch at the start makes no difference, nor
    /// does the precision of times that is asked for. Elements that keep a
    /// [separation](Query::separation) or their [thickness](Scene::set_thickness) touch when they
    /// come as near as that: an edge or a face is as thick as its thickest vertex here, and no
    /// contact is certain.
    ///
    /// `starts` and `ends` name bodies whose positions at that end are taken from a buffer:
    /// `(v, 3)` f32 tightly packed, with the usage `COPY_SRC`, copied when the encoder's commands
    /// run. All other positions come from the scene. A body that has no positions at the end, in a
    /// buffer or in the scene, does not move. For bodies named in `starts`, the scene's positions
    /// only serve to find clusters, once. Positions on the device are not checked: if one is not
    /// finite, the pairs of its elements are unspecified.
    ///
    /// At most one step of a detector may be encoded per submission, besides one frame of
    /// [`encode`](Gpu::encode), and it must be submitted before the detector is asked anything else
    /// or encodes into another encoder: see [`Gpu`]. If there is not enough room, here or in an
    /// earlier stage, the list is incomplete, its count is larger than its capacity and its first
    /// times are 0, see [`ResidentStep`]; [`grow`](Gpu::grow) then makes room.
    ///
    /// # Errors
    /// Those of [`encode`](Gpu::encode), for positions at both ends; a query with a clearance or a
    /// filter; a separation above 2^100, or a body of the query that is thicker.
    pub fn encode_step(
        &mut self,
        scene: &Scene,
        query: &Query,
        starts: &[(BodyId, &wgpu::Buffer)],
        ends: &[(BodyId, &wgpu::Buffer)],
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<ResidentStep, Error> {
        refuse_unknown(query)?;
        self.with_contacts(scene, query, starts, |engine, job, clusterings| {
            engine.encode_step(job, clusterings, [starts, ends], encoder)
        })
    }

    /// Encodes [`safe_distances`](Detector::safe_distances) into the caller's encoder: positions
    /// come from buffers on the device, and how far each vertex may move stays there. Nothing is
    /// read back: once there is [room](Gpu::grow), a solver on the device needs no answer from the
    /// host between its steps. [`encode_truncate`](Gpu::encode_truncate) moves its vertices by at
    /// most these numbers.
    ///
    /// The numbers are `f32`, proven under any rounding that WGSL allows: if every vertex moves by
    /// at most its number, on any path, no pair of elements touches that the device looks at: those
    /// of [`encode_step`](Gpu::encode_step), a vertex and a face or two edges, and for bare bodies
    /// an edge and a vertex or two vertices. An edge that passes through a face is not looked for:
    /// a scene is to begin free of intersections. Each number is below what the smallest distance
    /// of its vertex allows, by at most 2^-6 of it where no pair is nearer than a thousandth of its
    /// elements' size; it is 0 for pairs that touch, that are nearer than about 2^-19 of their
    /// size, whose size is below 2^-32, or that have a coordinate beyond 2^40.
    ///
    /// A query that names an edge and a face, or two faces, is about a vertex and a face and two
    /// edges of them. What it asks of a step is ignored: a separation, a clearance. Vertices of
    /// bodies without elements have `most`.
    ///
    /// `positions` names bodies whose positions are taken from a buffer, as in `encode_step`; all
    /// other positions come from the scene. Positions at the end of a step are ignored. How
    /// [thick](Scene::set_thickness) both elements are is taken from their distance: an edge or a
    /// face is as thick as its thickest vertex, and if edges or faces have a thickness of their
    /// own, a vertex is as thick as the thickest of its own.
    ///
    /// At most one step, or one question about safe distances, may be encoded per submission,
    /// besides one frame of [`encode`](Gpu::encode), and it must be submitted before the detector
    /// is asked anything else or encodes into another encoder: see [`Gpu`]. If there is not enough
    /// room, all numbers are 0, which is safe, and nothing moves until [`grow`](Gpu::grow) has made
    /// more: call it at least once, after the first submission, and again where vertices come
    /// nearer to each other.
    ///
    /// # Errors
    /// As `encode_step`, but for what is asked of a step alone; a `most` that is negative or above
    /// 2^100; fixed bodies that are not in the scene.
    pub fn encode_safe_distances(
        &mut self,
        scene: &Scene,
        most: f64,
        query: &Query,
        positions: &[(BodyId, &wgpu::Buffer)],
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<ResidentSafe, Error> {
        if !(0.0..=MOST_KEPT).contains(&most) {
            return Err(Error::Setting {
                setting: "most",
                given: shown(most),
                allowed: KEPT,
            });
        }
        let query = &of_safe(query);
        query.check_without_filter()?;
        refuse_unknown(query)?;
        for &body in &query.fixed {
            scene.body(body)?;
        }
        let limits = (most, query);
        self.with_contacts(scene, query, positions, |engine, job, clusterings| {
            engine.encode_safe(job, clusterings, positions, limits, encoder)
        })
    }

    /// Encodes how vertices move towards wished positions, after safe distances: each as far as
    /// these allow. The wished position is reached where it is certainly near enough; else the
    /// vertex ends on the way to it, or stays.
    ///
    /// These numbers hold for every direction. So a vertex stops at its number even where it goes
    /// away from all others; [`truncate`](Detector::truncate), which the host answers, looks at the
    /// directions too, and leaves alone what goes apart.
    ///
    /// `starts` has the positions of which `safe` was found, as they were given to
    /// [`encode_safe_distances`](Gpu::encode_safe_distances), or a copy. `ends` has the wished
    /// ones, and then those that are reached: no vertex is farther from its start than it may move,
    /// proven under any rounding that WGSL allows. So nothing touches on the way that was looked
    /// at, if all bodies that move are given, bodies that are not fixed move no other way, and
    /// others do not move. A wished position may be any number, infinite too.
    ///
    /// `safe` must come from the last call of `encode_safe_distances` of this detector, because the
    /// next one writes into the same buffer, and `scene` is the scene that it was asked for: if a
    /// body was [re-meshed](Scene::remesh) since, or its [edges](Scene::set_edges) were set, encode
    /// safe distances again. Whether a body has moved since is not checked: that is a matter of
    /// `starts`.
    ///
    /// Buffers hold `(v, 3)` f32 coordinates, and need the usage `STORAGE`. Bodies may be divided
    /// among several calls in one submission.
    ///
    /// # Errors
    /// Safe distances that are not the last ones of this detector, or of a body that is no longer
    /// the same; a body without safe distances, with `ends` alone or with two buffers, a buffer
    /// that is too small, lacks a usage, is larger than a binding may be, or is that of both ends;
    /// end positions of a body with vertices in a buffer that is given for another, too; a lost
    /// device, a detector without one of the caller's.
    pub fn encode_truncate(
        &mut self,
        scene: &Scene,
        safe: &ResidentSafe,
        starts: &[(BodyId, &wgpu::Buffer)],
        ends: &[(BodyId, &wgpu::Buffer)],
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<(), Error> {
        let engine = on_callers_device(&mut self.detector.gpu)?;
        engine.encode_truncate(scene, safe, [starts, ends], encoder)
    }

    /// Encodes a question about contacts, with the clusters of its parts: those of bodies whose
    /// positions are on the device are kept as they are.
    fn with_contacts<T>(
        &mut self,
        scene: &Scene,
        query: &Query,
        resident: &[(BodyId, &wgpu::Buffer)],
        encode: impl FnOnce(&mut Engine, Job<'_>, &[Arc<Clustering>]) -> Result<T, Error>,
    ) -> Result<T, Error> {
        let engine = on_callers_device(&mut self.detector.gpu)?;
        let plan = Plan::contacts(scene, query, Goal::All, self.detector.settings.limits())?;
        refuse_thickness(scene, &plan)?;
        let control = Control::new();
        let job = self.detector.runner.job(scene, &plan, &control)?;
        let resident: BTreeSet<BodyId> = resident.iter().map(|&(body, _)| body).collect();
        let judges = |body| !resident.contains(&body);
        let stats = &mut Stats::default();
        let clusterings = self.detector.clusterings.of_frame(job, judges, stats)?;
        encode(engine, job, &clusterings)
    }

    /// The positions of a body in the buffer from which the last frame read them, `(v, 3)` f32
    /// tightly packed, and the offset of the first byte: to draw what was tested without another
    /// upload. The buffer has the usage `COPY_SRC`; the next frame may write other positions into
    /// it, or replace it.
    ///
    /// `None` if they are not there: the last frame was answered on the CPU or in pieces, the body
    /// did not take part in it, has f64 positions, or has moved since.
    pub fn positions(&self, scene: &Scene, body: BodyId) -> Option<(wgpu::Buffer, u64)> {
        let engine = self.detector.gpu.as_ref()?;
        let (buffer, offset) = engine.positions_of(body, scene.body(body).ok()?)?;
        Some((buffer.clone(), offset))
    }

    /// Reads the counts of the last encoded frame, and of the last encoded step or safe distances,
    /// whose commands must have been submitted, and grows the lists that were too small. Returns
    /// whether these were complete; if not, encode them again. It says nothing of those before, and
    /// nothing of a kind of which the host has asked since: then it is `true`.
    ///
    /// Waits until the device has done all that was submitted to the queue so far.
    ///
    /// # Errors
    /// A lost device; lists larger than it can bind; a memory budget that does not allow them.
    pub fn grow(&mut self) -> Result<bool, Error> {
        match self.detector.gpu_in_use() {
            Some(gpu) => gpu.block_on(self.grow_async()),
            None => Ok(true),
        }
    }

    /// [`grow`](Gpu::grow) without blocking: the future waits for the device, which must be polled
    /// meanwhile, as for [`detect_async`](Gpu::detect_async). Without a thread that polls it,
    /// `block_on` waits forever.
    ///
    /// # Errors
    /// As `grow`.
    pub async fn grow_async(&mut self) -> Result<bool, Error> {
        match &mut self.detector.gpu {
            Some(engine) => engine.make_room().await,
            None => Ok(true),
        }
    }
}

/// The device of the caller's on which a detector works.
///
/// # Errors
/// It works on the CPU, or on a device of its own, of which no encoder and no buffer can be.
fn on_callers_device(gpu: &mut Option<Engine>) -> Result<&mut Engine, Error> {
    let engine = gpu.as_mut().ok_or_else(|| Error::NoAdapter {
        found: "this detector works on the CPU".to_owned(),
    })?;
    if engine.gpu().is_own() {
        return Err(Error::Gpu {
            what: "nothing can be encoded for a detector that opened a device of its own: give it \
                   yours with Settings::on_device"
                .to_owned(),
        });
    }
    Ok(engine)
}

/// What a device can take of lengths: up to [`MOST_KEPT`].
const KEPT: &str = "from 0 to 2^100 where it stays on a device";

/// Refuses bodies of a question that are thicker than a device can take.
fn refuse_thickness(scene: &Scene, plan: &Plan) -> Result<(), Error> {
    let thickness = |body: BodyId| scene.body_in(body.slot()).thickness();
    let mut bodies = plan.parts.iter().map(|part| part.id);
    match bodies.find(|&body| thickness(body) > MOST_KEPT) {
        None => Ok(()),
        Some(body) => Err(Error::Setting {
            setting: "thickness",
            given: format!("{} of body {body}", shown(thickness(body))),
            allowed: KEPT,
        }),
    }
}

/// A query as safe distances have it: without what is asked of a step. An edge and a face, or two
/// faces, are no nearer than a vertex and a face, or two edges, of them.
fn of_safe(query: &Query) -> Query {
    let with_faces = [PairKind::EdgeFace, PairKind::FaceFace];
    let looked_at = |kinds: PairKinds| {
        let has_faces = with_faces.into_iter().any(|kind| kinds.contains(kind));
        let is_looked_at = |kind: &PairKind| match kind {
            PairKind::VertexFace | PairKind::EdgeEdge => has_faces || kinds.contains(*kind),
            _ => !with_faces.contains(kind) && kinds.contains(*kind),
        };
        PairKind::ALL.into_iter().filter(is_looked_at).collect()
    };
    Query {
        kinds: query.kinds.map(looked_at),
        separation: 0.0,
        clearance: Clearance::new(0.0),
        ..query.clone()
    }
}

/// Refuses what kernels of steps do not know.
fn refuse_unknown(query: &Query) -> Result<(), Error> {
    query.check_step()?;
    if query.separation > MOST_KEPT {
        return Err(Error::Setting {
            setting: "separation",
            given: shown(query.separation),
            allowed: KEPT,
        });
    }
    if query.clearance.distance > 0.0 {
        return Err(Error::Setting {
            setting: "clearance",
            given: shown(query.clearance.distance),
            allowed: "0 for a step that stays on a device",
        });
    }
    if query.filter.is_some() {
        return Err(Error::Setting {
            setting: "filter",
            given: "a filter of pairs in a step that stays on a device".to_owned(),
            allowed: "only steps that are read back",
        });
    }
    if query.cell.is_some() {
        return Err(Error::Setting {
            setting: "owned_by",
            given: "a cell in a step that stays on a device".to_owned(),
            allowed: "only steps and candidates that are read back",
        });
    }
    Ok(())
}
