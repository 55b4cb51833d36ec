//! A pass as data: the launches of kernels, in order, each with its buffers and parameters.
//!
//! Pure functions make a [`Recording`]: `clusters` those of the method `Clusters` and of steps,
//! `cells` those of `Cells`. It can be printed, one line per launch. A [`Launcher`] encodes it; or
//! it runs launch by launch and reads back what each one has written, so that a wrong launch is
//! found by comparing with another device, or with kernels known to be good.

use std::collections::HashMap;
use std::fmt;
use std::sync::Arc;

use super::buffers::{Access, Bound, Slice, Storage, count, read};
use super::layout::{Arguments, Params, Step};
use super::open::GpuContext;
use super::pass_buffers::PassBuffers;
use super::pipeline::{BindingEntry, Bindings, Kernel, Program};
use super::view::{Motion, View};
use super::world::DeviceWorld;
use crate::scene::error::Error;
use crate::scene::words::debug_by_name;

/// The widest row of workgroups; `shared/layout.wgsl` has the same.
pub(super) const WIDEST: u64 = 32_768;

/// The number of workgroups of a launch.
#[derive(Debug, Clone)]
pub enum Workgroups {
    /// This many, in rows if necessary.
    Known(u64),
    /// As many as the arguments in this slot say, which an earlier launch has written.
    Indirect(wgpu::Buffer, u32),
}

/// A kernel with its buffers, parameters and workgroups.
#[derive(Debug, Clone)]
pub struct Launch {
    /// The index of its stage.
    stage: usize,
    program: Arc<Program>,
    /// In the order of the kernel's bindings.
    bound: Vec<Bound>,
    groups: Workgroups,
}

/// What comes before the launches.
#[derive(Debug, Clone)]
enum Before {
    Clear(Slice),
    Copy { from: Slice, to: Slice },
}

/// The launches of a pass, in order.
#[derive(Debug, Clone, Default)]
pub struct Recording {
    stages: Vec<&'static str>,
    start: Vec<Before>,
    launches: Vec<Launch>,
    /// What is read back, each from its first byte on.
    reads: Vec<Slice>,
}

impl Recording {
    /// The stages, by their timing labels. Some may have no launch.
    pub fn stages(&self) -> &[&'static str] {
        &self.stages
    }

    /// The launches.
    pub fn launches(&self) -> &[Launch] {
        &self.launches
    }

    /// The parameters of each launch that has some.
    fn steps(&self) -> impl Iterator<Item = Step> {
        let params = self.launches.iter().filter_map(Launch::params);
        params.map(Step::from)
    }

    /// Begins a stage.
    pub fn stage(&mut self, name: &'static str) {
        self.stages.push(name);
    }

    /// Adds a launch to the stage that was begun last.
    pub fn launch<B: Bindings>(&mut self, kernel: &Kernel<B>, bindings: &B, groups: Workgroups) {
        self.launches.push(Launch {
            stage: self.stages.len() - 1,
            program: Arc::clone(kernel.program()),
            bound: bindings.bound(),
            groups,
        });
    }

    /// Has a buffer cleared before the first launch.
    pub fn clear(&mut self, buffer: Slice) {
        self.start.push(Before::Clear(buffer));
    }

    /// Has the first bytes of a buffer, as many as are bound, copied before the first launch.
    pub fn copy(&mut self, from: Slice, to: Slice) {
        self.start.push(Before::Copy { from, to });
    }

    /// Has the first bytes of a buffer, as many as are bound, read back after the last launch.
    pub fn read(&mut self, buffer: Slice) {
        self.reads.push(buffer);
    }

    /// How many bytes are read back.
    pub fn read_bytes(&self) -> u64 {
        self.reads.iter().map(|read| read.bytes).sum()
    }

    /// Encodes what comes before the launches.
    fn encode_start(&self, encoder: &mut wgpu::CommandEncoder) {
        for start in &self.start {
            match start {
                Before::Clear(held) => encoder.clear_buffer(&held.buffer, 0, None),
                Before::Copy { from, to } if from.bytes > 0 => {
                    encoder.copy_buffer_to_buffer(&from.buffer, 0, &to.buffer, 0, from.bytes);
                }
                Before::Copy { .. } => {}
            }
        }
    }

    /// Encodes the copies of what is read back, one after the other.
    pub fn encode_reads(&self, encoder: &mut wgpu::CommandEncoder, staging: &wgpu::Buffer) {
        let mut to = 0;
        for read in self.reads.iter().filter(|read| read.bytes > 0) {
            encoder.copy_buffer_to_buffer(&read.buffer, 0, staging, to, read.bytes);
            to += read.bytes;
        }
    }
}

impl Launch {
    /// The name of the kernel.
    pub fn kernel(&self) -> &'static str {
        self.program.name()
    }

    fn params(&self) -> Option<Params> {
        self.bound.iter().find_map(|bound| match bound {
            Bound::Params(params) => Some(*params),
            Bound::Buffer(_) => None,
        })
    }

    /// The buffers that the kernel uses in one way, each with its binding.
    fn used(&self, access: Access) -> impl Iterator<Item = (&'static BindingEntry, &Slice)> {
        let entries = self.program.entries().iter().zip(&self.bound);
        entries.filter_map(move |(entry, bound)| match bound {
            Bound::Buffer(slice) if entry.access == access => Some((entry, slice)),
            _ => None,
        })
    }
}

