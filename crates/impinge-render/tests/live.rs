//! Live views on the first adapter. The tests fail if there is none; a software driver suffices.

use impinge::{BodyId, Scene};
use impinge_render::{Camera, Colors, Error, Faces, Live, Look, Orbit, Projection, UpAxis, wgpu};

const SIZE: [u32; 2] = [64, 64];
const COLORS: Colors = Colors {
    colliding: [220, 30, 30],
    other: [120, 120, 120],
};
const BACKGROUND: [u8; 3] = [0, 0, 255];

/// A device for drawing, and its errors: the first one ends the test.
fn device() -> (wgpu::Device, wgpu::Queue) {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends: wgpu::Backends::PRIMARY,
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    });
    let adapter = pollster::block_on(instance.request_adapter(&Default::default()))
        .expect("a GPU or a software driver is needed");
    let (device, queue) =
        pollster::block_on(adapter.request_device(&Default::default())).expect("a device");
    (device, queue)
}

struct Stage {
    device: wgpu::Device,
    queue: wgpu::Queue,
    live: Live,
    look: Look,
    camera: Camera,
}

impl Stage {
    fn new(samples: u32) -> Self {
        let (device, queue) = device();
        let format = wgpu::TextureFormat::Rgba8Unorm;
        let live = Live::new(device.clone(), queue.clone(), format, samples).expect("a renderer");
        Stage {
            device,
            queue,
            live,
            look: Look {
                background: BACKGROUND,
                line: [0, 255, 0],
                ..Look::default()
            },
            // Looks along -z at the square from (-1, -1) to (1, 1); y is up.
            camera: Camera {
                azimuth: 0.0,
                elevation: 0.0,
                up: UpAxis::Y,
                projection: Projection::Orthographic,
            },
        }
    }

    /// Adds triangles as one body.
    fn add(&mut self, triangles: &[[[f32; 3]; 3]]) -> usize {
        let faces: Vec<[u32; 3]> = (0u32..)
            .map(|ix| [3 * ix, 3 * ix + 1, 3 * ix + 2])
            .take(triangles.len())
            .collect();
        let mut scene = Scene::new();
        let id = scene
            .add_triangles(&faces, triangles.as_flattened())
            .expect("a body");
        self.add_body(&scene, id)
    }

    fn add_body(&mut self, scene: &Scene, id: BodyId) -> usize {
        let body = scene.body(id).expect("there");
        let number = self.live.add(Faces::of_body(body), COLORS).expect("room");
        self.live
            .set_positions(number, body.positions())
            .expect("as many as vertices");
        number
    }

    fn draw(&mut self) -> Vec<[u8; 4]> {
        let texture = self.device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d {
                width: SIZE[0],
                height: SIZE[1],
                depth_or_array_layers: 1,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba8Unorm,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let staging = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: u64::from(4 * SIZE[0] * SIZE[1]),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let orbit = Orbit {
            camera: self.camera,
            target: [0.0; 3],
            // Half the height of the view is then 1.
            distance: 4.0,
        };
        let mut encoder = self.device.create_command_encoder(&Default::default());
        let view = texture.create_view(&Default::default());
        self.live
            .encode(&mut encoder, &view, SIZE, &orbit, &self.look)
            .expect("drawn");
        encoder.copy_texture_to_buffer(
            texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &staging,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(4 * SIZE[0]),
                    rows_per_image: None,
                },
            },
            texture.size(),
        );
        self.queue.submit([encoder.finish()]);
        staging.map_async(wgpu::MapMode::Read, .., |mapped| mapped.expect("mapped"));
        self.device
            .poll(wgpu::PollType::wait_indefinitely())
            .expect("done");
        let bytes = staging.get_mapped_range(..).expect("mapped");
        let (pixels, _) = bytes.as_chunks();
        pixels.to_vec()
    }

    /// The pixel at a point of the square.
    fn at(&mut self, x: f32, y: f32) -> [u8; 3] {
        let pixels = self.draw();
        let column = ((x + 1.0) * 32.0) as usize;
        let row = ((1.0 - y) * 32.0) as usize;
        let [r, g, b, a] = pixels[row * 64 + column];
        assert_eq!(a, 255);
        [r, g, b]
    }
}

/// A triangle that covers the middle of the square, at a height above it.
fn triangle(z: f32) -> [[f32; 3]; 3] {
    [[-0.8, -0.8, z], [0.8, -0.8, z], [0.0, 0.8, z]]
}

fn is_grey([r, g, b]: [u8; 3]) -> bool {
    r == g && g == b && r > 60
}

fn is_red([r, g, b]: [u8; 3]) -> bool {
    r > 120 && g < 60 && b < 60
}

