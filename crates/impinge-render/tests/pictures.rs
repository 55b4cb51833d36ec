//! Pictures on the first adapter, and on the CPU, which must look alike. The tests fail if there is
//! no adapter; a software driver suffices.

use impinge::{Backend, Detector, Query, Scene};
use impinge_render::{
    Camera, Colors, Error, Face, Image, Normals, Picture, Projection, Renderer, Surface, UpAxis,
};
use impinge_scenes::{Model, solids::solid_ball, surfaces};

const RED: [u8; 3] = [215, 38, 61];
const BLUE: [u8; 3] = [27, 95, 217];
const GREY: [u8; 3] = [200, 200, 200];

fn renderer() -> Renderer {
    Renderer::new().expect("a GPU or a software driver is needed")
}

/// The picture by the device, which the CPU draws alike.
#[track_caller]
fn render(picture: &Picture) -> Image {
    let image = renderer().render(picture).unwrap();
    let by_cpu = picture.draw().unwrap();
    let n_pixels = image.pixels().len();
    // Samples at the edges of faces are rounded differently.
    let n_alike = n_pixels - n_differing(&image, &by_cpu, 6);
    assert!(
        n_alike * 200 >= n_pixels * 199,
        "{n_alike} of {n_pixels} are alike"
    );
    image
}

/// Looks along -z at a triangle or more; y is up.
fn front() -> Camera {
    Camera {
        azimuth: 0.0,
        elevation: 0.0,
        up: UpAxis::Y,
        projection: Projection::Orthographic,
    }
}

/// Only faces and light on a black background.
fn plain(surfaces: Vec<Surface>, size: [u32; 2]) -> Picture {
    Picture {
        surfaces,
        focus: None,
        camera: front(),
        size,
        see_through: 0.0,
        occlusion: 0.0,
        background: [[0; 3]; 2],
    }
}

fn triangle(points: [[f64; 3]; 3], color: [u8; 3]) -> Surface {
    Surface {
        positions: points.to_vec(),
        faces: vec![Face {
            corners: [0, 1, 2],
            color,
            shows_through: false,
        }],
        normals: Normals::Flat,
    }
}

fn at(image: &Image, x: u32, y: u32) -> [u8; 3] {
    let [r, g, b, a] = image.pixels()[(y * image.width() + x) as usize];
    assert_eq!(a, 255);
    [r, g, b]
}

#[track_caller]
fn assert_near(found: [u8; 3], expected: [u8; 3]) {
    let is_near = found.iter().zip(expected).all(|(a, b)| a.abs_diff(b) <= 20);
    assert!(is_near, "{found:?}, expected about {expected:?}");
}

fn is_red([r, g, b, _]: [u8; 4]) -> bool {
    r > 120 && u32::from(r) > 2 * u32::from(g.max(b))
}

fn is_blue([r, g, b, _]: [u8; 4]) -> bool {
    b > 120 && u32::from(b) > 3 * u32::from(r) && b > g
}

fn count(image: &Image, wanted: impl Fn([u8; 4]) -> bool) -> usize {
    image
        .pixels()
        .iter()
        .filter(|pixel| wanted(**pixel))
        .count()
}

#[test]
fn a_triangle_covers_its_pixels_and_no_others() {
    // Half a square: the camera fits 93 % of the height, pixels 3.5 to 96.5 of 100.
    let surface = triangle([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]], RED);
    for flipped in [false, true] {
        let mut surface = surface.clone();
        if flipped {
            // Both sides look the same.
            surface.faces[0].corners = [0, 2, 1];
        }
        let image = render(&plain(vec![surface], [100, 100]));
        assert_eq!((image.width(), image.height()), (100, 100));
        for y in 0..100 {
            for x in 0..100 {
                let (right, up) = (f64::from(x) + 0.5 - 3.5, 99.5 - f64::from(y) - 3.5);
                let inside = right.min(up).min(93.0 - right - up);
                if inside > 1.0 {
                    assert_near(at(&image, x, y), RED);
                } else if inside < -1.0 {
                    assert_eq!(at(&image, x, y), [0; 3], "{x} {y}");
                }
            }
        }
    }
}

