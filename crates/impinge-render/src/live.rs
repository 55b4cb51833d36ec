//! Bodies drawn again and again while they move.

mod pipelines;

use impinge::{Positions, wgpu};

use crate::body::Colors;
use crate::camera::Projection;
use crate::error::Error;
use crate::faces::Faces;

pub(crate) use pipelines::SHADERS;
use pipelines::{BodyUniform, DEPTH, N_STORAGE_BUFFERS, Pipelines, ViewUniform};

use crate::orbit::{Orbit, dot};

/// [`BodyUniform::place`] of positions that are in place.
const IN_PLACE: [f32; 4] = [0.0, 0.0, 0.0, 1.0];

/// What a live view shows, and in which colours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    /// Whether faces are drawn at all; lines always are.
    pub faces: bool,
    /// Whether only marked faces are drawn.
    pub only_marked: bool,
    /// How visible marked faces and lines are where other faces hide them, from 0 (not at all) to
    /// 1.
    pub see_through: f32,
    /// The width of lines in pixels.
    pub line_width: f32,
    /// The colour of lines, sRGB.
    pub line: [u8; 3],
    /// The colour of the background, sRGB.
    pub background: [u8; 3],
}

impl Default for Look {
    fn default() -> Self {
        Look {
            faces: true,
            only_marked: false,
            see_through: 0.35,
            line_width: 2.0,
            line: [20, 20, 20],
            background: [244, 246, 248],
        }
    }
}

/// Draws bodies into a texture of the caller's, on the caller's device.
///
/// It is for windows: faces go to the device once, and per frame only positions (12 bytes per
/// vertex) and one bit per face. Faces are flat. No call waits for the device, so it works in a
/// browser too. Errors of the device go to the caller's error scopes, or to the handler of the
/// device.
///
/// ```no_run
/// use impinge::{BodyId, Pairs, Scene};
/// use impinge_render::{Camera, Colors, Error, Faces, Live, Look, Orbit, wgpu};
/// # fn draw(device: wgpu::Device, queue: wgpu::Queue, target: &wgpu::TextureView, scene: &Scene, id: BodyId, pairs: &Pairs)
/// #     -> Result<(), Box<dyn std::error::Error>> {
/// let mut live = Live::new(device.clone(), queue.clone(), wgpu::TextureFormat::Rgba8Unorm, 4)?;
/// let body = scene.body(id)?;
/// let colors = Colors { colliding: [214, 39, 40], other: [200; 3] };
/// let number = live.add(Faces::of_body(body), colors)?;
/// // Each frame:
/// live.set_positions(number, body.positions())?;
/// live.mark(number, &pairs.colliding(id))?;
/// let orbit = Orbit::around(Camera::default(), [[-1.0; 3], [1.0; 3]], 1.5);
/// let mut encoder = device.create_command_encoder(&Default::default());
/// live.encode(&mut encoder, target, [1200, 800], &orbit, &Look::default())?;
/// queue.submit([encoder.finish()]);
/// # Ok(()) }
/// ```
#[derive(Debug)]
pub struct Live {
    device: wgpu::Device,
    queue: wgpu::Queue,
    format: wgpu::TextureFormat,
    samples: u32,
    pipelines: Pipelines,
    view: wgpu::Buffer,
    view_group: wgpu::BindGroup,
    bodies: Vec<BodyOnDevice>,
    lines: Lines,
    targets: Option<Targets>,
    middle: [f64; 3],
    half: f64,
    /// Positions on their way to the device.
    scratch: Vec<[f32; 3]>,
}

/// The buffers of a body.
#[derive(Debug)]
struct BodyOnDevice {
    faces: Faces,
    uniform: BodyUniform,
    uniform_buffer: wgpu::Buffer,
    positions: wgpu::Buffer,
    marks: wgpu::Buffer,
    /// The marks on the device.
    marked: Vec<u32>,
    colors: wgpu::Buffer,
    colored: Vec<u32>,
    group: wgpu::BindGroup,
    is_hidden: bool,
}

