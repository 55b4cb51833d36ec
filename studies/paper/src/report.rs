//! What was measured, as one tree of plain data: `report.json` is this and nothing else.

use serde::Serialize;

use crate::machine::{Adapter, Machine};
use crate::options::Waving;
use crate::samples::Samples;

/// Everything that a run found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// The library's version.
    pub version: String,
    /// Whether it was the quick run, whose times are not worth keeping.
    pub is_quick: bool,
    /// Whether the program was built without optimisation of its own crates.
    pub has_debug_assertions: bool,
    /// The CPU and what is on it.
    pub machine: Machine,
    /// The GPU that took part.
    pub adapter: Option<Adapter>,
    /// Why there is no GPU in the report, or no picture.
    pub remarks: Vec<String>,
    /// How bodies wave.
    pub waving: Waving,
    /// Table 1, figures 4 and 5: a scene each.
    pub surfaces: Vec<Scene>,
    /// Table 2, figure 6: a scene each.
    pub volumes: Vec<Scene>,
    /// Table 3: two rows a scene, for two ways to read the paper.
    pub duplicates: Vec<Duplicates>,
    /// Figure 7: missing rates of one scene.
    pub table_sizes: Option<TableSizes>,
}

/// One scene, all contestants.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scene {
    /// As on the command line.
    pub name: String,
    /// Where the mesh comes from; a stand-in says that it is one.
    pub mesh: String,
    /// Whether a generated mesh stands in for a scan.
    pub is_stand_in: bool,
    /// How the bodies move.
    pub motion: String,
    /// `"triangle"` or `"tetrahedron"`.
    pub kind: String,
    /// Primitives of each body.
    pub n_primitives: Vec<usize>,
    /// Frames, or steps, that were run.
    pub n_frames: usize,
    /// Pairs found a frame.
    pub n_pairs: Samples,
    /// Primitives of either body that take part in a pair, a frame.
    pub n_colliding: Samples,
    /// The sum of the frames' hashes: 16 hexadecimal digits.
    pub hash: String,
    /// Frames in which the oracle (every box against every box) was asked too.
    pub n_frames_of_oracle: usize,
    /// The contestants; the first one is that which others are compared with.
    pub runs: Vec<Run>,
    /// Time against λ on a few frames, of the methods that have one.
    pub sweep: Vec<Sweep>,
    /// A picture of the frame with the most pairs: a file in the report's folder.
    pub picture: Option<String>,
    /// The finite elements' share, in milliseconds a step, besides detection.
    pub simulation_ms: Option<Samples>,
    /// What each frame found, in order.
    pub course: Vec<Moment>,
}

/// What a frame found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Moment {
    /// Its number, from 0. A driver that imitates a GPU takes only some frames.
    pub frame: usize,
    /// Pairs.
    pub n_pairs: usize,
    /// Colliding primitives of both bodies.
    pub n_colliding: usize,
}

/// A method, for who reads the report by program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// The paper's two levels, with our owner rule.
    Cells,
    /// Ours.
    Clusters,
    /// The peer of the paper.
    Fwzs11,
}

/// One contestant's frames.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Run {
    /// The method.
    pub method: Method,
    /// `"cpu"` or the adapter's name.
    pub backend: String,
    /// Whether it ran on a GPU, imitated ones included.
    pub is_gpu: bool,
    /// Whether the GPU is a program on the CPU.
    pub is_software: bool,
    /// Density coefficient of the grid.
    pub lambda: Option<f64>,
    /// Whether λ is the one that the paper used.
    pub is_papers_lambda: bool,
    /// Whether λ measured best in the sweep, or was asked for.
    pub is_chosen_lambda: bool,
    /// Wall time a frame, from positions in memory to sorted pairs in memory.
    pub ms: Samples,
    /// Wall time a frame of each stage, in the order in which they run.
    pub stages: Vec<StageTimes>,
    /// Cells of the first level.
    pub n_cells: Samples,
    /// Cells that went through the second level.
    pub n_subdivided: Samples,
    /// Entries of the cell lists, a primitive counted once a cell.
    pub n_entries: Samples,
    /// Pairs of primitives that are tested exactly, repetitions counted.
    pub n_candidates: Samples,
    /// Candidates that the floating-point filter left to exact arithmetic.
    pub n_unsure: Samples,
    /// Bytes held besides the answer, the most of any frame.
    pub bytes_held: u64,
    /// The sum of the frames' hashes, 16 hexadecimal digits; as the scene's where all frames were run.
    pub hash: String,
    /// Frames whose pairs differ from the first contestant's: a defect.
    pub n_frames_differing: usize,
}

/// A stage's times.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StageTimes {
    /// Its name.
    pub name: String,
    /// Milliseconds a frame.
    pub ms: Samples,
}

