//! Measures a GPU: the time of each stage on the device, beside a lower bound.
//!
//! The lower bound (floor) is bytes over bandwidth plus launches. Both rates are measured on the
//! same device: the bandwidth by a kernel that copies, the cost of a launch by a sequence of
//! dependent launches.

use std::time::Instant;

use impinge::wgpu::{self, util::DeviceExt};
use impinge::{Backend, Detector, DeviceInfo, Method, Settings, Stats, devices};
use serde_json::json;

use crate::problem::{Ask, Problem};
use crate::report::{Report, figures, grouped};
use crate::{Failure, Options, files};

/// Untimed frames before the timed ones.
const N_WARM: usize = 4;
/// Stages of the host; all others run on the device, which times them if it can.
const ON_HOST: [&str; 4] = ["upload", "clustering", "decide", "collect"];

/// The adapter that the options choose.
pub fn device(options: &Options) -> Result<DeviceInfo, Failure> {
    let wanted = options.device.as_deref().unwrap_or("").to_lowercase();
    let mut all = devices().into_iter();
    let found = all.find(|device| device.name.to_lowercase().contains(&wanted));
    found.ok_or_else(|| "no such GPU; `impinge devices` lists the available ones".into())
}

/// The adapter's name in lower case, words joined by hyphens.
pub fn slug(device: &DeviceInfo) -> String {
    let name = device.name.split('(').next().unwrap_or("").to_lowercase();
    let words = name.split(|letter: char| !letter.is_ascii_alphanumeric());
    let words: Vec<&str> = words.filter(|word| !word.is_empty()).collect();
    words.join("-")
}

/// The same adapter for a device of the caller's.
pub fn adapter(info: &DeviceInfo) -> Result<wgpu::Adapter, Failure> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
    let mut adapters = adapters.into_iter();
    let found = adapters.find(|adapter| adapter.get_info().name == info.name);
    found.ok_or_else(|| "the GPU is gone".into())
}

/// All scenes, both methods.
pub fn scenes(options: &Options, report: &mut Report) -> Result<(), Failure> {
    let info = device(options)?;
    let rates = Rates::measure(&info)?;
    let kind = if info.is_software {
        " (software: these times say nothing about a GPU)"
    } else {
        ""
    };
    report.say(&format!(
        "{info}{kind}, {}.\n\nMeasured here: {:.0} GB/s by a kernel that copies, {:.2} µs per dependent launch. `device` is the sum of the stages on \
         the device by its own clock, from positions to pairs on the device; `host` is the time that the caller waits, including \
         upload, read-back, exact settling and sorting. Medians. Pairs equal those of the CPU backend, compared by hash in every scene.\n",
        info.driver, rates.bytes_per_ms / 1e6, rates.launch_ms * 1e3
    ));
    report.say(
        "| scene | method | pairs | candidates | unsure | device ms | host ms | floor ms | device : floor | stages ms |\n\
         |---|---|---:|---:|---:|---:|---:|---:|---:|---|",
    );
    let wanted = |scene: &str| options.scene.as_deref().is_none_or(|name| name == scene);
    let mut problems = Vec::new();
    for scene in ["ball", "bunny", "buddha", "dragon"] {
        if wanted(scene) {
            problems.push(files::two_body(scene)?);
        }
    }
    if wanted("dragon-self") {
        problems.push(files::within("dragon")?);
    }
    for problem in problems {
        let problem = problem.by_oracle()?;
        for method in [Method::Clusters, Method::Cells] {
            if method == Method::Clusters || options.cells {
                row(&problem, method, options, &rates, report)?;
            }
        }
    }
    Ok(())
}

