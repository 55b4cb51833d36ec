//! Embree 3 as a peer: a bounding volume hierarchy over user-defined primitives, refitted or
//! rebuilt each frame, `rtcCollide`, and the plain pair test in its callback.
//!
//! `rtcCollide` takes only user geometries and calls back with candidate pairs from several
//! threads. The callback is fast: no lock, no allocation, one atomic addition per batch of hits.
//! The setting (build quality, scene flags, threads, whether candidates' boxes are compared first)
//! is not fixed: [`tuned`] measures all sensible settings on the problem and keeps the fastest.

pub mod ffi;

use std::ffi::{CString, c_int, c_void};
use std::fmt;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering::Relaxed};
use std::time::Instant;

use impinge::Elements;

use crate::Failure;
use crate::plain::Corners;
use crate::problem::{Ask, Problem};
use crate::runner::{Answer, Runner};
use crate::tune;

/// One way to run Embree.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Setting {
    scene_quality: c_int,
    geometry_quality: c_int,
    flags: c_int,
    /// 0 means all.
    threads: usize,
    /// Whether boxes of candidates are compared before the pair test: a leaf may hold several
    /// primitives, and Embree does not compare their boxes.
    boxes: bool,
}

impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let quality = |quality| match quality {
            ffi::QUALITY_LOW => "low",
            ffi::QUALITY_MEDIUM => "medium",
            _ => "refit",
        };
        write!(
            f,
            "geometry {}, scene {}",
            quality(self.geometry_quality),
            quality(self.scene_quality)
        )?;
        for (flag, name) in [
            (ffi::SCENE_DYNAMIC, "dynamic"),
            (ffi::SCENE_COMPACT, "compact"),
            (ffi::SCENE_ROBUST, "robust"),
        ] {
            if self.flags & flag != 0 {
                write!(f, ", {name}")?;
            }
        }
        if self.boxes {
            write!(f, ", boxes compared")?;
        }
        match self.threads {
            0 => write!(f, ", all threads"),
            n => write!(f, ", {n} thread(s)"),
        }
    }
}

/// All settings to try. A refit needs the two-level tree of a scene of low quality: with
/// any other quality, Embree rebuilds, whatever the geometry says.
fn settings() -> Vec<Setting> {
    use ffi::*;
    let mut settings = Vec::new();
    for flags in [
        SCENE_DYNAMIC,
        SCENE_DYNAMIC | SCENE_ROBUST,
        SCENE_DYNAMIC | SCENE_COMPACT,
    ] {
        for threads in [0, 1] {
            for boxes in [false, true] {
                settings.push(Setting {
                    scene_quality: QUALITY_LOW,
                    geometry_quality: QUALITY_REFIT,
                    flags,
                    threads,
                    boxes,
                });
            }
        }
    }
    for (quality, flags) in [(QUALITY_LOW, SCENE_DYNAMIC), (QUALITY_MEDIUM, SCENE_NONE)] {
        settings.push(Setting {
            scene_quality: quality,
            geometry_quality: quality,
            flags,
            threads: 0,
            boxes: true,
        });
    }
    settings
}

/// Embree with a setting, or with the one that is fastest on this problem.
pub fn tuned(
    problem: &Problem,
    setting: Option<Setting>,
) -> Result<(Box<dyn Runner>, Setting), Failure> {
    let build = |setting: &Setting| -> Result<Box<dyn Runner>, Failure> {
        match problem.bodies.first().map(|body| &*body.elements) {
            Some(Elements::Tetrahedra(_)) => {
                Ok(Box::new(Embree::<[[f64; 3]; 4]>::new(problem, *setting)?))
            }
            _ => Ok(Box::new(Embree::<[[f64; 3]; 3]>::new(problem, *setting)?)),
        }
    };
    let settings = setting.map_or_else(settings, |setting| vec![setting]);
    tune::fastest(problem, &settings, build)
}

/// The primitives behind one Embree scene.
struct Side {
    /// Padded to 16 bytes, so that a position is one load.
    positions: Vec<[f32; 4]>,
    /// Corner indices, `K` per primitive.
    corners: Vec<u32>,
    /// The body of each primitive, if it matters.
    owners: Vec<u32>,
}

