//! Detectors on a GPU: on a device of their own, or on the caller's.

use std::cell::Cell;
use std::sync::Arc;

use super::{Detector, Settings};
use crate::clusterings::Clusterings;
use crate::cpu::steps::{ByDevice, StepClusters};
use crate::gpu::recording::{Ran, Recording};
use crate::gpu::{Capacities, Engine, GpuContext, WantedAdapter};
use crate::query::goal::Goal;
use crate::query::settings::Backend;
use crate::query::settings::Method;
use crate::scene::error::Error;
use crate::search::found::StepAnswer;
use crate::search::runner::Job;
use crate::search::stats::Stats;
use crate::workers::is_forked;

/// Candidates of the last frame from which on a device pays.
const PAYS_FROM: u64 = 50_000;

/// Opens the GPU that the settings ask for, if they ask for one.
pub(super) fn open(
    settings: &Settings,
    clusterings: &Clusterings,
) -> Result<Option<Engine>, Error> {
    let gpu = match of_caller(settings) {
        Some(gpu) => gpu.map(Some),
        None => wanted(settings).map(GpuContext::open).transpose(),
    };
    engine_of(gpu, settings, clusterings)
}

/// Whether a GPU is opened when it first pays: one that nobody has asked for by name.
pub(super) fn may_wait(settings: &Settings) -> bool {
    settings.backend == Backend::Auto && settings.device.is_none() && !pays(settings, 0)
}

/// [`open`] without blocking.
pub(super) async fn open_async(
    settings: &Settings,
    clusterings: &Clusterings,
) -> Result<Option<Engine>, Error> {
    let gpu = match (of_caller(settings), wanted(settings)) {
        (Some(gpu), _) => gpu.map(Some),
        (None, Some(wanted)) => GpuContext::open_async(wanted).await.map(Some),
        (None, None) => Ok(None),
    };
    engine_of(gpu, settings, clusterings)
}

/// The caller's device, if the settings have one.
fn of_caller(settings: &Settings) -> Option<Result<Arc<GpuContext>, Error>> {
    let (device, queue) = settings.on_device.clone()?;
    let is_used = settings.backend != Backend::Cpu;
    is_used.then(|| GpuContext::of_caller(device, queue).map(Arc::new))
}

fn wanted(settings: &Settings) -> Option<WantedAdapter<'_>> {
    let named = settings.device.as_deref().map(WantedAdapter::Named);
    match settings.backend {
        Backend::Cpu => None,
        Backend::Auto if settings.method == Method::Naive => None,
        // GPU drivers do not survive a fork.
        Backend::Auto if is_forked() => None,
        // A software driver is slower than the CPU backend.
        Backend::Auto => Some(named.unwrap_or(WantedAdapter::Hardware)),
        Backend::Gpu => Some(named.unwrap_or(WantedAdapter::Any)),
    }
}

fn engine_of(
    gpu: Result<Option<Arc<GpuContext>>, Error>,
    settings: &Settings,
    clusterings: &Clusterings,
) -> Result<Option<Engine>, Error> {
    match gpu {
        Ok(gpu) => Ok(gpu.map(|gpu| {
            let clusterings = clusterings.clone();
            Engine::new(gpu, settings, clusterings, Capacities::default())
        })),
        // A name that fits no adapter is a mistake, even with `Backend::Auto`.
        Err(error @ Error::NoAdapter { .. }) if settings.device.is_some() => Err(error),
        Err(_) if settings.backend == Backend::Auto => Ok(None),
        Err(error) => Err(error),
    }
}

