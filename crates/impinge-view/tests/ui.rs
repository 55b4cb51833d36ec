//! The app on a software driver, without a display. The tests fail if there is no adapter.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use eframe::egui::{Key, Modifiers, Pos2, UiBuilder};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};
use egui_kittest::wgpu::{WgpuTestRenderer, create_render_state, default_wgpu_setup};
use egui_wgpu::wgpu::PollType;
use egui_wgpu::{RenderState, RendererOptions};
use impinge::{Backend, BodyId, Detector, Positions, Query, Scene, SharedVertex};
use impinge_io::Sequence;
use impinge_render::{Colors, Focus};
use impinge_scenes::surfaces::ball;
use impinge_view::{Command, Content, Count, Frames, Options, Shown, Shows, Viewer};

const SIZE: [f32; 2] = [900.0, 800.0];
const COLORS: [Colors; 2] = [
    Colors {
        colliding: [214, 39, 40],
        other: [200; 3],
    },
    Colors {
        colliding: [27, 95, 217],
        other: [172, 178, 188],
    },
];

fn shown(scene: &Scene) -> Vec<Shown> {
    let names = ["first", "second"];
    scene
        .bodies()
        .zip(names)
        .zip(COLORS)
        .map(|(((id, _), name), colors)| Shown {
            id,
            name: name.to_owned(),
            colors,
            vertices: None,
        })
        .collect()
}

/// Two balls of about this many triangles; the second one is this far to the right.
fn balls(n_triangles: usize, offset: f32) -> (Scene, [BodyId; 2]) {
    let mut scene = Scene::new();
    let model = ball(n_triangles);
    let a = model.add_to(&mut scene).expect("a ball");
    let b = model.translated([offset, 0.125, 0.0]).add_to(&mut scene);
    (scene, [a, b.expect("a ball")])
}

/// The second ball comes from the right and goes away again; nothing collides in the first and the
/// last frames.
struct Passing {
    body: BodyId,
    rest: Vec<[f32; 3]>,
}

impl Passing {
    const N_FRAMES: usize = 12;
}

impl Frames for Passing {
    fn n_frames(&self) -> usize {
        Self::N_FRAMES
    }

    fn read(&self, frame_ix: usize) -> Result<Vec<(BodyId, Positions)>, String> {
        let offset = 3.0 - 0.5 * frame_ix as f32;
        let moved: Vec<[f32; 3]> = self
            .rest
            .iter()
            .map(|&[x, y, z]| [x + offset, y, z])
            .collect();
        Ok(vec![(self.body, moved.into())])
    }
}

fn passing() -> Content {
    let (scene, [_, body]) = balls(600, 0.0);
    let rest = match scene.body(body).expect("there").positions() {
        Positions::F32(rest) => rest.to_vec(),
        Positions::F64(_) => panic!("models are in single precision"),
    };
    Content {
        bodies: shown(&scene),
        scene,
        frames: Some(Arc::new(Passing { body, rest })),
        missing: None,
    }
}

fn still(n_triangles: usize, offset: f32) -> Content {
    let (scene, _) = balls(n_triangles, offset);
    Content {
        bodies: shown(&scene),
        scene,
        frames: None,
        missing: None,
    }
}

fn paused() -> Options {
    Options {
        plays: false,
        frame: Some(0),
        command: Command(vec!["impinge".to_owned(), "view".to_owned()]),
        ..Options::default()
    }
}

/// The app with what it loads.
fn open(
    load: impl FnOnce() -> Result<Content, String> + Send + 'static,
    options: Options,
) -> Harness<'static, Viewer> {
    let render = create_render_state(default_wgpu_setup(), RendererOptions::PREDICTABLE);
    open_on(render, load, options)
}

/// The same on a device of the test's own.
fn open_on(
    render: RenderState,
    load: impl FnOnce() -> Result<Content, String> + Send + 'static,
    options: Options,
) -> Harness<'static, Viewer> {
    let viewer = Viewer::new(Some(render.clone()), load, options);
    let mut harness = Harness::builder()
        .with_size(SIZE)
        .with_theme(eframe::egui::Theme::Light)
        .renderer(WgpuTestRenderer::from_render_state(render))
        .build_ui_state(
            |ui, viewer: &mut Viewer| {
                // Like a window: without the margin that the harness leaves.
                let all = ui.ctx().viewport_rect();
                ui.set_clip_rect(all);
                ui.scope_builder(UiBuilder::new().max_rect(all), |ui| viewer.show(ui));
            },
            viewer,
        );
    wait(&mut harness, |viewer| !viewer.is_loading());
    harness.step();
    harness
}

fn open_content(content: Content) -> Harness<'static, Viewer> {
    open(|| Ok(content), paused())
}

/// Steps until a condition holds, for at most a minute.
#[track_caller]
fn wait(harness: &mut Harness<'static, Viewer>, done: impl Fn(&Viewer) -> bool) {
    let started = Instant::now();
    while !done(harness.state()) {
        assert!(
            started.elapsed() < Duration::from_secs(60),
            "it takes too long"
        );
        std::thread::sleep(Duration::from_millis(5));
        harness.step();
    }
}

fn is_counted(viewer: &Viewer) -> bool {
    !viewer.counts().contains(&Count::Pending)
}

fn press(harness: &mut Harness<'static, Viewer>, key: Key) {
    harness.key_press(key);
    harness.run_steps(2);
}

fn click(harness: &mut Harness<'static, Viewer>, label: &str) {
    harness.get_by_label(label).click();
    harness.run_steps(2);
}

/// The middle of the part of the window that shows bodies.
fn middle(has_timeline: bool) -> Pos2 {
    let below = if has_timeline { 104.0 } else { 0.0 };
    Pos2::new((SIZE[0] - 252.0) / 2.0, (SIZE[1] - below) / 2.0)
}

fn drag(harness: &mut Harness<'static, Viewer>, from: Pos2, by: [f32; 2]) {
    harness.hover_at(from);
    harness.step();
    harness.drag_at(from);
    harness.step();
    for part in 1..=4 {
        let part = part as f32 / 4.0;
        harness.hover_at(Pos2::new(from.x + part * by[0], from.y + part * by[1]));
        harness.step();
    }
    harness.drop_at(Pos2::new(from.x + by[0], from.y + by[1]));
    harness.run_steps(2);
}

