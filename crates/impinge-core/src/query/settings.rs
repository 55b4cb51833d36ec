//! The settings of a detector.

use crate::query::goal::Limits;
use crate::scene::error::{Error, shown};
use crate::scene::words::words;
use crate::workers::affinity::Affinity;
use crate::workers::tuning::Tuning;

/// How candidates are found. All methods give the same pairs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum Method {
    /// `Cells` for a frame whose bodies are mostly new to the detector, if that is cheaper, and
    /// `Clusters` as soon as they come back: their second frame makes the clusters.
    /// [`Stats::method`](crate::Stats::method) says which one answered. With a memory budget, and
    /// for steps and distances always `Clusters`.
    #[default]
    Auto,
    /// Groups are fixed by topology; in each frame only their boxes move. The fastest method for
    /// bodies that are asked about more than once: the first frame pays for the groups.
    Clusters,
    /// The two-level grid of the paper: the elements of a cell form groups, made anew each frame.
    Cells,
    /// Every box against every box: the oracle, quadratic in elements.
    Naive,
}

impl Method {
    /// The method that `Auto` uses for bodies that it has met before. Other methods are returned
    /// unchanged.
    pub fn in_the_long_run(self) -> Method {
        match self {
            Method::Auto => Method::Clusters,
            other => other,
        }
    }
}

words!("method", "auto, clusters, cells or naive", Method: [Auto = "auto", Clusters = "clusters", Cells = "cells", Naive = "naive"; 4]);

/// Where the work is done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum Backend {
    /// A hardware GPU if there is one and it pays, else the CPU;
    /// [`Stats::backend`](crate::Stats::backend) says which one. It pays for steps, and for frames
    /// after one with at least 50,000 pairs of boxes that overlap; with a memory budget, and by
    /// `Cells`, it answers all frames. The CPU also takes over if the GPU fails or cannot hold the
    /// scene.
    #[default]
    Auto,
    /// The CPU, with one thread per core or as many as [`Settings::threads`] says.
    Cpu,
    /// A GPU; an error if there is none.
    Gpu,
}

words!("backend", "auto, cpu or gpu", Backend: [Auto = "auto", Cpu = "cpu", Gpu = "gpu"; 3]);

/// Whether a body is clustered again after it has flowed far from the pose in which it was
/// clustered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum Recluster {
    /// Yes, when the summed surface of its cluster boxes has grown so much that it pays. A GPU
    /// judges by a sample of the boxes, and only bodies whose positions are in the scene, not in a
    /// buffer of the caller's.
    #[default]
    Auto,
    /// Never: no frame pays for clustering again, but boxes may grow and frames get slower.
    Never,
}

words!("recluster", "auto or never", Recluster: [Auto = "auto", Never = "never"; 2]);

/// The widest vector instructions that the CPU backend may use, if the processor has them.
/// The pairs do not depend on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
#[non_exhaustive]
pub enum InstructionSet {
    /// Plain loops, vectorised by the compiler for the target's baseline.
    Portable,
    /// 256 bits on x86-64.
    Avx2,
    /// 512 bits on x86-64, where the processor has AVX-512 with its extensions VL, DQ, BW and VBMI2
    /// (Ice Lake, Zen 4 and later); else 256.
    #[default]
    Avx512,
}

words!("instruction_set", "portable, avx2 or avx512", InstructionSet: [Portable = "portable", Avx2 = "avx2", Avx512 = "avx512"; 3]);

/// The settings of a detector: [`Settings::new`] and what differs from it, one call each.
///
/// ```
/// use impinge::{Backend, Detector, Settings};
/// # fn main() -> Result<(), impinge::Error> {
/// let settings = Settings::new().backend(Backend::Cpu).threads(2);
/// let mut detector = Detector::new(settings)?;
/// # Ok(()) }
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[must_use]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct Settings {
    /// How candidates are found.
    pub method: Method,
    /// Where the work is done.
    pub backend: Backend,
    /// CPU threads; 0 means one per core.
    pub threads: usize,
    /// Which cores the helper threads may run on.
    pub affinity: Affinity,
    /// The widest vector instructions that the CPU backend may use.
    pub instruction_set: InstructionSet,
    /// `Cells`: the density coefficient λ of the paper's equation (1), above 0.
    pub density: f64,
    /// `Cells`: the most elements a group may hold, 1 to 64.
    #[doc(hidden)]
    pub group_size: u32,
    /// Bytes the detector may hold, the answer included; `None` for as many as it takes. While an
    /// answer is found that is larger than the one before, it takes up to twice its size. On a GPU:
    /// bytes of buffers on the device, and as many again for the answer on the host.
    pub memory_budget: Option<u64>,
    /// The most pairs that an answer may have: with more, detection ends with
    /// [`Error::TooManyPairs`](crate::Error::TooManyPairs) as soon as that is certain. `None` for
    /// any number.
    pub max_pairs: Option<u64>,
    /// `Clusters`: whether bodies are clustered again.
    pub recluster: Recluster,
    /// A distance in the unit of the scene, for solvers that ask again and again while little
    /// moves. If it is above 0, [`near`](crate::Detector::near),
    /// [`neighbours`](crate::Detector::neighbours) and
    /// [`safe_distances`](crate::Detector::safe_distances) list the pairs within their distance and
    /// this margin, and look at no others until some vertex has moved farther than half of it from
    /// where it was then, or anything but positions has changed. The answers are the same. With a
    /// memory budget nothing is listed.
    ///
    /// To make a list takes up to twice as long as to answer without one, and a question that it
    /// serves half to nine tenths of that: it pays from the third or so. After a list that served
    /// none, the next is made when vertices have moved at most half of the margin between two
    /// questions. With a larger margin it holds longer and has more pairs; an eighth of the
    /// distance is a good start.
    pub reuse_margin: f64,
    /// GPU: part of an adapter's name, to choose among several.
    pub device: Option<String>,
    /// GPU: the caller's device.
    #[cfg(feature = "gpu")]
    #[cfg_attr(feature = "serde", serde(skip))]
    pub(crate) on_device: Option<(wgpu::Device, wgpu::Queue)>,
    /// Not for users: the thresholds of the CPU backend.
    #[doc(hidden)]
    #[cfg_attr(feature = "serde", serde(skip))]
    pub tuning: Tuning,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            method: Method::default(),
            backend: Backend::default(),
            threads: 0,
            affinity: Affinity::default(),
            instruction_set: InstructionSet::default(),
            density: 1.0,
            group_size: 64,
            memory_budget: None,
            max_pairs: None,
            recluster: Recluster::default(),
            reuse_margin: 0.0,
            device: None,
            #[cfg(feature = "gpu")]
            on_device: None,
            tuning: Tuning::default(),
        }
    }
}

