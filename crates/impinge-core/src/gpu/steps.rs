//! Shared by the plans of both methods: the table of parameters, and timed passes.

use super::buffers::{Storage, Uniform};
use super::layout::{Params, Step};
use super::open::Gpu;
use crate::error::Error;

/// The parameters of all steps of a plan, sent when they change.
#[derive(Debug)]
pub struct Steps {
    planned: Vec<Step>,
    sent: Vec<Step>,
    buffer: Storage<Step>,
}

impl Default for Steps {
    fn default() -> Self {
        Steps::new()
    }
}

impl Steps {
    pub fn new() -> Self {
        Steps {
            planned: Vec::new(),
            sent: Vec::new(),
            buffer: Storage::new("steps", wgpu::BufferUsages::UNIFORM),
        }
    }

    pub fn clear(&mut self) {
        self.planned.clear();
    }

    /// Plans a step and returns its number.
    pub fn push(&mut self, params: Params) -> u32 {
        self.planned.push(params.into());
        // A plan has a few dozen steps.
        self.planned.len() as u32 - 1
    }

    /// Sends the planned steps if they have changed. Returns whether the buffer is a new one.
    ///
    /// # Errors
    /// As [`Storage::resize`].
    pub fn send(&mut self, gpu: &Gpu) -> Result<bool, Error> {
        if self.planned == self.sent && self.buffer.bytes() > 0 {
            return Ok(false);
        }
        // One step is bound at a time, so only a new buffer matters, not a new length.
        let bytes = self.buffer.bytes();
        self.buffer.upload(gpu, &self.planned)?;
        self.sent.clone_from(&self.planned);
        Ok(self.buffer.bytes() != bytes)
    }

    pub fn params(&self) -> Uniform<Params> {
        self.buffer.params()
    }
}

/// Encodes stages, each in a pass of its own so that it can be timed.
pub struct Stages<'a> {
    pub names: &'static [&'static str],
    pub encoder: &'a mut wgpu::CommandEncoder,
    pub times: Option<&'a wgpu::QuerySet>,
    pub next: u32,
}

impl Stages<'_> {
    /// The next stage.
    pub fn stage(&mut self, encode: impl FnOnce(&mut wgpu::ComputePass<'_>)) {
        let ix = self.next;
        self.next += 1;
        let mut pass = self
            .encoder
            .begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(self.names[ix as usize]),
                timestamp_writes: self
                    .times
                    .map(|query_set| wgpu::ComputePassTimestampWrites {
                        query_set,
                        beginning_of_pass_write_index: Some(2 * ix),
                        end_of_pass_write_index: Some(2 * ix + 1),
                    }),
            });
        encode(&mut pass);
    }
}