/// Segments, and how many of them the buffer holds.
#[derive(Debug)]
struct Lines {
    ends: wgpu::Buffer,
    group: wgpu::BindGroup,
    capacity: usize,
    n_segments: u32,
}

/// Textures as large as the caller's.
#[derive(Debug)]
struct Targets {
    size: [u32; 2],
    depth: wgpu::TextureView,
    /// With several samples per pixel.
    color: Option<wgpu::TextureView>,
}

impl Live {
    /// A renderer without bodies, for textures of one format. Colours are written as sRGB numbers,
    /// so the format must not convert them (`Rgba8Unorm`, not `Rgba8UnormSrgb`). `samples` per
    /// pixel are 1 or 4.
    ///
    /// # Errors
    /// Another number of samples; a format that converts; a device whose vertex shaders may read
    /// fewer than four buffers.
    pub fn new(
        device: wgpu::Device,
        queue: wgpu::Queue,
        format: wgpu::TextureFormat,
        samples: u32,
    ) -> Result<Self, Error> {
        if ![1, 4].contains(&samples) {
            return Err(Error::Setting {
                setting: "samples per pixel",
                given: f64::from(samples),
                allowed: "1 or 4",
            });
        }
        let offered = device.limits().max_storage_buffers_per_shader_stage;
        if format.is_srgb() {
            let what = format!("{format:?} converts colours, which are written as sRGB");
            return Err(Error::Gpu { what });
        }
        if offered < N_STORAGE_BUFFERS {
            let what = format!(
                "the device allows {offered} storage buffers per shader stage, {N_STORAGE_BUFFERS} are needed"
            );
            return Err(Error::Gpu { what });
        }
        let pipelines = Pipelines::new(&device, format, samples);
        let view = buffer(
            &device,
            "view",
            size_of::<ViewUniform>(),
            wgpu::BufferUsages::UNIFORM,
        );
        let view_group = group(&device, &pipelines.view_layout, &[&view]);
        let lines = Lines::new(&device, &pipelines, 0);
        Ok(Live {
            format,
            samples,
            pipelines,
            view,
            view_group,
            bodies: Vec::new(),
            lines,
            targets: None,
            middle: [0.0; 3],
            half: 1.0,
            scratch: Vec::new(),
            device,
            queue,
        })
    }

    /// Sets the box (lowest and highest coordinates) in which the bodies are, roughly. Positions
    /// are sent relative to it, so that a scene far from the origin, or of any size, keeps its
    /// shape in single precision. To be called before positions and lines are set.
    pub fn set_bounds(&mut self, [low, high]: [[f64; 3]; 2]) {
        let half = (0..3)
            .map(|k| 0.5 * high[k] - 0.5 * low[k])
            .fold(0.0, f64::max);
        self.half = if half > 0.0 && half.is_finite() {
            half
        } else {
            1.0
        };
        self.middle = std::array::from_fn(|k| {
            let middle = 0.5 * low[k] + 0.5 * high[k];
            // Where single precision suffices, so that the device can subtract the same number.
            let narrow = f64::from(middle as f32);
            match (narrow - middle).abs() <= self.half {
                true => narrow,
                false => middle,
            }
        });
    }

    fn place(&self, point: [f64; 3]) -> [f32; 3] {
        std::array::from_fn(|k| ((point[k] - self.middle[k]) / self.half) as f32)
    }

