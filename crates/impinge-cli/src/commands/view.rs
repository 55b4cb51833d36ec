//! `impinge view`: meshes in a window.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use clap::ValueEnum;
use impinge::{BodyId, CancelToken, Pairs, Positions};
use impinge_io::{Sequence, printable};
use impinge_render::{Camera, Colors, Focus, Projection};
use impinge_view::{Command, Content, Opener, Options, Shown, show, write_png};

use super::sequence::Frames;
use super::step::Frames as _;
use crate::apart::Inputs;
use crate::args::ViewArgs;
use crate::asked::{Asked, Question};
use crate::commands::demo_scene::DemoScene;
use crate::error::Error;
use crate::files::{Files, FrameFiles};
use crate::load::{Bodies, Loading, Nouns, Vertices};
use crate::origins::Origin;
use crate::output::out;
use crate::watch::go_on;
use crate::{headline, palette};

/// Frames of the built-in scene.
const DEMO_FRAMES: u32 = 300;

/// `impinge view`.
pub fn view(args: &ViewArgs, cancel: &CancelToken) -> Result<(), Error> {
    let mut options = options(args);
    if let Some(file) = &args.png {
        Inputs::new(&args.meshes).check("--png", &file.path)?;
        return save(args, &options, &file.path, cancel);
    }
    let (args, cancel) = (args.clone(), cancel.clone());
    let (again, token) = (args.clone(), cancel.clone());
    options.opener = Some(Opener(Arc::new(move |paths: &[PathBuf]| {
        let args = ViewArgs {
            meshes: paths.to_vec(),
            sequence: false,
            // What the files are is told by their names.
            bodies: None,
            ..again.clone()
        };
        let (content, _) = content(&args, &token).map_err(|error| error.line())?;
        Ok((content, command(&args)))
    })));
    let load = move || {
        let content = content(&args, &cancel).map_err(|error| error.line());
        content.map(|(content, _)| content)
    };
    Ok(show(load, options)?)
}

/// Saves a picture, and prints what it shows.
fn save(
    args: &ViewArgs,
    options: &Options,
    path: &Path,
    cancel: &CancelToken,
) -> Result<(), Error> {
    let (content, vertices) = content(args, cancel)?;
    let (scene, bodies) = (content.scene.clone(), content.bodies.clone());
    let pairs = picture(content, options, path)?;
    let nouns = Nouns::default();
    let names: Vec<(BodyId, &str)> = bodies
        .iter()
        .map(|body| (body.id, body.name.as_str()))
        .collect();
    let mut to = out();
    headline::write(&mut to, (&scene, &nouns), &names, &pairs, None)?;
    writeln!(to, "wrote {}", printable(path))?;
    let asked = Asked {
        between: true,
        within: args.within || bodies.len() == 1,
        only: None,
        shared_vertex: args.shared_vertex,
        question: Question::Pairs,
        has_self: true,
        excludes: false,
        rings: None,
        rest: None,
        has_kinds: false,
    };
    writeln!(to, "{}", asked.line(&vertices, &nouns))?;
    Ok(())
}

fn picture(content: Content, options: &Options, path: &Path) -> Result<Pairs, Error> {
    match content.missing {
        Some(missing) => Err(Error::View(missing)),
        None => write_png(content, options, path).map_err(Error::View),
    }
}

fn options(args: &ViewArgs) -> Options {
    Options {
        within: args.within.then_some(true),
        shared_vertex: args.shared_vertex,
        method: args.method,
        backend: args.backend.into(),
        frame: args.frame,
        plays: !args.paused,
        camera: Camera {
            azimuth: args.azimuth,
            elevation: args.elevation,
            up: args.up.into(),
            projection: match args.orthographic {
                true => Projection::Orthographic,
                false => Camera::default().projection,
            },
        },
        focus: match (args.target, args.eye_distance) {
            (Some(target), Some(distance)) => Some(Focus { target, distance }),
            _ => None,
        },
        shows: args.show.into(),
        curves: args.curves,
        moves: args.moves.clone(),
        size: args.size,
        folder: PathBuf::from(""),
        command: command(args),
        opener: None,
        measure: args.measure.map(Into::into),
    }
}