#[test]
fn a_body_covers_its_pixels_and_marks_change_their_color() {
    for samples in [1, 4] {
        let mut stage = Stage::new(samples);
        let body = stage.add(&[triangle(0.0)]);
        assert!(is_grey(stage.at(0.0, 0.0)), "{samples}");
        assert_eq!(stage.at(-0.9, 0.9), BACKGROUND);
        stage.live.mark(body, &[0]).expect("there");
        assert!(is_red(stage.at(0.0, 0.0)), "{samples}");
        stage.live.mark(body, &[]).expect("there");
        assert!(is_grey(stage.at(0.0, 0.0)), "{samples}");
    }
}

#[test]
fn hidden_marks_show_through_as_far_as_told() {
    let mut stage = Stage::new(1);
    let body = stage.add(&[triangle(0.0), triangle(0.5)]);
    stage.live.mark(body, &[0]).expect("there");
    stage.look.see_through = 0.0;
    let hidden = stage.at(0.0, 0.0);
    assert!(is_grey(hidden));
    stage.look.see_through = 0.35;
    let [r, g, _] = stage.at(0.0, 0.0);
    assert!(r > hidden[0] && g < hidden[1], "{hidden:?} {r} {g}");
    stage.look.see_through = 1.0;
    assert!(is_red(stage.at(0.0, 0.0)));
    // A mark in front hides nothing, and shows as it is.
    stage.look.see_through = 0.35;
    stage.live.mark(body, &[1]).expect("there");
    assert!(is_red(stage.at(0.0, 0.0)));
}

#[test]
fn only_marked_faces_are_drawn_on_request() {
    let mut stage = Stage::new(1);
    let body = stage.add(&[triangle(0.0), triangle(0.5)]);
    stage.look.only_marked = true;
    assert_eq!(stage.at(0.0, 0.0), BACKGROUND);
    stage.live.mark(body, &[0]).expect("there");
    assert!(is_red(stage.at(0.0, 0.0)));
    stage.look.faces = false;
    assert_eq!(stage.at(0.0, 0.0), BACKGROUND);
}

#[test]
fn positions_move_a_body_and_bounds_do_not() {
    let mut stage = Stage::new(1);
    let body = stage.add(&[triangle(0.0)]);
    let moved: Vec<[f32; 3]> = triangle(0.0).map(|[x, y, z]| [x + 10.0, y, z]).to_vec();
    stage
        .live
        .set_positions(body, &moved.into())
        .expect("three");
    assert_eq!(stage.at(0.0, 0.0), BACKGROUND);
    stage.live.set_bounds([[-50.0, -3.0, 0.0], [1.0, 7.0, 2.0]]);
    let back: Vec<[f64; 3]> = triangle(0.0).map(|point| point.map(f64::from)).to_vec();
    stage.live.set_positions(body, &back.into()).expect("three");
    assert!(is_grey(stage.at(0.0, 0.0)));
    assert_eq!(stage.at(-0.9, 0.9), BACKGROUND);
}

