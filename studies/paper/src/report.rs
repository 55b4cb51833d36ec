//! All measurements as one tree of plain data: the content of `report.json`.

use serde::Serialize;

use crate::machine::{Adapter, Machine};
use crate::options::Waving;
use crate::samples::Samples;

/// The results of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// The library's version.
    pub version: String,
    /// Whether it was the quick run, whose times are not meaningful.
    pub is_quick: bool,
    /// Whether the program was built with debug assertions.
    pub has_debug_assertions: bool,
    /// The machine.
    pub machine: Machine,
    /// The GPU that took part.
    pub adapter: Option<Adapter>,
    /// Reasons why the report has no GPU or no pictures.
    pub remarks: Vec<String>,
    /// How bodies wave.
    pub waving: Waving,
    /// Table 1, figures 4 and 5: one entry per scene.
    pub surfaces: Vec<Scene>,
    /// Table 2, figure 6: one entry per scene.
    pub volumes: Vec<Scene>,
    /// Table 3: two rows per scene, for two ways to read the paper.
    pub duplicates: Vec<Duplicates>,
    /// Figure 7: missing rates of one scene.
    pub table_sizes: Option<TableSizes>,
}

/// One scene, all contestants.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scene {
    /// The name on the command line.
    pub name: String,
    /// The origin of the mesh; it says if the mesh is a stand-in.
    pub mesh: String,
    /// Whether a generated mesh stands in for a scan.
    pub is_stand_in: bool,
    /// How the bodies move.
    pub motion: String,
    /// `"triangle"` or `"tetrahedron"`.
    pub kind: String,
    /// Elements of each body.
    pub n_elements: Vec<usize>,
    /// Frames, or steps, that were run.
    pub n_frames: usize,
    /// Pairs per frame.
    pub n_pairs: Samples,
    /// Elements of both bodies that take part in a pair, per frame.
    pub n_colliding: Samples,
    /// The sum of the frames' hashes: 16 hexadecimal digits.
    pub hash: String,
    /// Frames in which the oracle (every box against every box) ran too.
    pub n_frames_of_oracle: usize,
    /// The contestants; the others are compared with the first one.
    pub runs: Vec<Run>,
    /// Time against λ on a few frames, for methods with a λ.
    pub sweep: Vec<Sweep>,
    /// A picture of the frame with the most pairs: a file in the report's folder.
    pub picture: Option<String>,
    /// The time of the simulation in milliseconds per step, without detection.
    pub simulation_ms: Option<Samples>,
    /// The counts of each frame, in order.
    pub course: Vec<Moment>,
}

/// The counts of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Moment {
    /// Its number, from 0. A software driver runs only some frames.
    pub frame: usize,
    /// Pairs.
    pub n_pairs: usize,
    /// Colliding elements of both bodies.
    pub n_colliding: usize,
}

/// A method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// The paper's two levels with our owner rule.
    Cells,
    /// Our method.
    Clusters,
    /// The method that the paper compares itself with.
    Fwzs11,
}

/// One contestant's frames.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Run {
    /// The method.
    pub method: Method,
    /// `"cpu"` or the adapter's name.
    pub backend: String,
    /// Whether it ran on a GPU or a software driver.
    pub is_gpu: bool,
    /// Whether the GPU is a software driver on the CPU.
    pub is_software: bool,
    /// The density coefficient of the grid.
    pub lambda: Option<f64>,
    /// Whether λ is the one that the paper used.
    pub is_papers_lambda: bool,
    /// Whether λ was the fastest in the sweep, or was given.
    pub is_chosen_lambda: bool,
    /// Wall time per frame, from positions in memory to sorted pairs in memory.
    pub ms: Samples,
    /// Wall time per frame of each stage, in the order in which they run.
    pub stages: Vec<StageTimes>,
    /// Cells of the first level.
    pub n_cells: Samples,
    /// Cells that went through the second level.
    pub n_subdivided: Samples,
    /// Entries of the cell lists; an element is counted once per cell.
    pub n_entries: Samples,
    /// Pairs of elements that are tested exactly, including repetitions.
    pub n_candidates: Samples,
    /// Candidates that the floating-point filter left to exact arithmetic.
    pub n_unsure: Samples,
    /// Bytes held without the answer, the maximum over frames.
    pub bytes_held: u64,
    /// The sum of the frames' hashes, 16 hexadecimal digits; equal to the scene's if all frames
    /// were run.
    pub hash: String,
    /// Frames whose pairs differ from the first contestant's: a defect.
    pub n_frames_differing: usize,
}