/// The words that name the content.
fn command(args: &ViewArgs) -> Command {
    let mut words = vec!["impinge".to_owned(), "view".to_owned()];
    words.extend(args.meshes.iter().map(|path| path.display().to_string()));
    for (is_given, option) in [(args.sequence, "--sequence"), (args.no_weld, "--no-weld")] {
        if is_given {
            words.push(option.to_owned());
        }
    }
    if let Some(bodies) = args.bodies.and_then(|bodies| bodies.to_possible_value()) {
        words.extend(["--bodies".to_owned(), bodies.get_name().to_owned()]);
    }
    if args.meshes.is_empty() {
        words.extend(["--triangles".to_owned(), args.triangles.to_string()]);
    }
    Command(words)
}

/// What is shown, and what was welded of each body.
fn content(args: &ViewArgs, cancel: &CancelToken) -> Result<(Content, Vec<Vertices>), Error> {
    if args.meshes.is_empty() {
        let content = demo(args)?;
        let vertices = vec![Vertices::default(); content.bodies.len()];
        return Ok((content, vertices));
    }
    let files = Files::of(&args.meshes, args.sequence, args.bodies.is_some())?;
    // Self-collision may be asked for in the window.
    let loading = Loading::as_they_are(true, cancel)
        .asked(args.no_weld.then_some(false), true, None)
        .with_bodies(args.bodies);
    let mut bodies = Bodies::default();
    // One bad file does not hide the others.
    let mut missing = Vec::new();
    let mut frames: Option<Arc<dyn impinge_view::Frames>> = None;
    let mut still = files.others.to_vec();
    let opened = match files.frames {
        FrameFiles::None => None,
        FrameFiles::Sequence(path) => Some((Sequence::open(path)?, path)),
        FrameFiles::Each(paths) => Some((Sequence::of_files(paths.to_vec())?, files.mesh)),
    };
    if let Some((sequence, name)) = opened {
        let (body, weld) = bodies.add(files.mesh, loading)?;
        let of_body = Frames::of(sequence, name, files.mesh, weld, false)?;
        frames = Some(Arc::new(Moving { body, of_body }));
    } else {
        still.insert(0, files.mesh.to_owned());
    }
    let mut has_parts = false;
    for file in &still {
        match bodies.add_file(file, loading, args.meshes.len()) {
            Ok(is_cut) => has_parts |= is_cut,
            Err(error) => missing.push(error.line()),
        }
    }
    go_on(cancel)?;
    if bodies.ids.is_empty() {
        return Err(Error::View(missing.join("\n")));
    }
    loading.check(has_parts)?;
    let named = bodies.ids.iter().zip(bodies.names).enumerate();
    let shown = named.map(|(ix, (&id, name))| Shown {
        vertices: bodies.origins.of(ix).and_then(Origin::numbers),
        ..shown(ix, id, name)
    });
    let content = Content {
        bodies: shown.collect(),
        scene: bodies.scene,
        frames,
        missing: (!missing.is_empty()).then(|| missing.join("\n")),
    };
    Ok((content, bodies.vertices))
}

fn shown(ix: usize, id: BodyId, name: String) -> Shown {
    let palette::BodyColors { colliding, other } = palette::body(ix);
    let colors = Colors { colliding, other };
    Shown {
        id,
        name,
        colors,
        vertices: None,
    }
}

/// The body that moves, and its frames.
struct Moving {
    body: BodyId,
    of_body: Frames,
}

impl impinge_view::Frames for Moving {
    fn n_frames(&self) -> usize {
        self.of_body.n_frames()
    }

    fn read(&self, frame_ix: usize) -> Result<Vec<(BodyId, Positions)>, String> {
        let positions = self.of_body.read(frame_ix).map_err(|error| error.line())?;
        Ok(vec![(self.body, positions)])
    }
}

/// The built-in scene. Frames are computed when they are asked for.
struct Demo(Mutex<DemoScene>);

fn demo(args: &ViewArgs) -> Result<Content, Error> {
    let demo = DemoScene::new(args.triangles as usize)?;
    let bodies = demo.bodies();
    let bodies = bodies
        .iter()
        .enumerate()
        .map(|(ix, &(id, name))| shown(ix, id, name.to_owned()))
        .collect();
    Ok(Content {
        scene: demo.scene().clone(),
        bodies,
        frames: Some(Arc::new(Demo(Mutex::new(demo)))),
        missing: None,
    })
}

impl impinge_view::Frames for Demo {
    fn n_frames(&self) -> usize {
        DEMO_FRAMES as usize
    }