fn row(
    problem: &Problem,
    method: Method,
    options: &Options,
    rates: &Rates,
    report: &mut Report,
) -> Result<(), Failure> {
    let (mut scene, ids, query) = problem.scene()?;
    let detector = |backend: Backend| {
        Detector::new(
            Settings::new()
                .method(method)
                .backend(backend)
                .device(options.device.clone()),
        )
    };
    let mut gpu = detector(Backend::Gpu)?;
    let mut cpu = detector(Backend::Cpu)?;
    let n_frames = options.frames.unwrap_or(40).max(1);
    let mut frames: Vec<Stats> = Vec::with_capacity(n_frames);
    for frame in 0..N_WARM + n_frames {
        for (&id, body) in ids.iter().zip(&problem.bodies) {
            scene
                .positions_mut::<f32>(id)?
                .copy_from_slice(&body.poses[frame % problem.n_poses()]);
        }
        let answer = gpu.detect(&scene, &query)?;
        let n_pairs = answer.len() as u64;
        if let Some(expected) = problem.expected.filter(|&expected| expected != n_pairs) {
            return Err(format!("{}: {n_pairs} pairs, {expected} expected", problem.name).into());
        }
        if frame >= N_WARM {
            frames.push(answer.stats().clone());
        } else if answer.hash() != cpu.detect(&scene, &query)?.hash() {
            return Err(format!("{}: GPU and CPU differ in their pairs", problem.name).into());
        }
    }
    let n_pairs = gpu.detect(&scene, &query)?.len() as u64;
    let last = &frames[frames.len() - 1];
    let stage_ms = |name: &str| {
        median(frames.iter().map(|stats| {
            let stage = stats.stages.iter().find(|stage| stage.name == name);
            stage.map_or(0.0, |stage| stage.ms)
        }))
    };
    let name = match problem.ask {
        Ask::Within => format!("{}, self", problem.name),
        _ => problem.name.clone(),
    };
    let names: Vec<&str> = last.stages.iter().map(|stage| stage.name).collect();
    let device_ms = median(frames.iter().map(|stats| {
        let on_device = stats.stages.iter();
        let on_device = on_device.filter(|stage| !ON_HOST.contains(&stage.name));
        on_device.map(|stage| stage.ms).sum()
    }));
    let host_ms = median(frames.iter().map(|stats| stats.total_ms));
    let floor_ms = rates.floor_ms(problem, last);
    let stages: Vec<String> = names
        .iter()
        .map(|name| format!("{name} {}", figures(stage_ms(name))))
        .collect();
    report.say(&format!(
        "| {name} | {} | {} | {} | {} | {} | {} | {} | {:.1} | {} |",
        method.name(),
        grouped(n_pairs),
        grouped(last.n_candidates),
        grouped(last.n_unsure),
        figures(device_ms),
        figures(host_ms),
        figures(floor_ms),
        device_ms / floor_ms,
        stages.join(", "),
    ));
    report.keep_json(json!({
        "name": name,
        "about": problem.about,
        "method": method.name(),
        "elements": problem.n_elements(),
        "pairs": n_pairs,
        "candidates": last.n_candidates,
        "unsure": last.n_unsure,
        "work_items": last.n_work_items,
        "bytes_held": last.bytes_held,
        "frames": n_frames,
        "device_ms": device_ms,
        "host_ms": host_ms,
        "floor_ms": floor_ms,
        "stages_ms": names.iter().map(|&name| (name.to_owned(), json!(stage_ms(name)))).collect::<serde_json::Map<_, _>>(),
    }));
    Ok(())
}

pub fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// The rates of the device, per millisecond.
struct Rates {
    bytes_per_ms: f64,
    launch_ms: f64,
}

impl Rates {
    /// Measures the rates on a device opened only for this.
    fn measure(info: &DeviceInfo) -> Result<Rates, Failure> {
        let adapter = adapter(info)?;
        let (device, queue) = pollster::block_on(adapter.request_device(&Default::default()))?;
        Ok(Rates {
            bytes_per_ms: bandwidth(&device, &queue)?,
            launch_ms: launch(&device, &queue)?,
        })
    }

    /// The time of the bytes that must move, at full bandwidth, plus the launches of one pass, as
    /// counted in docs/lab/gpu.md.
    fn floor_ms(&self, problem: &Problem, stats: &Stats) -> f64 {
        const CLUSTER: u64 = 45 * (4 + 12);
        const BOX: u64 = 2 * 24;
        const ITEM: u64 = 128 * (16 + 3 * 12);
        const CANDIDATE: u64 = 8 + 32 + 72;
        const KEPT: u64 = 2 * 48;
        const ENTRY: u64 = 2 * 8;
        let is_cells = stats.method == Method::Cells.name();
        let bytes = if is_cells {
            let positions: u64 = problem
                .bodies
                .iter()
                .map(|body| body.poses[0].len() as u64 * 12)
                .sum();
            let corners = problem.n_elements() as u64 * 16;
            positions + corners + stats.n_entries * (KEPT + ENTRY) + stats.n_candidates * CANDIDATE
        } else {
            stats.n_clusters * (CLUSTER + BOX)
                + stats.n_work_items * ITEM
                + stats.n_candidates * CANDIDATE
        };
        let n_launches = if is_cells { 17.0 } else { 12.0 };
        bytes as f64 / self.bytes_per_ms + n_launches * self.launch_ms
    }
}