#[test]
fn positions_may_come_from_a_buffer_on_the_device() {
    let mut stage = Stage::new(1);
    let body = stage.add(&[triangle(0.0)]);
    stage.live.set_bounds([[-50.0, -3.0, 0.0], [1.1, 7.0, 2.0]]);
    let away: Vec<[f32; 3]> = triangle(0.0).map(|[x, y, z]| [x + 10.0, y, z]).to_vec();
    let here = triangle(0.0);
    stage
        .live
        .set_positions(body, &here.to_vec().into())
        .expect("three");
    let expected = stage.draw();
    stage.live.set_positions(body, &away.into()).expect("three");
    assert_eq!(stage.at(0.0, 0.0), BACKGROUND);
    let mut bytes = vec![0; 8];
    bytes.extend(here.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
    let buffer = |usage| {
        stage.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: bytes.len() as u64,
            usage: usage | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    };
    let (from, not_to_copy) = (
        buffer(wgpu::BufferUsages::COPY_SRC),
        buffer(wgpu::BufferUsages::STORAGE),
    );
    stage.queue.write_buffer(&from, 0, &bytes);
    let mut encoder = stage.device.create_command_encoder(&Default::default());
    let mut copy = |body, buffer, offset| {
        let copied = stage
            .live
            .copy_positions(&mut encoder, body, buffer, offset);
        copied.map_err(|error| error.to_string())
    };
    copy(body, &from, 8).expect("three");
    assert!(
        copy(body, &from, 12)
            .is_err_and(|text| text.contains("36 bytes of positions from byte 12"))
    );
    assert!(copy(body, &from, 6).is_err());
    assert!(copy(body, &not_to_copy, 8).is_err_and(|text| text.contains("COPY_SRC")));
    assert!(copy(body + 1, &from, 8).is_err());
    stage.queue.submit([encoder.finish()]);
    assert!(stage.draw() == expected);
    // Positions that the host sends are in place again.
    stage
        .live
        .set_positions(body, &here.to_vec().into())
        .expect("three");
    assert!(stage.draw() == expected);
    // So small that its inverse is beyond single precision.
    stage.live.set_bounds([[0.0; 3], [1e-44; 3]]);
    let mut encoder = stage.device.create_command_encoder(&Default::default());
    assert!(
        stage
            .live
            .copy_positions(&mut encoder, body, &from, 8)
            .is_err()
    );
}

#[test]
fn elements_may_have_colors_of_their_own() {
    let mut stage = Stage::new(1);
    let body = stage.add(&[triangle(0.0)]);
    stage
        .live
        .color(body, &[(0, [10, 200, 20])])
        .expect("there");
    let [r, g, b] = stage.at(0.0, 0.0);
    assert!(g > 120 && r < 60 && b < 60, "{r} {g} {b}");
    stage.live.color(body, &[]).expect("there");
    assert!(is_grey(stage.at(0.0, 0.0)));
}

#[test]
fn lines_are_as_wide_as_told_and_show_through() {
    let mut stage = Stage::new(1);
    stage.look.line_width = 6.0;
    let across = [[[-0.9, 0.0, 0.0], [0.9, 0.0, 0.0]]];
    stage.live.set_lines(&across).expect("room");
    let pixels = stage.draw();
    let is_line = |row: usize| pixels[row * 64 + 32][..3] == [0, 255, 0];
    let n_rows = (0..64).filter(|&row| is_line(row)).count();
    assert!((5..=7).contains(&n_rows), "{n_rows}");
    // In perspective, a segment that begins behind the viewer is cut off.
    stage.camera.projection = Projection::Perspective { degrees: 28.0 };
    let through_eye = [[[0.0, -0.2, 5.0], [0.0, 0.0, -5.0]]];
    stage.live.set_lines(&through_eye).expect("room");
    assert_eq!(stage.at(0.0, 0.0), [0, 255, 0]);
    assert_eq!(stage.at(0.0, 0.9), BACKGROUND);
    // Behind a face it is fainter.
    stage.add(&[triangle(0.5)]);
    stage.live.set_lines(&across).expect("room");
    let [r, g, b] = stage.at(0.0, 0.0);
    assert!(g > r && g > b && r > 20, "{r} {g} {b}");
}

#[test]
fn inner_faces_of_tetrahedra_are_drawn_where_a_tetrahedron_is_marked() {
    let mut stage = Stage::new(1);
    let mut scene = Scene::new();
    let positions = [
        [-0.8f32, -0.8, 0.0],
        [0.8, -0.8, 0.0],
        [0.0, 0.8, 0.0],
        [0.0, 0.0, 0.8],
        [0.0, 0.0, -0.8],
    ];
    let id = scene
        .add_tetrahedra(&[[0, 1, 2, 3], [0, 1, 2, 4]], &positions)
        .expect("a body");
    let body = stage.add_body(&scene, id);
    stage.look.only_marked = true;
    assert_eq!(stage.at(0.0, 0.0), BACKGROUND);
    stage.live.mark(body, &[1]).expect("there");
    // The nearest face of the marked tetrahedron is the inner one.
    assert!(is_red(stage.at(0.0, 0.0)));
    stage.look.only_marked = false;
    stage.look.see_through = 0.0;
    assert!(is_grey(stage.at(0.0, 0.1)));
}

#[test]
fn bad_requests_name_the_body_and_the_numbers() {
    let mut stage = Stage::new(1);
    let body = stage.add(&[triangle(0.0)]);
    let live = &mut stage.live;
    let text = |error: Result<(), Error>| error.expect_err("refused").to_string();
    assert_eq!(
        text(live.mark(body, &[1])),
        "element 1 collides, but the body has 1 elements"
    );
    assert_eq!(
        text(live.set_positions(body, &vec![[0.0f32; 3]; 4].into())),
        "body 0: 4 positions were given, it has 3 vertices"
    );
    assert_eq!(
        text(live.mark(5, &[])),
        "body 5 was named, but there are 1 bodies"
    );
    let format = wgpu::TextureFormat::Rgba8Unorm;
    let new = |format, samples| {
        Live::new(stage.device.clone(), stage.queue.clone(), format, samples).map(|_| ())
    };
    assert!(text(new(format, 2)).contains("samples per pixel: 2 given"));
    assert!(new(wgpu::TextureFormat::Rgba8UnormSrgb, 1).is_err());
    let texture = stage.device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d::default(),
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
        view_formats: &[],
    });
    let view = texture.create_view(&Default::default());
    let mut encoder = stage.device.create_command_encoder(&Default::default());
    let orbit = Orbit::around(Camera::default(), [[0.0; 3]; 2], 1.0);
    let look = Look::default();
    let drawn = stage
        .live
        .encode(&mut encoder, &view, [0, 7], &orbit, &look);
    assert!(text(drawn).contains("0 x 7 pixels"));
    // One pixel is enough.
    stage
        .live
        .encode(&mut encoder, &view, [1, 1], &orbit, &look)
        .expect("drawn");
}