impl Side {
    fn new<P: Corners>(problem: &Problem, bodies: &[usize]) -> Result<Self, Failure> {
        let mut side = Side {
            positions: Vec::new(),
            corners: Vec::new(),
            owners: Vec::new(),
        };
        for &body_ix in bodies {
            let body = &problem.bodies[body_ix];
            let first = u32::try_from(side.positions.len())?;
            side.positions
                .extend(body.poses[0].iter().map(|&[x, y, z]| [x, y, z, 0.0]));
            for primitive in 0..body.elements.len() {
                let corners = body.elements.corners(primitive);
                if corners.len() != P::N {
                    return Err("bodies of different kinds in one problem".into());
                }
                side.corners
                    .extend(corners.iter().map(|corner| corner + first));
                side.owners.push(u32::try_from(body_ix)?);
            }
        }
        Ok(side)
    }

    #[inline(always)]
    fn indices<P: Corners>(&self, primitive: usize) -> &[u32] {
        &self.corners[primitive * P::N..][..P::N]
    }

    #[inline(always)]
    fn corners<P: Corners>(&self, primitive: usize) -> P {
        let indices = self.indices::<P>(primitive);
        P::from_fn(|k| {
            let [x, y, z, _] = self.positions[indices[k] as usize];
            [x, y, z].map(f64::from)
        })
    }

    /// The box of a primitive, in the first three lanes.
    #[inline(always)]
    fn bounds<P: Corners>(&self, primitive: usize) -> ([f32; 4], [f32; 4]) {
        let indices = self.indices::<P>(primitive);
        let first = self.positions[indices[0] as usize];
        let (mut min, mut max) = (first, first);
        for &index in &indices[1..] {
            let p = self.positions[index as usize];
            // Written so that each line is one vector instruction; there are no NaNs here.
            min = std::array::from_fn(|k| if p[k] < min[k] { p[k] } else { min[k] });
            max = std::array::from_fn(|k| if p[k] > max[k] { p[k] } else { max[k] });
        }
        (min, max)
    }

    #[inline(always)]
    fn boxes_overlap<P: Corners>(&self, i: usize, other: &Side, j: usize) -> bool {
        let ((min_a, max_a), (min_b, max_b)) = (self.bounds::<P>(i), other.bounds::<P>(j));
        (0..4).fold(true, |overlap, k| {
            overlap & (min_a[k] <= max_b[k]) & (min_b[k] <= max_a[k])
        })
    }
}

/// The data of the collision callback.
struct Shared {
    sides: Vec<Side>,
    n_hits: AtomicUsize,
    /// Pairs, first primitive in the high half.
    hits: Vec<AtomicU64>,
}

const BETWEEN: u8 = 0;
const WITHIN: u8 = 1;
const ALL: u8 = 2;

unsafe extern "C" fn bounds<P: Corners>(arguments: *const ffi::BoundsArguments) {
    // SAFETY: Embree passes a valid pointer whose `user` is the `Side` that `frame` set, alive
    // and not mutated while a commit runs, and whose `bounds` is ours to write.
    let (side, primitive, bounds) = unsafe {
        let arguments = &*arguments;
        (
            &*arguments.user.cast::<Side>(),
            arguments.primitive as usize,
            &mut *arguments.bounds,
        )
    };
    (bounds.min, bounds.max) = side.bounds::<P>(primitive);
}

