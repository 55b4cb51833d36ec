//! Pictures in a file, and the command that makes one again.

use std::path::{Path, PathBuf};

use impinge::{Method, Pairs, SharedVertex};
use impinge_render::{Orbit, Picture, Projection, Renderer, Surface, UpAxis, wgpu};

use crate::content::Content;
use crate::find::{Answer, Finder, curves};
use crate::options::{Backend, Options, Question, Shows};
use crate::stage::{IDENTITY, Stage};

/// A picture that was saved.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Saved {
    pub path: PathBuf,
    /// The command that makes it again.
    pub command: String,
}

/// The colour of intersection curves.
pub(crate) const CURVE: [u8; 3] = [20, 20, 20];

/// The path that is suggested for a picture: `impinge-N.png` in the folder of the options, with the
/// first number that no file has.
pub(crate) fn suggested(options: &Options) -> PathBuf {
    let path = |number: u32| options.folder.join(format!("impinge-{number}.png"));
    let mut paths = (1..10_000).map(path);
    paths.find(|path| !path.exists()).unwrap_or_else(|| path(0))
}

/// Saves what the options show.
pub(crate) fn save(
    stage: &Stage,
    answer: Option<&Answer>,
    options: &Options,
    question: &Question,
    (device, queue): (wgpu::Device, wgpu::Queue),
    path: PathBuf,
) -> Result<Saved, String> {
    let renderer = Renderer::with_device(device, queue).map_err(|error| error.to_string())?;
    draw(stage, answer, options, renderer, &path)?;
    let more = command_options(stage, options, question, &path);
    Ok(Saved {
        path,
        command: options.command.line(&more),
    })
}

fn draw(
    stage: &Stage,
    answer: Option<&Answer>,
    options: &Options,
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
        let mut surface = surface.map_err(|error| error.to_string())?;
        match options.shows {
            Shows::Everything => {}
            Shows::Colliding => surface.faces.retain(|face| face.shows_through),
            Shows::Curves => continue,
        }
        surfaces.push(surface);
    }
    if let Some(answer) = answer
        && (options.curves || options.shows == Shows::Curves)
    {
        let segments = curves(stage.scene(), &answer.pairs)?;
        let radius = line_radius(stage, options);
        surfaces.push(Surface::of_segments(&segments, radius, CURVE));
    }
    let picture = Picture {
        surfaces,
        camera: options.camera,
        focus: options.focus,
        size: options.size,
        ..Picture::default()
    };
    let image = renderer
        .render(&picture)
        .map_err(|error| error.to_string())?;
    image.write_png(path).map_err(|error| error.to_string())
}

/// Half the width of lines: they are two pixels wide at the distance of what the picture looks at,
/// or about so wide in a picture of everything.
fn line_radius(stage: &Stage, options: &Options) -> f64 {
    let [width, height] = options.size.map(f64::from);
    if let Some(focus) = options.focus {
        let [_, high] = Orbit::at(options.camera, focus).visible(width / height);
        return 2.0 * high / height;
    }
    let [low, high] = stage.bounds(None).unwrap_or_default();
    let diagonal: f64 = (0..3).map(|k| (high[k] - low[k]).powi(2)).sum();
    diagonal.sqrt() / height.max(1.0)
}

/// The options of `impinge view` that make the picture again.
fn command_options(
    stage: &Stage,
    options: &Options,
    question: &Question,
    path: &Path,
) -> Vec<String> {
    let (camera, size) = (options.camera, options.size);
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
    if let Some(focus) = options.focus {
        let target = focus.target.map(|x| format!("{x:?}"));
        say("--target", target.join(","));
        say("--eye-distance", format!("{:?}", focus.distance));
    }
    match options.shows {
        Shows::Everything => {}
        Shows::Colliding => say("--show", "colliding".to_owned()),
        Shows::Curves => say("--show", "curves".to_owned()),
    }
    say("--size", format!("{}x{}", size[0], size[1]));
    if question.shared_vertex == SharedVertex::Skip {
        say("--shared-vertex", "skip".to_owned());
    }
    say("--png", path.display().to_string());
    if camera.projection == Projection::Orthographic {
        words.push("--orthographic".to_owned());
    }
    if options.curves {
        words.push("--curves".to_owned());
    }
    if question.within && stage.content.bodies.len() > 1 {
        words.push("--self".to_owned());
    }
    words
}

/// Draws a content as a PNG file, as a window that begins with these options saves it, but without
/// a window. Returns the pairs that the picture shows.
///
/// # Errors
/// A message for the user: a frame that cannot be read, a refused position, no device to draw with,
/// a file that cannot be written.
pub fn write_png(content: Content, options: &Options, path: &Path) -> Result<Pairs, String> {
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
) -> Result<Pairs, String> {
    let n_frames = content.n_frames();
    let frame = options.frame.unwrap_or(0);
    if frame >= n_frames {
        return Err(match n_frames {
            1 => format!("frame {frame} was requested, but there is one, number 0"),
            n => format!("frame {frame} was requested, but there are {n}, counted from 0"),
        });
    }
    let mut stage = Stage::new(content);
    stage.pose(frame)?;
    for &(body, matrix) in &options.moves {
        stage.place(body, matrix)?;
    }
    let question = Question {
        within: options.within.unwrap_or(stage.content.bodies.len() == 1),
        shared_vertex: options.shared_vertex,
        method: Method::Clusters,
        backend: Backend::Cpu,
    };
    let answer = Finder::default().find_on_cpu(&stage, &question)?;
    draw(&stage, Some(&answer), options, renderer, path)?;
    Ok(answer.pairs)
}
