//! The library through its C interface: what a call of C costs beside one of Rust. Its functions are
//! found in the shared library when the bench runs, so its code is the one that users link.

use std::ffi::{CStr, c_char, c_void};
use std::path::Path;
use std::ptr::null_mut;
use std::sync::Arc;
use std::time::Instant;

use impinge::Elements;
use libloading::Library;

use crate::problem::{Ask, Problem};
use crate::runner::{Answer, Runner};
use crate::{Failure, Options};

/// `impinge_array`.
#[repr(C)]
#[derive(Clone, Copy)]
struct Array {
    data: *const c_void,
    rows: usize,
    row_stride: isize,
    column_stride: isize,
    kind: u32,
}

/// `IMPINGE_F32`.
const F32: u32 = 1;
/// `IMPINGE_U32`.
const U32: u32 = 3;

impl Array {
    fn packed<T>(rows: &[T], kind: u32) -> Array {
        Array {
            data: rows.as_ptr().cast(),
            rows: rows.len(),
            row_stride: 0,
            column_stride: 0,
            kind,
        }
    }
}

/// The start of `impinge_query`, and room for the rest of it.
#[repr(C, align(8))]
struct CQuery {
    size: u32,
    between: u32,
    within: u32,
    shared_vertex: u32,
    a: u32,
    b: u32,
    rest: [u8; 1024],
}

/// The start of `impinge_settings`, and room for the rest of it.
#[repr(C, align(8))]
struct CSettings {
    size: u32,
    backend: u32,
    method: u32,
    threads: u32,
    rest: [u8; 1024],
}

type Handle = *mut c_void;
type Status = i32;
type Release = Option<extern "C" fn(*mut c_void)>;

/// Declares the functions, and finds them by their names.
macro_rules! functions {
    ($($name:ident($($argument:ty),*) $(-> $result:ty)?;)*) => {
        struct Functions {
            $($name: unsafe extern "C" fn($($argument),*) $(-> $result)?,)*
            /// They are part of it.
            _library: Library,
        }

        impl Functions {
            fn load(path: &Path) -> Result<Functions, Failure> {
                // SAFETY: The library of this repository has no code that runs when it is loaded.
                let library = unsafe { Library::new(path) }?;
                Ok(Functions {
                    $(
                        // SAFETY: The types are those of impinge.h.
                        $name: *unsafe { library.get(concat!(stringify!($name), "\0").as_bytes()) }?,
                    )*
                    _library: library,
                })
            }
        }
    };
}

functions! {
    impinge_error_message() -> *const c_char;
    impinge_scene_create(*mut Handle) -> Status;
    impinge_scene_destroy(Handle);
    impinge_scene_add_triangles(Handle, Array, Array, *mut u32) -> Status;
    impinge_scene_set_positions(Handle, u32, Array) -> Status;
    impinge_scene_lend_positions(Handle, u32, Array, Release, *mut c_void) -> Status;
    impinge_query_default(*mut CQuery);
    impinge_settings_default(*mut CSettings);
    impinge_detector_create(*const CSettings, *mut Handle) -> Status;
    impinge_detector_destroy(Handle);
    impinge_detect(Handle, Handle, *const CQuery, *mut Handle) -> Status;
    impinge_pairs_count(Handle) -> usize;
    impinge_pairs_hash(Handle) -> u64;
    impinge_pairs_destroy(Handle);
}

impl Functions {
    fn check(&self, status: Status) -> Result<(), Failure> {
        if status == 0 {
            return Ok(());
        }
        // SAFETY: It is a string until the next call that fails.
        let message = unsafe { CStr::from_ptr((self.impinge_error_message)()) };
        Err(message.to_string_lossy().into_owned().into())
    }
}

/// How the library gets its positions.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Feed {
    Copied,
    Lent,
}

/// A detector of C and its scene.
struct Through {
    functions: Functions,
    scene: Handle,
    detector: Handle,
    query: CQuery,
    bodies: Vec<u32>,
    feed: Feed,
    threads: usize,
    next: usize,
    /// By body and pose. What is lent stays until the scene is gone.
    poses: Vec<Vec<Arc<[[f32; 3]]>>>,
}

/// Contestants for two bodies of triangles, if the options name the library.
pub fn runners(problem: &Problem, options: &Options) -> Result<Vec<Box<dyn Runner>>, Failure> {
    let mut runners: Vec<Box<dyn Runner>> = Vec::new();
    if let Some(library) = &options.c_library {
        // As the contestants in Rust: one thread, too, if no number is named.
        let single = (options.threads == 0).then_some(1);
        for threads in std::iter::once(options.threads).chain(single) {
            for feed in [Feed::Copied, Feed::Lent] {
                runners.push(Box::new(Through::new(problem, library, threads, feed)?));
            }
        }
    }
    Ok(runners)
}

