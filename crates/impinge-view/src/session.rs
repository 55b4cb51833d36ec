//! Everything that is known while a content is shown: where its bodies are, what collides, what is
//! seen and how.

use std::path::PathBuf;

use eframe::egui;
use egui_wgpu::RenderState;
use impinge::{Detector, Element, Method};
use impinge_render::{Focus, Least, Look, Orbit, ramp};

use crate::content::Content;
use crate::drag::Drag;
use crate::find::{Answer, Finder, curves, near, nearest, quiet_detector};
use crate::flight::Flight;
use crate::options::{Backend, Options, Question, Shows};
use crate::pick::{Hit, pick};
use crate::picture::{self, Saved};
use crate::places::{Place, places};
use crate::player::Player;
use crate::screen::Screen;
use crate::stage::{IDENTITY, Matrix, Stage};
use crate::timeline::{NEWS, Timeline};

/// The colour of elements within the distance, of the one that is selected, and of its partners.
pub(crate) const NEAR: [u8; 3] = [255, 165, 60];
pub(crate) const SELECTED: [u8; 3] = [255, 225, 0];
pub(crate) const PARTNER: [u8; 3] = [0, 170, 120];
/// The most pairs of which places are told apart.
const MOST_PAIRS: usize = 500_000;
/// The most states that are kept for undoing.
const MAX_UNDO: usize = 100;

/// What has changed since the last refresh.
#[derive(Debug, Clone, Copy, Default)]
struct Changed {
    /// Bodies are elsewhere.
    positions: bool,
    /// Other pairs may be the answer.
    question: bool,
    /// Marks, colours or lines.
    marks: bool,
    /// The timeline is of another question, or of bodies elsewhere.
    timeline: bool,
    /// Only the view.
    view: bool,
}

pub(crate) struct Session {
    pub stage: Stage,
    pub options: Options,
    pub question: Question,
    pub player: Player,
    pub orbit: Orbit,
    pub shows: Shows,
    pub shows_curves: bool,
    pub shows_impacts: bool,
    pub shows_near: bool,
    pub distance: f64,
    pub with_earliest: bool,
    pub answer: Option<Answer>,
    /// The number of impacts or of near pairs, for the user.
    pub note: Option<String>,
    pub timeline: Timeline,
    pub selected: Option<(usize, u32)>,
    pub message: Option<String>,
    /// What could not be loaded: shown until the user dismisses it.
    missing: Option<String>,
    pub saved: Option<Saved>,
    /// Why the last picture was not saved.
    save_error: Option<String>,
    /// The path of the picture that is about to be saved, as the user edits it.
    pub saving: Option<String>,
    pub drag: Option<Drag>,
    /// Whether the first frame with a collision is to be shown as soon as it is known.
    seeks: bool,
    screen: Screen,
    finder: Finder,
    /// For distances from the point under the pointer, once they were asked for.
    prober: Option<Detector>,
    /// For the next frame, once impacts were asked for.
    scratch: Option<Stage>,
    flight: Option<Flight>,
    /// The box to see completely as soon as the shape of the view is known.
    bounds: Option<[[f64; 3]; 2]>,
    /// Width through height of the view.
    aspect: f64,
    undo: Vec<Vec<Matrix>>,
    places: Option<Vec<Place>>,
    /// The place where the camera is, and of how many.
    pub place: Option<(usize, usize)>,
    changed: Changed,
    /// Milliseconds from one frame to the next, a running mean.
    pub frame_ms: f64,
}