    /// Adds a body; returns its number, counted from 0. Its vertices are at 0 until positions are
    /// set.
    ///
    /// # Errors
    /// A body that is too large for the device's buffers.
    pub fn add(&mut self, faces: Faces, colors: Colors) -> Result<usize, Error> {
        let n_faces = faces.len();
        let usage = wgpu::BufferUsages::STORAGE;
        let limits = self.device.limits();
        let most = limits
            .max_storage_buffer_binding_size
            .min(limits.max_buffer_size);
        for (what, bytes) in [
            ("faces", 16 * n_faces),
            ("positions", 12 * faces.n_vertices()),
        ] {
            if bytes as u64 > most {
                let what =
                    format!("{what} take {bytes} bytes, the device allows {most} per buffer");
                return Err(Error::Gpu { what });
            }
        }
        // Vertices are numbered with 32 bits while they are drawn.
        if n_faces as u64 > u64::from(u32::MAX / 3) {
            let what = format!("{n_faces} faces, {} can be drawn", u32::MAX / 3);
            return Err(Error::Gpu { what });
        }
        let device = &self.device;
        let n_words = n_faces.div_ceil(32);
        let uniform_buffer = buffer(
            device,
            "body",
            size_of::<BodyUniform>(),
            wgpu::BufferUsages::UNIFORM,
        );
        let positions = buffer(device, "positions", 12 * faces.n_vertices(), usage);
        let corners = buffer(device, "faces", 16 * n_faces, usage);
        let marks = buffer(device, "marks", 4 * n_words, usage);
        let colors_buffer = buffer(device, "colors", 4 * n_faces, usage);
        self.queue
            .write_buffer(&corners, 0, bytemuck::cast_slice(faces.packed()));
        let group = group(
            device,
            &self.pipelines.body_layout,
            &[
                &uniform_buffer,
                &positions,
                &corners,
                &marks,
                &colors_buffer,
            ],
        );
        let body = BodyOnDevice {
            uniform: BodyUniform {
                other: srgb(colors.other),
                marked: srgb(colors.colliding),
                has_colors: [0; 4],
                place: IN_PLACE,
            },
            uniform_buffer,
            positions,
            marks,
            marked: vec![0; n_words],
            colors: colors_buffer,
            colored: Vec::new(),
            group,
            is_hidden: false,
            faces,
        };
        body.write_uniform(&self.queue);
        self.bodies.push(body);
        Ok(self.bodies.len() - 1)
    }

    /// Removes all bodies and lines.
    pub fn clear(&mut self) {
        self.bodies.clear();
        self.lines.n_segments = 0;
    }

    /// The faces of a body, or `None` if there is no such body.
    pub fn faces(&self, body: usize) -> Option<&Faces> {
        self.bodies.get(body).map(|body| &body.faces)
    }

    /// Hides a body, or shows it again.
    ///
    /// # Errors
    /// No such body.
    pub fn hide(&mut self, body: usize, is_hidden: bool) -> Result<(), Error> {
        self.body(body)?;
        self.bodies[body].is_hidden = is_hidden;
        Ok(())
    }

    /// Whether a body is hidden; one that does not exist is not.
    pub fn is_hidden(&self, body: usize) -> bool {
        self.bodies.get(body).is_some_and(|body| body.is_hidden)
    }

    /// Sends the positions of a body's vertices.
    ///
    /// # Errors
    /// No such body; another number of positions than the body has vertices.
    pub fn set_positions(&mut self, body: usize, positions: &Positions) -> Result<(), Error> {
        let held = self.body(body)?;
        let expected = held.faces.n_vertices();
        if positions.len() != expected {
            return Err(Error::WrongNumberOfPositions {
                body,
                given: positions.len(),
                expected,
            });
        }
        let mut scratch = std::mem::take(&mut self.scratch);
        scratch.clear();
        let points = (0..positions.len()).map(|vertex| positions.point(vertex));
        scratch.extend(points.map(|point| self.place(point)));
        let queue = self.queue.clone();
        let held = self.body_mut(body)?;
        queue.write_buffer(&held.positions, 0, bytemuck::cast_slice(&scratch));
        held.set_place(&queue, IN_PLACE);
        self.scratch = scratch;
        Ok(())
    }