#[test]
fn the_nearer_face_hides_the_other_whatever_their_order() {
    let corners = [[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]];
    let at_depth = |z: f64, color| triangle(corners.map(|[x, y]| [x, y, z]), color);
    for (red_z, blue_z, expected) in [(0.1, 0.0, RED), (0.0, 0.1, BLUE)] {
        let (red, blue) = (at_depth(red_z, RED), at_depth(blue_z, BLUE));
        for surfaces in [vec![red.clone(), blue.clone()], vec![blue, red]] {
            let image = render(&plain(surfaces, [64, 64]));
            assert_near(at(&image, 20, 44), expected);
        }
    }
}

#[test]
fn a_face_that_shows_through_wins_against_one_in_the_same_place() {
    // The same plane with other corners: depths are rounded differently.
    let grey = triangle(
        [[-1.0, -1.5, 0.1], [5.0, -1.0, 3.7], [-1.2, 6.0, 1.5]],
        GREY,
    );
    let mut red = triangle([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], RED);
    let [a, b, c] = [0, 1, 2].map(|k| grey.positions[k]);
    let inside =
        |u: f64, v: f64| std::array::from_fn(|k| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]));
    red.positions = vec![inside(0.1, 0.1), inside(0.7, 0.15), inside(0.2, 0.6)];
    red.faces[0].shows_through = true;
    let mut over = red.clone();
    over.positions.iter_mut().for_each(|point| point[2] += 0.01);
    let n_red = |surfaces: [&Surface; 2]| {
        let picture = plain(surfaces.map(Surface::clone).to_vec(), [200, 200]);
        count(&render(&picture), is_red)
    };
    let expected = n_red([&grey, &over]);
    assert!(expected > 1_000);
    for surfaces in [[&grey, &red], [&red, &grey]] {
        assert!(n_red(surfaces).abs_diff(expected) < expected / 50);
    }
}

#[test]
fn a_hidden_face_that_shows_through_is_seen_as_far_as_asked() {
    let near = triangle([[0.0, 0.0, 1.0], [4.0, 0.0, 1.0], [0.0, 4.0, 1.0]], GREY);
    let mut far = triangle([[0.5, 0.5, 0.0], [1.5, 0.5, 0.0], [0.5, 1.5, 0.0]], RED);
    far.faces[0].shows_through = true;
    let mut redness = Vec::new();
    for see_through in [0.0, 0.3, 1.0] {
        let picture = Picture {
            see_through,
            ..plain(vec![near.clone(), far.clone()], [64, 64])
        };
        let image = render(&picture);
        let [r, g, _] = at(&image, 16, 47);
        redness.push(i32::from(r) - i32::from(g));
        // The rest stays as it is.
        assert_near(at(&image, 32, 58), GREY);
    }
    assert!(redness[0].abs() < 5, "{redness:?}");
    assert!((20..120).contains(&redness[1]), "{redness:?}");
    assert!(redness[2] > 150, "{redness:?}");
}

#[test]
fn the_viewer_stands_where_the_angles_say() {
    // A small square at the end of each axis; the one that faces the viewer is in the middle of the
    // picture.
    let axes: [([f64; 3], [u8; 3]); 3] = [
        ([1.0, 0.0, 0.0], RED),
        ([0.0, 1.0, 0.0], [40, 160, 40]),
        ([0.0, 0.0, 1.0], BLUE),
    ];
    let surfaces: Vec<Surface> = axes
        .iter()
        .flat_map(|&(axis, color)| {
            // In front, and dark behind the origin.
            [(1.0, color), (-1.0, [20, 20, 20])].map(|(sign, color)| {
                let middle = axis.map(|x| sign * x);
                let [x, y, z] = axis;
                let (u, v) = ([y, z, x], [z, x, y]);
                let corner = |a: f64, b: f64| {
                    std::array::from_fn(|k| middle[k] + 0.3 * (a * u[k] + b * v[k]))
                };
                triangle(
                    [corner(-2.0, -1.0), corner(2.0, -1.0), corner(0.0, 2.0)],
                    color,
                )
            })
        })
        .collect();
    for (up, azimuth, elevation, expected) in [
        (UpAxis::Y, 0.0, 0.0, BLUE),
        (UpAxis::Y, 90.0, 0.0, RED),
        (UpAxis::Y, 0.0, 90.0, [40, 160, 40]),
        (UpAxis::Z, 90.0, 0.0, RED),
        (UpAxis::Z, 180.0, 0.0, [40, 160, 40]),
        (UpAxis::Z, 0.0, 90.0, BLUE),
    ] {
        for projection in [
            Projection::Orthographic,
            Projection::Perspective { degrees: 30.0 },
        ] {
            let mut picture = plain(surfaces.clone(), [60, 60]);
            picture.camera = Camera {
                azimuth,
                elevation,
                up,
                projection,
            };
            let image = render(&picture);
            assert_near(at(&image, 30, 30), expected);
        }
    }
}