/// Time against λ.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Sweep {
    /// The method.
    pub method: Method,
    /// `"cpu"` or the adapter's name.
    pub backend: String,
    /// λ and the milliseconds with it.
    pub points: Vec<(f64, f64)>,
}

/// A scene's row of table 3: means over frames.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Duplicates {
    /// The scene.
    pub scene: String,
    /// Which pairs of a cell are tested: of those that touch a common sub-cell all, as the paper has it, or
    /// the ones whose boxes overlap.
    pub has_box_test: bool,
    /// Frames looked at.
    pub n_frames: usize,
    /// Slots of the hash table.
    pub table_size: u64,
    /// Pairs that are tested at all, a frame.
    pub n_candidates: f64,
    /// Of those, the share tested more than once without a hash table.
    pub share_repeated: f64,
    /// How often a candidate is tested, on average.
    pub times_checked: f64,
    /// Milliseconds a frame where every test is made.
    pub ms_without: Samples,
    /// Milliseconds a frame with the DJB2 table.
    pub ms_with: Samples,
    /// Milliseconds a frame with the owner rule.
    pub ms_owner: Samples,
    /// Colliding primitives a frame, all tests made.
    pub n_colliding_without: f64,
    /// Colliding primitives a frame with the table.
    pub n_colliding_with: f64,
    /// Colliding primitives a frame with the owner rule.
    pub n_colliding_owner: f64,
    /// Share of the colliding primitives that the table loses.
    pub missing_rate: f64,
    /// Share of the pairs that the table loses.
    pub missing_rate_of_pairs: f64,
    /// Whether in every frame all pairs of the table are pairs of the exact answer.
    pub is_subset: bool,
    /// Whether in every frame tests without a table and the owner rule gave the exact answer.
    pub is_equal_without: bool,
}

/// Missing rates against the size of the hash table.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TableSizes {
    /// The scene.
    pub scene: String,
    /// Frames looked at.
    pub n_frames: usize,
    /// Primitives of both bodies: the paper's size.
    pub n_primitives: u64,
    /// A size and what is lost with it.
    pub points: Vec<TableSize>,
}

/// One size of the hash table.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TableSize {
    /// Slots.
    pub table_size: u64,
    /// Share of the colliding primitives that is lost.
    pub missing_rate: f64,
    /// Share of the pairs that is lost.
    pub missing_rate_of_pairs: f64,
    /// Share of the colliding primitives that is lost where boxes are tested before the table.
    pub missing_rate_with_box_test: f64,
}

impl Report {
    /// Frames in which a contestant gave other pairs than the first one, and subsets that are none.
    pub fn n_disagreements(&self) -> usize {
        let differing =
            |scene: &Scene| -> usize { scene.runs.iter().map(|run| run.n_frames_differing).sum() };
        let scenes = self.surfaces.iter().chain(&self.volumes);
        let rows = self.duplicates.iter();
        scenes.map(differing).sum::<usize>()
            + rows
                .filter(|row| !(row.is_subset && row.is_equal_without))
                .count()
    }
}

impl Scene {
    /// The run of a method on the CPU or a GPU; of two that differ in λ, the paper's.
    pub fn run(&self, method: Method, is_gpu: bool) -> Option<&Run> {
        let mut runs = self.runs_of(method, is_gpu);
        let first = runs.next()?;
        Some(match first.is_papers_lambda {
            true => first,
            false => runs.find(|run| run.is_papers_lambda).unwrap_or(first),
        })
    }

    /// The fastest run of a method whose λ was looked for; `None` where only the paper's was run.
    pub fn best(&self, method: Method, is_gpu: bool) -> Option<&Run> {
        self.runs_of(method, is_gpu)
            .find(|run| run.is_chosen_lambda)?;
        self.runs_of(method, is_gpu)
            .min_by(|a, b| a.ms.median.total_cmp(&b.ms.median))
    }

    /// λ was looked for or not: the fastest run of a method.
    pub fn fastest(&self, method: Method, is_gpu: bool) -> Option<&Run> {
        self.runs_of(method, is_gpu)
            .min_by(|a, b| a.ms.median.total_cmp(&b.ms.median))
    }

    /// Time against λ of a method on the CPU or a GPU.
    pub fn sweep(&self, method: Method, is_gpu: bool) -> Option<&Sweep> {
        self.sweep
            .iter()
            .find(|sweep| sweep.method == method && (sweep.backend != "cpu") == is_gpu)
    }

    fn runs_of(&self, method: Method, is_gpu: bool) -> impl Iterator<Item = &Run> {
        self.runs
            .iter()
            .filter(move |run| run.method == method && run.is_gpu == is_gpu)
    }
}