    /// Takes the positions of a body's vertices, `(v, 3)` f32 tightly packed, from a buffer of the
    /// same device with the usage `COPY_SRC`, from this byte on: such as that of the `positions` of
    /// a detector's `Gpu`. They are copied when the encoder's commands run.
    ///
    /// # Errors
    /// No such body; a buffer that ends before the last vertex or lacks its usage; an offset that
    /// is no multiple of 4; bounds so small or so far away that single precision does not have
    /// them: then use [`set_positions`](Live::set_positions).
    pub fn copy_positions(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        body: usize,
        buffer: &wgpu::Buffer,
        offset: u64,
    ) -> Result<(), Error> {
        let [x, y, z] = self.middle.map(|x| x as f32);
        let place = [x, y, z, (1.0 / self.half) as f32];
        let is_narrow = (0..3).all(|k| f64::from(place[k]) == self.middle[k]);
        let queue = self.queue.clone();
        let held = self.body_mut(body)?;
        let bytes = 12 * held.faces.n_vertices() as u64;
        let refused = |what: String| Err(Error::Gpu { what });
        if !is_narrow || !place[3].is_normal() {
            return refused("the bounds are beyond single precision".to_owned());
        }
        if !offset.is_multiple_of(4) || offset.saturating_add(bytes) > buffer.size() {
            let size = buffer.size();
            return refused(format!(
                "{bytes} bytes of positions from byte {offset} on, the buffer has {size}"
            ));
        }
        if !buffer.usage().contains(wgpu::BufferUsages::COPY_SRC) {
            return refused("the buffer of the positions lacks the usage COPY_SRC".to_owned());
        }
        if bytes > 0 {
            encoder.copy_buffer_to_buffer(buffer, offset, &held.positions, 0, bytes);
        }
        held.set_place(&queue, place);
        Ok(())
    }

    /// Marks the faces of these elements and of no others: they get the colliding colour, and
    /// show through.
    ///
    /// # Errors
    /// No such body; an element that it does not have.
    pub fn mark(&mut self, body: usize, elements: &[u32]) -> Result<(), Error> {
        let faces = &self.body(body)?.faces;
        let mut words = vec![0u32; faces.len().div_ceil(32)];
        for &element in elements {
            check_element(faces, element)?;
            for face in faces.of_element(element) {
                words[face / 32] |= 1 << (face % 32);
            }
        }
        let queue = self.queue.clone();
        let held = self.body_mut(body)?;
        if held.marked != words {
            queue.write_buffer(&held.marks, 0, bytemuck::cast_slice(&words));
            held.marked = words;
        }
        Ok(())
    }

    /// Gives the faces of these elements colours of their own (sRGB), and takes those of all
    /// others away.
    ///
    /// # Errors
    /// No such body; an element that it does not have.
    pub fn color(&mut self, body: usize, colors: &[(u32, [u8; 3])]) -> Result<(), Error> {
        let faces = &self.body(body)?.faces;
        let mut words = Vec::new();
        if !colors.is_empty() {
            words.resize(faces.len(), 0u32);
        }
        for &(element, [r, g, b]) in colors {
            check_element(faces, element)?;
            for face in faces.of_element(element) {
                words[face] = u32::from_le_bytes([r, g, b, 255]);
            }
        }
        let queue = self.queue.clone();
        let held = self.body_mut(body)?;
        if held.colored != words {
            if !words.is_empty() {
                queue.write_buffer(&held.colors, 0, bytemuck::cast_slice(&words));
            }
            held.uniform.has_colors[0] = u32::from(!words.is_empty());
            held.write_uniform(&queue);
            held.colored = words;
        }
        Ok(())
    }

    /// Draws these segments, and no others from now on.
    ///
    /// # Errors
    /// More segments than fit in a buffer of the device.
    pub fn set_lines(&mut self, segments: &[[[f64; 3]; 2]]) -> Result<(), Error> {
        let limits = self.device.limits();
        let most = limits
            .max_storage_buffer_binding_size
            .min(limits.max_buffer_size);
        if segments.len() as u64 * 32 > most {
            let what = format!("{} segments, {} can be drawn", segments.len(), most / 32);
            return Err(Error::Gpu { what });
        }
        if segments.len() > self.lines.capacity {
            let capacity = segments.len().next_power_of_two().min((most / 32) as usize);
            self.lines = Lines::new(&self.device, &self.pipelines, capacity);
        }
        let ends: Vec<[f32; 4]> = segments
            .iter()
            .flatten()
            .map(|&point| {
                let [x, y, z] = self.place(point);
                [x, y, z, 0.0]
            })
            .collect();
        self.lines.n_segments = (ends.len() / 2) as u32;
        self.queue
            .write_buffer(&self.lines.ends, 0, bytemuck::cast_slice(&ends));
        Ok(())
    }