#[test]
fn everything_is_in_the_picture_and_fills_it() {
    let ball = |offset: [f64; 3]| {
        let model = surfaces::ball(500);
        let mut scene = Scene::new();
        let id = model.add_to(&mut scene).unwrap();
        let colors = Colors {
            colliding: RED,
            other: RED,
        };
        let mut surface = Surface::of_body(scene.body(id).unwrap(), &[], colors).unwrap();
        for point in &mut surface.positions {
            *point = std::array::from_fn(|k| 1e6 * (point[k] + offset[k]) + 1e9);
        }
        surface
    };
    for projection in [
        Projection::Orthographic,
        Projection::Perspective { degrees: 20.0 },
        Projection::Perspective { degrees: 80.0 },
    ] {
        for size in [[200, 100], [100, 200]] {
            let mut picture = plain(vec![ball([0.0; 3]), ball([3.0, 1.0, 5.0])], size);
            picture.camera = Camera {
                azimuth: 30.0,
                elevation: 40.0,
                up: UpAxis::Z,
                projection,
            };
            let image = render(&picture);
            let [width, height] = size;
            let covered = |x: u32, y: u32| at(&image, x, y) != [0; 3];
            let (mut first, mut last) = ([u32::MAX; 2], [0; 2]);
            for y in 0..height {
                for x in 0..width {
                    if covered(x, y) {
                        first = [first[0].min(x), first[1].min(y)];
                        last = [last[0].max(x), last[1].max(y)];
                    }
                }
            }
            let margins = [0, 1].map(|k| (first[k], size[k] - 1 - last[k]));
            assert!(margins.iter().all(|&(a, b)| a.min(b) >= 2), "{margins:?}");
            // One pair of edges is reached, within 5 % of the size.
            assert!(
                (0..2).any(|k| {
                    let (a, b) = margins[k];
                    a.max(b) <= size[k] / 20
                }),
                "{projection:?} {size:?} {margins:?}"
            );
        }
    }
}

fn colliding(models: [Model; 2]) -> Picture {
    let mut scene = Scene::new();
    let ids = models.map(|model| model.add_to(&mut scene).unwrap());
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    let pairs = detector
        .detect(&scene, &Query::between(ids[0], ids[1]))
        .unwrap();
    assert!(!pairs.is_empty());
    let surfaces = ids
        .iter()
        .zip([RED, BLUE])
        .map(|(&id, color)| {
            let colors = Colors {
                colliding: color,
                other: GREY,
            };
            Surface::of_body(scene.body(id).unwrap(), &pairs.colliding(id), colors).unwrap()
        })
        .collect();
    Picture {
        surfaces,
        size: [320, 240],
        camera: Camera {
            azimuth: 25.0,
            ..Camera::default()
        },
        ..Picture::default()
    }
}

#[test]
fn what_collides_is_red_and_blue() {
    let apart = [0.7, 0.25, -0.3];
    for models in [
        [
            surfaces::ball(2_000),
            surfaces::ball(2_000).translated(apart),
        ],
        [solid_ball(3_000), solid_ball(3_000).translated(apart)],
    ] {
        let mut picture = colliding(models);
        let image = render(&picture);
        assert!(count(&image, is_red) > 100, "{}", count(&image, is_red));
        assert!(count(&image, is_blue) > 100, "{}", count(&image, is_blue));
        for face in picture
            .surfaces
            .iter_mut()
            .flat_map(|surface| &mut surface.faces)
        {
            face.color = GREY;
        }
        let grey = render(&picture);
        assert_eq!((count(&grey, is_red), count(&grey, is_blue)), (0, 0));
    }
}

/// Pixels of which a channel differs by more than `allowed`.
fn n_differing(a: &Image, b: &Image, allowed: u8) -> usize {
    let differ = |(a, b): (&[u8; 4], &[u8; 4])| (0..4).any(|k| a[k].abs_diff(b[k]) > allowed);
    a.pixels()
        .iter()
        .zip(b.pixels())
        .filter(|&pair| differ(pair))
        .count()
}

