//! The detector that users hold. It picks the backend; the frame loop does the rest.

mod distance;
#[cfg(feature = "gpu")]
mod gpu;
mod steps;

use crate::clock::Instant;
use crate::contact::{Contacts, Penetration, Topologies, Work};
use crate::cpu::Cpu;
use crate::error::Error;
use crate::ids::BodyId;
use crate::pairs::Pairs;
use crate::progress::Control;
use crate::proximity::{Distances, Nearest};
use crate::query::{Query, Scope};
use crate::run::{FrameLoop, ready};
use crate::scene::Scene;
use crate::settings::{Backend, Method, Settings};
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
    touching: distance::Touching,
    distances: Distances,
    topologies: Topologies,
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
            touching: distance::Touching::default(),
            distances: Distances::default(),
            topologies: Topologies::default(),
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
        if let Some(any) = self.any_soon(scene, query, control)? {
            return Ok(any);
        }
        self.wait_for(scene, query, control, Wanted::Any)?;
        Ok(self.frames.n_pairs() > 0)
    }

    /// Whether any of many bodies meet, on the CPU, if that is soon known.
    fn any_soon(
        &mut self,
        scene: &Scene,
        query: &Query,
        control: &Control<'_>,
    ) -> Result<Option<bool>, Error> {
        let Settings {
            method,
            memory_budget,
            ..
        } = self.settings;
        let is_about_many = matches!(
            query.scope,
            Scope::Across
                | Scope::All {
                    between: true,
                    within: false
                }
        );
        let may_choose = matches!(method, Method::Auto | Method::Clusters);
        if !is_about_many || query.cell.is_some() || !may_choose || memory_budget.is_some() {
            return Ok(None);
        }
        #[cfg(feature = "gpu")]
        if self.gpu.is_some() {
            return Ok(None);
        }
        let start = Instant::now();
        control.step(0, 1)?;
        let (frame, workers) = self.frames.resolve(scene, query)?;
        if frame.layers.len() <= 2 {
            return Ok(None);
        }
        let any = self.distances.any(scene, frame, workers, control)?;
        if let Some(any) = any {
            self.frames.note(u64::from(any), start);
        }
        Ok(any)
    }

    /// The two bodies that are nearest to each other of all that the query lets meet, and the pair of primitives that has their
    /// [`distance`](Detector::distance); `None` if there are no two that have primitives. Of several pairs at the same computed
    /// distance the lowest. Pairs of bodies whose boxes are farther apart than the nearest two are never looked at.
    ///
    /// ```
    /// use impinge::{Backend, Detector, Query, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// let points = [0.0f32, 5.0, 7.0].map(|x| scene.add_points(&[[x, 0.0, 0.0]]));
    /// let [_, b, c] = points.map(|body| body.expect("finite"));
    /// let mut detector = Detector::new(Backend::Cpu)?;
    /// let nearest = detector.nearest(&scene, &Query::all())?.expect("there are three");
    /// assert_eq!((nearest.distance, nearest.bodies), (2.0, [b, c]));
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// A stale id, bad positions that were written in place, a query for self-collision or for the pairs of a cell.
    pub fn nearest(&mut self, scene: &Scene, query: &Query) -> Result<Option<Nearest>, Error> {
        self.nearest_with(scene, query, &Control::new())
    }

    /// [`nearest`](Detector::nearest) with a token to stop it and a callback to watch it.
    ///
    /// # Errors
    /// As `nearest`, and [`Error::Cancelled`].
    pub fn nearest_with(
        &mut self,
        scene: &Scene,
        query: &Query,
        control: &Control<'_>,
    ) -> Result<Option<Nearest>, Error> {
        let refused = |setting, given: &str| Error::Setting {
            setting,
            given: given.to_owned(),
            allowed: "pairs of different bodies, and all of space",
        };
        if query.cell.is_some() {
            return Err(refused("owned_by", "a cell"));
        }
        control.step(0, 1)?;
        let (frame, workers) = self.frames.resolve(scene, query)?;
        if frame.layers.iter().any(|layer| layer.within) {
            return Err(refused("query", "self-collision"));
        }
        self.distances.nearest(scene, frame, workers, control)
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
        self.distance_with(scene, a, b, &Control::new())
    }

    /// [`distance`](Detector::distance) with a token to stop it and a callback to watch it.
    ///
    /// # Errors
    /// As `distance`, and [`Error::Cancelled`].
    pub fn distance_with(
        &mut self,
        scene: &Scene,
        a: BodyId,
        b: BodyId,
        control: &Control<'_>,
    ) -> Result<Option<Nearest>, Error> {
        let Detector {
            touching,
            distances,
            frames,
            cpu,
            settings,
            ..
        } = self;
        let workers = frames.workers();
        distances.between(scene, [a, b], workers, control, || {
            touching.lowest(scene, [a, b], (workers, control), cpu, settings)
        })
    }

    /// Where the triangles of each pair meet: points, segments and polygons. The scene must not have changed since the pairs
    /// were found.
    ///
    /// ```
    /// use impinge::{Backend, Detector, Query, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// let floor = [[0.0f32, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
    /// let blade = [[1.0f32, 1.0, -1.0], [2.0, 1.0, -1.0], [1.0, 1.0, 1.0]];
    /// scene.add_triangles(&[[0, 1, 2]], &floor)?;
    /// scene.add_triangles(&[[0, 1, 2]], &blade)?;
    /// let mut detector = Detector::new(Backend::Cpu)?;
    /// let pairs = detector.detect(&scene, &Query::all())?.clone();
    /// let contacts = detector.contacts(&scene, &pairs)?;
    /// assert_eq!(contacts.points(), [[1.0, 1.0, 0.0], [1.5, 1.0, 0.0]]);
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// A body of the pairs is no longer in the scene, is of another kind or has too few primitives; positions written in
    /// place since then are refused.
    pub fn contacts(&mut self, scene: &Scene, pairs: &Pairs) -> Result<Contacts, Error> {
        self.contacts_with(scene, pairs, &Control::new())
    }

    /// [`contacts`](Detector::contacts) with a token to stop it and a callback to watch it.
    ///
    /// # Errors
    /// As `contacts`, and [`Error::Cancelled`].
    pub fn contacts_with(
        &mut self,
        scene: &Scene,
        pairs: &Pairs,
        control: &Control<'_>,
    ) -> Result<Contacts, Error> {
        let workers = self.frames.workers();
        let _shift = workers.shift(pairs.len() as u64);
        Contacts::new(scene, pairs, Work { workers, control })
    }

    /// How deep two closed bodies of triangles are in each other, from contacts among which are all of these two. The
    /// bodies' topologies are kept, so that later calls cost less.
    ///
    /// A vertex is inside where the other surface's winding number around it is not 0; a vertex on the surface
    /// is not inside. The body with the lower number is the first, whichever argument it is.
    ///
    /// ```
    /// use impinge::{Backend, Detector, Query, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let tetrahedron = [[0u32, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    /// let corners = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    /// let mut scene = Scene::new();
    /// let a = scene.add_triangles(&tetrahedron, &corners)?;
    /// let b = scene.add_triangles(&tetrahedron, &corners.map(|[x, y, z]| [x + 0.1, y + 0.125, z - 0.875]))?;
    /// let mut detector = Detector::new(Backend::Cpu)?;
    /// let pairs = detector.detect(&scene, &Query::between(a, b))?.clone();
    /// let contacts = detector.contacts(&scene, &pairs)?;
    /// let penetration = detector.penetration(&scene, &contacts, a, b)?;
    /// assert_eq!(penetration.inside[1], [3]); // The tip of b is in a.
    /// let region = &penetration.regions[0];
    /// assert!(region.depth.is_some_and(|depth| depth <= 0.125));
    /// assert!(region.normal.is_some_and(|normal| normal[2] > 0.9)); // Push a up.
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// A body that is not in the scene, the same body twice, a body not made of triangles, a surface that is not closed.
    pub fn penetration(
        &mut self,
        scene: &Scene,
        contacts: &Contacts,
        a: BodyId,
        b: BodyId,
    ) -> Result<Penetration, Error> {
        self.penetration_with(scene, contacts, a, b, &Control::new())
    }

    /// [`penetration`](Detector::penetration) with a token to stop it and a callback to watch it.
    ///
    /// # Errors
    /// As `penetration`, and [`Error::Cancelled`].
    pub fn penetration_with(
        &mut self,
        scene: &Scene,
        contacts: &Contacts,
        a: BodyId,
        b: BodyId,
        control: &Control<'_>,
    ) -> Result<Penetration, Error> {
        let workers = self.frames.workers();
        let _shift = workers.shift(0);
        let work = Work { workers, control };
        self.topologies.penetration(scene, contacts, [a, b], work)
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