    fn read(&self, frame_ix: usize) -> Result<Vec<(BodyId, Positions)>, String> {
        let mut demo = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        // Frames are at most 300.
        demo.pose(frame_ix as u32, DEMO_FRAMES)
            .map_err(|error| error.to_string())?;
        let ids: Vec<BodyId> = demo.bodies().iter().map(|&(id, _)| id).collect();
        let positions = |id| {
            let body = demo.scene().body(id).map_err(|error| error.to_string())?;
            Ok((id, body.positions().clone()))
        };
        ids.into_iter().map(positions).collect()
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use serde_json::{Value, json};

    use impinge_io::ReadOptions;

    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        args: ViewArgs,
    }

    /// What a picture of a file shows, and how many vertices were welded.
    fn shown_of(words: &[&str], folder: &Path) -> (Value, usize) {
        let words = ["view"].iter().chain(words);
        let args = Line::try_parse_from(words).unwrap().args;
        let (content, vertices) = content(&args, &CancelToken::new()).unwrap();
        let pairs = picture(content, &options(&args), &folder.join("a.png")).unwrap();
        let n_welded = vertices.iter().map(|of| of.n_welded).sum();
        let hash = format!("{:016x}", pairs.hash());
        (json!({ "pairs": pairs.len(), "hash": hash }), n_welded)
    }

    #[test]
    fn parts_of_a_file_are_bodies_if_asked_for() {
        let doors = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doors");
        let content_of = |words: &[&str]| {
            let args = Line::try_parse_from(["view"].iter().chain(words))
                .unwrap()
                .args;
            let content = content(&args, &CancelToken::new());
            content.map(|(content, _)| (content, command(&args).0.join(" ")))
        };
        let file = format!("{doors}/nodes.gltf");
        let (content, command) = content_of(&[&file, "--bodies", "nodes"]).unwrap();
        let names: Vec<_> = content
            .bodies
            .iter()
            .map(|body| body.name.as_str())
            .collect();
        assert_eq!(names, ["crate", "lid", "far"]);
        assert!(command.ends_with("nodes.gltf --bodies nodes"), "{command}");
        assert_eq!(content_of(&[&file]).unwrap().0.bodies.len(), 1);
        let refused = content_of(&[&file, "--bodies", "groups"])
            .err()
            .unwrap()
            .line();
        assert_eq!(refused, "--bodies groups: only OBJ files have groups");
    }

    #[test]
    fn frames_have_the_faces_of_the_mesh() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, faces: &str| {
            let path = folder.path().join(name);
            let text = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\n{faces}");
            std::fs::write(&path, text).unwrap();
            path.display().to_string()
        };
        let [a, b] = ["r_1.obj", "r_2.obj"].map(|name| write(name, "f 1 2 3\nf 2 4 3\n"));
        let c = write("r_3.obj", "f 1 2 4\nf 2 4 3\n");
        let args = Line::try_parse_from(["view", &a, &b, &c]).unwrap().args;
        let (content, _) = content(&args, &CancelToken::new()).unwrap();
        let frames = content.frames.unwrap();
        assert_eq!(frames.n_frames(), 3);
        assert!(frames.read(1).is_ok());
        let refused = frames.read(2).unwrap_err();
        assert!(
            refused.contains("r_3.obj") && refused.contains("of face 0, which the mesh has"),
            "{refused}"
        );
    }

    /// As every other door: `tests/cli/doors.rs`.
    #[test]
    fn files_have_the_answers_of_all_doors() {
        let doors = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doors"));
        let text = std::fs::read_to_string(doors.join("answers.json")).unwrap();
        let answers: Value = serde_json::from_str(&text).unwrap();
        let folder = tempfile::tempdir().unwrap();
        for (name, answer) in answers.as_object().unwrap() {
            let path = doors.join(name);
            let size = ["--size", "32x32"];
            let words = [&[path.to_str().unwrap()][..], &size].concat();
            let (shown, n_welded) = shown_of(&words, folder.path());
            let expected = json!({ "pairs": answer["pairs"], "hash": answer["hash"] });
            assert_eq!(shown, expected, "{name}");
            let welded = impinge_io::read(&path, &ReadOptions::default()).unwrap();
            let whole = impinge_io::read(&path, &ReadOptions::as_they_are()).unwrap();
            assert_eq!(n_welded, whole.n_vertices() - welded.n_vertices(), "{name}");
        }
        assert_eq!(answers.as_object().unwrap().len(), 8);
    }
}
