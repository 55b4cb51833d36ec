//! A simulation that never leaves the GPU: a compute shader deforms a mesh, the detector finds the
//! pairs that intersect now and those that may touch on the way to the next pose, other shaders use
//! them. The host only submits; it reads back once, after the last frame.
//!
//! `cargo run --release --example gpu_resident --features gpu`

use impinge::wgpu::{self, util::DeviceExt};
use impinge::{Detector, Query, Scene, Settings};

const FRAMES: u32 = 60;
/// Frames before the clock counts.
const WARM: u32 = 10;

/// Moves every vertex of the rest pose by a travelling wave.
const DEFORM: &str = "
@group(0) @binding(0) var<storage, read> rest: array<f32>;
@group(0) @binding(1) var<storage, read_write> positions: array<f32>;
@group(0) @binding(2) var<uniform> time: vec4<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let word = 3u * id.x;
    if word >= arrayLength(&rest) {
        return;
    }
    let x = rest[word];
    positions[word] = x;
    positions[word + 1u] = rest[word + 1u] + 0.1 * sin(8.0 * x + time.x);
    positions[word + 2u] = rest[word + 2u] + 0.5 - 0.01 * time.x;
}
";

/// Marks the elements that take part in a pair. Unsure pairs count as pairs, which is safe. A
/// count above the room of its list says that pairs are missing: that frame marks nothing.
const MARK: &str = "
struct Pair { low: u32, high: u32 }
@group(0) @binding(0) var<storage, read> pairs: array<Pair>;
@group(0) @binding(1) var<storage, read> unsure: array<Pair>;
@group(0) @binding(2) var<storage, read> counts: array<u32>;
@group(0) @binding(3) var<storage, read_write> is_hit: array<u32>;
@group(0) @binding(4) var<uniform> offsets: vec4<u32>;

@compute @workgroup_size(64)
fn main(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) n_groups: vec3<u32>,
) {
    let n_pairs = counts[offsets.x];
    let n_unsure = counts[offsets.y];
    if n_pairs > arrayLength(&pairs) || n_unsure > arrayLength(&unsure) {
        return;
    }
    for (var ix = id.x; ix < n_pairs + n_unsure; ix += 64u * n_groups.x) {
        var pair: Pair;
        if ix < n_pairs {
            pair = pairs[ix];
        } else {
            pair = unsure[ix - n_pairs];
        }
        is_hit[pair.low] = 1u;
        is_hit[pair.high] = 1u;
    }
}
";

/// Counts the pairs of a step that may touch, by kind: vertices with faces, and edges with edges.
/// The third number becomes the time until which nothing touches, as bits; those of numbers from 0
/// to 1 are ordered as the numbers are. The fourth becomes the time by which something touches. If
/// pairs are missing, the count is above the room of the list, and the first times of all are 0.
const COUNT: &str = "
struct Pair { low: u32, high: u32 }
@group(0) @binding(0) var<storage, read> pairs: array<Pair>;
@group(0) @binding(1) var<storage, read> times: array<vec2<f32>>;
@group(0) @binding(2) var<storage, read> counts: array<u32>;
@group(0) @binding(3) var<storage, read_write> found: array<atomic<u32>, 4>;
@group(0) @binding(4) var<uniform> told: vec4<u32>;

