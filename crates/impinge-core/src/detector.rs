//! The detector that users hold. It picks the backend; the frame loop does the rest.

#[cfg(feature = "gpu")]
mod gpu;
mod steps;

use crate::cpu::Cpu;
use crate::error::Error;
use crate::ids::BodyId;
use crate::pairs::Pairs;
use crate::progress::Control;
use crate::proximity::{Distances, Nearest};
use crate::query::Query;
use crate::run::{FrameLoop, ready};
use crate::scene::Scene;
use crate::settings::{Backend, Settings};
use crate::sink::Wanted;
use crate::stats::Statistics;

/// Finds intersecting pairs, frame after frame. Owns the scratch memory and reuses it.
///
/// ```
/// use impinge::{Backend, Detector, Query, Scene};
/// # fn main() -> Result<(), impinge::Error> {
/// let mut scene = Scene::new();
/// let triangle = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let a = scene.add_triangles(&[[0, 1, 2]], &triangle)?;
/// let b = scene.add_triangles(&[[0, 1, 2]], &triangle.map(|[x, y, z]| [x, z + 0.25, y - 0.25]))?;
/// let mut detector = Detector::new(Backend::Cpu)?;
/// let pairs = detector.detect(&scene, &Query::between(a, b))?;
/// assert_eq!(pairs.between(a, b).collect::<Vec<_>>(), [(0, 0)]);
/// # Ok(()) }
/// ```
pub struct Detector {
    settings: Settings,
    frames: FrameLoop,
    cpu: Cpu,
    steps: steps::StepMemory,
    distances: Distances,
    #[cfg(feature = "gpu")]
    gpu: Option<crate::gpu::Engine>,
}

impl Detector {
    /// Creates a detector with the default method on the given backend.
    ///
    /// # Errors
    /// As [`with_settings`](Detector::with_settings).
    pub fn new(backend: Backend) -> Result<Self, Error> {
        Detector::with_settings(Settings {
            backend,
            ..Settings::default()
        })
    }

    /// Creates a detector with explicit settings.
    ///
    /// # Errors
    /// A setting out of its range; no adapter for `Backend::Gpu`.
    pub fn with_settings(settings: Settings) -> Result<Self, Error> {
        settings.check()?;
        #[cfg(feature = "gpu")]
        let gpu = gpu::open(&settings)?;
        Ok(Detector::assemble(
            settings,
            #[cfg(feature = "gpu")]
            gpu,
        ))
    }

    /// [`with_settings`](Detector::with_settings) without blocking. In a browser this is the only way to open a GPU.
    ///
    /// # Errors
    /// As `with_settings`.
    pub async fn with_settings_async(settings: Settings) -> Result<Self, Error> {
        settings.check()?;
        #[cfg(feature = "gpu")]
        let gpu = gpu::open_async(&settings).await?;
        Ok(Detector::assemble(
            settings,
            #[cfg(feature = "gpu")]
            gpu,
        ))
    }

    fn assemble(
        settings: Settings,
        #[cfg(feature = "gpu")] gpu: Option<crate::gpu::Engine>,
    ) -> Self {
        Detector {
            #[cfg(feature = "gpu")]
            gpu,
            frames: FrameLoop::new(
                settings.threads,
                settings.placement,
                settings.limits(),
                settings.tuning,
            ),
            cpu: Cpu::new(&settings),
            steps: steps::StepMemory::new(&settings),
            distances: Distances::new(),
            settings,
        }
    }

    /// The settings it was created with.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// All pairs that the query asks for, in the current state of the scene.
    ///
    /// # Errors
    /// A stale id, refused positions, more pairs than allowed, no memory for the answer, a memory budget too small for
    /// one slab and the answer, a GPU failure.
    pub fn detect(&mut self, scene: &Scene, query: &Query) -> Result<&Pairs, Error> {
        self.detect_with(scene, query, &Control::new())
    }

    /// [`detect`](Detector::detect) with a token to stop it and a callback to watch it.
    ///
    /// # Errors
    /// As `detect`, and [`Error::Cancelled`].
    pub fn detect_with(
        &mut self,
        scene: &Scene,
        query: &Query,
        control: &Control<'_>,
    ) -> Result<&Pairs, Error> {
        self.wait_for(scene, query, control, Wanted::Pairs)?;
        Ok(self.frames.pairs())
    }

    /// How many pairs [`detect`](Detector::detect) would find. None of them is held, so there may be more than memory
    /// has room for.
    ///
    /// # Errors
    /// As `detect`.
    pub fn count(&mut self, scene: &Scene, query: &Query) -> Result<u64, Error> {
        self.count_with(scene, query, &Control::new())
    }