impl Session {
    pub fn new(
        content: Content,
        options: &Options,
        render: RenderState,
        ctx: &egui::Context,
    ) -> Result<Self, String> {
        let mut stage = Stage::new(content);
        let n_frames = stage.content.n_frames();
        let missing = stage.content.missing.take();
        let frame_ix = options.frame.unwrap_or(0).min(n_frames - 1);
        let mut message = stage.pose(frame_ix).err();
        for &(body, matrix) in &options.moves {
            stage.place(body, matrix)?;
        }
        let mut screen = Screen::new(render)?;
        screen.show(&stage)?;
        let n_elements: usize = stage
            .scene()
            .bodies()
            .map(|(_, body)| body.n_elements())
            .sum();
        if n_elements == 0 {
            message
                .get_or_insert_with(|| "there is nothing to see: no body has elements".to_owned());
        }
        let question = Question {
            within: options.within.unwrap_or(stage.content.bodies.len() == 1),
            shared_vertex: options.shared_vertex,
            // The window asks about the same bodies in every frame.
            method: options.method.in_the_long_run(),
            backend: match options.method {
                Method::Naive => Backend::Cpu,
                _ => options.backend,
            },
        };
        let bounds = stage.bounds(None).unwrap_or([[-1.0; 3], [1.0; 3]]);
        let diagonal = length(bounds);
        let timeline = start_timeline(&stage, question, false, ctx);
        let (orbit, bounds) = match options.focus {
            Some(focus) => (Orbit::at(options.camera, focus), None),
            None => (Orbit::around(options.camera, bounds, 1.0), Some(bounds)),
        };
        Ok(Session {
            scratch: None,
            prober: None,
            orbit,
            bounds,
            aspect: 1.0,
            question,
            player: Player::new(options.plays && n_frames > 1 && options.frame.is_some()),
            seeks: options.frame.is_none() && options.measure.is_none() && n_frames > 1,
            options: options.clone(),
            shows: options.shows,
            shows_curves: options.curves,
            shows_impacts: false,
            shows_near: false,
            distance: 0.01 * diagonal,
            with_earliest: false,
            answer: None,
            note: None,
            timeline,
            selected: None,
            message,
            missing,
            saved: None,
            save_error: None,
            saving: None,
            drag: None,
            stage,
            screen,
            finder: Finder::default(),
            flight: None,
            undo: Vec::new(),
            places: None,
            place: None,
            changed: Changed {
                positions: true,
                ..Changed::default()
            },
            frame_ms: 0.0,
        })
    }

    /// All that the user is to be told, the last message first.
    pub fn messages(&self) -> impl Iterator<Item = &str> {
        let texts = [&self.message, &self.missing].into_iter();
        texts.filter_map(|text| text.as_deref())
    }

    /// Shows no message.
    pub fn dismiss(&mut self) {
        self.message = None;
        self.missing = None;
    }

    pub fn n_frames(&self) -> usize {
        self.stage.content.n_frames()
    }

    /// Shows a frame.
    pub fn go_to(&mut self, frame_ix: usize) {
        let frame_ix = frame_ix.min(self.n_frames() - 1);
        if frame_ix == self.stage.frame_ix() {
            return;
        }
        self.message = self.stage.pose(frame_ix).err();
        if self.message.is_some() {
            self.player.plays = false;
        }
        self.changed.positions = true;
    }

    /// Plays, or stops.
    pub fn play_or_pause(&mut self) {
        self.seeks = false;
        self.player.plays = !self.player.plays;
    }

    /// Stops, and shows the frame so many frames away.
    pub fn step(&mut self, by: isize) {
        self.seeks = false;
        self.player.plays = false;
        let n_frames = self.n_frames();
        let frame_ix = self.stage.frame_ix().checked_add_signed(by);
        self.go_to(frame_ix.unwrap_or(0).min(n_frames - 1));
    }

    /// Stops, and shows a frame, if there is one; otherwise says so.
    pub fn jump(&mut self, frame_ix: Option<usize>) {
        self.seeks = false;
        self.player.plays = false;
        match frame_ix {
            Some(frame_ix) => self.go_to(frame_ix),
            None if self.timeline.is_counted() => {
                self.message = Some("no such frame has a collision".to_owned());
            }
            None => self.message = Some("no such frame yet: frames are still counted".to_owned()),
        }
    }

    /// To be called after the question was changed.
    pub fn asked(&mut self, before: Question) {
        if self.question == before {
            return;
        }
        if self.question.method == Method::Naive {
            self.question.backend = Backend::Cpu;
        }
        self.changed.question = true;
        if !self.question.same_pairs(&before) {
            self.changed.timeline = true;
        }
    }

    /// To be called after what is shown was changed.
    pub fn restyled(&mut self) {
        self.changed.marks = true;
    }

    /// To be called after the view was changed.
    pub fn viewed(&mut self) {
        self.changed.view = true;
    }