impl fmt::Display for Launch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:<22}", self.kernel())?;
        match &self.groups {
            Workgroups::Known(n) => write!(f, " x {n:<10}")?,
            Workgroups::Indirect(_, slot) => write!(f, " x arguments {slot}")?,
        }
        for (access, arrow) in [(Access::Read, "<-"), (Access::Write, "->")] {
            let labels: Vec<&str> = self.used(access).map(|(_, slice)| slice.label).collect();
            write!(f, " {arrow} {}", labels.join(", "))?;
        }
        match self.params() {
            Some(params) => write!(f, " {{{params}}}"),
            None => Ok(()),
        }
    }
}

impl fmt::Display for Recording {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for start in &self.start {
            match start {
                Before::Clear(held) => writeln!(f, "{:<10}clear {}", "", held.label)?,
                Before::Copy { from, to } => {
                    writeln!(f, "{:<10}copy  {} -> {}", "", from.label, to.label)?;
                }
            }
        }
        for launch in &self.launches {
            writeln!(f, "{:<10}{launch}", self.stages[launch.stage])?;
        }
        let labels: Vec<&str> = self.reads.iter().map(|read| read.label).collect();
        match labels.is_empty() {
            true => Ok(()),
            false => writeln!(f, "{:<10}read  {}", "", labels.join(", ")),
        }
    }
}

debug_by_name!(Recorder<'_> => "Recorder");

/// Makes a recording from the buffers that its launches bind.
pub struct Recorder<'a> {
    /// The kernels, and the limits of the device.
    pub gpu: &'a GpuContext,
    /// The data on parts.
    pub world: &'a DeviceWorld,
    /// What a frame, or a step, sees of them.
    pub view: &'a View,
    /// Whether that is a frame or a step.
    pub motion: Motion,
    /// The buffers for results.
    pub pass_buffers: &'a PassBuffers,
    /// Whether rules say which candidates are left out.
    pub leaves_out: bool,
    /// What has been recorded so far.
    pub recording: Recording,
}

impl Recorder<'_> {
    /// As many workgroups as the arguments in this slot say.
    pub fn indirect(&self, slot: u32) -> Workgroups {
        Workgroups::Indirect(self.pass_buffers.arguments.buffer().clone(), slot)
    }
}

/// A launch that has run, and what it left in the buffers that it may write.
#[derive(Debug)]
pub struct Ran {
    /// The stage.
    pub stage: &'static str,
    /// The kernel.
    pub kernel: &'static str,
    /// The launch in words.
    pub launch: String,
    /// What the kernel may have written.
    pub written: Vec<Written>,
}

/// The contents of a buffer.
#[derive(Debug, PartialEq, Eq)]
pub struct Written {
    /// The name of the binding.
    pub name: &'static str,
    /// Its elements, sorted: threads fill lists in any order.
    pub elements: Vec<Vec<u8>>,
}

/// Runs recordings. Keeps the table of parameters and the bind groups of the last one.
#[derive(Debug)]
pub struct Launcher {
    params: Storage<Step>,
    sent: Vec<Step>,
    groups: HashMap<MadeOf, BoundGroup>,
}

/// What a bind group was made of.
#[derive(Debug, PartialEq, Eq, Hash)]
struct MadeOf {
    /// The address of the program.
    program: usize,
    buffers: Vec<(wgpu::Buffer, u64)>,
}

/// A bind group.
#[derive(Debug)]
struct BoundGroup {
    /// Its program, which keeps its address for as long as the bind group is there.
    _program: Arc<Program>,
    group: wgpu::BindGroup,
}

impl Default for Launcher {
    fn default() -> Self {
        Launcher {
            params: Storage::new("parameters", wgpu::BufferUsages::UNIFORM),
            sent: Vec::new(),
            groups: HashMap::new(),
        }
    }
}

/// A launch that is ready: its bind group, and the offset of its parameters.
struct Ready {
    group: wgpu::BindGroup,
    offset: Option<u32>,
}

