//! Stage `collect`: counters and results come back in one copy.
//!
//! ```text
//! counters | grid | pairs: a quarter more than last time | unsure pairs: likewise | stages' times
//!
//! in a step, in place of both:  unsure pairs: likewise | their times, unless any contact will do
//! ```
//!
//! If there are more than were copied, the rest follows in a second copy; no kernel runs again.

use super::buffers::map;
use super::device::Scopes;
use super::layout::{Counter, Grid, N_COUNTERS, NEVER, PairKey, PairTimes, UnsureKey, time_by};
use super::open::GpuContext;
use super::pass_buffers::{PassBuffers, PassCounts};
use super::recording::Recording;
use crate::query::goal::Goal;
use crate::scene::error::Error;
use crate::search::sink::reserve;
use crate::search::undecided::UndecidedPair;

const COUNTERS: u64 = N_COUNTERS as u64 * size_of::<Counter>() as u64;
const GRID: u64 = size_of::<Grid>() as u64;
/// The most stages of a method.
const MOST_STAGES: usize = 8;
const TIMES: u64 = 2 * MOST_STAGES as u64 * size_of::<u64>() as u64;
const HEADER: u64 = COUNTERS + GRID;
const KEY: u64 = size_of::<PairKey>() as u64;
const TIMES_OF_PAIR: u64 = size_of::<PairTimes>() as u64;
/// At least this many keys are copied.
const LEAST: u64 = 1024;

/// The buffers through which results are read back.
#[derive(Debug, Default)]
pub struct Collector {
    staging: Option<wgpu::Buffer>,
    times: Option<Times>,
    /// The number of pairs of the last pass.
    n_pairs: u64,
    n_unsure: u64,
}

#[derive(Debug)]
struct Times {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
}

/// How many keys the first copy includes.
#[derive(Debug, Clone, Copy)]
pub struct Guess {
    pairs: u64,
    unsure: u64,
    /// Of unsure pairs in a step, unless any contact will do.
    times: u64,
    /// In a step: which contacts are sought.
    sought: Option<Goal>,
}

impl Guess {
    fn bytes(&self) -> u64 {
        HEADER + KEY * (self.pairs + self.unsure) + TIMES_OF_PAIR * self.times
    }

    fn has_times(&self) -> bool {
        matches!(self.sought, Some(Goal::All | Goal::Earliest))
    }
}

/// The results of a pass.
#[derive(Debug)]
pub struct Collected {
    pub counts: PassCounts,
    /// The grid of `Cells`.
    pub grid: Grid,
    /// Milliseconds per stage, if the device has a clock.
    pub stage_ms: Option<Vec<f64>>,
    pub pairs: Vec<PairKey>,
    pub unsure: Vec<UnsureKey>,
    /// In a step: the unsure pairs with their times, none if the step is answered without them.
    pub undecided: Vec<UndecidedPair>,
}