/// Has the device find the pairs of a step that may touch, and decides them on the CPU. Returns
/// [`ByDevice::Not`] if there is no device, or if the CPU has to answer: steps with a
/// clearance or a filter, steps that the device cannot hold, any step in a browser, which cannot
/// wait for a device here. With `Backend::Auto` the CPU takes over for good if the device fails.
pub(super) fn find_in_step(
    engine: &mut Option<Engine>,
    clusters: &mut StepClusters,
    (job, settings): (Job<'_>, &Settings),
    answer: StepAnswer<'_>,
    stats: &mut Stats,
) -> Result<ByDevice, Error> {
    if cfg!(target_family = "wasm")
        || job.plan.has_clearance()
        || job.plan.has_filter()
        || (settings.memory_budget.is_some()
            && (job.plan.leaves_out() || job.plan.keeps_distance()))
    {
        return Ok(ByDevice::Not);
    }
    let Some(on_device) = engine else {
        return Ok(ByDevice::Not);
    };
    // Which pairs a cell owns is not known on a device, so a pair that certainly touches may be
    // another cell's.
    let sought = match job.plan.has_cell() {
        false => job.plan.goal,
        true => Goal::All,
    };
    let gpu = Arc::clone(on_device.gpu());
    let before = stats.clone();
    let found = clusters.run_on_device(job, settings, answer, stats, |clusterings, take, stats| {
        gpu.block_on(on_device.find_undecided(job, clusterings, (sought, take), stats))
    });
    match found {
        Ok(ByDevice::Not) => {}
        Ok(done) => {
            stats.backend.clear();
            stats.backend.push_str(gpu.name());
            return Ok(done);
        }
        Err(Error::Gpu { .. }) if settings.backend == Backend::Auto => *engine = None,
        Err(error) => return Err(error),
    }
    *stats = before;
    Ok(ByDevice::Not)
}

/// Whether a device pays for a frame, with `Backend::Auto`, if the last one had so many candidates.
///
/// With few, the CPU has answered before the device has the positions. What was measured
/// (docs/lab/gpu.md), milliseconds:
///
/// ```text
/// candidates            20,000   64,000   149,000   650,000
/// the CPU, 16 threads     0.38     1.62      2.65      13.0
/// the device              0.97     0.77      1.09       8.3
/// ```
///
/// A first frame is the CPU's: it has large new bodies in its grid, where a device would wait for
/// the host to make their clusters. A memory budget is for one of both, so the device answers, and
/// so it does by `Cells`, which takes the CPU four times as long.
pub(super) fn pays(settings: &Settings, n_candidates: u64) -> bool {
    let may_wait = settings.memory_budget.is_none() && settings.method != Method::Cells;
    n_candidates >= PAYS_FROM || !may_wait
}

impl Detector {
    /// [`new`](Detector::new), with the initial room of GPU buffers. For
    /// tests: buffers grow by themselves.
    ///
    /// # Errors
    /// As `new`.
    #[doc(hidden)]
    pub fn with_capacities(settings: Settings, capacities: Capacities) -> Result<Self, Error> {
        let mut detector = Detector::new(settings)?;
        if let Some(gpu) = detector.gpu_in_use() {
            let clusterings = detector.clusterings.clone();
            let engine = Engine::new(gpu, &detector.settings, clusterings, capacities);
            detector.gpu = Some(engine);
        }
        Ok(detector)
    }

    /// [`new`](Detector::new), with the most bytes of topology or positions that a GPU may
    /// bind at once. For tests: devices report their own limit.
    ///
    /// # Errors
    /// As `new`.
    #[doc(hidden)]
    pub fn with_most_bound(settings: Settings, bytes: u64) -> Result<Self, Error> {
        let mut detector = Detector::new(settings)?;
        if let Some(engine) = &mut detector.gpu {
            engine.most_bound = bytes;
        }
        Ok(detector)
    }

    /// Whether each question is also answered launch by launch, with what each kernel has written
    /// read back: slow. For finding the launch that goes wrong: see [`ran`](Detector::ran).
    #[doc(hidden)]
    pub fn trace(&mut self, is_traced: bool) {
        if let Some(engine) = &mut self.gpu {
            engine.is_traced = is_traced;
        }
    }

    /// The last pass of the last question that a device has answered: its launches as data, to be
    /// printed.
    #[doc(hidden)]
    pub fn recording(&self) -> Option<&Recording> {
        let engine = self.gpu.as_ref()?;
        Some(&engine.lane.recording)
    }

    /// What each launch of the last pass of the last question has written, if it was traced.
    #[doc(hidden)]
    pub fn ran(&self) -> &[Ran] {
        let engine = self.gpu.as_ref();
        engine.map_or(&[], |engine| &engine.lane.ran)
    }

    /// Bytes of topology and positions on the device. For tests: statistics add the buffers for
    /// results.
    #[doc(hidden)]
    pub fn bytes_on_device(&self) -> u64 {
        self.gpu.as_ref().map_or(0, Engine::bytes_of_world)
    }

    /// [`new`](Detector::new) on the caller's device, with one line of one kernel replaced. For
    /// tests: answers may be wrong.
    ///
    /// # Errors
    /// As `new`; a kernel without this line.
    #[doc(hidden)]
    pub fn with_damage(
        device: wgpu::Device,
        queue: wgpu::Queue,
        settings: Settings,
        (kernel, line, damaged): (&str, &str, &str),
    ) -> Result<Self, Error> {
        let is_damaged = Cell::new(false);
        let gpu = GpuContext::of_caller_with(device, queue, |source| {
            let text = source.text();
            let is_it = source.name == kernel && text.contains(line);
            is_damaged.set(is_damaged.get() || is_it);
            is_it.then(|| text.replace(line, damaged))
        })?;
        if !is_damaged.get() {
            let what = format!("kernel {kernel} has no line \"{line}\"");
            return Err(Error::Gpu { what });
        }
        let settings = Settings {
            backend: Backend::Gpu,
            device: None,
            ..settings
        };
        settings.check()?;
        let clusterings = Clusterings::new(&settings);
        let engine = engine_of(Ok(Some(Arc::new(gpu))), &settings, &clusterings)?;
        Ok(Detector::assemble(settings, clusterings, engine))
    }

    /// Opens the GPU that has waited, for a question for which it pays. If there is none, the CPU
    /// answers from now on.
    pub(super) fn open_gpu(&mut self) {
        if std::mem::take(&mut self.gpu_waits) {
            self.gpu = open(&self.settings, &self.clusterings).unwrap_or_default();
        }
    }

    /// The name of the GPU that is open.
    #[doc(hidden)]
    pub fn gpu_name(&self) -> Option<&str> {
        self.gpu.as_ref().map(|engine| engine.gpu().name())
    }

    /// Whether a GPU is still to be looked for, when one first pays.
    #[doc(hidden)]
    pub fn waits_for_gpu(&self) -> bool {
        self.gpu_waits
    }

    pub(super) fn gpu_in_use(&self) -> Option<Arc<GpuContext>> {
        self.gpu.as_ref().map(|engine| Arc::clone(engine.gpu()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::query::Query;
    use crate::scene::Scene;

    #[test]
    fn a_device_that_nobody_named_waits_for_a_question_for_which_it_pays() {
        let mut scene = Scene::new();
        let corners = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        scene.add_triangles(&[[0, 1, 2]], &corners).unwrap();
        let mut detector = Detector::new(Settings::new()).unwrap();
        detector.detect(&scene, &Query::all()).unwrap();
        detector.near(&scene, 0.5, &Query::all()).unwrap();
        assert!(detector.gpu_waits && detector.gpu.is_none());
        detector.earliest(&scene, &Query::all()).unwrap();
        assert!(!detector.gpu_waits);
        let budget = Settings::new().memory_budget(Some(1 << 24));
        assert!(!Detector::new(budget).unwrap().gpu_waits);
        assert!(!Detector::new(Backend::Cpu).unwrap().gpu_waits);
    }
}