/// A stage's times.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StageTimes {
    /// Its name.
    pub name: String,
    /// Milliseconds per frame.
    pub ms: Samples,
}

/// Time against λ.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Sweep {
    /// The method.
    pub method: Method,
    /// `"cpu"` or the adapter's name.
    pub backend: String,
    /// Pairs of λ and milliseconds.
    pub points: Vec<(f64, f64)>,
}

/// A scene's row of table 3: means over frames.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Duplicates {
    /// The scene.
    pub scene: String,
    /// Which pairs of a cell are tested: all that touch a common sub-cell, as in the paper (false),
    /// or only those of them whose boxes overlap (true).
    pub has_box_test: bool,
    /// The number of measured frames.
    pub n_frames: usize,
    /// Slots of the hash table.
    pub table_size: u64,
    /// Different pairs that are tested, per frame.
    pub n_candidates: f64,
    /// Of those, the share tested more than once without a hash table.
    pub share_repeated: f64,
    /// How often a candidate is tested, on average.
    pub times_checked: f64,
    /// Milliseconds per frame if every cell tests its pairs.
    pub ms_without: Samples,
    /// Milliseconds per frame with the DJB2 table.
    pub ms_with: Samples,
    /// Milliseconds per frame with the owner rule.
    pub ms_owner: Samples,
    /// Colliding elements per frame if every cell tests its pairs.
    pub n_colliding_without: f64,
    /// Colliding elements per frame with the table.
    pub n_colliding_with: f64,
    /// Colliding elements per frame with the owner rule.
    pub n_colliding_owner: f64,
    /// Share of the colliding elements that the table loses.
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
    /// The number of measured frames.
    pub n_frames: usize,
    /// Elements of both bodies: the paper's size of the table.
    pub n_elements: u64,
    /// Sizes with their losses.
    pub points: Vec<TableSize>,
}

/// One size of the hash table.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TableSize {
    /// Slots.
    pub table_size: u64,
    /// Share of the colliding elements that is lost.
    pub missing_rate: f64,
    /// Share of the pairs that is lost.
    pub missing_rate_of_pairs: f64,
    /// Share of the colliding elements that is lost if boxes are tested before the table.
    pub missing_rate_with_box_test: f64,
}

impl Report {
    /// The number of answers that differ: frames in which a contestant found other pairs than the
    /// first one, and failed checks of table 3.
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
    /// The run of a method on the CPU or a GPU; of two runs with different λ, the one with the
    /// paper's.
    pub fn run(&self, method: Method, is_gpu: bool) -> Option<&Run> {
        let mut runs = self.runs_of(method, is_gpu);
        let first = runs.next()?;
        Some(match first.is_papers_lambda {
            true => first,
            false => runs.find(|run| run.is_papers_lambda).unwrap_or(first),
        })
    }

    /// The fastest run of a method, if it also ran with a chosen λ; `None` if only the paper's λ
    /// was run.
    pub fn best(&self, method: Method, is_gpu: bool) -> Option<&Run> {
        self.runs_of(method, is_gpu)
            .find(|run| run.is_chosen_lambda)?;
        self.runs_of(method, is_gpu)
            .min_by(|a, b| a.ms.median.total_cmp(&b.ms.median))
    }

    /// The fastest run of a method, with any λ.
    pub fn fastest(&self, method: Method, is_gpu: bool) -> Option<&Run> {
        self.runs_of(method, is_gpu)
            .min_by(|a, b| a.ms.median.total_cmp(&b.ms.median))
    }

    /// Time against λ for a method on the CPU or a GPU.
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
