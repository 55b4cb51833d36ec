//! Pictures in a file, and the command that makes one again.

use std::path::{Path, PathBuf};

use impinge::{Method, SharedVertex};
use impinge_render::{Camera, Picture, Projection, Renderer, Surface, UpAxis, wgpu};

use crate::content::Content;
use crate::find::{Answer, Finder};
use crate::options::{Backend, Options, Question};
use crate::stage::{IDENTITY, Stage};

/// A picture that was saved.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Saved {
    pub path: PathBuf,
    /// The command that makes it again.
    pub command: String,
}

/// Saves what is shown as `impinge-N.png` in the folder of the options, with the first number that no file has.
pub(crate) fn save(
    stage: &Stage,
    answer: Option<&Answer>,
    options: &Options,
    question: &Question,
    camera: Camera,
    (device, queue): (wgpu::Device, wgpu::Queue),
) -> Result<Saved, String> {
    let path = (1..)
        .map(|number: u32| options.folder.join(format!("impinge-{number}.png")))
        .find(|path| !path.exists())
        .ok_or("there are too many pictures in this folder")?;
    let renderer = Renderer::with_device(device, queue).map_err(|error| error.to_string())?;
    draw(stage, answer, options.size, camera, renderer, &path)?;
    let more = command_options(stage, options.size, question, camera, &path);
    Ok(Saved {
        path,
        command: options.command.line(&more),
    })
}

fn draw(
    stage: &Stage,
    answer: Option<&Answer>,
    size: [u32; 2],
    camera: Camera,
    mut renderer: Renderer,
    path: &Path,
) -> Result<(), String> {
    let mut surfaces = Vec::new();
    for (ix, shown) in stage.content.bodies.iter().enumerate() {
        let body = stage
            .scene()
            .body(shown.id)
            .map_err(|error| error.to_string())?;
        let colliding: &[u32] = answer.map_or(&[], |answer| &answer.colliding[ix]);
        let surface: Result<Surface, _> = Surface::of_body(body, colliding, shown.colors);
        surfaces.push(surface.map_err(|error| error.to_string())?);
    }
    let picture = Picture {
        surfaces,
        camera,
        size,
        ..Picture::default()
    };
    let image = renderer
        .render(&picture)
        .map_err(|error| error.to_string())?;
    image.write_png(path).map_err(|error| error.to_string())
}

/// The options of `impinge view` that make the picture again.
fn command_options(
    stage: &Stage,
    size: [u32; 2],
    question: &Question,
    camera: Camera,
    path: &Path,
) -> Vec<String> {
    let mut words = Vec::new();
    let mut say = |option: &str, value: String| words.extend([option.to_owned(), value]);
    if stage.content.n_frames() > 1 {
        say("--frame", stage.frame_ix().to_string());
    }
    for (body, matrix) in stage.moves.iter().enumerate() {
        if *matrix != IDENTITY {
            let numbers: Vec<String> = matrix[..3]
                .as_flattened()
                .iter()
                .map(|x| format!("{x:?}"))
                .collect();
            say("--move", format!("{body}:{}", numbers.join(",")));
        }
    }
    say("--azimuth", format!("{:?}", camera.azimuth));
    say("--elevation", format!("{:?}", camera.elevation));
    if camera.up == UpAxis::Z {
        say("--up", "z".to_owned());
    }
    say("--size", format!("{}x{}", size[0], size[1]));
    if question.shared_vertex == SharedVertex::Skip {
        say("--shared-vertex", "skip".to_owned());
    }
    say("--png", path.display().to_string());
    if camera.projection == Projection::Orthographic {
        words.push("--orthographic".to_owned());
    }
    if question.within && stage.content.bodies.len() > 1 {
        words.push("--self".to_owned());
    }
    words
}

/// Draws a content as a PNG file, as a window that begins with these options saves it, but without a window.
///
/// # Errors
/// A message for the user: a frame that cannot be read, a refused position, no device to draw with, a file that cannot be
/// written.
pub fn write_png(content: Content, options: &Options, path: &Path) -> Result<(), String> {
    let renderer = Renderer::new().map_err(|error| error.to_string())?;
    draw_png(content, options, renderer, path)
}

/// [`write_png`] with a renderer of the caller's.
///
/// # Errors
/// As `write_png`.
pub fn draw_png(
    content: Content,
    options: &Options,
    renderer: Renderer,
    path: &Path,
) -> Result<(), String> {
    let n_frames = content.n_frames();
    if options.frame >= n_frames {
        return Err(format!(
            "frame {} was requested, there are {n_frames} frames, counted from 0",
            options.frame
        ));
    }
    let mut stage = Stage::new(content);
    stage.pose(options.frame)?;
    for &(body, matrix) in &options.moves {
        stage.place(body, matrix)?;
    }
    let question = Question {
        within: options.within.unwrap_or(stage.content.bodies.len() == 1),
        shared_vertex: options.shared_vertex,
        method: Method::default(),
        backend: Backend::Cpu,
    };
    let answer = Finder::default().find_on_cpu(&stage, &question)?;
    draw(
        &stage,
        Some(&answer),
        options.size,
        options.camera,
        renderer,
        path,
    )
}