#[test]
fn runs_and_chunks_change_no_byte_and_tiles_no_picture() {
    let mut picture = colliding([
        surfaces::ball(2_000),
        surfaces::bumpy_ball(3_000, 0.2).translated([0.9, 0.3, 0.2]),
    ]);
    let mut one = renderer();
    let image = one.render(&picture).unwrap();
    assert_eq!(image, one.render(&picture).unwrap());
    assert_eq!(image, render(&picture));
    for (tile, n_faces) in [(1536, 100), (1536, 1), (100, 100_000), (37, 700)] {
        let image_of_parts = renderer()
            .with_room(tile, n_faces)
            .render(&picture)
            .unwrap();
        // Pixels beside a seam may be rounded differently: drivers place faces relative to the
        // tile.
        let is_one_tile = tile >= picture.size[0];
        let allowed = if is_one_tile { 0 } else { 1 };
        assert!(
            n_differing(&image, &image_of_parts, allowed) == 0,
            "{tile} {n_faces}"
        );
        assert!(
            n_differing(&image, &image_of_parts, 0) < 50,
            "{tile} {n_faces}"
        );
    }
    // So it is on the CPU.
    let by_cpu = picture.draw().unwrap();
    assert_eq!(by_cpu, picture.draw().unwrap());
    for tile in [100, 37] {
        let of_parts = picture.draw_in_tiles(tile).unwrap();
        assert_eq!(n_differing(&by_cpu, &of_parts, 0), 0, "{tile}");
    }
    // Shows that the comparison can fail: another picture has other bytes.
    picture.camera.azimuth += 1.0;
    let other = one.render(&picture).unwrap();
    assert!(n_differing(&image, &other, 1) > 500);
}

#[test]
fn hollows_are_darker() {
    let floor = |x: f64| [x, 0.0, -1.0];
    let wall = |x: f64, y: f64| [x, y, -1.0];
    let quad = |corners: [[f64; 3]; 4]| Surface {
        positions: corners.to_vec(),
        faces: [[0, 1, 2], [0, 2, 3]]
            .map(|corners| Face {
                corners,
                color: GREY,
                shows_through: false,
            })
            .to_vec(),
        normals: Normals::Flat,
    };
    let surfaces = vec![
        quad([floor(-1.0), floor(1.0), [1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]]),
        quad([floor(-1.0), floor(1.0), wall(1.0, 1.0), wall(-1.0, 1.0)]),
    ];
    let mut picture = plain(surfaces, [200, 200]);
    picture.camera.elevation = 45.0;
    let flat = render(&picture);
    picture.occlusion = 1.0;
    let shaded = render(&picture);
    // The edge between floor and wall lies in the middle of the picture's height.
    let edge = (50..150).max_by_key(|&y| at(&flat, 100, y)[0].abs_diff(at(&shaded, 100, y)[0]));
    let edge = edge.unwrap();
    assert!(at(&shaded, 100, edge)[0] + 20 < at(&flat, 100, edge)[0]);
    assert_eq!(at(&shaded, 100, 180), at(&flat, 100, 180));
}

#[test]
fn an_empty_picture_is_its_background() {
    let picture = Picture {
        background: [[10, 20, 30]; 2],
        size: [7, 5],
        ..Picture::default()
    };
    let image = render(&picture);
    assert_eq!(image.pixels(), [[10, 20, 30, 255]; 35]);
    // A point and a needle are invisible and do no harm.
    let point = triangle([[1.0; 3]; 3], RED);
    let needle = triangle([[0.0; 3], [1e-300, 0.0, 0.0], [1e300, 0.0, 0.0]], RED);
    for surface in [point, needle] {
        for projection in [
            Projection::Orthographic,
            Projection::Perspective { degrees: 30.0 },
        ] {
            let mut picture = plain(vec![surface.clone()], [8, 8]);
            picture.camera.projection = projection;
            let image = render(&picture);
            assert!(image.pixels().iter().all(|p| *p == [0, 0, 0, 255]));
        }
    }
}

