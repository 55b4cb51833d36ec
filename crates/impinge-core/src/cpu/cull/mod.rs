//! A coarse map of where bodies are, used to drop elements that no other body comes near.
//!
//! ```text
//! quantise   each vertex once: the cell of the map that it lies in, one byte per axis
//! mark       each element: the range of its vertices' cells, in the map of its body; a row of
//!            cells along x is a number of 64 bits
//! compare    cells that two bodies mark
//! look up    each element again: whether its range has such a cell
//! ```
//!
//! In: positions and where each body may meet others. Out: whether an element may have a partner.
//! Cost: four bytes per vertex, twelve per element near other bodies. Invariant: the function
//! from coordinates to cells is monotone under any rounding, so a point of two elements lies in a
//! cell that both mark.

mod codes;

use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use crate::bvh::bounds::Aabb;
use crate::bvh::grid::Grid;
use crate::scene::elements::with_corners;
use crate::scene::index::{ElementIx, PartIx};
use crate::workers::tuning::Tuning;

use super::world::World;
use codes::{Codes, Function, greater_bytes, lesser_bytes};

/// The most cells along each axis. Two more hold vertices outside the region. A row along x then
/// has 64 cells; along y and z a byte numbers the cells.
const MOST_ALONG: [u32; 3] = [62, 253, 253];
/// Elements that are examined together; then those among them that are near are marked.
const TOGETHER: usize = 512;

/// An element within its body's reach, and the first and last cell of its vertices along x, y, z,
/// one byte per axis.
#[derive(Debug, Clone, Copy)]
struct WithinReach {
    element: ElementIx,
    low: u32,
    high: u32,
}

impl WithinReach {
    /// How many rows of the map it touches.
    #[inline(always)]
    fn n_rows(&self) -> u32 {
        let ([_, y, z, _], [_, y_end, z_end, _]) =
            (self.low.to_le_bytes(), self.high.to_le_bytes());
        (u32::from(y_end - y) + 1) * (u32::from(z_end - z) + 1)
    }
}

/// A task of the bounds stage: a run of one part's elements, or of its vertices.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BoundsTask {
    pub part: PartIx,
    pub first: u32,
    pub end: u32,
}

impl BoundsTask {
    /// Cuts `n` elements or vertices of a part into runs.
    pub fn cut(part: PartIx, n: u32, length: u32) -> impl Iterator<Item = BoundsTask> {
        (0..n)
            .step_by(length as usize)
            .map(move |first| BoundsTask {
                part,
                first,
                end: n.min(first.saturating_add(length)),
            })
    }
}

/// The map and its memory.
#[derive(Default)]
pub(crate) struct Cull {
    /// From coordinates to cells.
    function: Function,
    /// The number of cells along each axis, including those outside the region.
    along: [u32; 3],
    /// The most rows of the map that one element marks; a larger element counts as being
    /// everywhere.
    most_marked: u32,
    /// The cell of each vertex, one byte per axis, body after body.
    codes: Vec<u32>,
    /// Where each part's codes start.
    firsts: Vec<usize>,
    /// The maps of all bodies, one after the other: rows along x, bit k for cell k.
    maps: Vec<AtomicU64>,
    /// Cells marked by two bodies, or by one body whose self-collision is queried.
    live: Vec<u64>,
    /// Maps of bodies with elements too large to be marked.
    everywhere: AtomicU32,
    /// Maps of bodies whose self-collision is queried.
    alone: u32,
    near: Vec<Mutex<Vec<WithinReach>>>,
}

impl Cull {
    /// The most maps, and so the most parts: there are sets of them.
    pub const MOST_MAPS: usize = u32::BITS as usize;

    /// Prepares for a frame of at most [`MOST_MAPS`](Self::MOST_MAPS) parts, which meet within the
    /// region; their elements come in `n_runs` runs.
    pub fn begin(&mut self, world: World<'_>, region: &Aabb, n_runs: usize, tuning: &Tuning) {
        self.most_marked = tuning.most_marked;
        let plan = world.plan;
        let wanted = plan.n_elements() / tuning.map_cell.max(1);
        let along = Grid::new(region, wanted, 1.0).resolution;
        let along: [u32; 3] = std::array::from_fn(|axis| along[axis].min(MOST_ALONG[axis]));
        self.along = along.map(|along| along + 2);
        self.function = Function {
            origin: region.min,
            scale: std::array::from_fn(|axis| {
                // Slightly less than all cells, so that the region's end still lies in the last
                // cell.
                let extent = region.max[axis] - region.min[axis];
                let scale = (along[axis] as f32 - 0.01) / extent;
                if scale.is_finite() && scale > 0.0 {
                    scale
                } else {
                    1.0
                }
            }),
            limit: along.map(|along| (along + 1) as f32),
        };
        self.firsts.clear();
        self.alone = 0;
        let mut n_codes = 0;
        for (ix, part) in plan.numbered_parts() {
            self.firsts.push(n_codes);
            n_codes += world.body(ix).positions.len();
            self.alone |= u32::from(part.within) << ix.raw();
        }
        self.codes.resize(n_codes, 0);
        *self.everywhere.get_mut() = 0;
        self.maps.clear();
        let n_maps = plan.parts.len();
        self.maps
            .resize_with(n_maps * self.n_rows(), AtomicU64::default);
        self.near
            .resize_with(n_runs.max(self.near.len()), Mutex::default);
    }

