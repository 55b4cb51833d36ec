//! What a frame, or a step, sees of the world on the device: which parts take part, their records,
//! the tree over them.

use crate::scene::error::Error;

use super::buffers::Storage;
use super::layout::{Body, Level, NodePair};
use super::open::GpuContext;
use super::top_level::{Top, Trees};

/// By how many keys the boxes of rounded positions are widened: see `boxes.wgsl`.
pub(super) const SLACK: u32 = 2;
/// Marks a part that does not take part.
const NO_PART: u32 = u32::MAX;

/// What is asked of the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Motion {
    /// A frame, in which nothing moves.
    Still,
    /// A step, with boxes and positions at both ends.
    Moving,
}

impl Motion {
    /// How many boxes each node has, and how many positions each vertex.
    pub fn n_ends(self) -> u64 {
        match self {
            Motion::Still => 1,
            Motion::Moving => 2,
        }
    }

    pub(super) fn other(self) -> Motion {
        match self {
            Motion::Still => Motion::Moving,
            Motion::Moving => Motion::Still,
        }
    }
}

/// What a pass asks of candidates, and by how much their boxes are widened for it: the bits of an
/// f32.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Asks {
    pub(super) test: StepTest,
    pub(super) reach: u32,
}

/// What is asked of candidates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum StepTest {
    /// Whether they touch.
    #[default]
    Touch,
    /// Whether they keep their distance during a step.
    Keep,
    /// How far vertices may move.
    Safe,
}

/// What a frame, or a step, sees of the world.
#[derive(Debug)]
pub struct View {
    /// By query_part: its part.
    pub(super) parts: Vec<u32>,
    /// By part: its query_part.
    pub(super) query_parts: Vec<u32>,
    pub(super) top: Option<Top>,
    /// The nodes of each height, first those of the trees, then those of the tree over them.
    pub levels: Vec<Level>,
    /// Whether boxes have to be refitted.
    pub is_moved: bool,
    bodies_sent: Vec<Body>,
    ignored_sent: Vec<NodePair>,
    /// The records of all parts: those that take part, and marks for the others.
    pub bodies: Storage<Body>,
    /// The sorted list of pairs that are left out.
    pub ignored: Storage<NodePair>,
    /// The levels as kernels read them.
    pub table: Storage<Level>,
}

impl Default for View {
    fn default() -> Self {
        View {
            parts: Vec::new(),
            query_parts: Vec::new(),
            top: None,
            levels: Vec::new(),
            is_moved: true,
            bodies_sent: Vec::new(),
            ignored_sent: Vec::new(),
            bodies: Storage::plain("bodies"),
            ignored: Storage::plain("ignored"),
            table: Storage::plain("levels"),
        }
    }
}

impl View {
    /// A view of some of `n_parts` parts, with a tree over them if there are more than a few.
    pub(super) fn new(
        gpu: &GpuContext,
        trees: &mut Trees,
        parts: Vec<u32>,
        n_parts: usize,
        sample: impl Fn(u32) -> [f32; 3],
    ) -> Result<Self, Error> {
        let mut query_parts = vec![NO_PART; n_parts];
        for (query_part, &part) in (0..).zip(&parts) {
            query_parts[part as usize] = query_part;
        }
        let top = trees.push_top(&parts, sample);
        let mut levels = trees.levels(Some(&parts));
        levels.extend(top.iter().flat_map(|top| &top.levels));
        let mut view = View {
            parts,
            query_parts,
            top,
            levels,
            ..View::default()
        };
        view.table.upload(gpu, &view.levels)?;
        Ok(view)
    }

    pub(super) fn bytes(&self) -> u64 {
        self.bodies.bytes() + self.ignored.bytes() + self.table.bytes()
    }

    /// The root of the tree over parts.
    pub fn top(&self) -> Option<u32> {
        self.top.as_ref().map(|top| top.root)
    }

    /// The length of the list of ignored pairs.
    pub fn n_ignored(&self) -> u32 {
        self.ignored_sent.len() as u32
    }

    /// Sends records and ignored pairs that differ from those on the device.
    pub(super) fn send(
        &mut self,
        gpu: &GpuContext,
        bodies: Vec<Body>,
        ignored: Vec<NodePair>,
    ) -> Result<(), Error> {
        if bodies != self.bodies_sent || self.bodies.bytes() == 0 {
            self.bodies.upload(gpu, &bodies)?;
            self.bodies_sent = bodies;
        }
        if ignored != self.ignored_sent || self.ignored.bytes() == 0 {
            self.ignored.upload(gpu, &ignored)?;
            self.ignored_sent = ignored;
        }
        Ok(())
    }
}
