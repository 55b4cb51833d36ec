//! The library's enumerations as values of options.

use clap::ValueEnum;

/// [`impinge::Method`] as an option.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum MethodArg {
    /// The grid for large meshes that are asked about for the first time, clusters as soon as they
    /// come back
    Auto,
    /// Groups fixed by topology; the fastest method for meshes that move
    Clusters,
    /// The two-level grid
    Cells,
    /// Every box against every box; slow, the reference for the other methods
    Naive,
}

impl From<MethodArg> for impinge::Method {
    fn from(method: MethodArg) -> Self {
        match method {
            MethodArg::Auto => impinge::Method::Auto,
            MethodArg::Clusters => impinge::Method::Clusters,
            MethodArg::Cells => impinge::Method::Cells,
            MethodArg::Naive => impinge::Method::Naive,
        }
    }
}

/// [`impinge::Backend`] as an option.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum BackendArg {
    /// A GPU if there is one, else the CPU
    Auto,
    /// The CPU
    Cpu,
    /// A GPU, or an error if there is none
    Gpu,
}

impl From<BackendArg> for impinge::Backend {
    fn from(backend: BackendArg) -> Self {
        match backend {
            BackendArg::Auto => impinge::Backend::Auto,
            BackendArg::Cpu => impinge::Backend::Cpu,
            BackendArg::Gpu => impinge::Backend::Gpu,
        }
    }
}

/// [`impinge::SharedVertex`] as an option.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum SharedVertexArg {
    /// None
    Skip,
    /// Those that also meet outside their common vertices, edge or face
    Resolve,
}

impl From<SharedVertexArg> for impinge::SharedVertex {
    fn from(rule: SharedVertexArg) -> Self {
        match rule {
            SharedVertexArg::Skip => impinge::SharedVertex::Skip,
            SharedVertexArg::Resolve => impinge::SharedVertex::Resolve,
        }
    }
}

/// [`impinge::Precision`] as an option.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum PrecisionArg {
    /// Single precision
    F32,
    /// Double precision
    F64,
}

impl From<PrecisionArg> for impinge::Precision {
    fn from(precision: PrecisionArg) -> Self {
        match precision {
            PrecisionArg::F32 => impinge::Precision::F32,
            PrecisionArg::F64 => impinge::Precision::F64,
        }
    }
}

/// [`impinge::Start`] as an option.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum StartArg {
    /// Reported with the time 0, and the start is asked for intersections
    Verify,
    /// Reported with the time 0
    Report,
    /// Ignored, whatever they do later in the step
    Skip,
}

impl From<StartArg> for impinge::Start {
    fn from(start: StartArg) -> Self {
        match start {
            StartArg::Verify => impinge::Start::Verify,
            StartArg::Report => impinge::Start::Report,
            StartArg::Skip => impinge::Start::Skip,
        }
    }
}

/// What becomes a body of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum BodiesArg {
    /// Each node of a glTF file that has a mesh, each item of a 3MF file; other files are one body
    /// each
    Nodes,
    /// Each object (o) of an OBJ file, or each group (g) of one without objects; other files are
    /// one body each
    Groups,
    /// Each file
    File,
}

impl BodiesArg {
    /// The error where no file has such parts.
    pub fn misfit(self) -> String {
        match self {
            BodiesArg::Nodes => "--bodies nodes: only glTF and 3MF files have nodes",
            BodiesArg::Groups => "--bodies groups: only OBJ files have groups",
            BodiesArg::File => "--bodies file: every file is a body",
        }
        .to_owned()
    }
}