    /// Adds the commands that draw everything over the whole target, a view of a texture of the
    /// renderer's format and of `size` pixels. The caller submits them before the next call.
    ///
    /// # Errors
    /// A size of 0 or beyond the device's textures; a camera with a setting out of its range.
    pub fn encode(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        target: &wgpu::TextureView,
        size: [u32; 2],
        orbit: &Orbit,
        look: &Look,
    ) -> Result<(), Error> {
        let most = self.device.limits().max_texture_dimension_2d;
        if size[0].min(size[1]) == 0 || size[0].max(size[1]) > most {
            return Err(Error::Size {
                given: size,
                allowed: format!("1 x 1 to {most} x {most}"),
            });
        }
        orbit.camera.check()?;
        if !(orbit.distance > 0.0 && orbit.distance.is_finite()) {
            return Err(Error::Setting {
                setting: "distance",
                given: orbit.distance,
                allowed: "any finite number above 0",
            });
        }
        let uniform = self.uniform(size, orbit, look);
        self.queue
            .write_buffer(&self.view, 0, bytemuck::bytes_of(&uniform));
        if self.targets.as_ref().is_none_or(|held| held.size != size) {
            // Drop the old textures first: both may not fit in memory.
            self.targets = None;
            self.targets = Some(Targets::new(&self.device, self.format, self.samples, size));
        }
        let Some(targets) = &self.targets else {
            return Ok(());
        };
        let [r, g, b] = look.background.map(|x| f64::from(x) / 255.0);
        let (view, resolve_target) = match &targets.color {
            Some(color) => (color, Some(target)),
            None => (target, None),
        };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("live"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a: 1.0 }),
                    store: match resolve_target {
                        Some(_) => wgpu::StoreOp::Discard,
                        None => wgpu::StoreOp::Store,
                    },
                },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &targets.depth,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(0.0),
                    store: wgpu::StoreOp::Discard,
                }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.set_bind_group(0, &self.view_group, &[]);
        if look.faces {
            self.draw_faces(&mut pass, &self.pipelines.faces, false);
            if look.see_through > 0.0 {
                self.draw_faces(&mut pass, &self.pipelines.hidden_faces, true);
            }
        }
        if self.lines.n_segments > 0 {
            pass.set_bind_group(1, &self.lines.group, &[]);
            for pipeline in [&self.pipelines.hidden_lines, &self.pipelines.lines] {
                pass.set_pipeline(pipeline);
                pass.draw(0..6 * self.lines.n_segments, 0..1);
            }
        }
        Ok(())
    }

    fn draw_faces(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        pipeline: &wgpu::RenderPipeline,
        only_with_marks: bool,
    ) {
        pass.set_pipeline(pipeline);
        for body in &self.bodies {
            let has_marks = || body.marked.iter().any(|&word| word != 0);
            if body.is_hidden || body.faces.is_empty() || only_with_marks && !has_marks() {
                continue;
            }
            pass.set_bind_group(1, &body.group, &[]);
            pass.draw(0..3 * body.faces.len() as u32, 0..1);
        }
    }

    fn uniform(&self, size: [u32; 2], orbit: &Orbit, look: &Look) -> ViewUniform {
        let aspect = f64::from(size[0]) / f64::from(size[1]);
        let target: [f64; 3] =
            std::array::from_fn(|k| (orbit.target[k] - self.middle[k]) / self.half);
        let distance = orbit.distance / self.half;
        let axes = orbit.axes();
        let [right, up, back] = axes.map(|axis| {
            let [x, y, z] = axis.map(|x| x as f32);
            [x, y, z, -dot(axis, target) as f32]
        });
        let [wide, high] = orbit.visible(aspect).map(|x| x / orbit.distance);
        let is_perspective = matches!(orbit.camera.projection, Projection::Perspective { .. });
        let projection = match is_perspective {
            // Depth is the near plane's distance divided by the point's.
            true => [1.0 / wide, 1.0 / high, 0.0, 2e-3 * distance],
            false => {
                let range = 2.0 * (4.0 * distance + 10.0);
                [
                    1.0 / (wide * distance),
                    1.0 / (high * distance),
                    1.0 / range,
                    0.5 + distance / range,
                ]
            }
        };
        let sky = orbit.camera.axes().sky;
        let [x, y, z] = axes.map(|axis| dot(axis, sky) as f32);
        let [r, g, b, _] = srgb(look.line);
        let back = [back[0], back[1], back[2], back[3] - distance as f32];
        ViewUniform {
            right,
            up,
            back,
            projection: projection.map(|x| x as f32),
            sky: [x, y, z, if is_perspective { 1.0 } else { 0.0 }],
            screen: [
                size[0] as f32,
                size[1] as f32,
                look.line_width,
                look.see_through,
            ],
            line: [r, g, b, 1.0],
            only_marked: [u32::from(look.only_marked), 0, 0, 0],
        }
    }

    fn body(&self, body: usize) -> Result<&BodyOnDevice, Error> {
        let n_bodies = self.bodies.len();
        self.bodies
            .get(body)
            .ok_or(Error::NoSuchBody { body, n_bodies })
    }

    fn body_mut(&mut self, body: usize) -> Result<&mut BodyOnDevice, Error> {
        let n_bodies = self.bodies.len();
        self.bodies
            .get_mut(body)
            .ok_or(Error::NoSuchBody { body, n_bodies })
    }
}