    /// How many bodies have elements that count as being everywhere.
    pub fn n_everywhere(&self) -> u64 {
        self.everywhere.load(Ordering::Relaxed).count_ones().into()
    }

    fn n_rows(&self) -> usize {
        self.along[1] as usize * self.along[2] as usize
    }

    pub fn bytes(&self) -> usize {
        let near = |part: &Mutex<Vec<WithinReach>>| part.lock().map_or(0, |part| part.capacity());
        size_of::<u32>() * self.codes.capacity()
            + size_of::<u64>() * (self.maps.capacity() + self.live.capacity())
            + size_of::<usize>() * self.firsts.capacity()
            + size_of::<WithinReach>() * self.near.iter().map(near).sum::<usize>()
    }

    /// Write access to the vertices' cells for several threads at once.
    pub fn codes(&mut self) -> Codes {
        Codes {
            first: self.codes.as_mut_ptr(),
            function: self.function,
        }
    }

    /// Where a part's codes start.
    pub fn first_code(&self, part: PartIx) -> usize {
        self.firsts[part.index()]
    }

    /// Lists the elements of a run that are near `reach`, and marks their cells.
    pub fn mark(&self, world: World<'_>, run: BoundsTask, run_ix: usize, reach: &Aabb) {
        let mut near = self.near[run_ix].lock().expect("no task panics");
        near.clear();
        let body = world.body(run.part);
        let codes = &self.codes[self.first_code(run.part)..];
        let reach = (
            self.function.code(&reach.min),
            self.function.code(&reach.max),
        );
        with_corners!(body.elements, |corners| self
            .mark_all(codes, corners, run, reach, &mut near));
    }

    fn mark_all<const N: usize>(
        &self,
        codes: &[u32],
        corners: &[[u32; N]],
        run: BoundsTask,
        reach: (u32, u32),
        near: &mut Vec<WithinReach>,
    ) {
        let map_ix = run.part.index();
        let n_rows = self.n_rows();
        let map = &self.maps[map_ix * n_rows..][..n_rows];
        let mut together = [WithinReach {
            element: ElementIx::new(0),
            low: 0,
            high: 0,
        }; TOGETHER];
        let corners = &corners[run.first as usize..run.end as usize];
        for (first, corners) in (run.first..)
            .step_by(TOGETHER)
            .zip(corners.chunks(TOGETHER))
        {
            // No branch: whether an element is near is unpredictable.
            let mut n = 0;
            for (element, corners) in (first..).map(ElementIx::new).zip(corners) {
                let vertex = codes[corners[0] as usize];
                let (mut low, mut high) = (vertex, vertex);
                for &corner in &corners[1..] {
                    let vertex = codes[corner as usize];
                    low = lesser_bytes(low, vertex);
                    high = greater_bytes(high, vertex);
                }
                // Partners can only meet it within reach.
                low = greater_bytes(low, reach.0);
                high = lesser_bytes(high, reach.1);
                together[n] = WithinReach { element, low, high };
                n += usize::from(greater_bytes(low, high) == high);
            }
            near.extend_from_slice(&together[..n]);
            for near in &together[..n] {
                if near.n_rows() > self.most_marked {
                    self.everywhere.fetch_or(1 << map_ix, Ordering::Relaxed);
                    continue;
                }
                self.for_rows(near, |row, cells| {
                    let row = &map[row];
                    if row.load(Ordering::Relaxed) & cells != cells {
                        row.fetch_or(cells, Ordering::Relaxed);
                    }
                });
            }
        }
    }

    /// Finds the cells in which elements may have partners, once all are marked.
    pub fn compare(&mut self) {
        let n_rows = self.n_rows();
        self.live.clear();
        self.live.resize(n_rows, 0);
        let n_maps = self.maps.len() / n_rows;
        for row in 0..n_rows {
            let (mut once, mut live) = (0u64, 0u64);
            for map in 0..n_maps {
                let everywhere = *self.everywhere.get_mut() >> map & 1 == 1;
                let marks = match everywhere {
                    true => u64::MAX,
                    false => *self.maps[map * n_rows + row].get_mut(),
                };
                let alone = self.alone >> map & 1 == 1;
                live |= if alone { marks } else { once & marks };
                once |= marks;
            }
            self.live[row] = live;
        }
    }

    /// Calls back for the elements of a run that may have partners, in order. Returns how many
    /// were near.
    pub fn for_live(&self, run_ix: usize, mut call: impl FnMut(ElementIx)) -> usize {
        let near = self.near[run_ix].lock().expect("no task panics");
        for near in &*near {
            let mut live = u64::from(near.n_rows() > self.most_marked);
            if live == 0 {
                self.for_rows(near, |row, cells| live |= self.live[row] & cells);
            }
            if live != 0 {
                call(near.element);
            }
        }
        near.len()
    }

    /// Calls back for the rows of an element's range, each with its cells of that row.
    #[inline(always)]
    fn for_rows(&self, near: &WithinReach, mut call: impl FnMut(usize, u64)) {
        let ([x, y, z, _], [x_end, y_end, z_end, _]) =
            (near.low.to_le_bytes(), near.high.to_le_bytes());
        let cells = (u64::MAX << x) & (u64::MAX >> (63 - x_end));
        for z in usize::from(z)..=usize::from(z_end) {
            let first = z * self.along[1] as usize;
            for row in first + usize::from(y)..=first + usize::from(y_end) {
                call(row, cells);
            }
        }
    }
}