impl Launcher {
    /// Encodes a recording, each stage in a pass of its own so that it can be timed.
    ///
    /// # Errors
    /// As [`Storage::resize`]. Errors of kernels go to the open error scopes.
    pub fn encode(
        &mut self,
        gpu: &GpuContext,
        recording: &Recording,
        times: Option<&wgpu::QuerySet>,
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<(), Error> {
        let ready = self.prepare(gpu, recording)?;
        recording.encode_start(encoder);
        let mut next = 0;
        for (ix, name) in (0u32..).zip(&recording.stages) {
            let timestamp_writes = times.map(|query_set| wgpu::ComputePassTimestampWrites {
                query_set,
                beginning_of_pass_write_index: Some(2 * ix),
                end_of_pass_write_index: Some(2 * ix + 1),
            });
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(name),
                timestamp_writes,
            });
            while let Some(launch) = recording.launches.get(next)
                && launch.stage == ix as usize
            {
                Launcher::dispatch(launch, &ready[next], &mut pass);
                next += 1;
            }
        }
        Ok(())
    }

    /// Runs a recording launch by launch, and reads back what each has written. Slow.
    ///
    /// # Errors
    /// Those of [`encode`](Launcher::encode); a device that is lost.
    pub async fn run_each(
        &mut self,
        gpu: &GpuContext,
        recording: &Recording,
    ) -> Result<Vec<Ran>, Error> {
        let ready = self.prepare(gpu, recording)?;
        let encoder = || gpu.device.create_command_encoder(&Default::default());
        let mut first = encoder();
        recording.encode_start(&mut first);
        gpu.queue.submit([first.finish()]);
        let mut all = Vec::with_capacity(recording.launches.len());
        for (launch, ready) in recording.launches.iter().zip(&ready) {
            let mut encoder = encoder();
            // A queue holds what is left of an earlier round, in any order.
            for (entry, slice) in launch.used(Access::Write) {
                if entry.name == "next_queue" {
                    encoder.clear_buffer(&slice.buffer, 0, None);
                }
            }
            let mut pass = encoder.begin_compute_pass(&Default::default());
            Launcher::dispatch(launch, ready, &mut pass);
            drop(pass);
            gpu.queue.submit([encoder.finish()]);
            let mut written = Vec::new();
            for (entry, slice) in launch.used(Access::Write) {
                let bytes = read(gpu, slice).await?;
                let elements = bytes.chunks_exact(entry.stride as usize);
                let mut elements: Vec<Vec<u8>> = elements.map(<[u8]>::to_vec).collect();
                elements.sort_unstable();
                let name = entry.name;
                written.push(Written { name, elements });
            }
            all.push(Ran {
                stage: recording.stages[launch.stage],
                kernel: launch.kernel(),
                launch: launch.to_string(),
                written,
            });
        }
        Ok(all)
    }

    /// Whether the parameters of a recording are those on the device.
    pub fn has_sent(&self, recording: &Recording) -> bool {
        self.params.bytes() != 0 && recording.steps().eq(self.sent.iter().copied())
    }

    /// Sends the parameters, if they differ from those on the device, and binds all buffers.
    #[expect(
        clippy::mutable_key_type,
        reason = "wgpu hashes a buffer by its identity, which stays"
    )]
    fn prepare(&mut self, gpu: &GpuContext, recording: &Recording) -> Result<Vec<Ready>, Error> {
        if !self.has_sent(recording) {
            let steps = Vec::from_iter(recording.steps());
            self.params.upload(gpu, &steps)?;
            self.sent = steps;
        }
        let mut before = std::mem::take(&mut self.groups);
        let mut next = 0;
        let launches = recording.launches.iter();
        let ready = launches.map(|launch| {
            let offset = launch.params().map(|_| {
                next += 1;
                // A pass has a few dozen launches; truncations have one per body.
                (next - 1) * size_of::<Step>() as u32
            });
            let group = self.group(gpu, &mut before, launch);
            Ready { group, offset }
        });
        Ok(ready.collect())
    }

    /// The bind group of a launch: one of this recording, one of the recording before, or a new
    /// one.
    #[expect(
        clippy::mutable_key_type,
        reason = "wgpu hashes a buffer by its identity, which stays"
    )]
    fn group(
        &mut self,
        gpu: &GpuContext,
        before: &mut HashMap<MadeOf, BoundGroup>,
        launch: &Launch,
    ) -> wgpu::BindGroup {
        let buffer = |bound: &Bound| match bound {
            Bound::Buffer(slice) => (slice.buffer.clone(), slice.bytes),
            Bound::Params(_) => (self.params.buffer().clone(), count(size_of::<Params>())),
        };
        let made_of = MadeOf {
            program: Arc::as_ptr(&launch.program).addr(),
            buffers: launch.bound.iter().map(buffer).collect(),
        };
        if let Some(held) = self.groups.get(&made_of) {
            return held.group.clone();
        }
        let held = before.remove(&made_of).unwrap_or_else(|| BoundGroup {
            _program: Arc::clone(&launch.program),
            group: launch.program.bind(gpu, &made_of.buffers),
        });
        let group = held.group.clone();
        self.groups.insert(made_of, held);
        group
    }

    fn dispatch(launch: &Launch, ready: &Ready, pass: &mut wgpu::ComputePass<'_>) {
        pass.set_pipeline(launch.program.pipeline());
        pass.set_bind_group(0, &ready.group, ready.offset.as_slice());
        match &launch.groups {
            &Workgroups::Known(n) => {
                // Both fit: counts are below 2^32.
                let (x, y) = (n.min(WIDEST) as u32, n.div_ceil(WIDEST) as u32);
                pass.dispatch_workgroups(x, y, 1);
            }
            Workgroups::Indirect(arguments, slot) => {
                let bytes = count(size_of::<Arguments>());
                pass.dispatch_workgroups_indirect(arguments, u64::from(*slot) * bytes);
            }
        }
    }
}
