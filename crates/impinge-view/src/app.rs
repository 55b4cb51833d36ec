//! The app: loads a content, then lets a session show it.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread;
use std::time::{Duration, Instant};

use eframe::egui;
use egui_wgpu::RenderState;
use impinge_render::{Camera, Orbit};

use crate::content::Content;
use crate::options::{Command, Opener, Options};
use crate::session::Session;
use crate::timeline::Count;
use crate::{input, panel, view};

/// The app in the window. [`show`](crate::show) opens one; tests run it without a window.
pub struct Viewer {
    state: State,
    /// The files to open, as the user edits their paths.
    opening: Option<String>,
    options: Options,
    render: Option<RenderState>,
    last: Option<Instant>,
    measured: Measured,
}

/// A content, and the command that opens a window with it.
type Loaded = Result<(Content, Command), String>;

enum State {
    /// The content is being read.
    Loading(Receiver<Loaded>),
    /// It cannot be shown.
    Failed(String),
    Shown(Box<Session>),
}

impl State {
    fn loading(load: impl FnOnce() -> Loaded + Send + 'static) -> Self {
        let (to, content) = channel();
        let thread = thread::Builder::new().name("load".to_owned());
        let spawned = thread.spawn(move || {
            // If the window was closed meanwhile, nobody waits for the content.
            let _ = to.send(load());
        });
        match spawned {
            Err(error) => State::Failed(format!("no thread can be started: {error}")),
            Ok(_) => State::Loading(content),
        }
    }
}

/// Frames shown so far, for [`Options::measure`].
#[derive(Default)]
struct Measured {
    n_frames: u32,
    began: Option<Instant>,
}

/// How often the window looks whether the content has been read.
const LOADING: Duration = Duration::from_millis(20);

/// Frames that are not measured: buffers and pipelines are made in them.
const WARM_UP: u32 = 10;

impl Viewer {
    /// An app for a window, or for a test, that draws with the device of `render`. `load` runs on a
    /// thread of its own.
    pub fn new(
        render: Option<RenderState>,
        load: impl FnOnce() -> Result<Content, String> + Send + 'static,
        options: Options,
    ) -> Self {
        let command = options.command.clone();
        let state = match &render {
            None => State::Failed("the window has no graphics device".to_owned()),
            Some(_) => State::loading(move || Ok((load()?, command))),
        };
        Viewer {
            state,
            opening: None,
            options,
            render,
            last: None,
            measured: Measured::default(),
        }
    }

    /// Whether the content is still being read.
    pub fn is_loading(&self) -> bool {
        matches!(self.state, State::Loading(_))
    }

    /// The message that is shown, if there is one: of several, the last that came up.
    pub fn message(&self) -> Option<&str> {
        match &self.state {
            State::Loading(_) => None,
            State::Failed(text) => Some(text),
            State::Shown(session) => session.messages().next(),
        }
    }

    /// The places of collision in the frame that is shown: the numbers of their bodies, and of
    /// their pairs.
    pub fn places(&mut self) -> Vec<([usize; 2], usize)> {
        let State::Shown(session) = &mut self.state else {
            return Vec::new();
        };
        let places = session.places().iter();
        places.map(|place| (place.bodies, place.n_pairs)).collect()
    }

    /// The number of the place to which the camera has flown, from 0.
    pub fn place(&self) -> Option<usize> {
        self.session()?.place.map(|(ix, _)| ix)
    }

    /// The names of the bodies.
    pub fn names(&self) -> Vec<&str> {
        let bodies = self
            .session()
            .map_or(&[][..], |session| &session.stage.content.bodies);
        bodies.iter().map(|shown| shown.name.as_str()).collect()
    }

    /// Reads files and shows them in the place of what is shown.
    fn open(&mut self, paths: Vec<PathBuf>) {
        let Some(Opener(open)) = self.options.opener.clone() else {
            return;
        };
        if paths.is_empty() || self.render.is_none() {
            return;
        }
        self.options = Options {
            frame: None,
            focus: None,
            moves: Vec::new(),
            ..self.options.clone()
        };
        self.opening = None;
        self.state = State::loading(move || open(&paths));
    }

    /// The field for the paths of files to open.
    fn opener(&mut self, ui: &mut egui::Ui) {
        if self.options.opener.is_none() {
            return;
        }
        let is_new = self.opening.is_none();
        if is_new {
            let button = ui.button("Open files");
            if !button
                .on_hover_text("Or drop them onto the window")
                .clicked()
            {
                return;
            }
        }
        let text = self.opening.get_or_insert_default();
        let label = ui.label("Files to open, one per line");
        // The name keeps the focus when the button, which is counted before it, is gone.
        let field = egui::TextEdit::multiline(text)
            .id_salt("files to open")
            .desired_rows(2);
        let field = ui.add(field).labelled_by(label.id);
        // Otherwise what is typed would be taken for the window's keys.
        if is_new {
            field.request_focus();
        }
        let mut chosen = None;
        let mut is_over = false;
        ui.horizontal(|ui| {
            if ui.button("Open").clicked() {
                let lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
                chosen = Some(lines.map(PathBuf::from).collect());
            }
            is_over = ui.button("Close").clicked();
        });
        if is_over {
            self.opening = None;
        }
        if let Some(paths) = chosen {
            self.open(paths);
        }
    }

    fn session(&self) -> Option<&Session> {
        match &self.state {
            State::Shown(session) => Some(session),
            _ => None,
        }
    }

    /// The number of pairs in the frame that is shown.
    pub fn n_pairs(&self) -> Option<usize> {
        let answer = self.session()?.answer.as_ref()?;
        Some(answer.pairs.len())
    }