/// The pairs that the library finds in each frame.
fn expected(content: &Content) -> Vec<(u64, u64)> {
    let mut detector = Detector::new(Backend::Cpu).expect("a detector");
    let mut scene = content.scene.clone();
    let query = Query::between_all().shared_vertex(SharedVertex::Resolve);
    let frames = content.frames.clone().expect("it moves");
    (0..frames.n_frames())
        .map(|frame_ix| {
            for (id, positions) in frames.read(frame_ix).expect("a frame") {
                scene.set_positions(id, positions).expect("accepted");
            }
            let pairs = detector.detect(&scene, &query).expect("an answer");
            (pairs.len() as u64, pairs.hash())
        })
        .collect()
}

#[test]
fn the_answer_is_that_of_the_library() {
    let content = still(600, 0.5);
    let mut detector = Detector::new(Backend::Cpu).expect("a detector");
    let pairs = detector
        .detect(&content.scene, &Query::between_all())
        .expect("an answer");
    let (n, hash) = (pairs.len(), pairs.hash());
    assert!(n > 0);
    let harness = open_content(content);
    assert_eq!(harness.state().n_pairs(), Some(n));
    assert_eq!(harness.state().hash(), Some(hash));
    harness.get_by_label(&format!("{n} pairs"));
    harness.get_by_label(&format!("hash {hash:016x}"));
}

#[test]
fn a_drag_moves_a_body_and_changes_the_pairs_and_undo_brings_them_back() {
    let mut harness = open_content(still(600, 0.5));
    let (before, hash) = (harness.state().n_pairs(), harness.state().hash());
    drag(&mut harness, middle(false), [0.0, -120.0]);
    assert_eq!(harness.state().message(), None);
    assert_ne!(harness.state().hash(), hash);
    let moved = harness.state().hash();
    // Far away, nothing collides.
    drag(
        &mut harness,
        Pos2::new(middle(false).x, middle(false).y - 120.0),
        [0.0, -500.0],
    );
    assert_eq!(harness.state().n_pairs(), Some(0));
    harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    harness.run_steps(2);
    assert_eq!(harness.state().hash(), moved);
    click(&mut harness, "Put bodies back");
    assert_eq!(harness.state().n_pairs(), before);
    assert_eq!(harness.state().hash(), hash);
}

#[test]
fn a_drag_beside_the_bodies_turns_the_view_and_leaves_the_pairs() {
    let mut harness = open_content(still(600, 0.5));
    let (camera, hash) = (harness.state().camera(), harness.state().hash());
    drag(&mut harness, Pos2::new(15.0, 780.0), [200.0, 0.0]);
    assert_ne!(harness.state().camera(), camera);
    assert_eq!(harness.state().hash(), hash);
}

#[test]
fn a_click_names_a_triangle_and_its_partners() {
    let mut content = still(600, 0.5);
    // As in a file with other vertices before those of each body, and between them.
    let number = |body: usize, vertex: u32| 1000 * (body as u32 + 1) + 2 * vertex;
    let scene = content.scene.clone();
    for (ix, (shown, (_, body))) in content.bodies.iter_mut().zip(scene.bodies()).enumerate() {
        let all = 0..body.n_vertices() as u32;
        shown.vertices = Some(all.map(|vertex| number(ix, vertex)).collect());
    }
    let mut harness = open_content(content);
    assert_eq!(harness.state().selected(), None);
    for pressed in [true, false] {
        harness.hover_at(middle(false));
        harness.event(eframe::egui::Event::PointerButton {
            pos: middle(false),
            button: eframe::egui::PointerButton::Primary,
            pressed,
            modifiers: Modifiers::NONE,
        });
    }
    harness.run_steps(2);
    let (body, element) = harness.state().selected().expect("a triangle is there");
    let name = ["first", "second"][body];
    let (_, held) = scene.bodies().nth(body).expect("a body");
    let corners = held.elements().corners(element as usize);
    let corners: Vec<String> = corners
        .iter()
        .map(|&vertex| number(body, vertex).to_string())
        .collect();
    let text = format!(
        "triangle {element} of {name} (body {body})\nvertices {}\n",
        corners.join(", ")
    );
    let found = harness.query_all_by_label_contains(&text).count();
    assert_eq!(found, 1, "{text}");
    look(&mut harness, "selected");
    press(&mut harness, Key::Period);
    press(&mut harness, Key::Escape);
    assert_eq!(harness.state().selected(), None);
}

#[test]
fn switches_change_how_the_answer_is_found_and_not_the_answer() {
    let mut harness = open_content(still(600, 0.5));
    let hash = harness.state().hash();
    let mut ways = vec![harness.state().how().map(str::to_owned)];
    for label in ["cells", "GPU", "clusters", "CPU", "naive"] {
        click(&mut harness, label);
        assert_eq!(harness.state().message(), None, "{label}");
        assert_eq!(harness.state().hash(), hash, "{label}");
        let how = harness.state().how().map(str::to_owned);
        assert!(!ways.contains(&how), "{label}: {how:?} again");
        ways.push(how);
        if label == "clusters" {
            // Back on the CPU it is what it was in the beginning.
            ways.retain(|way| way.as_deref() != Some("clusters on cpu"));
        }
    }
}

#[test]
fn self_collision_and_neighbours_change_the_answer_as_the_library_says() {
    // A strip that is folded onto itself: neighbours overlap.
    let mut scene = Scene::new();
    let positions = [
        [0.0f32, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.5, 0.25, 0.0],
    ];
    scene
        .add_triangles(&[[0, 1, 2], [0, 1, 3]], &positions)
        .expect("a body");
    let mut detector = Detector::new(Backend::Cpu).expect("a detector");
    let mut count = |rule| {
        let query = Query::all().shared_vertex(rule);
        detector.detect(&scene, &query).expect("an answer").len()
    };
    let (resolved, skipped) = (count(SharedVertex::Resolve), count(SharedVertex::Skip));
    assert_eq!((resolved, skipped), (1, 0));
    let content = Content {
        bodies: shown(&scene),
        scene: scene.clone(),
        frames: None,
        missing: None,
    };
    let mut harness = open_content(content);
    // One body alone is asked for itself.
    assert_eq!(harness.state().n_pairs(), Some(resolved));
    click(&mut harness, "skip");
    assert_eq!(harness.state().n_pairs(), Some(skipped));
    click(&mut harness, "resolve");
    assert_eq!(harness.state().n_pairs(), Some(resolved));
    click(&mut harness, "Self-collision");
    assert_eq!(harness.state().n_pairs(), Some(0));
}