impl Collector {
    /// The queries that record the stages' times, if the device has a clock.
    pub fn times(&mut self, gpu: &GpuContext) -> Option<&wgpu::QuerySet> {
        if gpu.has_timestamps && self.times.is_none() {
            self.times = Some(Times {
                queries: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                    label: Some("times"),
                    ty: wgpu::QueryType::Timestamp,
                    count: 2 * MOST_STAGES as u32,
                }),
                resolved: gpu.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("times"),
                    size: TIMES,
                    usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                    mapped_at_creation: false,
                }),
            });
        }
        self.times.as_ref().map(|times| &times.queries)
    }

    fn reserve(&mut self, gpu: &GpuContext, bytes: u64) -> wgpu::Buffer {
        match &self.staging {
            Some(staging) if staging.size() >= bytes => staging.clone(),
            _ => {
                self.staging = None;
                let staging = gpu.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("read-back"),
                    size: bytes,
                    usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                    mapped_at_creation: false,
                });
                self.staging.insert(staging).clone()
            }
        }
    }

    /// Records what is read back: counters, the grid, and about as many keys as last time.
    /// `sought`: which contacts of a step are.
    pub fn record(
        &self,
        pass_buffers: &PassBuffers,
        sought: Option<Goal>,
        recording: &mut Recording,
    ) -> Guess {
        let capacities = pass_buffers.capacities();
        let guess = |last: u64, capacity: u64| (last + last / 4).max(LEAST).min(capacity);
        let unsure = guess(self.n_unsure, capacities.unsure);
        let guess = Guess {
            // The pairs of a step go to its search, and no farther.
            pairs: match sought {
                Some(_) => 0,
                None => guess(self.n_pairs, capacities.pairs),
            },
            unsure,
            times: match sought {
                Some(Goal::Any) | None => 0,
                Some(_) => unsure,
            },
            sought,
        };
        recording.read(pass_buffers.counters.all());
        recording.read(pass_buffers.grid.all());
        recording.read(pass_buffers.pairs.first(guess.pairs));
        recording.read(pass_buffers.unsure.first(guess.unsure));
        recording.read(pass_buffers.times.first(guess.times));
        guess
    }

    /// Encodes the copies of what is read back, and of the times of the stages.
    pub fn encode(
        &mut self,
        gpu: &GpuContext,
        encoder: &mut wgpu::CommandEncoder,
        recording: &Recording,
    ) {
        let bytes = recording.read_bytes();
        let staging = self.reserve(gpu, bytes + TIMES);
        recording.encode_reads(encoder, &staging);
        if let Some(times) = &self.times {
            // A method has a few stages.
            let n_stages = recording.stages().len() as u32;
            encoder.resolve_query_set(&times.queries, 0..2 * n_stages, &times.resolved, 0);
            encoder.copy_buffer_to_buffer(&times.resolved, 0, &staging, bytes, TIMES);
        }
    }

    /// Waits for the copy and reads it.
    ///
    /// # Errors
    /// Device errors.
    pub async fn take(
        &mut self,
        gpu: &GpuContext,
        pass_buffers: &PassBuffers,
        n_stages: usize,
        guess: Guess,
    ) -> Result<Collected, Error> {
        // Given back when all went well: a buffer that stays mapped is of no more use.
        let staging = self.staging.take().expect("encoded before");
        let mut keys = ReadKeys::default();
        let first = {
            let view = map(gpu, &staging, guess.bytes() + TIMES).await?;
            FirstCopy::new(&view, pass_buffers, guess, &mut keys)?
        };
        staging.unmap();
        self.staging = Some(staging);
        (self.n_pairs, self.n_unsure) = (first.n_pairs, first.n_unsure);
        self.take_more(gpu, pass_buffers, guess, &mut keys).await?;
        let stage_ms = self.times.is_some().then(|| {
            let ms = f64::from(gpu.queue.get_timestamp_period()) * 1e-6;
            let ticks = &first.ticks;
            let span = |stage: usize| ticks[2 * stage + 1].saturating_sub(ticks[2 * stage]);
            (0..n_stages).map(|stage| span(stage) as f64 * ms).collect()
        });
        Ok(Collected {
            undecided: match guess.sought {
                Some(_) => keys.undecided()?,
                None => Vec::new(),
            },
            counts: first.counts,
            grid: first.grid,
            stage_ms,
            pairs: keys.pairs,
            unsure: keys.unsure,
        })
    }

    /// Copies and reads the keys that the first copy had no room for.
    ///
    /// # Errors
    /// Device errors.
    async fn take_more(
        &mut self,
        gpu: &GpuContext,
        pass_buffers: &PassBuffers,
        guess: Guess,
        keys: &mut ReadKeys,
    ) -> Result<(), Error> {
        let more_pairs = self.n_pairs.saturating_sub(guess.pairs);
        let more_unsure = self.n_unsure.saturating_sub(guess.unsure);
        let more_times = if guess.has_times() { more_unsure } else { 0 };
        if more_pairs + more_unsure == 0 {
            return Ok(());
        }
        let size_of_keys = KEY * (more_pairs + more_unsure);
        let bytes = size_of_keys + TIMES_OF_PAIR * more_times;
        let scopes = Scopes::open(&gpu.device);
        let staging = self.reserve(gpu, bytes);
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut copy = |from: &wgpu::Buffer, first: u64, to: u64, size: u64| {
            encoder.copy_buffer_to_buffer(from, first, &staging, to, size);
        };
        let of_pairs = KEY * more_pairs;
        copy(pass_buffers.pairs.buffer(), KEY * guess.pairs, 0, of_pairs);
        let (first, size) = (KEY * guess.unsure, KEY * more_unsure);
        copy(pass_buffers.unsure.buffer(), first, of_pairs, size);
        let (first, size) = (TIMES_OF_PAIR * guess.times, TIMES_OF_PAIR * more_times);
        copy(pass_buffers.times.buffer(), first, size_of_keys, size);
        gpu.queue.submit([encoder.finish()]);
        scopes.close().await?;
        {
            let view = map(gpu, &staging, bytes).await?;
            let (of_keys, of_times) = view[..bytes as usize].split_at(size_of_keys as usize);
            let (of_pairs, of_unsure) = of_keys.split_at(of_pairs as usize);
            append(&mut keys.pairs, of_pairs);
            append(&mut keys.unsure, of_unsure);
            append(&mut keys.times, of_times);
        }
        staging.unmap();
        Ok(())
    }
}