    pub fn is_hidden(&self, body: usize) -> bool {
        self.screen.live.is_hidden(body)
    }

    /// Hides a body, or shows it again. It collides in any case.
    pub fn hide(&mut self, body: usize, is_hidden: bool) {
        if let Err(error) = self.screen.live.hide(body, is_hidden) {
            self.message = Some(error.to_string());
        }
        self.changed.view = true;
    }

    pub fn set_earliest(&mut self, with_earliest: bool) {
        self.with_earliest = with_earliest;
        self.changed.timeline = true;
    }

    /// Keeps where the bodies are, for undoing.
    pub fn remember(&mut self) {
        if self.undo.len() == MAX_UNDO {
            self.undo.remove(0);
        }
        self.undo.push(self.stage.moves.clone());
    }

    pub fn undo(&mut self) {
        if let Some(moves) = self.undo.pop() {
            self.place_all(&moves);
        }
    }

    pub fn is_moved(&self) -> bool {
        self.stage.moves.iter().any(|matrix| *matrix != IDENTITY)
    }

    /// Puts all bodies where their files have them.
    pub fn put_back(&mut self) {
        self.remember();
        self.place_all(&vec![IDENTITY; self.stage.moves.len()]);
    }

    fn place_all(&mut self, moves: &[Matrix]) {
        for (body, &matrix) in moves.iter().enumerate() {
            self.place(body, matrix);
        }
        self.changed.timeline = true;
    }

    /// Whether a drag moves or turns a body.
    pub fn drags_body(&self) -> bool {
        matches!(self.drag, Some(Drag::Move { .. } | Drag::Spin { .. }))
    }

    /// Moves a body; a matrix that is refused changes nothing.
    pub fn place(&mut self, body: usize, matrix: Matrix) {
        if let Err(text) = self.stage.place(body, matrix) {
            self.message = Some(text);
        }
        self.changed.positions = true;
    }

    /// To be called when a body was let go.
    pub fn released(&mut self) {
        self.changed.timeline = true;
    }

    /// The triangle at a point of the view.
    pub fn hit(&self, aspect: f64, at: [f64; 2]) -> Option<Hit> {
        let only = match self.shows {
            Shows::Everything => None,
            Shows::Colliding => self.answer.as_ref().map(|answer| &answer.colliding[..]),
            Shows::Curves => return None,
        };
        let faces = |body| match self.is_hidden(body) {
            true => None,
            false => self.screen.live.faces(body),
        };
        pick(&self.stage, faces, self.orbit.ray(aspect, at), only)
    }

    /// What is said of a point of the view: the triangle there, and how far from that point the
    /// nearest other body is.
    pub fn under(&mut self, aspect: f64, at: [f64; 2]) -> Option<String> {
        let hit = self.hit(aspect, at)?;
        let name = |body: usize| self.stage.content.bodies[body].name.as_str();
        let mut text = format!("{}, triangle {}", name(hit.body), hit.element);
        if self.prober.is_none() {
            self.prober = quiet_detector().ok();
        }
        let [start, along] = self.orbit.ray(aspect, at);
        let point = std::array::from_fn(|k| start[k] + hit.t * along[k]);
        let found = nearest(self.prober.as_mut()?, &self.stage, hit.body, point);
        match found {
            Ok(Some((other, distance))) => {
                text += &format!("\n{} from {}", four_digits(distance), name(other));
            }
            Ok(None) => {}
            Err(why) => text += &format!("\n{why}"),
        }
        Some(text)
    }

    pub fn select(&mut self, selected: Option<(usize, u32)>) {
        self.selected = selected;
        self.changed.marks = true;
    }

    /// The partners of the selected element.
    pub fn partners(&self) -> Vec<(usize, u32)> {
        let (Some((body, element)), Some(answer)) = (self.selected, &self.answer) else {
            return Vec::new();
        };
        let Some(id) = self.stage.id(body) else {
            return Vec::new();
        };
        let own = Element { body: id, element };
        let number = |other: Element| {
            let bodies = &self.stage.content.bodies;
            let body = bodies.iter().position(|shown| shown.id == other.body)?;
            Some((body, other.element))
        };
        let other = |(a, b): (Element, Element)| match (a == own, b == own) {
            (true, _) => number(b),
            (_, true) => number(a),
            _ => None,
        };
        answer.pairs.iter().filter_map(other).collect()
    }