    /// The hash of the pairs in the frame that is shown.
    pub fn hash(&self) -> Option<u64> {
        let answer = self.session()?.answer.as_ref()?;
        Some(answer.pairs.hash())
    }

    /// Method and backend of the last answer, such as `clusters on cpu`.
    pub fn how(&self) -> Option<&str> {
        let answer = self.session()?.answer.as_ref()?;
        Some(&answer.how)
    }

    /// The frame that is shown.
    pub fn frame(&self) -> Option<usize> {
        Some(self.session()?.stage.frame_ix())
    }

    /// The timeline, one entry per frame.
    pub fn counts(&self) -> &[Count] {
        self.session()
            .map_or(&[], |session| &session.timeline.counts)
    }

    /// For the step from each frame to the next: `None` if not known, `Some(None)` if nothing
    /// touches, else the time of the earliest impact.
    pub fn earliest(&self) -> &[Option<Option<f64>>] {
        self.session()
            .map_or(&[], |session| &session.timeline.earliest)
    }

    /// The direction of view.
    pub fn camera(&self) -> Option<Camera> {
        self.orbit().map(|orbit| orbit.camera)
    }

    /// The viewpoint.
    pub fn orbit(&self) -> Option<Orbit> {
        self.session().map(|session| session.orbit)
    }

    /// The selected body and element.
    pub fn selected(&self) -> Option<(usize, u32)> {
        self.session()?.selected
    }

    /// The path of the last picture that was saved, and the command that makes it again.
    pub fn saved(&self) -> Option<(&std::path::Path, &str)> {
        let saved = self.session()?.saved.as_ref()?;
        Some((&saved.path, &saved.command))
    }

    /// Takes over the content once it is read.
    fn load(&mut self, ctx: &egui::Context) {
        let State::Loading(content) = &self.state else {
            return;
        };
        let loaded = match content.try_recv() {
            Ok(loaded) => loaded,
            Err(TryRecvError::Empty) => return,
            Err(TryRecvError::Disconnected) => Err("reading ended without a result".to_owned()),
        };
        let Some(render) = self.render.clone() else {
            return;
        };
        let session = loaded.and_then(|(content, command)| {
            self.options.command = command;
            Session::new(content, &self.options, render, ctx)
        });
        self.state = match session {
            Ok(session) => State::Shown(Box::new(session)),
            Err(text) => State::Failed(text),
        };
    }

    /// Counts frames; after the last one prints how many there were per second, and closes the
    /// window.
    fn measure(&mut self, ctx: &egui::Context) {
        let Some(wanted) = self.options.measure else {
            return;
        };
        let State::Shown(session) = &self.state else {
            // Nothing can be measured.
            if let State::Failed(text) = &self.state {
                eprintln!("error: {text}");
                ctx.send_viewport_cmd(egui::ViewportCommand::Close);
            }
            return;
        };
        // Frames are measured alone, not the timeline beside them.
        if self.measured.n_frames + 1 == WARM_UP && !session.timeline.is_counted() {
            return;
        }
        self.measured.n_frames += 1;
        if self.measured.n_frames == WARM_UP {
            self.measured.began = Some(Instant::now());
        }
        let Some(began) = self.measured.began else {
            return;
        };
        let n_frames = self.measured.n_frames - WARM_UP;
        if n_frames == wanted {
            let seconds = began.elapsed().as_secs_f64();
            let detection = session.answer.as_ref().map_or(0.0, |answer| answer.ms);
            println!(
                "{n_frames} frames in {seconds:.2} s: {:.1} frames per second; {detection:.3} ms of detection in the last one",
                f64::from(n_frames) / seconds
            );
            ctx.send_viewport_cmd(egui::ViewportCommand::Close);
        }
    }
}

impl eframe::App for Viewer {
    fn ui(&mut self, ui: &mut egui::Ui, _frame: &mut eframe::Frame) {
        self.show(ui);
    }
}

impl Viewer {
    /// One frame of the app, with all that its user did since the last one.
    pub fn show(&mut self, ui: &mut egui::Ui) {
        let ctx = ui.ctx().clone();
        let now = Instant::now();
        let seconds = self
            .last
            .map_or(0.0, |last| now.duration_since(last).as_secs_f64());
        self.last = Some(now);
        self.load(&ctx);
        let dropped = ctx.input_mut(|input| std::mem::take(&mut input.raw.dropped_files));
        self.open(dropped.iter().map(|file| file.path().to_owned()).collect());
        if self.options.opener.is_some() && !self.is_loading() {
            egui::Panel::top("open").show(ui, |ui| self.opener(ui));
        }
        match &mut self.state {
            State::Loading(_) => {
                egui::CentralPanel::default().show(ui, |ui| {
                    ui.centered_and_justified(|ui| ui.label("reading …"));
                });
                ctx.request_repaint_after(LOADING);
            }
            State::Failed(text) => {
                egui::CentralPanel::default().show(ui, |ui| {
                    ui.centered_and_justified(|ui| {
                        ui.label(
                            egui::RichText::new(text.as_str())
                                .color(panel::RED)
                                .size(16.0),
                        )
                    });
                });
            }
            State::Shown(session) => {
                input::keys(&ctx, session);
                let goes_on = session.advance(seconds);
                panel::side(ui, session);
                panel::bottom(ui, session);
                session.refresh(&ctx);
                view::show(ui, session);
                if goes_on {
                    ctx.request_repaint();
                }
            }
        }
        self.measure(&ctx);
    }
}
