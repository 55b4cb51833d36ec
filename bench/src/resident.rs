//! What stays on a GPU: pairs of a frame, pairs of a step that may touch, and how far vertices may
//! move with wished positions cut to that. Positions are on the device, and nothing is read back.
//!
//! Two times a frame: `alone`, when the host waits for each frame, and `in a row`, when it submits
//! all frames and waits once. Beside them the same question on the CPU, answered in memory.

use std::time::Instant;

use impinge::wgpu::{self, util::DeviceExt};
use impinge::{Backend, BodyId, Detector, Gpu, Query, Scene, Settings};
use serde_json::json;

use crate::gpu::{self, median};
use crate::report::{Report, figures, grouped};
use crate::{Failure, Options, files, surfaces};

/// Frames before the clock counts.
const N_WARM: usize = 4;
/// How far vertices of the cloth may move at most, as a part of the longest side of its box.
const MOST: f64 = 1e-3;

/// Encodes a frame of this number.
trait Encode: Fn(usize, &mut Gpu<'_>, &mut wgpu::CommandEncoder) -> Result<(), impinge::Error> {}

impl<F> Encode for F where
    F: Fn(usize, &mut Gpu<'_>, &mut wgpu::CommandEncoder) -> Result<(), impinge::Error>
{
}

/// A device, as a solver would own it.
struct Caller {
    device: wgpu::Device,
    queue: wgpu::Queue,
}

impl Caller {
    fn new(options: &Options) -> Result<Self, Failure> {
        let adapter = gpu::adapter(&gpu::device(options)?)?;
        let (device, queue) = pollster::block_on(adapter.request_device(&Default::default()))?;
        Ok(Caller { device, queue })
    }

    fn detector(&self) -> Result<Detector, Failure> {
        let (device, queue) = (self.device.clone(), self.queue.clone());
        Ok(Detector::new(Settings::new().on_device(device, queue))?)
    }

    fn positions(&self, positions: &[[f32; 3]]) -> wgpu::Buffer {
        use wgpu::BufferUsages as Usage;
        let floats = positions.as_flattened().iter();
        let bytes: Vec<u8> = floats.flat_map(|x| x.to_le_bytes()).collect();
        self.device
            .create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: None,
                contents: &bytes,
                usage: Usage::STORAGE | Usage::COPY_SRC | Usage::COPY_DST,
            })
    }

    fn wait(&self) -> Result<(), Failure> {
        self.device.poll(wgpu::PollType::wait_indefinitely())?;
        Ok(())
    }

    /// Encodes a frame and submits it.
    fn submit(&self, frame: usize, gpu: &mut Gpu<'_>, encode: &impl Encode) -> Result<(), Failure> {
        let mut encoder = self.device.create_command_encoder(&Default::default());
        encode(frame, gpu, &mut encoder)?;
        self.queue.submit([encoder.finish()]);
        Ok(())
    }

    /// Milliseconds per frame of a new detector, once all lists have room: alone, and in a row.
    fn measure(&self, n_frames: usize, encode: impl Encode) -> Result<[f64; 2], Failure> {
        let mut detector = self.detector()?;
        let mut gpu = detector.gpu().ok_or("the detector has no device")?;
        for frame in 0.. {
            self.submit(frame, &mut gpu, &encode)?;
            if gpu.grow()? && frame >= N_WARM {
                break;
            }
        }
        let mut alone = Vec::new();
        for frame in 0..n_frames {
            let start = Instant::now();
            self.submit(frame, &mut gpu, &encode)?;
            self.wait()?;
            alone.push(start.elapsed().as_secs_f64() * 1e3);
        }
        let start = Instant::now();
        for frame in 0..n_frames {
            self.submit(frame, &mut gpu, &encode)?;
        }
        self.wait()?;
        let in_a_row = start.elapsed().as_secs_f64() * 1e3 / n_frames as f64;
        Ok([median(alone.into_iter()), in_a_row])
    }
}

/// The median of the CPU's frames, in milliseconds.
fn on_cpu(
    n_frames: usize,
    mut ask: impl FnMut(usize, &mut Detector) -> Result<(), Failure>,
) -> Result<f64, Failure> {
    let mut detector = Detector::new(Backend::Cpu)?;
    let mut all = Vec::new();
    for frame in 0..N_WARM + n_frames {
        let start = Instant::now();
        ask(frame, &mut detector)?;
        if frame >= N_WARM {
            all.push(start.elapsed().as_secs_f64() * 1e3);
        }
    }
    Ok(median(all.into_iter()))
}

/// All questions.
pub fn run(options: &Options, report: &mut Report) -> Result<(), Failure> {
    report.say(&format!(
        "{}. `alone`: the host waits for each frame. `in a row`: it submits all and waits once. `CPU`: the same question there, all threads; for a step, its exact impacts. \
         Medians, milliseconds.\n",
        gpu::device(options)?
    ));
    let [opened, first] = start_up(options)?;
    report.say(&format!(
        "The first detector opens the device in {} ms; its first frame, which compiles kernels, takes {} ms.\n",
        figures(opened),
        figures(first)
    ));
    report.keep_json(json!({ "open_ms": opened, "first_frame_ms": first }));
    report.say(
        "| scene | question | elements | alone | in a row | CPU |\n|---|---|---:|---:|---:|---:|",
    );
    let caller = Caller::new(options)?;
    for scene in ["ball", "bunny", "buddha", "dragon"] {
        frames(scene, options, &caller, report)?;
    }
    cloth(options, &caller, report)
}