#[test]
fn the_timeline_counts_what_the_library_finds_and_keys_jump_along_it() {
    let content = passing();
    let expected = expected(&content);
    let mut harness = open_content(content);
    wait(&mut harness, is_counted);
    let counts: Vec<Count> = expected.iter().map(|&(n, _)| Count::Pairs(n)).collect();
    assert_eq!(harness.state().counts(), counts);
    let colliding: Vec<usize> = (0..expected.len())
        .filter(|&ix| expected[ix].0 > 0)
        .collect();
    let (first, last) = (colliding[0], colliding[colliding.len() - 1]);
    assert!(first > 0 && last + 1 < expected.len() && last > first);

    press(&mut harness, Key::B);
    assert_eq!(harness.state().frame(), Some(first));
    assert_eq!(harness.state().hash(), Some(expected[first].1));
    press(&mut harness, Key::N);
    assert_eq!(harness.state().frame(), Some(colliding[1]));
    press(&mut harness, Key::I);
    press(&mut harness, Key::F);
    fly(&mut harness);
    look(&mut harness, "timeline");
    press(&mut harness, Key::P);
    assert_eq!(harness.state().frame(), Some(first));
    press(&mut harness, Key::P);
    assert_eq!(harness.state().frame(), Some(first));
    assert!(
        harness
            .state()
            .message()
            .is_some_and(|text| text.contains("no such frame"))
    );
    press(&mut harness, Key::End);
    assert_eq!(harness.state().frame(), Some(expected.len() - 1));
    press(&mut harness, Key::ArrowLeft);
    assert_eq!(harness.state().frame(), Some(expected.len() - 2));
    press(&mut harness, Key::ArrowRight);
    press(&mut harness, Key::ArrowRight);
    assert_eq!(harness.state().frame(), Some(expected.len() - 1));
    press(&mut harness, Key::Home);
    assert_eq!(harness.state().frame(), Some(0));
    click(&mut harness, "First collision");
    assert_eq!(harness.state().frame(), Some(first));
}

#[test]
fn space_plays_and_pauses() {
    let mut harness = open_content(passing());
    press(&mut harness, Key::Space);
    wait(&mut harness, |viewer| viewer.frame() > Some(1));
    press(&mut harness, Key::Space);
    let frame = harness.state().frame();
    std::thread::sleep(Duration::from_millis(120));
    harness.run_steps(3);
    assert_eq!(harness.state().frame(), frame);
}

#[test]
fn a_moved_body_is_counted_where_it_is() {
    let mut harness = open_content(passing());
    wait(&mut harness, is_counted);
    let before = harness.state().counts().to_vec();
    press(&mut harness, Key::B);
    press(&mut harness, Key::F);
    fly(&mut harness);
    drag(&mut harness, middle(true), [0.0, -500.0]);
    wait(&mut harness, is_counted);
    assert_ne!(harness.state().counts(), before);
    click(&mut harness, "Put bodies back");
    wait(&mut harness, |viewer| viewer.counts() == before);
}

#[test]
fn the_earliest_impacts_are_those_of_the_library() {
    let content = passing();
    let frames = content.frames.clone().expect("it moves");
    let mut scene = content.scene.clone();
    let mut detector = Detector::new(Backend::Cpu).expect("a detector");
    let mut expected = Vec::new();
    for frame_ix in 0..frames.n_frames() - 1 {
        let [(id, start), (_, end)] =
            [frame_ix, frame_ix + 1].map(|ix| frames.read(ix).expect("a frame").remove(0));
        let (Positions::F32(start), Positions::F32(end)) = (start, end) else {
            panic!("single precision");
        };
        scene.set_positions(id, &start).expect("accepted");
        scene.set_end_positions(id, &end).expect("accepted");
        let step = Query::between_all();
        let first = detector.earliest(&scene, &step).expect("an answer");
        expected.push(Some(first.map(|impact| impact.toi)));
    }
    assert!(
        expected
            .iter()
            .flatten()
            .flatten()
            .any(|&toi| toi > 0.0 && toi < 1.0)
    );
    let mut harness = open_content(content);
    click(&mut harness, "Earliest impacts");
    wait(&mut harness, |viewer| {
        !viewer.earliest().is_empty() && viewer.earliest().iter().all(Option::is_some)
    });
    assert_eq!(harness.state().earliest(), expected);
}

#[test]
fn a_sequence_from_files_gives_the_same_counts() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("run.pc2");
    let content = passing();
    let frames = content.frames.clone().expect("it moves");
    write_pc2(&file, &*frames);
    let expected: Vec<Count> = expected(&content)
        .into_iter()
        .map(|(n, _)| Count::Pairs(n))
        .collect();
    struct Read(Sequence, BodyId);
    impl Frames for Read {
        fn n_frames(&self) -> usize {
            self.0.n_frames()
        }
        fn read(&self, frame_ix: usize) -> Result<Vec<(BodyId, Positions)>, String> {
            let positions = self.0.frame(frame_ix).map_err(|error| error.to_string())?;
            Ok(vec![(
                self.1,
                match positions {
                    impinge_io::Positions::F32(positions) => positions.into(),
                    impinge_io::Positions::F64(positions) => positions.into(),
                },
            )])
        }
    }
    let (_, id) = (content.bodies[0].id, content.bodies[1].id);
    let sequence = Sequence::open(&file).expect("a sequence");
    let content = Content {
        frames: Some(Arc::new(Read(sequence, id))),
        missing: None,
        ..content
    };
    let mut harness = open_content(content);
    wait(&mut harness, is_counted);
    assert_eq!(harness.state().counts(), expected);
}

fn write_pc2(path: &Path, frames: &dyn Frames) {
    let mut bytes = b"POINTCACHE2\0".to_vec();
    let (_, first) = frames.read(0).expect("a frame").remove(0);
    bytes.extend(1i32.to_le_bytes());
    bytes.extend((first.len() as i32).to_le_bytes());
    bytes.extend(0f32.to_le_bytes());
    bytes.extend(1f32.to_le_bytes());
    bytes.extend((frames.n_frames() as i32).to_le_bytes());
    for frame_ix in 0..frames.n_frames() {
        let (_, positions) = frames.read(frame_ix).expect("a frame").remove(0);
        for vertex in 0..positions.len() {
            for x in positions.point(vertex) {
                bytes.extend((x as f32).to_le_bytes());
            }
        }
    }
    std::fs::write(path, bytes).expect("written");
}