@compute @workgroup_size(64)
fn main(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) n_groups: vec3<u32>,
) {
    let n = min(counts[told.x], arrayLength(&pairs));
    let first_vertex = told.y;
    if id.x == 0u {
        atomicStore(&found[3], counts[told.z]);
    }
    for (var ix = id.x; ix < n; ix += 64u * n_groups.x) {
        // Edges have the lowest numbers, faces the highest ones.
        let are_edges = pairs[ix].high < first_vertex;
        atomicAdd(&found[select(0u, 1u, are_edges)], 1u);
        atomicMin(&found[2], bitcast<u32>(times[ix].x));
    }
}
";

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let instance = wgpu::Instance::default();
    let adapter = pollster::block_on(instance.request_adapter(&Default::default()))?;
    let (device, queue) = pollster::block_on(adapter.request_device(&Default::default()))?;
    println!("on {}", adapter.get_info().name);

    // Two tori: one deforms on the device and sinks into the other, which does not move.
    let (faces, points) = torus(100);
    let mut scene = Scene::new();
    let moving = scene.add_triangles(&faces, &points)?;
    let resting = scene.add_triangles(&faces, &points)?;
    let query = Query::between(moving, resting);
    let mut detector = Detector::new(Settings::new().on_device(device.clone(), queue.clone()))?;
    let mut gpu = detector.gpu().expect("it has one");

    let words: Vec<u8> = points
        .iter()
        .flatten()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    let buffer = |label, contents: &[u8], usage| {
        device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some(label),
            contents,
            usage,
        })
    };
    use wgpu::BufferUsages as Usage;
    let rest = buffer("rest", &words, Usage::STORAGE);
    let positions = buffer("positions", &words, Usage::STORAGE | Usage::COPY_SRC);
    let before = buffer(
        "positions before",
        &words,
        Usage::COPY_SRC | Usage::COPY_DST,
    );
    let nothing = [0, 0, 1f32.to_bits(), 0].map(u32::to_le_bytes);
    let nothing = buffer("nothing", nothing.as_flattened(), Usage::COPY_SRC);
    let of_step = buffer(
        "pairs of a step",
        &[0; 16],
        Usage::STORAGE | Usage::COPY_SRC | Usage::COPY_DST,
    );
    let time = buffer("time", &[0; 16], Usage::UNIFORM | Usage::COPY_DST);
    let n_elements = 2 * faces.len();
    let is_hit = buffer(
        "is hit",
        &vec![0; 4 * n_elements],
        Usage::STORAGE | Usage::COPY_SRC | Usage::COPY_DST,
    );
    let deform = pipeline(&device, DEFORM);
    let mark = pipeline(&device, MARK);
    let count = pipeline(&device, COUNT);
    let deform_group = group(&device, &deform, &[&rest, &positions, &time]);

    let mut start = std::time::Instant::now();
    for frame in 0..FRAMES {
        if frame == WARM {
            // The first frames compile kernels and make room.
            device.poll(wgpu::PollType::wait_indefinitely())?;
            start = std::time::Instant::now();
        }
        let now = frame as f32 * 0.5;
        queue.write_buffer(&time, 0, &now.to_le_bytes());
        let mut encoder = device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(&positions, 0, &before, 0, before.size());
        run(
            &mut encoder,
            &deform,
            &deform_group,
            points.len().div_ceil(64),
        );
        let found = gpu.encode(&scene, &query, &[(moving, &positions)], &mut encoder)?;
        let words = [found.n_pairs_offset / 4, found.n_unsure_offset / 4, 0, 0];
        let words: Vec<u8> = words
            .iter()
            .flat_map(|&word| (word as u32).to_le_bytes())
            .collect();
        let offsets = buffer("offsets", &words, Usage::UNIFORM);
        let buffers = [
            &found.pairs,
            &found.unsure,
            &found.counts,
            &is_hit,
            &offsets,
        ];
        encoder.clear_buffer(&is_hit, 0, None);
        run(&mut encoder, &mark, &group(&device, &mark, &buffers), 64);

        // What may touch on the way from the last pose to this one.
        let (starts, ends) = ([(moving, &before)], [(moving, &positions)]);
        let found = gpu.encode_step(&scene, &query, &starts, &ends, &mut encoder)?;
        let [n_pairs, touches_by] = [found.n_pairs_offset, found.touches_by_offset];
        let words = [
            n_pairs as u32 / 4,
            found.first_vertex,
            touches_by as u32 / 4,
            0,
        ];
        let words: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let told = buffer("told", &words, Usage::UNIFORM);
        let (pairs, times) = (&found.pairs, &found.times);
        let buffers = [pairs, times, &found.counts, &of_step, &told];
        encoder.copy_buffer_to_buffer(&nothing, 0, &of_step, 0, nothing.size());
        run(&mut encoder, &count, &group(&device, &count, &buffers), 64);
        queue.submit([encoder.finish()]);
    }

    // The only read-back: did everything fit, how many elements were hit in the last frame, and
    // how many pairs may have touched on the way to it?
    let is_complete = gpu.grow()?;
    let staging = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("staging"),
        size: is_hit.size() + of_step.size(),
        usage: Usage::MAP_READ | Usage::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&Default::default());
    encoder.copy_buffer_to_buffer(&is_hit, 0, &staging, 0, is_hit.size());
    encoder.copy_buffer_to_buffer(&of_step, 0, &staging, is_hit.size(), of_step.size());
    queue.submit([encoder.finish()]);
    staging.map_async(wgpu::MapMode::Read, .., |_| ());
    device.poll(wgpu::PollType::wait_indefinitely())?;
    let view = staging.get_mapped_range(..)?;
    let words = view
        .as_chunks::<4>()
        .0
        .iter()
        .map(|word| u32::from_le_bytes(*word));
    let words: Vec<u32> = words.collect();
    let (hit, may_touch) = words.split_at(n_elements);
    let n_hit: u32 = hit.iter().sum();
    let ms = start.elapsed().as_secs_f64() * 1e3 / f64::from(FRAMES - WARM);
    println!(
        "{n_hit} of {n_elements} triangles hit, complete: {is_complete}, {ms:.2} ms per frame"
    );
    println!(
        "on the way there {} pairs of a vertex and a face and {} pairs of edges may touch, none before t = {}, and one certainly before t = {}",
        may_touch[0],
        may_touch[1],
        f32::from_bits(may_touch[2]),
        f32::from_bits(may_touch[3])
    );
    Ok(())
}

