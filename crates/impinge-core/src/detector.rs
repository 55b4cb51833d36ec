//! The detector that users hold. It picks the backend; the frame loop does the rest.

#[cfg(feature = "gpu")]
mod gpu;
mod steps;

use crate::cpu::Cpu;
use crate::error::Error;
use crate::pairs::Pairs;
use crate::progress::Control;
use crate::query::Query;
use crate::run::{FrameLoop, ready};
use crate::scene::Scene;
use crate::settings::{Backend, Settings};

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
    steps: steps::Steps,
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
            frames: FrameLoop::new(settings.threads),
            cpu: Cpu::new(&settings),
            steps: steps::Steps::new(&settings),
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
    /// A stale id, refused positions, a memory budget too small for even one slab, a GPU failure.
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
        #[cfg(feature = "gpu")]
        if let Some(gpu) = self.gpu_in_use() {
            gpu.block_on(self.answer(scene, query, control))?;
            return Ok(self.frames.pairs());
        }
        ready(self.answer(scene, query, control))?;
        Ok(self.frames.pairs())
    }

    /// [`detect`](Detector::detect) without blocking. On a GPU the future waits for the device, which must be
    /// polled meanwhile (a browser does that; natively call `wgpu::Device::poll`). On the CPU it is ready at once.
    ///
    /// # Errors
    /// As `detect`.
    pub async fn detect_async(&mut self, scene: &Scene, query: &Query) -> Result<&Pairs, Error> {
        self.answer(scene, query, &Control::new()).await?;
        Ok(self.frames.pairs())
    }

    /// One frame. With `Backend::Auto`, the CPU takes over for good if the GPU fails or cannot hold the scene.
    async fn answer(
        &mut self,
        scene: &Scene,
        query: &Query,
        control: &Control<'_>,
    ) -> Result<(), Error> {
        #[cfg(feature = "gpu")]
        if let Some(engine) = &mut self.gpu {
            match self.frames.run(scene, query, control, engine).await {
                Err(Error::Gpu { .. }) if self.settings.backend == Backend::Auto => self.gpu = None,
                result => return result,
            }
        }
        self.frames.run(scene, query, control, &mut self.cpu).await
    }
}