#[test]
fn what_cannot_be_read_is_a_message() {
    let harness = open(|| Err("a.obj: line 3: not a number".to_owned()), paused());
    assert_eq!(
        harness.state().message(),
        Some("a.obj: line 3: not a number")
    );
    harness.get_by_label("a.obj: line 3: not a number");
}

/// The third frame cannot be read, and the fourth is refused.
struct Broken(BodyId, Positions, AtomicUsize);

impl Frames for Broken {
    fn n_frames(&self) -> usize {
        5
    }

    fn read(&self, frame_ix: usize) -> Result<Vec<(BodyId, Positions)>, String> {
        self.2.fetch_add(1, Ordering::Relaxed);
        match frame_ix {
            2 => Err("run_2.obj: no such file".to_owned()),
            3 => Ok(vec![(self.0, vec![[f32::NAN; 3]; self.1.len()].into())]),
            _ => Ok(vec![(self.0, self.1.clone())]),
        }
    }
}

#[test]
fn bad_frames_are_messages_and_marks_on_the_timeline() {
    let (scene, [id, _]) = balls(100, 0.5);
    let positions = scene.body(id).expect("there").positions().clone();
    let content = Content {
        bodies: shown(&scene),
        scene,
        frames: Some(Arc::new(Broken(id, positions, AtomicUsize::new(0)))),
        missing: None,
    };
    let mut harness = open_content(content);
    wait(&mut harness, is_counted);
    let counts = harness.state().counts();
    assert_eq!(
        counts[2],
        Count::Failed("run_2.obj: no such file".to_owned())
    );
    assert!(
        matches!(&counts[3], Count::Failed(text) if text.contains("NaN")),
        "{:?}",
        counts[3]
    );
    assert!(matches!(counts[4], Count::Pairs(n) if n > 0));
    press(&mut harness, Key::ArrowRight);
    press(&mut harness, Key::ArrowRight);
    assert_eq!(harness.state().message(), Some("run_2.obj: no such file"));
    press(&mut harness, Key::End);
    assert_eq!(harness.state().message(), None);
    assert!(harness.state().n_pairs() > Some(0));
}

#[test]
fn what_could_not_be_loaded_stays_a_message_until_it_is_dismissed() {
    let (scene, [id, _]) = balls(100, 0.5);
    let positions = scene.body(id).expect("there").positions().clone();
    let content = Content {
        bodies: shown(&scene),
        scene,
        frames: Some(Arc::new(Broken(id, positions, AtomicUsize::new(0)))),
        missing: Some("b.obj: no such file".to_owned()),
    };
    // The frame that is shown first is bad, too.
    let options = Options {
        frame: Some(2),
        ..paused()
    };
    let mut harness = open(|| Ok(content), options);
    harness.get_by_label_contains("b.obj: no such file");
    harness.get_by_label_contains("run_2.obj: no such file");
    press(&mut harness, Key::End);
    assert_eq!(harness.state().message(), Some("b.obj: no such file"));
    harness.get_by_label("b.obj: no such file");
    click(&mut harness, "Dismiss");
    assert_eq!(harness.state().message(), None);
}

#[test]
fn an_empty_mesh_is_a_message() {
    let mut scene = Scene::new();
    scene
        .add_triangles::<f32>(&[], &[])
        .expect("empty bodies are allowed");
    let content = Content {
        bodies: shown(&scene),
        scene,
        frames: None,
        missing: None,
    };
    let mut harness = open_content(content);
    let text = harness.state().message().expect("a message").to_owned();
    assert!(text.contains("nothing to see"), "{text}");
    press(&mut harness, Key::F);
    press(&mut harness, Key::J);
    harness.render().expect("a picture");
}

#[test]
fn a_lost_device_is_a_message_and_the_cpu_still_answers() {
    let render = create_render_state(default_wgpu_setup(), RendererOptions::PREDICTABLE);
    let (device, queue) = (render.device.clone(), render.queue.clone());
    let mut harness = open_on(render, || Ok(still(1000, 0.6)), paused());
    let before = harness.state().hash().expect("an answer");
    // A device that is destroyed is lost once all its work is done.
    queue.submit([]);
    device
        .poll(PollType::wait_indefinitely())
        .expect("it is done");
    device.destroy();
    drag(&mut harness, Pos2::new(20.0, 20.0), [40.0, 0.0]);
    let message = harness.state().message().expect("a message").to_owned();
    assert!(message.contains("device"), "{message}");
    assert_eq!(harness.state().hash(), Some(before));
    // Detection on this device is refused, and back on the CPU it goes on.
    click(&mut harness, "GPU");
    assert!(harness.state().message().is_some());
    click(&mut harness, "CPU");
    assert_eq!(harness.state().hash(), Some(before));
}

#[test]
fn a_window_of_one_pixel_does_no_harm() {
    let mut harness = open_content(passing());
    for size in [[1.0, 1.0], [300.0, 2.0], [252.0, 400.0], SIZE] {
        harness.set_size(size.into());
        harness.run_steps(3);
        press(&mut harness, Key::ArrowRight);
    }
    assert!(harness.state().n_pairs().is_some());
    harness.render().expect("a picture");
}

/// Waits until the camera has arrived.
fn fly(harness: &mut Harness<'static, Viewer>) {
    harness.step();
    std::thread::sleep(Duration::from_millis(500));
    harness.run_steps(3);
}

/// Saves a picture for people to look at, in the folder IMPINGE_PICTURES if it is set.
fn look(harness: &mut Harness<'static, Viewer>, name: &str) {
    if let Some(folder) = std::env::var_os("IMPINGE_PICTURES") {
        harness.run_steps(2);
        let image = harness.render().expect("a picture");
        image
            .save(Path::new(&folder).join(format!("{name}.png")))
            .expect("saved");
    }
}

/// Keeps a saved picture for people to look at, as [`look`] does.
fn keep(png: &[u8], name: &str) {
    if let Some(folder) = std::env::var_os("IMPINGE_PICTURES") {
        std::fs::write(Path::new(&folder).join(format!("{name}.png")), png).expect("saved");
    }
}