#[test]
fn bad_input_is_refused_by_name() {
    let mut renderer = renderer();
    let good = triangle([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], RED);
    let mut refused = |change: &dyn Fn(&mut Picture)| {
        let mut picture = plain(vec![good.clone(), good.clone()], [16, 16]);
        change(&mut picture);
        renderer.render(&picture).unwrap_err().to_string()
    };
    assert_eq!(
        refused(&|picture| picture.surfaces[1].positions[2][0] = f64::NAN),
        "surface 1: vertex 2 has a non-finite position (NaN, 1, 0)"
    );
    assert_eq!(
        refused(&|picture| picture.surfaces[1].faces[0].corners[1] = 3),
        "surface 1: face 0 names vertex 3, but there are 3 vertices"
    );
    for size in [[0, 16], [16, 0], [u32::MAX, 16], [16, u32::MAX]] {
        let text = refused(&|picture| picture.size = size);
        let begin = format!(
            "a picture of {} x {} pixels was requested",
            size[0], size[1]
        );
        assert!(text.starts_with(&begin), "{text}");
    }
    let text = refused(&|picture| picture.camera.elevation = 91.0);
    assert_eq!(text, "elevation: 91 given, -90 to 90 allowed");
    let text = refused(&|picture| picture.camera.azimuth = f64::INFINITY);
    assert_eq!(text, "azimuth: inf given, any finite angle allowed");
    let text = refused(&|picture| picture.see_through = -0.5);
    assert_eq!(text, "see_through: -0.5 given, 0 to 1 allowed");
    let text = refused(&|picture| {
        picture.camera.projection = Projection::Perspective { degrees: 0.0 };
    });
    assert_eq!(text, "angle of view: 0 given, above 0 to 120 allowed");
    // The renderer still works after the errors.
    renderer.render(&plain(vec![good], [16, 16])).unwrap();

    let error = Renderer::on_device_named("no such device").unwrap_err();
    assert!(matches!(error, Error::NoAdapter { .. }), "{error}");
    assert!(error.to_string().contains("no such device"), "{error}");

    let mut scene = Scene::new();
    let id = surfaces::ball(20).add_to(&mut scene).unwrap();
    let colors = Colors {
        colliding: RED,
        other: GREY,
    };
    let error = Surface::of_body(scene.body(id).unwrap(), &[20], colors).unwrap_err();
    let text = "element 20 collides, but the body has 20 elements";
    assert_eq!(error.to_string(), text);
}

#[test]
fn a_device_of_the_caller_draws_as_large_as_its_textures() {
    use impinge_render::wgpu;
    let descriptor = wgpu::InstanceDescriptor {
        flags: wgpu::InstanceFlags::empty(),
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    };
    let instance = wgpu::Instance::new(descriptor);
    let adapter = pollster::block_on(instance.request_adapter(&Default::default()))
        .expect("a GPU or a software driver is needed");
    let required_limits = wgpu::Limits::downlevel_defaults();
    assert_eq!(required_limits.max_texture_dimension_2d, 2048);
    let request = adapter.request_device(&wgpu::DeviceDescriptor {
        required_limits,
        ..Default::default()
    });
    let (device, queue) = pollster::block_on(request).unwrap();
    let mut renderer = Renderer::with_device(device, queue).unwrap();
    // Several tiles with their margins.
    let surface = triangle([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], RED);
    let mut picture = plain(vec![surface], [2048, 2048]);
    let image = renderer.render(&picture).unwrap();
    assert_near(at(&image, 500, 1500), RED);
    assert_near(at(&image, 1600, 1900), RED);
    assert_eq!(at(&image, 1600, 100), [0; 3]);
    picture.size = [2049, 10];
    let text = renderer.render(&picture).unwrap_err().to_string();
    assert_eq!(
        text,
        "a picture of 2049 x 10 pixels was requested, 1 x 1 to 2048 x 2048 is possible"
    );
}

#[test]
fn files_hold_the_pixels() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let surface = triangle([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], RED);
    let image = render(&plain(vec![surface], [50, 20]));
    image.write_png(&path).unwrap();
    let file = std::io::BufReader::new(std::fs::File::open(&path).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    assert_eq!(reader.info().size(), (50, 20));
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut bytes).unwrap();
    let expected: Vec<u8> = image
        .pixels()
        .iter()
        .flat_map(|p| [p[0], p[1], p[2]])
        .collect();
    assert_eq!(bytes, expected);
    let error = image.write_png(folder.path().join("no/a.png")).unwrap_err();
    assert!(error.to_string().contains("cannot write"), "{error}");
}