/// Triangles and vertices of a torus around the z axis: `n` rings of `n` vertices.
fn torus(n: u32) -> (Vec<[u32; 3]>, Vec<[f32; 3]>) {
    let turn = |k: u32| std::f32::consts::TAU * k as f32 / n as f32;
    let vertex = |k: u32| {
        let (around, across) = (turn(k / n), turn(k % n));
        let radius = 0.35 + 0.15 * across.cos();
        [
            radius * around.cos(),
            radius * around.sin(),
            0.15 * across.sin(),
        ]
    };
    let square = |k: u32| {
        let corner = |i, j| (k / n + i) % n * n + (k + j) % n;
        let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
        [[a, b, c], [a, c, d]]
    };
    (
        (0..n * n).flat_map(square).collect(),
        (0..n * n).map(vertex).collect(),
    )
}

fn pipeline(device: &wgpu::Device, shader: &str) -> wgpu::ComputePipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(shader.into()),
    });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: Some("main"),
        compilation_options: Default::default(),
        cache: None,
    })
}

fn group(
    device: &wgpu::Device,
    pipeline: &wgpu::ComputePipeline,
    buffers: &[&wgpu::Buffer],
) -> wgpu::BindGroup {
    let entries: Vec<wgpu::BindGroupEntry<'_>> = (0..)
        .zip(buffers)
        .map(|(binding, buffer)| wgpu::BindGroupEntry {
            binding,
            resource: buffer.as_entire_binding(),
        })
        .collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &entries,
    })
}

fn run(
    encoder: &mut wgpu::CommandEncoder,
    pipeline: &wgpu::ComputePipeline,
    group: &wgpu::BindGroup,
    n_groups: usize,
) {
    let mut pass = encoder.begin_compute_pass(&Default::default());
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, group, &[]);
    pass.dispatch_workgroups(n_groups as u32, 1, 1);
}