/// What the first copy has besides keys.
struct FirstCopy {
    counts: PassCounts,
    grid: Grid,
    ticks: Vec<u64>,
    /// The number of keys on the device that are read.
    n_pairs: u64,
    n_unsure: u64,
}

impl FirstCopy {
    /// Reads the first copy, and makes room for all keys.
    ///
    /// # Errors
    /// There is no memory for the keys.
    fn new(
        bytes: &[u8],
        pass_buffers: &PassBuffers,
        guess: Guess,
        keys: &mut ReadKeys,
    ) -> Result<Self, Error> {
        let at = |from: u64, size: u64| &bytes[from as usize..(from + size) as usize];
        let counters: Vec<Counter> = bytemuck::pod_collect_to_vec(at(0, COUNTERS));
        let counts = PassCounts::new(&counters);
        let capacities = pass_buffers.capacities();
        let n_pairs = match guess.sought {
            Some(_) => 0,
            None => counts.needed.pairs.min(capacities.pairs),
        };
        let is_answered = guess.sought.is_some_and(|sought| counts.answer(sought));
        let n_unsure = match is_answered {
            true => 0,
            false => counts.needed.unsure.min(capacities.unsure),
        };
        let first = HEADER;
        reserve_all(&mut keys.pairs, n_pairs)?;
        reserve_all(&mut keys.unsure, n_unsure)?;
        append(&mut keys.pairs, at(first, KEY * n_pairs.min(guess.pairs)));
        let first = first + KEY * guess.pairs;
        let size = KEY * n_unsure.min(guess.unsure);
        append(&mut keys.unsure, at(first, size));
        if guess.has_times() {
            reserve_all(&mut keys.times, n_unsure)?;
            let first = first + KEY * guess.unsure;
            let size = TIMES_OF_PAIR * n_unsure.min(guess.times);
            append(&mut keys.times, at(first, size));
        }
        Ok(FirstCopy {
            counts,
            grid: bytemuck::pod_read_unaligned(at(COUNTERS, GRID)),
            ticks: bytemuck::pod_collect_to_vec(at(guess.bytes(), TIMES)),
            n_pairs,
            n_unsure,
        })
    }
}

/// The keys of a pass that were read.
#[derive(Default)]
struct ReadKeys {
    pairs: Vec<PairKey>,
    unsure: Vec<UnsureKey>,
    /// Of unsure pairs in a step, unless any contact will do.
    times: Vec<PairTimes>,
}

impl ReadKeys {
    /// The unsure pairs of a step with their times.
    ///
    /// # Errors
    /// There is no memory for them.
    fn undecided(&self) -> Result<Vec<UndecidedPair>, Error> {
        let mut undecided = Vec::new();
        reserve_all(&mut undecided, self.unsure.len() as u64)?;
        let nothing = PairTimes {
            free_until: 0,
            touches_by: NEVER.to_bits(),
        };
        let times = self.times.iter().chain(std::iter::repeat(&nothing));
        let pairs = self.unsure.iter().zip(times);
        undecided.extend(pairs.map(|(pair, times)| UndecidedPair {
            slots: [pair.low, pair.high],
            free_until: f32::from_bits(times.free_until),
            touches_by: time_by(times.touches_by),
        }));
        Ok(undecided)
    }
}

/// Makes room for all keys of a list.
///
/// # Errors
/// There is no memory for them.
fn reserve_all<K>(keys: &mut Vec<K>, n: u64) -> Result<(), Error> {
    let n = usize::try_from(n).unwrap_or(usize::MAX);
    reserve(keys, n, "pairs of one pass")
}

/// Appends keys as the device wrote them, within the room that was made.
fn append<K: bytemuck::Pod>(keys: &mut Vec<K>, bytes: &[u8]) {
    let each = bytes.chunks_exact(size_of::<K>());
    keys.extend(each.map(bytemuck::pod_read_unaligned::<K>));
}