/// Milliseconds until a detector on the device is there, and until it has answered a small frame.
fn start_up(options: &Options) -> Result<[f64; 2], Failure> {
    let (scene, _, query) = files::two_body("ball")?.scene()?;
    let settings = Settings::new()
        .backend(Backend::Gpu)
        .device(options.device.clone());
    let start = Instant::now();
    let mut detector = Detector::new(settings)?;
    let opened = start.elapsed().as_secs_f64() * 1e3;
    detector.detect(&scene, &query)?;
    Ok([opened, start.elapsed().as_secs_f64() * 1e3 - opened])
}

fn row(
    report: &mut Report,
    scene: &str,
    question: &str,
    n: usize,
    [alone, in_a_row]: [f64; 2],
    cpu: f64,
) {
    report.say(&format!(
        "| {scene} | {question} | {} | {} | {} | {} |",
        grouped(n as u64),
        figures(alone),
        figures(in_a_row),
        figures(cpu)
    ));
    report.keep_json(json!({
        "scene": scene, "question": question, "elements": n,
        "alone_ms": alone, "in_a_row_ms": in_a_row, "cpu_ms": cpu,
    }));
}

/// Intersections of two bodies.
fn frames(
    name: &str,
    options: &Options,
    caller: &Caller,
    report: &mut Report,
) -> Result<(), Failure> {
    let problem = files::two_body(name)?;
    let n_frames = options.frames.unwrap_or(40).max(1);
    let (mut scene, ids, query) = problem.scene()?;
    let poses: Vec<Vec<wgpu::Buffer>> = problem
        .bodies
        .iter()
        .map(|body| {
            body.poses
                .iter()
                .map(|pose| caller.positions(pose))
                .collect()
        })
        .collect();
    let encode = |frame: usize, gpu: &mut Gpu<'_>, encoder: &mut wgpu::CommandEncoder| {
        let at = |(&id, poses): (&BodyId, &'_ Vec<wgpu::Buffer>)| {
            (id, poses[frame % problem.n_poses()].clone())
        };
        let positions: Vec<_> = ids.iter().zip(&poses).map(at).collect();
        let positions: Vec<_> = positions.iter().map(|(id, buffer)| (*id, buffer)).collect();
        gpu.encode(&scene, &query, &positions, encoder)?;
        Ok(())
    };
    let times = caller.measure(n_frames, encode)?;
    let cpu = on_cpu(n_frames, |frame, detector| {
        for (&id, body) in ids.iter().zip(&problem.bodies) {
            let pose = &body.poses[frame % problem.n_poses()];
            scene.positions_mut::<f32>(id)?.copy_from_slice(pose);
        }
        detector.detect(&scene, &query)?;
        Ok(())
    })?;
    row(report, name, "pairs", problem.n_elements(), times, cpu);
    Ok(())
}

/// A step of cloth: what may touch, and the loop of a solver that moves vertices by safe distances.
fn cloth(options: &Options, caller: &Caller, report: &mut Report) -> Result<(), Failure> {
    let read = |frame: u32| {
        let (faces, at) = surfaces::read(&format!("ccd/cloth-ball/frames/cloth_ball{frame}.ply"))?;
        match at {
            impinge_io::Positions::F32(at) => Ok::<_, Failure>((faces, at)),
            _ => Err("not in single precision".into()),
        }
    };
    let ((faces, start), (_, end)) = (read(92)?, read(93)?);
    let n_frames = options.frames.unwrap_or(40).max(1);
    let sides = [0, 1, 2].map(|k| {
        let along = || start.iter().map(|p| p[k]);
        f64::from(along().fold(f32::MIN, f32::max) - along().fold(f32::MAX, f32::min))
    });
    let most = MOST * sides.into_iter().fold(0.0, f64::max);
    let mut scene = Scene::new();
    let n_faces = faces.len();
    let body = scene.add((faces, start.clone()))?;
    scene.set_end_positions(body, &end)?;
    let query = Query::all();
    let [starts, wished, ends] = [&start, &end, &end].map(|at| caller.positions(at));

    let step = |_: usize, gpu: &mut Gpu<'_>, encoder: &mut wgpu::CommandEncoder| {
        gpu.encode_step(
            &scene,
            &query,
            &[(body, &starts)],
            &[(body, &ends)],
            encoder,
        )?;
        Ok(())
    };
    let times = caller.measure(n_frames, step)?;
    let cpu = on_cpu(n_frames, |_, detector| {
        scene.set_end_positions(body, &end)?;
        detector.impacts(&scene, &query)?;
        Ok(())
    })?;
    row(
        report,
        "cloth-ball",
        "pairs of a step that may touch",
        n_faces,
        times,
        cpu,
    );

    let truncated = |_: usize, gpu: &mut Gpu<'_>, encoder: &mut wgpu::CommandEncoder| {
        encoder.copy_buffer_to_buffer(&wished, 0, &ends, 0, wished.size());
        let safe = gpu.encode_safe_distances(&scene, most, &query, &[(body, &starts)], encoder)?;
        gpu.encode_truncate(&scene, &safe, &[(body, &starts)], &[(body, &ends)], encoder)
    };
    let times = caller.measure(n_frames, truncated)?;
    let cpu = on_cpu(n_frames, |_, detector| {
        scene.set_positions(body, &start)?;
        detector.safe_distances(&scene, most, &query)?;
        Ok(())
    })?;
    let question = format!("safe distances to {}, wishes cut", figures(most));
    row(report, "cloth-ball", &question, n_faces, times, cpu);
    Ok(())
}
