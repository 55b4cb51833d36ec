//! Frames that stay on the device: positions come from the caller's buffers, pairs go to ours.

use super::buffers::count;
use super::collect::map;
use super::engine::Engine;
use super::layout::{Counter, N_COUNTERS, N_PAIRS, N_UNSURE};
use super::room::{Capacities, NextPass, PassCounts};
use crate::error::Error;
use crate::ids::BodyId;
use crate::positions::Positions;
use crate::run::Job;
use crate::scene::Body;
use crate::stats::Statistics;

/// The buffers that hold the pairs of an encoded frame once its commands have run.
///
/// Both lists hold two `u32` per pair: the numbers of its primitives, the lower one first. Primitives are
/// numbered consecutively, body after body in the order of their ids: primitive `i` of a body has the number
/// `first + i`, where `first` is the number of primitives of all layers before it. The order of
/// pairs is not specified.
///
/// A count may be larger than its list: the list then holds as many pairs as fit, and
/// [`Detector::make_room`](crate::Detector::make_room) makes it larger.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct ResidentPairs {
    /// Pairs that certainly intersect.
    pub pairs: wgpu::Buffer,
    /// Pairs that may or may not intersect, within the rounding error of the device. To be conservative, count them
    /// as pairs.
    pub unsure: wgpu::Buffer,
    /// Holds the two counts as `u32`.
    pub counts: wgpu::Buffer,
    /// Byte offset of the number of pairs in `counts`.
    pub n_pairs_offset: u64,
    /// Byte offset of the number of unsure pairs in `counts`.
    pub n_unsure_offset: u64,
    /// The number of pairs that the list has room for.
    pub pairs_capacity: u64,
    /// The number of unsure pairs that the list has room for.
    pub unsure_capacity: u64,
}

const COUNTER: u64 = size_of::<Counter>() as u64;

impl Engine {
    /// Encodes all work of a frame as one pass.
    ///
    /// # Errors
    /// Those of [`Detector::encode`](crate::Detector::encode).
    pub fn encode(
        &mut self,
        job: Job<'_>,
        positions: &[(BodyId, &wgpu::Buffer)],
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<ResidentPairs, Error> {
        let Job { scene, frame, .. } = job;
        for &(body, buffer) in positions {
            let needed = 12 * count(scene.body(body)?.n_vertices());
            if buffer.size() < needed {
                return Err(Error::Gpu {
                    what: format!(
                        "body {body}: its positions take {needed} bytes, the buffer has {}",
                        buffer.size()
                    ),
                });
            }
            if !buffer.usage().contains(wgpu::BufferUsages::COPY_SRC) {
                return Err(Error::Gpu {
                    what: format!("body {body}: its buffer lacks the usage COPY_SRC"),
                });
            }
        }
        let ids: Vec<BodyId> = positions.iter().map(|&(body, _)| body).collect();
        self.update(job, &ids, &mut Statistics::default())?;
        for &(body, buffer) in positions {
            self.world.copy_positions(body, buffer, encoder);
        }
        let cells = self.cells_wanted(frame);
        let capacities = self.first_room(cells)?;
        let work = self.whole(frame);
        self.encode_pass(frame, work.as_ref(), capacities, cells, None, encoder)?;
        let capacities = self.room.capacities();
        Ok(ResidentPairs {
            pairs: self.room.pairs.buffer().clone(),
            unsure: self.room.unsure.buffer().clone(),
            counts: self.room.counters.buffer().clone(),
            n_pairs_offset: u64::from(N_PAIRS) * COUNTER,
            n_unsure_offset: u64::from(N_UNSURE) * COUNTER,
            pairs_capacity: capacities.pairs,
            unsure_capacity: capacities.unsure,
        })
    }

    /// The positions of a body on the device, see
    /// [`Detector::positions_on_device`](crate::Detector::positions_on_device).
    pub fn positions_of(&self, id: BodyId, body: &Body) -> Option<(&wgpu::Buffer, u64)> {
        match body.positions() {
            Positions::F32(_) => self.world.positions_of(id, body.positions_stamp()),
            Positions::F64(_) => None,
        }
    }

    /// Reads the counters and grows the buffers that were too small. Returns whether none was.
    ///
    /// # Errors
    /// Those of [`Detector::make_room`](crate::Detector::make_room).
    pub async fn make_room(&mut self) -> Result<bool, Error> {
        self.gpu().check_lost()?;
        let capacities = self.room.capacities();
        if capacities == Capacities::NONE {
            return Ok(true);
        }
        let counts = {
            let bytes = u64::from(N_COUNTERS) * COUNTER;
            let device = &self.gpu().device;
            let staging = device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("counters"),
                size: bytes,
                usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            });
            let mut encoder =
                device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            let counters = self.room.counters.buffer();
            encoder.copy_buffer_to_buffer(counters, 0, &staging, 0, bytes);
            self.gpu().queue.submit([encoder.finish()]);
            let view = map(&staging, bytes).await?;
            PassCounts::new(&bytemuck::pod_collect_to_vec::<u8, Counter>(&view))
        };
        match counts.judge(self.gpu(), capacities, self.budget_for_room()) {
            NextPass::Complete => Ok(true),
            NextPass::Grow(larger) => {
                self.grow_to(larger);
                Ok(false)
            }
            NextPass::Split => Err(self.too_small("the frame at once", counts.needed)),
        }
    }
}