fn n_pixels(harness: &mut Harness<'static, Viewer>, is: impl Fn([u8; 3]) -> bool) -> usize {
    harness.run_steps(2);
    let image = harness.render().expect("a picture");
    // Beside the panels and the legend.
    let has_legend = |x: u32, y: u32| x < 250 && y > SIZE[1] as u32 - 300;
    image
        .enumerate_pixels()
        .filter(|(x, y, pixel)| {
            *x < (SIZE[0] - 252.0) as u32 && *y < SIZE[1] as u32 - 104 && !has_legend(*x, *y) && {
                let [r, g, b, _] = pixel.0;
                is([r, g, b])
            }
        })
        .count()
}

fn is_red([r, g, b]: [u8; 3]) -> bool {
    r > 120 && u32::from(r) > 2 * u32::from(g.max(b))
}

fn is_grey([r, g, b]: [u8; 3]) -> bool {
    r.abs_diff(g) < 16 && b.abs_diff(g) < 24 && r < 225
}

/// Neither window nor picture has a background as dark as this.
fn is_body([r, g, b]: [u8; 3]) -> bool {
    r.min(g).min(b) < 225
}

fn is_black([r, g, b]: [u8; 3]) -> bool {
    r < 60 && g < 60 && b < 60
}

#[test]
fn c_shows_everything_then_what_collides_then_curves() {
    let mut harness = open_content(still(600, 0.5));
    harness.set_size(SIZE.into());
    look(&mut harness, "everything");
    assert!(n_pixels(&mut harness, is_red) > 100);
    assert!(n_pixels(&mut harness, is_grey) > 20_000);
    press(&mut harness, Key::C);
    look(&mut harness, "colliding");
    assert!(n_pixels(&mut harness, is_red) > 100);
    assert!(n_pixels(&mut harness, is_grey) < 500);
    press(&mut harness, Key::C);
    look(&mut harness, "curves");
    assert_eq!(n_pixels(&mut harness, is_red), 0);
    assert!(n_pixels(&mut harness, is_black) > 300);
    press(&mut harness, Key::C);
    assert!(n_pixels(&mut harness, is_grey) > 20_000);
    let before = n_pixels(&mut harness, is_black);
    press(&mut harness, Key::I);
    assert!(n_pixels(&mut harness, is_black) > before + 200);
}

#[test]
fn bodies_that_are_tested_on_the_device_are_drawn_where_they_are() {
    let mut harness = open_content(still(600, 0.5));
    harness.set_size(SIZE.into());
    let mut pictures = Vec::new();
    for label in ["CPU", "GPU"] {
        click(&mut harness, label);
        drag(&mut harness, middle(false), [60.0, 0.0]);
        assert_eq!(harness.state().message(), None, "{label}");
        let seen = [is_red, is_grey].map(|is| n_pixels(&mut harness, is));
        assert!(seen[0] > 40 && seen[1] > 10_000, "{label}: {seen:?}");
        pictures.push(seen);
        click(&mut harness, "Put bodies back");
    }
    // Rounding may move an edge over the middle of a few pixels.
    let differ = |k: usize| pictures[0][k].abs_diff(pictures[1][k]);
    assert!(differ(0) < 20 && differ(1) < 60, "{pictures:?}");
}

#[test]
fn impacts_and_near_faces_have_colors() {
    let mut harness = open_content(passing());
    wait(&mut harness, is_counted);
    press(&mut harness, Key::B);
    press(&mut harness, Key::ArrowLeft);
    assert_eq!(harness.state().n_pairs(), Some(0));
    assert_eq!(n_pixels(&mut harness, is_red), 0);
    click(&mut harness, "Impacts by time");
    assert_eq!(harness.state().message(), None);
    assert!(
        harness
            .query_by_label_contains("impacts, the earliest at")
            .is_some()
    );
    look(&mut harness, "impacts");
    let is_warm = |[r, g, b]: [u8; 3]| r > 110 && u32::from(r) > 3 * u32::from(b) && g < r;
    assert!(n_pixels(&mut harness, is_warm) > 20);
    click(&mut harness, "Impacts by time");
    assert_eq!(n_pixels(&mut harness, is_warm), 0);
    press(&mut harness, Key::ArrowRight);
    // The number beside it has the same label.
    harness
        .get_by_role_and_label(eframe::egui::accesskit::Role::CheckBox, "Within")
        .click();
    harness.run_steps(2);
    assert_eq!(harness.state().message(), None);
    assert!(
        harness
            .query_by_label_contains("pairs of faces within")
            .is_some()
    );
}

/// Where a point of the scene is in the window.
fn in_window(harness: &Harness<'static, Viewer>, point: [f64; 3], has_timeline: bool) -> Pos2 {
    let center = middle(has_timeline);
    let orbit = harness.state().orbit().expect("a viewpoint");
    let aspect = f64::from(center.x / center.y);
    let ([x, y], _) = orbit.project(aspect, point).expect("it is in view");
    Pos2::new(center.x * (1.0 + x as f32), center.y * (1.0 - y as f32))
}

#[test]
fn a_body_that_no_frame_moves_stays_where_it_was_dragged_during_a_step() {
    let mut harness = open_content(passing());
    wait(&mut harness, is_counted);
    press(&mut harness, Key::B);
    press(&mut harness, Key::ArrowLeft);
    press(&mut harness, Key::F);
    fly(&mut harness);
    click(&mut harness, "Impacts by time");
    harness.get_by_label_contains("impacts, the earliest at");
    let from = in_window(&harness, [0.0; 3], true);
    drag(&mut harness, from, [0.0, -500.0]);
    assert_eq!(harness.state().message(), None);
    harness.get_by_label("nothing touches before the next frame");
}

#[test]
fn j_flies_from_place_to_place_and_f_back() {
    // A small contact.
    let mut harness = open_content(still(3_000, 0.95));
    press(&mut harness, Key::C);
    press(&mut harness, Key::J);
    harness.get_by_label("place 1 of 1");
    fly(&mut harness);
    // The camera is near the contact: it fills more of the view than before.
    let near = n_pixels(&mut harness, is_red);
    look(&mut harness, "place");
    press(&mut harness, Key::F);
    fly(&mut harness);
    let far = n_pixels(&mut harness, is_red);
    assert!(near > 4 * far && far > 0, "{near} {far}");
}