/// The time of the fastest of several runs, in milliseconds, from submission to idle.
fn fastest(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    encode: impl Fn(&mut wgpu::CommandEncoder),
) -> Result<f64, Failure> {
    let mut best = f64::INFINITY;
    for _ in 0..5 {
        let mut encoder = device.create_command_encoder(&Default::default());
        encode(&mut encoder);
        let start = Instant::now();
        queue.submit([encoder.finish()]);
        device.poll(wgpu::PollType::wait_indefinitely())?;
        best = best.min(start.elapsed().as_secs_f64() * 1e3);
    }
    Ok(best)
}

/// Bytes read and written per millisecond by a kernel that copies, without the time of the
/// submission. Copies that the driver makes may be several times slower.
fn bandwidth(device: &wgpu::Device, queue: &wgpu::Queue) -> Result<f64, Failure> {
    // More than caches hold, and no more than one binding may.
    const BYTES: u64 = 128 << 20;
    const MORE: u32 = 16;
    let buffer = || {
        device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: BYTES,
            usage: wgpu::BufferUsages::STORAGE,
            mapped_at_creation: false,
        })
    };
    let kernel = Kernel::new(
        device,
        "@group(0) @binding(0) var<storage, read_write> input: array<vec4<u32>>;
         @group(0) @binding(1) var<storage, read_write> written: array<vec4<u32>>;
         @compute @workgroup_size(256)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) { written[id.x] = input[id.x]; }",
        &[buffer(), buffer()],
    );
    // One invocation for 16 bytes.
    let n_groups = (BYTES / 16 / 256) as u32;
    let copies = |n: u32| fastest(device, queue, |encoder| kernel.run(encoder, n_groups, n));
    let ms = copies(1 + MORE)? - copies(1)?;
    Ok((2 * BYTES * u64::from(MORE)) as f64 / ms.max(1e-6))
}

/// A kernel with its buffers.
struct Kernel {
    pipeline: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
}

impl Kernel {
    fn new(device: &wgpu::Device, text: &str, buffers: &[wgpu::Buffer]) -> Self {
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: None,
            source: wgpu::ShaderSource::Wgsl(text.into()),
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: None,
            layout: None,
            module: &module,
            entry_point: None,
            compilation_options: Default::default(),
            cache: None,
        });
        let entries = (0..).zip(buffers);
        let entries: Vec<_> = entries
            .map(|(binding, buffer)| wgpu::BindGroupEntry {
                binding,
                resource: buffer.as_entire_binding(),
            })
            .collect();
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        });
        Kernel { pipeline, group }
    }

    /// `n` launches, one after the other.
    fn run(&self, encoder: &mut wgpu::CommandEncoder, n_groups: u32, n: u32) {
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.group, &[]);
        for _ in 0..n {
            pass.dispatch_workgroups(n_groups, 1, 1);
        }
    }
}

/// Milliseconds per dependent launch.
fn launch(device: &wgpu::Device, queue: &wgpu::Queue) -> Result<f64, Failure> {
    const N: u32 = 256;
    let counters = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: None,
        contents: &[0; 256],
        usage: wgpu::BufferUsages::STORAGE,
    });
    let kernel = Kernel::new(
        device,
        "@group(0) @binding(0) var<storage, read_write> n: array<u32>;
         @compute @workgroup_size(64)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) { n[id.x] += 1u; }",
        &[counters],
    );
    let launches = |n: u32| fastest(device, queue, |encoder| kernel.run(encoder, 1, n));
    Ok((launches(1 + N)? - launches(1)?).max(0.0) / f64::from(N))
}
