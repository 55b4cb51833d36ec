//! Positions that are sent to the device: what each body has there, who wrote it last, and the
//! bytes that all threads write.

use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError, Weak};

use crate::scene::Scene;
use crate::scene::ids::BodyId;
use crate::scene::positions::Positions;
use crate::workers::Workers;

use super::buffers::count;
use super::layout::Coordinate;
use super::topology::narrowed;

/// Vertices whose positions a task sends.
const SENT_BY_A_TASK: u64 = 1 << 14;
/// Bytes of a vertex.
pub(super) const VERTEX: u64 = 3 * size_of::<Coordinate>() as u64;

/// A body whose positions are on the device.
#[derive(Debug)]
pub(super) struct Resident {
    pub id: BodyId,
    pub topology_stamp: u64,
    /// Index of its first vertex among those of one end.
    pub first_vertex: u64,
    pub n_vertices: u64,
    /// Its positions at the start, and at the end.
    pub written: [LastWrite; 2],
}

/// What was written last where a body's positions are, at one end.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct LastWrite {
    /// The stamp of the scene's positions; 0 for those of a buffer of the caller's.
    pub stamp: u64,
    /// The last encoding that writes here, if there was one since the queue certainly wrote last.
    pub encoding: Option<u64>,
    /// Whether that encoding has written last, and not the queue.
    pub is_encoded: bool,
}

/// Encodings for the caller, who may submit them later, or never. While the commands of one may
/// still run, they may write positions and boxes after whatever the queue has been given.
#[derive(Debug, Default)]
pub(super) struct Encoded {
    n: u64,
    /// The number of each, and what its commands hold until they have run or are dropped.
    pending: Vec<(u64, Weak<()>)>,
}

impl Encoded {
    /// The number of a new encoding.
    pub fn begin(&mut self, encoder: &wgpu::CommandEncoder) -> u64 {
        let held = Arc::new(());
        self.n += 1;
        self.pending.push((self.n, Arc::downgrade(&held)));
        encoder.on_submitted_work_done(move || drop(held));
        self.n
    }

    /// The least number of those that may still run.
    pub fn oldest(&mut self) -> Option<u64> {
        self.pending.retain(|(_, held)| held.strong_count() > 0);
        self.pending.first().map(|&(number, _)| number)
    }

    /// Whether one may still run.
    pub fn may_run(&self, number: u64) -> bool {
        let pending = &mut self.pending.iter();
        pending.any(|(own, held)| *own == number && held.strong_count() > 0)
    }
}

impl Resident {
    /// Its vertices among those of one end.
    pub fn vertices(&self) -> Range<u64> {
        self.first_vertex..self.first_vertex + self.n_vertices
    }
}

impl LastWrite {
    /// Whether commands that were encoded, the oldest of those that may still run being this one,
    /// may write here.
    pub fn may_be_overwritten(&self, oldest: Option<u64>) -> bool {
        (self.encoding.zip(oldest)).is_some_and(|(encoding, oldest)| oldest <= encoding)
    }

    /// Says that the queue writes positions of the scene.
    pub fn by_queue(&mut self, stamp: u64, oldest: Option<u64>) {
        let encoding = self.encoding.filter(|_| self.may_be_overwritten(oldest));
        *self = LastWrite {
            stamp,
            encoding,
            is_encoded: false,
        };
    }

    /// Says that commands write positions.
    pub fn by_encoding(&mut self, stamp: u64, number: u64) {
        *self = LastWrite {
            stamp,
            encoding: Some(number),
            is_encoded: true,
        };
    }
}

/// The stamp of a body's positions at one end.
pub(super) fn stamp(scene: &Scene, body: &Resident, end: u64) -> u64 {
    let body = scene.body_in(body.id.slot());
    [body.positions_stamp(), body.step_stamp()][end as usize]
}

/// A body's positions at one end. Without positions at the end, it stays where it is.
pub(super) fn positions<'a>(scene: &'a Scene, body: &Resident, end: u64) -> &'a Positions {
    let body = scene.body_in(body.id.slot());
    let start = body.positions();
    match end {
        0 => start,
        _ => body.end_positions().unwrap_or(start),
    }
}

/// A part of what is sent, for one of the threads.
struct Sent<'a>(wgpu::WriteOnly<'a, [u8]>);

// SAFETY: a `WriteOnly<T>` is `Send` where `T` is, but wgpu says so of sized types alone. It is
// like a mutable reference, and bytes may be sent.
unsafe impl Send for Sent<'_> {}

/// Writes the positions of consecutive bodies as the device has them, on all threads.
pub(super) fn fill<'a>(
    mut to: wgpu::WriteOnly<'_, [u8]>,
    run: &[Resident],
    positions: impl Fn(&Resident) -> &'a Positions + Sync,
    workers: &Workers,
) {
    let size = SENT_BY_A_TASK * VERTEX;
    let mut tasks = Vec::new();
    while let Some(part) = to.split_off(..to.len().min(size as usize))
        && !part.is_empty()
    {
        tasks.push(Mutex::new(Some(Sent(part))));
    }
    workers.for_each(&mut vec![(); workers.n()], tasks.len(), |(), ix| {
        let part = tasks[ix]
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take();
        let Some(Sent(mut to)) = part else { return };
        let start = run[0].first_vertex + count(ix) * SENT_BY_A_TASK;
        let end = start + count(to.len()) / VERTEX;
        let first = run.partition_point(|body| body.vertices().end <= start);
        for body in &run[first..] {
            let vertices = body.vertices();
            if vertices.start >= end {
                break;
            }
            let (from, until) = (vertices.start.max(start), vertices.end.min(end));
            // A body without vertices ends no run.
            if from >= until {
                continue;
            }
            let own = [from, until].map(|vertex| (vertex - vertices.start) as usize);
            let bytes = (until - from) * VERTEX;
            let Some(to) = to.split_off(..bytes as usize) else {
                break;
            };
            put(positions(body), own[0]..own[1], to);
        }
    });
}

/// Writes coordinates as the device has them.
fn put(positions: &Positions, vertices: Range<usize>, mut to: wgpu::WriteOnly<'_, [u8]>) {
    match positions {
        Positions::F32(positions) => to.copy_from_slice(bytemuck::cast_slice(&positions[vertices])),
        Positions::F64(positions) => {
            let words = positions[vertices].as_flattened().iter().map(narrowed);
            to.into_chunks().0.write_iter(words.map(u32::to_ne_bytes));
        }
    }
}