unsafe extern "C" fn collide<P: Corners, const RULE: u8, const BOXES: bool>(
    user: *mut c_void,
    collisions: *mut ffi::Collision,
    n_collisions: u32,
) {
    // SAFETY: `user` is the `Shared` that `frame` passes, alive and only shared while rtcCollide
    // runs, and Embree passes `n_collisions` valid entries.
    let (shared, collisions) = unsafe {
        (
            &*user.cast::<Shared>(),
            std::slice::from_raw_parts(collisions, n_collisions as usize),
        )
    };
    let a = &shared.sides[0];
    let b = if RULE == BETWEEN { &shared.sides[1] } else { a };
    const N_BATCH: usize = 64;
    for batch in collisions.chunks(N_BATCH) {
        let mut found = [0u64; N_BATCH];
        let mut n_found = 0;
        for collision in batch {
            let (i, j) = (collision.primitive0 as usize, collision.primitive1 as usize);
            // For a scene against itself, Embree reports both orders.
            if RULE != BETWEEN && i >= j {
                continue;
            }
            if RULE == ALL && a.owners[i] == b.owners[j] {
                continue;
            }
            if BOXES && !a.boxes_overlap::<P>(i, b, j) {
                continue;
            }
            if RULE == WITHIN {
                let (of_i, of_j) = (a.indices::<P>(i), b.indices::<P>(j));
                if of_i.iter().any(|corner| of_j.contains(corner)) {
                    continue;
                }
            }
            if a.corners::<P>(i).meet(&b.corners::<P>(j)) {
                found[n_found] = (i as u64) << 32 | j as u64;
                n_found += 1;
            }
        }
        if n_found > 0 {
            let start = shared.n_hits.fetch_add(n_found, Relaxed);
            // After the end only the count grows; `frame` then grows the buffer and runs again.
            if let Some(room) = shared.hits.get(start..start + n_found) {
                for (slot, pair) in room.iter().zip(found) {
                    slot.store(pair, Relaxed);
                }
            }
        }
    }
}

/// A device and the objects that depend on it; released in reverse order.
pub struct Handles {
    pub device: ffi::Device,
    pub scenes: Vec<ffi::Scene>,
    pub geometries: Vec<ffi::Geometry>,
}

impl Handles {
    /// A device with so many threads; 0 means all.
    pub fn new(n_threads: usize) -> Result<Self, Failure> {
        let config = CString::new(match n_threads {
            0 => String::new(),
            n => format!("threads={n}"),
        })?;
        // SAFETY: a plain call of the C interface.
        let device = unsafe { ffi::rtcNewDevice(config.as_ptr()) };
        let handles = Handles {
            device,
            scenes: Vec::new(),
            geometries: Vec::new(),
        };
        handles.check("making a device")?;
        Ok(handles)
    }

    /// What Embree said last, if that is an error.
    pub fn check(&self, doing: &str) -> Result<(), Failure> {
        // SAFETY: the device is alive as long as `self`; null is allowed and asks for the thread's
        // own error.
        match unsafe { ffi::rtcGetDeviceError(self.device) } {
            0 => Ok(()),
            code => Err(format!("Embree: {doing} failed with error {code}").into()),
        }
    }
}

impl Drop for Handles {
    fn drop(&mut self) {
        // SAFETY: each handle was created once, by whoever filled these lists, and is released
        // once, here.
        unsafe {
            for &geometry in &self.geometries {
                ffi::rtcReleaseGeometry(geometry);
            }
            for &scene in &self.scenes {
                ffi::rtcReleaseScene(scene);
            }
            if !self.device.is_null() {
                ffi::rtcReleaseDevice(self.device);
            }
        }
    }
}

/// Embree set up for a problem of primitives `P`.
struct Embree<P> {
    handles: Handles,
    shared: Box<Shared>,
    /// The bodies of each side, and the first vertex of each.
    layout: Vec<Vec<(usize, usize)>>,
    callback: ffi::CollideFunction,
    setting: Setting,
    primitives: std::marker::PhantomData<P>,
}