impl BodyOnDevice {
    fn set_place(&mut self, queue: &wgpu::Queue, place: [f32; 4]) {
        if self.uniform.place != place {
            self.uniform.place = place;
            self.write_uniform(queue);
        }
    }

    fn write_uniform(&self, queue: &wgpu::Queue) {
        queue.write_buffer(&self.uniform_buffer, 0, bytemuck::bytes_of(&self.uniform));
    }
}

impl Lines {
    fn new(device: &wgpu::Device, pipelines: &Pipelines, capacity: usize) -> Self {
        let ends = buffer(device, "lines", 32 * capacity, wgpu::BufferUsages::STORAGE);
        Lines {
            group: group(device, &pipelines.lines_layout, &[&ends]),
            ends,
            capacity,
            n_segments: 0,
        }
    }
}

impl Targets {
    fn new(
        device: &wgpu::Device,
        format: wgpu::TextureFormat,
        samples: u32,
        [width, height]: [u32; 2],
    ) -> Self {
        let texture = |label, format| {
            device
                .create_texture(&wgpu::TextureDescriptor {
                    label: Some(label),
                    size: wgpu::Extent3d {
                        width,
                        height,
                        depth_or_array_layers: 1,
                    },
                    mip_level_count: 1,
                    sample_count: samples,
                    dimension: wgpu::TextureDimension::D2,
                    format,
                    usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
                    view_formats: &[],
                })
                .create_view(&wgpu::TextureViewDescriptor::default())
        };
        Targets {
            size: [width, height],
            depth: texture("depth", DEPTH),
            color: (samples > 1).then(|| texture("color", format)),
        }
    }
}

fn check_element(faces: &Faces, element: u32) -> Result<(), Error> {
    let n_elements = faces.n_elements();
    match (element as usize) < n_elements {
        true => Ok(()),
        false => Err(Error::ElementOutOfRange {
            element,
            n_elements,
        }),
    }
}

/// A buffer that the host writes; never empty, because an empty one cannot be bound.
fn buffer(
    device: &wgpu::Device,
    label: &str,
    bytes: usize,
    usage: wgpu::BufferUsages,
) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: (bytes as u64).max(32),
        usage: usage | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

fn group(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    buffers: &[&wgpu::Buffer],
) -> wgpu::BindGroup {
    let entries: Vec<wgpu::BindGroupEntry> = (0u32..)
        .zip(buffers)
        .map(|(binding, buffer)| wgpu::BindGroupEntry {
            binding,
            resource: buffer.as_entire_binding(),
        })
        .collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout,
        entries: &entries,
    })
}

fn srgb([r, g, b]: [u8; 3]) -> [f32; 4] {
    [r, g, b, 255].map(|x| f32::from(x) / 255.0)
}
