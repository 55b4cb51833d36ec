//! What a detector may be told.

use crate::error::Error;

/// How candidates are found. All methods give the same pairs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Method {
    /// Groups fixed by topology; each frame only their boxes move. The fast one.
    #[default]
    Clusters,
    /// The two-level grid of the paper: groups are what a cell holds, made anew each frame.
    Cells,
    /// Every box against every box: the oracle, quadratic in primitives.
    Naive,
}

impl Method {
    /// `"clusters"`, `"cells"` or `"naive"`.
    pub fn name(self) -> &'static str {
        match self {
            Method::Clusters => "clusters",
            Method::Cells => "cells",
            Method::Naive => "naive",
        }
    }
}

/// Where the work is done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Backend {
    /// A GPU where there is one in hardware, else the CPU; also when the GPU fails or the scene is
    /// more than it can hold.
    #[default]
    Auto,
    /// All cores, or as many threads as told.
    Cpu,
    /// A GPU; an error where there is none.
    Gpu,
}

/// Whether a body that has flowed far from the pose in which it was clustered is clustered anew.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Recluster {
    /// When the summed surface of its cluster boxes has grown enough for it to pay. A GPU judges by a sample of
    /// them, and only bodies whose positions are in the scene, not in a buffer of the caller's.
    #[default]
    Auto,
    /// Never: no frame ever pays for it. Boxes may grow and frames get slower.
    Never,
}

/// The widest vector instructions that the CPU backend may use, where the processor has them.
/// The pairs do not depend on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub enum InstructionSet {
    /// Plain loops, vectorised by the compiler for the target's baseline.
    Portable,
    /// 256 bits on x86-64.
    Avx2,
    /// 512 bits on x86-64, where the processor has AVX-512 with its extensions VL, DQ, BW and VBMI2 (Ice Lake, Zen 4
    /// and later); else 256.
    #[default]
    Avx512,
}

/// What a detector may be told.
#[derive(Debug, Clone)]
pub struct Settings {
    /// How candidates are found.
    pub method: Method,
    /// Where.
    pub backend: Backend,
    /// CPU threads; 0 means one a core.
    pub threads: usize,
    /// The widest vector instructions that the CPU backend may use.
    pub instruction_set: InstructionSet,
    /// `Cells`: the density coefficient λ of the paper's equation (1), above 0.
    pub lambda: f64,
    /// `Cells`: the most primitives a group may hold, 1 to 64.
    pub group_size: u32,
    /// Bytes the detector may hold besides the answer; `None` for as many as it takes.
    pub memory_budget: Option<u64>,
    /// `Clusters`: whether bodies are clustered again.
    pub recluster: Recluster,
    /// GPU: part of an adapter's name, to choose among several.
    pub device: Option<String>,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            method: Method::default(),
            backend: Backend::default(),
            threads: 0,
            instruction_set: InstructionSet::default(),
            lambda: 1.0,
            group_size: 64,
            memory_budget: None,
            recluster: Recluster::default(),
            device: None,
        }
    }
}

impl Settings {
    /// Whether everything is in its range.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let refuse = |setting, given: String, allowed| {
            Err(Error::Setting {
                setting,
                given,
                allowed,
            })
        };
        if !(self.lambda.is_finite() && self.lambda > 0.0) {
            return refuse("lambda", self.lambda.to_string(), "a number above 0");
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
                return refuse("method on a GPU", given, "clusters or cells");
            }
        }
        if self.threads > 1024 {
            return refuse("threads", self.threads.to_string(), "0 to 1024");
        }
        Ok(())
    }
}