impl Through {
    fn new(problem: &Problem, library: &Path, threads: usize, feed: Feed) -> Result<Self, Failure> {
        let functions = Functions::load(library)
            .map_err(|error| format!("--c-library {}: {error}", library.display()))?;
        let poses = problem.bodies.iter();
        let poses = poses.map(|body| body.poses.iter().map(|pose| Arc::from(&pose[..])).collect());
        let mut through = Through {
            functions,
            scene: null_mut(),
            detector: null_mut(),
            query: CQuery {
                size: 0,
                between: 0,
                within: 0,
                shared_vertex: 0,
                a: 0,
                b: 0,
                rest: [0; 1024],
            },
            bodies: Vec::new(),
            feed,
            threads,
            next: 0,
            poses: poses.collect(),
        };
        through.open(problem)?;
        Ok(through)
    }

    fn open(&mut self, problem: &Problem) -> Result<(), Failure> {
        let c = &self.functions;
        // SAFETY: Pointers are to what lives longer than the calls; those of handles are filled.
        unsafe {
            c.check((c.impinge_scene_create)(&mut self.scene))?;
            for body in &problem.bodies {
                let Elements::Triangles(faces) = &*body.elements else {
                    return Err("--c-library: a body is not of triangles".into());
                };
                let mut id = 0;
                let (faces, points) = (
                    Array::packed(faces, U32),
                    Array::packed(&body.poses[0], F32),
                );
                c.check((c.impinge_scene_add_triangles)(
                    self.scene, faces, points, &mut id,
                ))?;
                self.bodies.push(id);
            }
            let mut settings = CSettings {
                size: 0,
                backend: 0,
                method: 0,
                threads: 0,
                rest: [0; 1024],
            };
            (c.impinge_settings_default)(&mut settings);
            settings.backend = 1;
            settings.method = 1;
            settings.threads = u32::try_from(self.threads)?;
            c.check((c.impinge_detector_create)(&settings, &mut self.detector))?;
            (c.impinge_query_default)(&mut self.query);
        }
        let (Ask::Between, &[a, b]) = (problem.ask, &self.bodies[..]) else {
            return Err("--c-library: two bodies are expected".into());
        };
        (self.query.within, self.query.a, self.query.b) = (0, a, b);
        Ok(())
    }
}

impl Drop for Through {
    fn drop(&mut self) {
        // SAFETY: The handles are its own, or null. Lent positions are dropped afterwards.
        unsafe {
            (self.functions.impinge_detector_destroy)(self.detector);
            (self.functions.impinge_scene_destroy)(self.scene);
        }
    }
}

impl Runner for Through {
    fn name(&self) -> String {
        let fed = match self.feed {
            Feed::Copied => "copied",
            Feed::Lent => "lent",
        };
        let threads = match self.threads {
            0 => String::new(),
            n => format!(", {n} thread{}", if n == 1 { "" } else { "s" }),
        };
        format!("impinge.h{threads}, positions {fed}")
    }

    fn setting(&self) -> String {
        "default".to_owned()
    }

    fn load(&mut self, _: &Problem, pose: usize) -> Result<(), Failure> {
        self.next = pose;
        Ok(())
    }

    fn frame(&mut self, verify: bool) -> Result<Answer, Failure> {
        let c = &self.functions;
        let mut pairs = null_mut();
        let start = Instant::now();
        for (&body, poses) in self.bodies.iter().zip(&self.poses) {
            let positions = Array::packed(&poses[self.next], F32);
            // SAFETY: Positions are not changed, and live longer than the scene.
            c.check(unsafe {
                match self.feed {
                    Feed::Copied => (c.impinge_scene_set_positions)(self.scene, body, positions),
                    Feed::Lent => (c.impinge_scene_lend_positions)(
                        self.scene,
                        body,
                        positions,
                        None,
                        null_mut(),
                    ),
                }
            })?;
        }
        // SAFETY: The handles live, and that of the answer is filled.
        c.check(unsafe { (c.impinge_detect)(self.detector, self.scene, &self.query, &mut pairs) })?;
        let ms = start.elapsed().as_secs_f64() * 1e3;
        // SAFETY: The answer lives until it is destroyed.
        unsafe {
            let answer = Answer {
                n_pairs: (c.impinge_pairs_count)(pairs) as u64,
                hash: verify.then(|| (c.impinge_pairs_hash)(pairs)),
                ms,
            };
            (c.impinge_pairs_destroy)(pairs);
            Ok(answer)
        }
    }
}