impl<P: Corners> Embree<P> {
    fn new(problem: &Problem, setting: Setting) -> Result<Self, Failure> {
        let n_bodies = problem.bodies.len();
        let groups: Vec<Vec<usize>> = match problem.ask {
            Ask::Between => vec![vec![0], vec![1]],
            Ask::Within | Ask::Resolved | Ask::All => vec![(0..n_bodies).collect()],
        };
        let mut sides = Vec::new();
        let mut layout = Vec::new();
        for group in &groups {
            sides.push(Side::new::<P>(problem, group)?);
            let mut first = 0;
            layout.push(
                group
                    .iter()
                    .map(|&body_ix| {
                        let start = first;
                        first += problem.bodies[body_ix].poses[0].len();
                        (body_ix, start)
                    })
                    .collect(),
            );
        }
        let callback = match (problem.ask, setting.boxes) {
            (Ask::Between, false) => collide::<P, BETWEEN, false>,
            (Ask::Between, true) => collide::<P, BETWEEN, true>,
            (Ask::Within | Ask::Resolved, false) => collide::<P, WITHIN, false>,
            (Ask::Within | Ask::Resolved, true) => collide::<P, WITHIN, true>,
            (Ask::All, false) => collide::<P, ALL, false>,
            (Ask::All, true) => collide::<P, ALL, true> as ffi::CollideFunction,
        };
        let mut handles = Handles::new(setting.threads)?;
        // SAFETY: plain calls of the C interface with live handles; counts match the sides.
        unsafe {
            for side in &sides {
                let scene = ffi::rtcNewScene(handles.device);
                handles.scenes.push(scene);
                ffi::rtcSetSceneBuildQuality(scene, setting.scene_quality);
                ffi::rtcSetSceneFlags(scene, setting.flags);
                let geometry = ffi::rtcNewGeometry(handles.device, ffi::GEOMETRY_USER);
                handles.geometries.push(geometry);
                ffi::rtcSetGeometryBuildQuality(geometry, setting.geometry_quality);
                let n_elements = u32::try_from(side.owners.len())?;
                ffi::rtcSetGeometryUserPrimitiveCount(geometry, n_elements);
                ffi::rtcAttachGeometry(scene, geometry);
            }
        }
        handles.check("setting up")?;
        Ok(Embree {
            handles,
            shared: Box::new(Shared {
                sides,
                n_hits: AtomicUsize::new(0),
                hits: Vec::new(),
            }),
            layout,
            callback,
            setting,
            primitives: std::marker::PhantomData,
        })
    }

    /// Refits or builds, collides, and returns the number of pairs.
    fn run(&self) -> usize {
        self.shared.n_hits.store(0, Relaxed);
        let handles = &self.handles;
        for ((&scene, &geometry), side) in handles
            .scenes
            .iter()
            .zip(&handles.geometries)
            .zip(&self.shared.sides)
        {
            let user = std::ptr::from_ref(side).cast_mut().cast();
            // SAFETY: the handles are alive; `side` outlives the commit, which is the only time at
            // which Embree calls back with it, and the callback only reads it.
            unsafe {
                ffi::rtcSetGeometryUserData(geometry, user);
                ffi::rtcSetGeometryBoundsFunction(geometry, bounds::<P>, user);
                ffi::rtcCommitGeometry(geometry);
                ffi::rtcCommitScene(scene);
            }
        }

        let (first, last) = (handles.scenes[0], handles.scenes[handles.scenes.len() - 1]);
        let user = std::ptr::from_ref(&*self.shared).cast_mut().cast();
        // SAFETY: both scenes are committed; the callback reads `shared` and writes its atomics
        // only.
        unsafe { ffi::rtcCollide(first, last, self.callback, user) };
        self.shared.n_hits.load(Relaxed)
    }
}

impl<P: Corners> Runner for Embree<P> {
    fn name(&self) -> String {
        "Embree 3".to_owned()
    }

    fn setting(&self) -> String {
        self.setting.to_string()
    }

    fn load(&mut self, problem: &Problem, pose: usize) -> Result<(), Failure> {
        for (side, layout) in self.shared.sides.iter_mut().zip(&self.layout) {
            for &(body_ix, first) in layout {
                let pose = &problem.bodies[body_ix].poses[pose];
                for (position, &[x, y, z]) in side.positions[first..].iter_mut().zip(pose) {
                    *position = [x, y, z, 0.0];
                }
            }
        }
        Ok(())
    }

    fn frame(&mut self, _verify: bool) -> Result<Answer, Failure> {
        let start = Instant::now();
        let mut n_hits = self.run();
        if n_hits > self.shared.hits.len() {
            // Only the first frame of a scene gets here: make room for 50 % more.
            let room = n_hits + n_hits / 2;
            self.shared.hits.resize_with(room, AtomicU64::default);
            n_hits = self.run();
        }
        let ms = start.elapsed().as_secs_f64() * 1e3;
        self.handles.check("a frame")?;
        Ok(Answer {
            n_pairs: n_hits as u64,
            hash: None,
            ms,
        })
    }
}