    /// The places of collision, as the program numbers them. None where there are too many pairs,
    /// or where they cannot be told: then there is a message. They are found when they are first
    /// asked for after the answer has changed.
    pub fn places(&mut self) -> &[Place] {
        let answer = match &self.answer {
            Some(answer) if answer.pairs.len() <= MOST_PAIRS => answer,
            _ => return &[],
        };
        if self.places.is_none() {
            let found = places(&self.stage, answer).unwrap_or_else(|text| {
                self.message = Some(text);
                Vec::new()
            });
            self.places = Some(found);
        }
        self.places.as_deref().unwrap_or_default()
    }

    /// Flies to the next place of collision, or to the one before.
    pub fn next_place(&mut self, by: isize) {
        let n = self.places().len();
        if n == 0 {
            self.place = None;
            self.message = Some(match &self.answer {
                Some(answer) if answer.pairs.len() > MOST_PAIRS => {
                    "there are too many pairs to tell places apart".to_owned()
                }
                _ => "nothing collides in this frame".to_owned(),
            });
            return;
        }
        let next = match self.place {
            None if by < 0 => n - 1,
            None => 0,
            Some((ix, _)) => (ix % n + n).saturating_add_signed(by) % n,
        };
        self.go_to_place(next);
    }

    /// Flies to a place of collision.
    pub fn go_to_place(&mut self, number: usize) {
        let places = self.places();
        let Some(place) = places.get(number) else {
            return;
        };
        let (bounds, n) = (place.bounds, places.len());
        self.seeks = false;
        self.player.plays = false;
        self.place = Some((number, n));
        self.fly(bounds, 2.5);
    }

    /// Flies to where everything is seen.
    pub fn frame_all(&mut self) {
        if let Some(bounds) = self.stage.bounds(None) {
            self.fly(bounds, 1.0);
        }
    }

    /// Flies to the selected element.
    pub fn frame_selected(&mut self) {
        let Some((body, element)) = self.selected else {
            return;
        };
        if let Some(bounds) = self.stage.element_bounds(body, element) {
            self.fly(bounds, 6.0);
        }
    }

    /// Flies to a box, seen from so many times the distance at which it fills the view.
    fn fly(&mut self, bounds: [[f64; 3]; 2], room: f64) {
        let mut to = Orbit::around(self.orbit.camera, bounds, self.aspect);
        let everything = self.stage.bounds(None).unwrap_or([[-1.0; 3], [1.0; 3]]);
        let whole = length(everything);
        let farthest = Orbit::around(self.orbit.camera, everything, self.aspect).distance;
        // A box without size is seen from near, not from nowhere.
        to.distance = match length(bounds) > 0.0 {
            true => (to.distance * room)
                .min(farthest.max(to.distance))
                .max(1e-3 * whole),
            false => 0.1 * whole,
        };
        self.flight = Some(Flight::new(self.orbit, to));
    }

    /// Tells the shape of the view, width through height.
    pub fn set_aspect(&mut self, aspect: f64) {
        self.aspect = aspect;
        if let Some(bounds) = self.bounds.take() {
            self.orbit = Orbit::around(self.orbit.camera, bounds, aspect);
            self.changed.view = true;
        }
    }

    /// Ends a flight: the user has taken over.
    pub fn land(&mut self) {
        self.flight = None;
    }

    /// Lets time pass: frames play, the camera flies. Returns whether the window must be drawn
    /// again soon.
    pub fn advance(&mut self, seconds: f64) -> bool {
        self.timeline.update();
        self.timeline
            .set_busy(self.player.plays || self.drag.is_some());
        self.frame_ms += 0.1 * (1e3 * seconds - self.frame_ms);
        self.seek();
        if self.options.measure.is_some() {
            self.go_to((self.stage.frame_ix() + 1) % self.n_frames());
            self.changed.positions = true;
            return true;
        }
        let next = self
            .player
            .advance(self.stage.frame_ix(), self.n_frames(), seconds);
        self.go_to(next);
        if let Some(flight) = &mut self.flight {
            let (orbit, is_last) = flight.advance(seconds);
            self.orbit = orbit;
            if is_last {
                self.flight = None;
            }
            self.changed.view = true;
        }
        self.player.plays || self.flight.is_some()
    }