#[test]
fn a_saved_picture_is_made_again_by_what_its_command_says() {
    let folder = tempfile::tempdir().expect("a folder");
    let content = passing();
    let options = Options {
        folder: folder.path().to_owned(),
        size: [320, 200],
        ..paused()
    };
    let mut harness = open(
        {
            let content = content.clone();
            move || Ok(content)
        },
        options.clone(),
    );
    wait(&mut harness, is_counted);
    press(&mut harness, Key::B);
    drag(&mut harness, Pos2::new(15.0, 600.0), [80.0, 30.0]);
    // Near the contact, with its curves.
    press(&mut harness, Key::J);
    fly(&mut harness);
    press(&mut harness, Key::I);
    press(&mut harness, Key::S);
    // The next free name is suggested.
    click(&mut harness, "Save");
    assert_eq!(harness.state().message(), None);
    let (path, command) = harness.state().saved().expect("a picture");
    let path = path.to_owned();
    let (frame, orbit) = (harness.state().frame(), harness.state().orbit());
    let (frame, orbit) = (frame.expect("a frame"), orbit.expect("a viewpoint"));
    let camera = orbit.camera;
    assert!(
        command.starts_with(&format!("impinge view --frame {frame} --azimuth ")),
        "{command}"
    );
    assert!(command.contains(&format!(
        "--azimuth {:?} --elevation {:?} --target {:?},{:?},{:?} --eye-distance {:?} --size 320x200",
        camera.azimuth,
        camera.elevation,
        orbit.target[0],
        orbit.target[1],
        orbit.target[2],
        orbit.distance
    )));
    assert!(command.ends_with(" --curves"), "{command}");
    let again = folder.path().join("again.png");
    let all = Options {
        frame: Some(frame),
        camera,
        ..options.clone()
    };
    let draw = |options: &Options| {
        impinge_view::write_png(content.clone(), options, &again).expect("a picture");
        std::fs::read(&again).expect("there")
    };
    let count = |png: &[u8], is: fn([u8; 3]) -> bool| {
        let image = image::load_from_memory(png).expect("a picture").to_rgb8();
        image.pixels().filter(|pixel| is(pixel.0)).count()
    };
    let focused = Options {
        focus: Some(Focus {
            target: orbit.target,
            distance: orbit.distance,
        }),
        ..all.clone()
    };
    let with_curves = draw(&Options {
        curves: true,
        ..focused.clone()
    });
    assert!(std::fs::read(&path).expect("there") == with_curves);
    keep(&with_curves, "saved");
    // Framing: from half as far, everything is larger, and a picture of everything is another one.
    let near = draw(&focused);
    let closer = draw(&Options {
        focus: Some(Focus {
            target: orbit.target,
            distance: 0.5 * orbit.distance,
        }),
        ..focused.clone()
    });
    assert!(near != draw(&all), "the focus has no effect");
    assert!(count(&closer, is_body) > 2 * count(&near, is_body));
    assert!(
        count(&with_curves, is_black) > count(&near, is_black) + 20,
        "curves"
    );
    // The window shows the bodies as large as the picture, relative to the heights of both.
    let in_window = n_pixels(&mut harness, is_body) as f64 / f64::from(SIZE[1] - 104.0).powi(2);
    let in_picture = count(&with_curves, is_body) as f64 / 200f64.powi(2);
    assert!(
        (0.8..1.25).contains(&(in_window / in_picture)),
        "{in_window} {in_picture}"
    );
    for (shows, word) in [(Shows::Colliding, "colliding"), (Shows::Curves, "curves")] {
        press(&mut harness, Key::C);
        press(&mut harness, Key::S);
        click(&mut harness, "Save");
        let (path, command) = harness.state().saved().expect("a picture");
        assert!(command.contains(&format!(" --show {word} ")), "{command}");
        let png = draw(&Options {
            curves: true,
            shows,
            ..focused.clone()
        });
        assert!(std::fs::read(path).expect("there") == png, "{word}");
        assert_eq!(count(&png, is_red) > 0, shows == Shows::Colliding);
        assert!(count(&png, is_black) > 20, "{word}");
        keep(&png, word);
    }
    // A window that begins with these options shows the same.
    let same = open(
        move || Ok(content),
        Options {
            curves: true,
            ..focused
        },
    );
    assert_eq!(same.state().orbit(), Some(orbit));
    // The next one has another name.
    press(&mut harness, Key::S);
    click(&mut harness, "Save");
    let (path, _) = harness.state().saved().expect("a picture");
    assert!(path.ends_with("impinge-4.png"), "{path:?}");
}

#[test]
fn the_window_begins_at_the_first_collision() {
    let content = passing();
    let expected = expected(&content);
    let first = expected
        .iter()
        .position(|&(n, _)| n > 0)
        .expect("they pass");
    assert!(first > 0);
    let options = Options {
        plays: true,
        frame: None,
        ..paused()
    };
    let begins_at = |frame| {
        let options = Options {
            frame: Some(frame),
            ..options.clone()
        };
        let content = content.clone();
        let harness = open(
            move || Ok(content),
            Options {
                plays: false,
                ..options
            },
        );
        harness.state().orbit().expect("a viewpoint")
    };
    let mut harness = {
        let content = content.clone();
        open(move || Ok(content), options.clone())
    };
    wait(&mut harness, |viewer| viewer.frame() == Some(first));
    harness.run_steps(3);
    assert_eq!(harness.state().frame(), Some(first));
    assert_eq!(harness.state().n_pairs(), Some(expected[first].0 as usize));
    // The bodies are seen as they are there, not those of all frames.
    let orbit = harness.state().orbit().expect("a viewpoint");
    let there = begins_at(first);
    assert_eq!(
        (orbit.target, orbit.distance),
        (there.target, there.distance)
    );
    assert_ne!(orbit.distance, begins_at(0).distance);
    look(&mut harness, "first-collision");
}

#[test]
fn bodies_have_names_and_a_legend_and_can_be_hidden() {
    let mut harness = open_content(still(600, 0.5));
    let n_pairs = harness.state().n_pairs();
    harness.get_by_label("first where it collides");
    harness.get_by_label("collides with nothing");
    let both = n_pixels(&mut harness, is_body);
    let label = harness.get_by_label_contains("second: ");
    label.click();
    harness.run_steps(2);
    let one = n_pixels(&mut harness, is_body);
    assert!(4 * one < 3 * both, "{one} {both}");
    assert!(harness.query_by_label("second where it collides").is_none());
    // It collides in any case.
    assert_eq!(harness.state().n_pairs(), n_pairs);
    look(&mut harness, "hidden");
    harness.get_by_label_contains("second: ").click();
    harness.run_steps(2);
    assert_eq!(n_pixels(&mut harness, is_body), both);
}