    /// [`count`](Detector::count) with a token to stop it and a callback to watch it.
    ///
    /// # Errors
    /// As `count`, and [`Error::Cancelled`].
    pub fn count_with(
        &mut self,
        scene: &Scene,
        query: &Query,
        control: &Control<'_>,
    ) -> Result<u64, Error> {
        self.wait_for(scene, query, control, Wanted::Count)?;
        Ok(self.frames.n_pairs())
    }

    /// Whether [`detect`](Detector::detect) would find any pair. The search ends with the first one that is certain.
    ///
    /// That pair is not given: which one comes first depends on the threads. For one that is the same on every run take
    /// the first of all pairs.
    ///
    /// # Errors
    /// As `detect`; but any number of pairs is allowed.
    pub fn any(&mut self, scene: &Scene, query: &Query) -> Result<bool, Error> {
        self.any_with(scene, query, &Control::new())
    }

    /// [`any`](Detector::any) with a token to stop it and a callback to watch it.
    ///
    /// # Errors
    /// As `any`, and [`Error::Cancelled`].
    pub fn any_with(
        &mut self,
        scene: &Scene,
        query: &Query,
        control: &Control<'_>,
    ) -> Result<bool, Error> {
        self.wait_for(scene, query, control, Wanted::Any)?;
        Ok(self.frames.n_pairs() > 0)
    }

    /// The smallest distance of two bodies at the positions that they have, and the pair of primitives that has it; `None` if one
    /// body has no primitives. The distance is 0 if and only if they share a point, which is decided exactly. Tetrahedra are
    /// solid: a body inside one has distance 0.
    ///
    /// The detector keeps a tree per body and the nearest pair of each call. So repeated calls for bodies that move cost
    /// little more than to read their positions. The answer does not depend on earlier calls.
    ///
    /// ```
    /// use impinge::{Backend, Detector, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// let triangle = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// let a = scene.add_triangles(&[[0, 1, 2]], &triangle)?;
    /// let b = scene.add_triangles(&[[0, 1, 2]], &triangle.map(|[x, y, z]| [x, y, z + 3.0]))?;
    /// let mut detector = Detector::new(Backend::Cpu)?;
    /// let nearest = detector.distance(&scene, a, b)?.expect("both have primitives");
    /// assert_eq!((nearest.distance, nearest.primitives), (3.0, [0, 0]));
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// A stale id, the same body twice, bad positions that were written in place.
    pub fn distance(
        &mut self,
        scene: &Scene,
        a: BodyId,
        b: BodyId,
    ) -> Result<Option<Nearest>, Error> {
        self.distances.between(scene, a, b)
    }

    /// The pairs that [`detect`](Detector::detect) found last, out of the detector without a copy. Until the next
    /// frame it then holds none.
    pub fn take_pairs(&mut self) -> Pairs {
        self.frames.take_pairs()
    }

    /// How the last frame was answered: stages, counts, bytes. The same as [`Pairs::stats`], and there after
    /// [`count`](Detector::count) and [`any`](Detector::any) too.
    pub fn stats(&self) -> &Statistics {
        self.frames.pairs().stats()
    }

    fn wait_for(
        &mut self,
        scene: &Scene,
        query: &Query,
        control: &Control<'_>,
        wanted: Wanted,
    ) -> Result<(), Error> {
        #[cfg(feature = "gpu")]
        if let Some(gpu) = self.gpu_in_use() {
            return gpu.block_on(self.answer(scene, query, control, wanted));
        }
        ready(self.answer(scene, query, control, wanted))
    }

    /// [`detect`](Detector::detect) without blocking. On a GPU the future waits for the device, which must be
    /// polled meanwhile (a browser does that; natively call `wgpu::Device::poll`). On the CPU it is ready at once.
    ///
    /// # Errors
    /// As `detect`.
    pub async fn detect_async(&mut self, scene: &Scene, query: &Query) -> Result<&Pairs, Error> {
        self.answer(scene, query, &Control::new(), Wanted::Pairs)
            .await?;
        Ok(self.frames.pairs())
    }

    /// One frame. With `Backend::Auto`, the CPU takes over for good if the GPU fails or cannot hold the scene.
    async fn answer(
        &mut self,
        scene: &Scene,
        query: &Query,
        control: &Control<'_>,
        wanted: Wanted,
    ) -> Result<(), Error> {
        #[cfg(feature = "gpu")]
        if let Some(engine) = &mut self.gpu {
            let may_choose = self.settings.backend == Backend::Auto;
            let cpu = may_choose.then_some(&mut self.cpu);
            let mut finder = gpu::OnDevice { engine, cpu };
            let found = self.frames.run(scene, query, control, wanted, &mut finder);
            match found.await {
                Err(Error::Gpu { .. }) if self.settings.backend == Backend::Auto => self.gpu = None,
                result => return result,
            }
        }
        self.frames
            .run(scene, query, control, wanted, &mut self.cpu)
            .await
    }
}