    /// Shows the first frame with a collision as soon as it is known. If there is none, frames
    /// play.
    fn seek(&mut self) {
        if !self.seeks || self.drag.is_some() {
            return;
        }
        if let Some(frame_ix) = self.timeline.first_collision_for_certain() {
            self.seeks = false;
            self.go_to(frame_ix);
            if self.options.focus.is_none()
                && let Some(bounds) = self.stage.bounds(None)
            {
                match &mut self.bounds {
                    Some(held) => *held = bounds,
                    None => self.orbit = Orbit::around(self.orbit.camera, bounds, self.aspect),
                }
                self.changed.view = true;
            }
        } else if self.timeline.is_counted() {
            self.seeks = false;
            self.player.plays = self.options.plays;
        }
    }

    /// Brings answer, marks and timeline up to date.
    pub fn refresh(&mut self, ctx: &egui::Context) {
        if let Some(text) = self.screen.take_error() {
            self.message = Some(format!("the graphics device reports: {text}"));
        }
        let changed = self.changed;
        if changed.timeline {
            self.timeline = start_timeline(&self.stage, self.question, self.with_earliest, ctx);
        }
        if changed.positions || changed.question {
            self.places = None;
            self.place = None;
            match self
                .finder
                .find(&self.stage, &self.question, &self.screen.device())
            {
                Ok(answer) => self.answer = Some(answer),
                Err(text) => {
                    self.answer = None;
                    self.player.plays = false;
                    self.message = Some(text);
                }
            }
        }
        if changed.positions
            && let Err(text) = self
                .screen
                .send_positions(&self.stage, self.finder.on_device())
        {
            self.message = Some(text);
        }
        if (changed.positions || changed.question || changed.marks)
            && let Err(text) = self.mark()
        {
            self.message = Some(text);
        }
        self.changed = Changed {
            view: changed.view || changed.positions || changed.question || changed.marks,
            ..Changed::default()
        };
    }

    /// Sends marks, colours and lines to the screen.
    fn mark(&mut self) -> Result<(), String> {
        let n_bodies = self.stage.content.bodies.len();
        let mut colors: Vec<Vec<(u32, [u8; 3])>> = vec![Vec::new(); n_bodies];
        let mut marks = match &self.answer {
            Some(answer) => answer.colliding.clone(),
            None => vec![Vec::new(); n_bodies],
        };
        self.note = None;
        if self.shows_near {
            let (faces, n_pairs) = near(&self.stage, &self.question, self.distance)?;
            for ((colors, faces), colliding) in colors.iter_mut().zip(faces).zip(&marks) {
                let near = faces
                    .into_iter()
                    .filter(|face| colliding.binary_search(face).is_err());
                colors.extend(near.map(|face| (face, NEAR)));
            }
            self.note = Some(format!("{n_pairs} pairs of faces within {}", self.distance));
        }
        if self.shows_impacts {
            self.note = Some(self.color_impacts(&mut marks, &mut colors)?);
        }
        for (body, element) in self.partners() {
            colors[body].push((element, PARTNER));
        }
        if let Some((body, element)) = self.selected {
            colors[body].push((element, SELECTED));
        }
        for body in 0..n_bodies {
            let live = &mut self.screen.live;
            live.mark(body, &marks[body])
                .map_err(|error| error.to_string())?;
            live.color(body, &colors[body])
                .map_err(|error| error.to_string())?;
        }
        let segments = match &self.answer {
            Some(answer) if self.shows_curves || self.shows == Shows::Curves => {
                curves(self.stage.scene(), &answer.pairs)?
            }
            _ => Vec::new(),
        };
        self.screen
            .live
            .set_lines(&segments)
            .map_err(|error| error.to_string())
    }