#[test]
fn places_are_listed_as_the_program_numbers_them_and_can_be_clicked() {
    // Three small balls in a large one's surface: the places have different numbers of pairs.
    let mut scene = Scene::new();
    ball(2_000).add_to(&mut scene).expect("a ball");
    let (mut faces, mut positions) = (Vec::new(), Vec::new());
    for (n, at) in [
        (100, [0.5, 0.0, 0.0]),
        (900, [0.0, 0.5, 0.0]),
        (300, [0.0, 0.0, 0.5]),
    ] {
        let model = ball(n).scaled(0.2).translated(at);
        let impinge::Elements::Triangles(own) = &model.elements else {
            panic!("a ball has triangles");
        };
        let first = positions.len() as u32;
        faces.extend(own.iter().map(|face| face.map(|vertex| first + vertex)));
        positions.extend_from_slice(&model.positions);
    }
    scene.add_triangles(&faces, &positions).expect("balls");
    let mut detector = Detector::new(Backend::Cpu).expect("a detector");
    let pairs = detector
        .detect(&scene, &Query::between_all())
        .expect("an answer");
    let expected: Vec<usize> = pairs
        .places(&scene)
        .expect("places")
        .iter()
        .map(|place| place.n_pairs)
        .collect();
    assert_eq!(expected.len(), 3);
    assert!(
        expected[0] > expected[1] && expected[1] > expected[2],
        "{expected:?}"
    );
    let mut harness = open_content(Content {
        bodies: shown(&scene),
        scene,
        frames: None,
        missing: None,
    });
    let listed = harness.state_mut().places();
    assert_eq!(
        listed,
        Vec::from_iter(expected.iter().map(|&n| ([0, 1], n)))
    );
    let before = harness.state().orbit().expect("a viewpoint");
    harness.get_by_label_contains("2. ").click();
    harness.run_steps(2);
    fly(&mut harness);
    assert_eq!(harness.state().place(), Some(1));
    assert_ne!(
        harness.state().orbit().expect("a viewpoint").target,
        before.target
    );
    look(&mut harness, "places");
}

#[test]
fn places_are_not_listed_while_a_body_is_dragged() {
    let mut harness = open_content(still(600, 0.5));
    let is_listed =
        |harness: &Harness<'static, Viewer>| harness.query_by_label("1 place").is_some();
    assert!(is_listed(&harness));
    // Beside the bodies a drag turns the view, and in the middle it moves a body.
    for (from, stays) in [(Pos2::new(15.0, 780.0), true), (middle(false), false)] {
        harness.hover_at(from);
        harness.step();
        harness.drag_at(from);
        harness.step();
        for part in 1..=4 {
            harness.hover_at(Pos2::new(from.x + 5.0 * part as f32, from.y));
            harness.step();
        }
        assert_eq!(is_listed(&harness), stays);
        harness.drop_at(Pos2::new(from.x + 20.0, from.y));
        harness.run_steps(2);
        assert!(is_listed(&harness));
    }
}

#[derive(Debug)]
struct Dropped(std::path::PathBuf);

impl eframe::egui::DroppedFile for Dropped {
    fn path(&self) -> &Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        Err("only its path counts".to_owned())
    }
}

#[test]
fn files_can_be_opened_and_dropped() {
    let opener = impinge_view::Opener(Arc::new(|paths: &[std::path::PathBuf]| {
        if paths.iter().any(|path| path.ends_with("bad.obj")) {
            return Err("bad.obj: not a mesh".to_owned());
        }
        let mut content = still(600, 0.5);
        content.bodies[0].name = paths[0].display().to_string();
        content.missing = (paths.len() > 1).then(|| "b.obj: no such file".to_owned());
        let mut words = vec!["impinge".to_owned(), "view".to_owned()];
        words.extend(paths.iter().map(|path| path.display().to_string()));
        words.push("--no-weld".to_owned());
        Ok((content, Command(words)))
    }));
    let folder = tempfile::tempdir().expect("a folder");
    let options = Options {
        opener: Some(opener),
        folder: folder.path().to_owned(),
        size: [64, 48],
        ..paused()
    };
    let mut harness = open(|| Ok(still(600, 9.0)), options);
    assert_eq!(harness.state().n_pairs(), Some(0));
    let drop = |harness: &mut Harness<'static, Viewer>, names: &[&str]| {
        let files = names
            .iter()
            .map(|name| Arc::new(Dropped(name.into())) as eframe::egui::DroppedFileHandle);
        harness.input_mut().dropped_files.extend(files);
        harness.step();
        wait(harness, |viewer| !viewer.is_loading());
        harness.run_steps(2);
    };
    drop(&mut harness, &["dropped.obj"]);
    assert_eq!(harness.state().names()[0], "dropped.obj");
    assert!(harness.state().n_pairs() > Some(0));
    // One bad file of two: a message, and the other.
    drop(&mut harness, &["a.obj", "b.obj"]);
    assert_eq!(harness.state().message(), Some("b.obj: no such file"));
    assert_eq!(harness.state().names()[0], "a.obj");
    drop(&mut harness, &["bad.obj"]);
    harness.get_by_label("bad.obj: not a mesh");
    // From there others can be opened.
    click(&mut harness, "Open files");
    // What is typed goes into the field, without a click on it: no key of the window is meant.
    let field = harness.get_by_label("Files to open, one per line");
    assert!(field.is_focused());
    field.type_text("typed.obj");
    harness.run_steps(2);
    click(&mut harness, "Open");
    wait(&mut harness, |viewer| {
        !viewer.is_loading() && viewer.names().len() == 2
    });
    assert_eq!(harness.state().names()[0], "typed.obj");
    // The command that makes a picture again is that of these files, with what else the opener
    // says.
    press(&mut harness, Key::S);
    click(&mut harness, "Save");
    let (_, command) = harness.state().saved().expect("a picture");
    let begin = "impinge view typed.obj --no-weld --azimuth ";
    assert!(command.starts_with(begin), "{command}");
}

#[test]
fn a_picture_is_saved_where_the_user_says() {
    let folder = tempfile::tempdir().expect("a folder");
    let options = Options {
        folder: folder.path().to_owned(),
        size: [64, 48],
        ..paused()
    };
    let mut harness = open(|| Ok(still(600, 0.5)), options);
    press(&mut harness, Key::S);
    assert!(harness.state().saved().is_none(), "it asks first");
    let field = harness.get_by_label("Save the picture as");
    field.focus();
    harness.step();
    harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
    harness.step();
    let path = folder.path().join("mine.png");
    harness
        .get_by_label("Save the picture as")
        .type_text(path.to_str().expect("a name"));
    harness.run_steps(2);
    click(&mut harness, "Save");
    assert_eq!(
        harness.state().saved().map(|(path, _)| path),
        Some(path.as_path())
    );
    assert!(path.exists());
}