impl Settings {
    /// The default settings.
    pub fn new() -> Self {
        Settings::default()
    }

    /// How candidates are found.
    pub fn method(mut self, method: Method) -> Self {
        self.method = method;
        self
    }

    /// Where the work is done.
    pub fn backend(mut self, backend: Backend) -> Self {
        self.backend = backend;
        self
    }

    /// CPU threads; 0 means one per core.
    pub fn threads(mut self, threads: usize) -> Self {
        self.threads = threads;
        self
    }

    /// Which cores the helper threads may run on.
    pub fn affinity(mut self, affinity: Affinity) -> Self {
        self.affinity = affinity;
        self
    }

    /// The widest vector instructions that the CPU backend may use.
    pub fn instruction_set(mut self, instruction_set: InstructionSet) -> Self {
        self.instruction_set = instruction_set;
        self
    }

    /// `Cells`: the density coefficient of the grid, above 0.
    pub fn density(mut self, density: f64) -> Self {
        self.density = density;
        self
    }

    /// Not for users.
    #[doc(hidden)]
    pub fn group_size(mut self, group_size: u32) -> Self {
        self.group_size = group_size;
        self
    }

    /// Bytes the detector may hold, the answer included; `None` for as many as it takes.
    pub fn memory_budget(mut self, memory_budget: impl Into<Option<u64>>) -> Self {
        self.memory_budget = memory_budget.into();
        self
    }

    /// The most pairs that an answer may have; `None` for any number.
    pub fn max_pairs(mut self, max_pairs: impl Into<Option<u64>>) -> Self {
        self.max_pairs = max_pairs.into();
        self
    }

    /// `Clusters`: whether bodies are clustered again.
    pub fn recluster(mut self, recluster: Recluster) -> Self {
        self.recluster = recluster;
        self
    }

    /// The margin with which near pairs are listed, in the unit of the scene; 0 for no lists.
    pub fn reuse_margin(mut self, reuse_margin: f64) -> Self {
        self.reuse_margin = reuse_margin;
        self
    }

    /// GPU: part of an adapter's name, to choose among several.
    pub fn device(mut self, device: impl Into<Option<String>>) -> Self {
        self.device = device.into();
        self
    }

    /// Work on the caller's device, which must allow 8 storage buffers per stage and workgroups of
    /// 256 (WebGPU's defaults do).
    ///
    /// Such a detector answers like any other, and also through
    /// [`gpu`](crate::Detector::gpu), where positions and pairs stay on the device. To make it
    /// waits for nothing, so that works in a browser too. Kernels are compiled when the first frame
    /// needs them.
    #[cfg(feature = "gpu")]
    pub fn on_device(mut self, device: wgpu::Device, queue: wgpu::Queue) -> Self {
        self.backend = Backend::Gpu;
        self.device = None;
        self.on_device = Some((device, queue));
        self
    }

    /// Not for users.
    #[doc(hidden)]
    pub fn tuning(mut self, tuning: Tuning) -> Self {
        self.tuning = tuning;
        self
    }

    /// Limits on the size of an answer.
    pub(crate) fn limits(&self) -> Limits {
        Limits {
            max_pairs: self.max_pairs,
            memory_budget: self.memory_budget,
            besides: 0,
        }
    }

    /// Refuses settings that are out of range.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let refuse = |setting, given: String, allowed| {
            Err(Error::Setting {
                setting,
                given,
                allowed,
            })
        };
        if !(self.density.is_finite() && self.density > 0.0) {
            return refuse("density", shown(self.density), "a number above 0");
        }
        if !(self.reuse_margin.is_finite() && self.reuse_margin >= 0.0) {
            let given = shown(self.reuse_margin);
            return refuse("reuse_margin", given, "a number that is not below 0");
        }
        if !(1..=64).contains(&self.group_size) {
            return refuse("group size", self.group_size.to_string(), "1 to 64");
        }
        if self.backend == Backend::Gpu {
            if !cfg!(feature = "gpu") {
                return Err(Error::NoAdapter {
                    found: "impinge was built without its feature `gpu`".to_owned(),
                });
            }
            if self.method == Method::Naive {
                let given = self.method.name().to_owned();
                return refuse("method on a GPU", given, "auto, clusters or cells");
            }
        }
        if self.threads > 1024 {
            return refuse("threads", self.threads.to_string(), "0 to 1024");
        }
        Ok(())
    }
}

impl From<Backend> for Settings {
    /// A backend, and everything else by default.
    fn from(backend: Backend) -> Self {
        Settings {
            backend,
            ..Settings::default()
        }
    }
}