    /// Marks what touches on the way to the next frame, in the colours of its time. Returns a note.
    fn color_impacts(
        &mut self,
        marks: &mut [Vec<u32>],
        colors: &mut [Vec<(u32, [u8; 3])>],
    ) -> Result<String, String> {
        let scratch = self.scratch.get_or_insert_with(|| self.stage.clone());
        if !self.stage.set_ends(scratch)? {
            return Ok("no frame follows: nothing moves".to_owned());
        }
        let mut detector = quiet_detector().map_err(|error| error.to_string())?;
        let impacts = detector
            .impacts(self.stage.scene(), &self.question.query())
            .map_err(|error| error.to_string())?;
        let (scene, bodies) = (self.stage.scene(), &self.stage.content.bodies);
        let pairs = impacts.iter().map(|of| (of.kind, [of.a, of.b], of.toi));
        let times = Least::new(scene, bodies.iter().map(|shown| shown.id), pairs)
            .map_err(|error| error.to_string())?;
        for (ix, shown) in bodies.iter().enumerate() {
            let body = scene.body(shown.id).map_err(|error| error.to_string())?;
            let time = |element: u32| times.of(ix, body.elements().corners(element as usize));
            marks[ix].clear();
            if !times.has(ix) {
                continue;
            }
            for element in (0..).take(body.n_elements()) {
                if let Some(toi) = time(element) {
                    marks[ix].push(element);
                    colors[ix].push((element, ramp(toi)));
                }
            }
        }
        Ok(match impacts.earliest() {
            None => "nothing touches before the next frame".to_owned(),
            Some(first) => format!("{} impacts, the earliest at {:?}", impacts.len(), first.toi),
        })
    }

    fn look(&self) -> Look {
        Look {
            faces: self.shows != Shows::Curves,
            only_marked: self.shows == Shows::Colliding,
            ..Look::default()
        }
    }

    /// The texture with the bodies, drawn if anything has changed.
    pub fn draw(&mut self, size: [u32; 2]) -> Option<egui::TextureId> {
        let has_size = self.screen.has_size(size);
        if has_size && !self.changed.view {
            return self.screen.drawn();
        }
        self.changed.view = false;
        let look = self.look();
        match self.screen.draw(size, &self.orbit, &look) {
            Ok(id) => Some(id),
            Err(text) => {
                self.message = Some(text);
                None
            }
        }
    }

    /// Asks where a picture is to be saved.
    pub fn ask_where(&mut self) {
        let path = picture::suggested(&self.options);
        self.saving = Some(path.display().to_string());
    }

    /// Saves a picture where the user says.
    pub fn save(&mut self) {
        let Some(path) = self.saving.take() else {
            return;
        };
        let path = PathBuf::from(path.trim());
        // The next one is suggested for the same folder.
        if let Some(folder) = path.parent() {
            self.options.folder = folder.to_owned();
        }
        let options = Options {
            camera: self.orbit.camera,
            focus: Some(Focus {
                target: self.orbit.target,
                distance: self.orbit.distance,
            }),
            shows: self.shows,
            curves: self.shows_curves,
            ..self.options.clone()
        };
        let (answer, device) = (self.answer.as_ref(), self.screen.device());
        match picture::save(&self.stage, answer, &options, &self.question, device, path) {
            Ok(saved) => {
                self.saved = Some(saved);
                let error = self.save_error.take();
                if self.message == error {
                    self.message = None;
                }
            }
            Err(text) => {
                self.save_error = Some(text.clone());
                self.message = Some(text);
            }
        }
    }
}

fn start_timeline(
    stage: &Stage,
    question: Question,
    with_earliest: bool,
    ctx: &egui::Context,
) -> Timeline {
    let ctx = ctx.clone();
    let wake = move || ctx.request_repaint_after(NEWS);
    Timeline::start(stage, question, with_earliest, wake)
}

/// A number with four digits.
fn four_digits(x: f64) -> String {
    let rounded = format!("{x:.3e}").parse::<f64>();
    rounded.map_or_else(|_| x.to_string(), |x| x.to_string())
}

/// The diagonal of a box.
fn length([low, high]: [[f64; 3]; 2]) -> f64 {
    (0..3)
        .map(|k| (high[k] - low[k]).powi(2))
        .sum::<f64>()
        .sqrt()
}