#[test]
fn a_picture_that_is_saved_at_last_leaves_no_message_that_it_is_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let missing = folder.path().join("missing");
    let options = Options {
        folder: missing.clone(),
        size: [64, 48],
        ..paused()
    };
    let mut harness = open(|| Ok(passing()), options);
    wait(&mut harness, is_counted);
    press(&mut harness, Key::S);
    click(&mut harness, "Save");
    let message = harness.state().message().expect("a message");
    assert!(message.contains("cannot write"), "{message}");
    std::fs::create_dir(&missing).expect("a folder");
    press(&mut harness, Key::S);
    click(&mut harness, "Save");
    assert!(harness.state().saved().is_some());
    assert_eq!(harness.state().message(), None);
    // A message about something else stays.
    press(&mut harness, Key::End);
    press(&mut harness, Key::N);
    let other = harness.state().message().map(str::to_owned);
    assert!(other.is_some());
    press(&mut harness, Key::S);
    click(&mut harness, "Save");
    assert_eq!(harness.state().message().map(str::to_owned), other);
}

/// A pointer that rests on a body is told how far the nearest other body is from there.
#[test]
fn distances_are_told_where_the_pointer_rests() {
    let mut harness = open_content(still(600, 3.0));
    harness
        .ctx
        .all_styles_mut(|style| style.interaction.tooltip_delay = 0.0);
    let (scene, [first, second]) = balls(600, 3.0);
    let orbit = harness.state().orbit().expect("shown");
    let depth = |point: [f64; 3]| orbit.project(1.0, point).expect("in front").1;
    let positions = scene.body(first).expect("a ball").positions();
    let vertices = (0..positions.len()).map(|vertex| positions.point(vertex));
    // The vertices that are nearest to the eye: of all, and of those on the right.
    let mut told = Vec::new();
    for least in [-9.0, 0.3] {
        let seen = vertices.clone().filter(|point| point[0] > least);
        let point = seen
            .min_by(|&p, &q| depth(p).total_cmp(&depth(q)))
            .expect("a vertex");
        let at = in_window(&harness, point, false);
        harness.hover_at(at);
        harness.run_steps(6);
        let text = harness
            .query_all_by_label_contains("from second")
            .find_map(|node| {
                node.accesskit_node()
                    .label()
                    .or(node.accesskit_node().value())
            })
            .expect("a distance");
        let (triangle, distance) = text.split_once('\n').expect("two lines");
        assert!(triangle.starts_with("first, triangle "), "{text}");
        let (number, _) = distance.split_once(' ').expect("a number");
        let number: f64 = number.parse().expect("a number");
        let closest = Detector::new(Backend::Cpu)
            .and_then(|mut detector| {
                detector.closest(&scene, &[point], f64::INFINITY, &Query::across([second]))
            })
            .expect("a distance");
        let expected = closest.iter().next().flatten().expect("near").distance;
        assert!((number - expected).abs() < 0.02, "{text}: {expected}");
        told.push(number);
        harness.hover_at(Pos2::new(5.0, SIZE[1] - 5.0));
        harness.run_steps(6);
        let n_told = harness.query_all_by_label_contains("from second").count();
        assert_eq!(n_told, 0, "nothing is under the pointer");
    }
    assert!(told[1] < told[0] - 0.1, "{told:?}");
}

/// Each control says what it does to a pointer that rests on it.
#[test]
fn controls_have_tooltips() {
    let mut harness = open_content(passing());
    harness
        .ctx
        .all_styles_mut(|style| style.interaction.tooltip_delay = 0.0);
    for (control, text) in [
        ("Play", "Space"),
        ("First collision", "first frame with a collision (B)"),
        ("Next collision", "next frame with a collision (N)"),
        ("Earliest impacts", "first contact"),
        ("Next place", "(J)"),
        ("See all", "(F)"),
        ("Save picture", "(S)"),
        ("Everything", "(C)"),
        ("Only what collides", "(C)"),
        ("Only curves", "(C)"),
        ("Intersection curves", "(I)"),
        ("Impacts by time", "next frame"),
        ("Within", "in the unit of the files"),
        ("Self-collision", "within one body"),
        ("resolve", "also meet elsewhere"),
        ("skip", "never a pair"),
        ("clusters", "fixed"),
        ("cells", "grid"),
        ("naive", "slow"),
        ("CPU", "the same"),
        ("GPU", "the same"),
    ] {
        harness.hover_at(Pos2::new(300.0, 300.0));
        harness.run_steps(4);
        let at = harness.get_by_label(control).rect().center();
        harness.hover_at(at);
        harness.run_steps(6);
        assert!(
            harness.query_all_by_label_contains(text).count() > 0,
            "{control}: no tooltip with \"{text}\""
        );
    }
}

/// Every frame collides: the timeline is one area, whatever the width of a frame.
#[test]
fn the_timeline_has_no_stripes() {
    struct Resting(usize);
    impl Frames for Resting {
        fn n_frames(&self) -> usize {
            self.0
        }
        fn read(&self, _: usize) -> Result<Vec<(BodyId, Positions)>, String> {
            Ok(Vec::new())
        }
    }
    for n_frames in [37, 411] {
        let mut content = still(300, 0.5);
        content.frames = Some(Arc::new(Resting(n_frames)));
        let mut harness = open_content(content);
        wait(&mut harness, is_counted);
        harness.run_steps(2);
        let image = harness.render().expect("a picture");
        let row = SIZE[1] as u32 - 20;
        let at = |x: u32| {
            let [r, g, b, _] = image.get_pixel(x, row).0;
            [r, g, b]
        };
        let width = (SIZE[0] - 252.0) as u32;
        let reds = (0..width).filter(|&x| is_red(at(x)));
        let reds: Vec<u32> = reds.collect();
        let (first, last) = (reds[0], reds[reds.len() - 1]);
        assert!(last - first > width - 60, "{first} {last}");
        // The cursor is blue.
        let others = (first..=last).filter(|&x| !is_red(at(x)));
        assert!(others.count() <= 4, "{n_frames}");
    }
}
