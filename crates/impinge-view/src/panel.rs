//! The panels: the answer and switches at the side, the timeline below.

use eframe::egui::{self, Color32, Pos2, Rect, RichText, Sense, Stroke, Ui};
use impinge::{Method, SharedVertex};
use impinge_render::ramp;

use crate::input::KEYS;
use crate::options::{Backend, Shows};
use crate::picture::CURVE;
use crate::session::{self, Session};
use crate::timeline::Count;

/// The colour of messages, and of the first collision.
pub(crate) const RED: Color32 = Color32::from_rgb(190, 30, 45);
const BAR: Color32 = Color32::from_rgb(214, 39, 40);
const CURSOR: Color32 = Color32::from_rgb(27, 95, 217);
const IMPACT: Color32 = Color32::from_rgb(240, 160, 30);
/// The most partners that are listed.
const MAX_PARTNERS: usize = 12;
/// The most places that are listed.
const MAX_PLACES: usize = 100;
/// The most bodies in the legend.
const MAX_LEGEND: usize = 8;

/// The panel at the side.
pub(crate) fn side(ui: &mut Ui, session: &mut Session) {
    egui::Panel::right("side")
        .resizable(false)
        .exact_size(252.0)
        .show(ui, |ui| {
            egui::ScrollArea::vertical().show(ui, |ui| {
                answer(ui, session);
                bodies(ui, session);
                ui.separator();
                places(ui, session);
                selection(ui, session);
                actions(ui, session);
                ui.separator();
                shown(ui, session);
                ui.separator();
                questions(ui, session);
                ui.collapsing("Keys and mouse", help);
            });
        });
}

fn answer(ui: &mut Ui, session: &Session) {
    let Some(answer) = &session.answer else {
        ui.heading("no answer");
        return;
    };
    ui.heading(counted(answer.pairs.len(), "pair"))
        .on_hover_text(
            "Pairs of triangles (or tetrahedra) that share a point, in the frame that is shown",
        );
    ui.label(RichText::new(format!("hash {:016x}", answer.pairs.hash())).monospace())
        .on_hover_text("A number made from all pairs: the same wherever the same pairs are found");
    ui.label(format!("{:.3} ms, {}", answer.ms, answer.how))
        .on_hover_text("How long the pairs took to find, by which method, and where");
    if session.player.plays || session.options.measure.is_some() {
        let fps = 1e3 / session.frame_ms.max(1e-3);
        ui.weak(format!("{fps:.0} frames per second"));
    }
}

/// The bodies by name and colour, each with a switch.
fn bodies(ui: &mut Ui, session: &mut Session) {
    for ix in 0..session.stage.content.bodies.len() {
        let shown = &session.stage.content.bodies[ix];
        let [r, g, b] = shown.colors.colliding;
        let held = session.stage.scene().body(shown.id);
        let n = held.map_or(0, |body| body.n_elements());
        let n_colliding = match &session.answer {
            Some(answer) => answer.colliding.get(ix).map_or(0, Vec::len),
            None => 0,
        };
        let (name, whole_name) = (short(&shown.name).to_owned(), shown.name.clone());
        let text = format!("{name}: {} of {} collide", grouped(n_colliding), grouped(n));
        let mut is_shown = !session.is_hidden(ix);
        let text = RichText::new(text).color(Color32::from_rgb(r, g, b));
        let switch = ui.checkbox(&mut is_shown, text);
        if switch.changed() {
            session.hide(ix, !is_shown);
        }
        switch.on_hover_text(format!(
            "{whole_name}\nWithout the tick the body is hidden. It collides in any case."
        ));
    }
}

/// The places of collision, to click. They are not sought while frames play or a body is dragged.
fn places(ui: &mut Ui, session: &mut Session) {
    if session.player.plays || session.drags_body() {
        return;
    }
    let current = session.place.map(|(ix, _)| ix);
    let places = session.places();
    let n = places.len();
    if n == 0 {
        return;
    }
    let listed = places.iter().take(MAX_PLACES);
    let listed: Vec<([usize; 2], usize)> =
        listed.map(|place| (place.bodies, place.n_pairs)).collect();
    ui.label(counted(n, "place"))
        .on_hover_text("Groups of pairs that hang together, those with the most pairs first: as `impinge pairs --json` lists them");
    let mut chosen = None;
    let area = egui::ScrollArea::vertical()
        .id_salt("places")
        .max_height(132.0);
    area.show(ui, |ui| {
        for (ix, &(bodies, n_pairs)) in listed.iter().enumerate() {
            let names = bodies.map(|body| {
                let shown = session.stage.content.bodies.get(body);
                shown.map_or("", |shown| short(&shown.name))
            });
            let who = match bodies[0] == bodies[1] {
                true => names[0].to_owned(),
                false => format!("{}, {}", names[0], names[1]),
            };
            let text = format!("{}. {}: {who}", ix + 1, counted(n_pairs, "pair"));
            if ui.selectable_label(current == Some(ix), text).clicked() {
                chosen = Some(ix);
            }
        }
        if n > MAX_PLACES {
            ui.weak(format!("and {} more", grouped(n - MAX_PLACES)));
        }
    });
    if let Some(ix) = chosen {
        session.go_to_place(ix);
    }
    ui.separator();
}

/// What colours mean, over the bodies.
pub(crate) fn legend(ui: &mut Ui, session: &Session) {
    let line = |ui: &mut Ui, [r, g, b]: [u8; 3], text: &str| {
        ui.horizontal(|ui| {
            let (rect, _) = ui.allocate_exact_size(egui::vec2(10.0, 10.0), Sense::hover());
            ui.painter()
                .rect_filled(rect, 2.0, Color32::from_rgb(r, g, b));
            ui.add(egui::Label::new(RichText::new(text).small()).selectable(false));
        });
    };
    if session.shows_curves || session.shows == Shows::Curves {
        line(ui, CURVE, "where surfaces cross");
    }
    if session.shows == Shows::Curves {
        return;
    }
    for (ix, shown) in session
        .stage
        .content
        .bodies
        .iter()
        .enumerate()
        .take(MAX_LEGEND)
    {
        if !session.is_hidden(ix) {
            let name = short(&shown.name);
            line(
                ui,
                shown.colors.colliding,
                &format!("{name} where it collides"),
            );
        }
    }
    if session.stage.content.bodies.len() > MAX_LEGEND {
        ui.label(RichText::new("…").small());
    }
    if session.shows == Shows::Everything
        && let Some(shown) = session.stage.content.bodies.first()
    {
        line(ui, shown.colors.other, "collides with nothing");
    }
    if session.shows_near {
        line(ui, session::NEAR, "within the distance");
    }
    if session.shows_impacts {
        line(ui, ramp(0.0), "touches soon after this frame");
        line(ui, ramp(1.0), "touches just before the next");
    }
    if session.selected.is_some() {
        line(ui, session::SELECTED, "selected");
        line(ui, session::PARTNER, "collides with the selected one");
    }
}

/// Switches that change what is asked, or how it is found.
fn questions(ui: &mut Ui, session: &mut Session) {
    let before = session.question;
    let question = &mut session.question;
    ui.checkbox(&mut question.within, "Self-collision")
        .on_hover_text("Also pairs within one body");
    ui.horizontal(|ui| {
        ui.label("Neighbours")
            .on_hover_text("Triangles of one body that share vertices");
        for (rule, name, text) in [
            (
                SharedVertex::Resolve,
                "resolve",
                "Neighbours are a pair if they also meet elsewhere",
            ),
            (SharedVertex::Skip, "skip", "Neighbours are never a pair"),
        ] {
            ui.radio_value(&mut question.shared_vertex, rule, name)
                .on_hover_text(text);
        }
    });
    ui.horizontal(|ui| {
        ui.label("Method")
            .on_hover_text("How pairs are found. All methods find the same ones.");
        for (method, name, text) in [
            (
                Method::Clusters,
                "clusters",
                "Groups fixed by topology: the fastest for meshes that move",
            ),
            (Method::Cells, "cells", "A grid, made anew for each frame"),
            (
                Method::Naive,
                "naive",
                "Every box against every box: slow, to check the others",
            ),
        ] {
            ui.radio_value(&mut question.method, method, name)
                .on_hover_text(text);
        }
    });
    ui.horizontal(|ui| {
        let text = "Where pairs are found. They are the same ones.";
        ui.label("On the").on_hover_text(text);
        ui.radio_value(&mut question.backend, Backend::Cpu, "CPU")
            .on_hover_text(text);
        ui.add_enabled_ui(question.method != Method::Naive, |ui| {
            ui.radio_value(&mut question.backend, Backend::Gpu, "GPU")
                .on_hover_text(text)
                .on_disabled_hover_text("The method naive runs on the CPU");
        });
    });
    session.asked(before);
}

/// Switches that change what is seen.
fn shown(ui: &mut Ui, session: &mut Session) {
    let before = session.shows;
    for (shows, name, text) in [
        (Shows::Everything, "Everything", "All bodies (C)"),
        (
            Shows::Colliding,
            "Only what collides",
            "Only faces that are in a pair (C)",
        ),
        (
            Shows::Curves,
            "Only curves",
            "The lines in which surfaces cross (C)",
        ),
    ] {
        ui.radio_value(&mut session.shows, shows, name)
            .on_hover_text(text);
    }
    let mut changed = before != session.shows;
    changed |= ui
        .checkbox(&mut session.shows_curves, "Intersection curves")
        .on_hover_text("Also the lines in which surfaces cross (I)")
        .changed();
    if session.n_frames() > 1 {
        changed |= ui
            .checkbox(&mut session.shows_impacts, "Impacts by time")
            .on_hover_text("What touches on the way to the next frame: early red, late yellow")
            .changed();
    }
    ui.horizontal(|ui| {
        let text =
            "Colours the faces that are at most so far from others, in the unit of the files";
        let label = ui
            .checkbox(&mut session.shows_near, "Within")
            .on_hover_text(text);
        changed |= label.changed();
        let speed = 0.02 * session.distance.max(1e-9);
        let range = 0.0..=f64::MAX;
        let value = egui::DragValue::new(&mut session.distance)
            .speed(speed)
            .range(range)
            .max_decimals(6);
        let value = ui.add(value).labelled_by(label.id).on_hover_text(text);
        changed |= value.changed() && session.shows_near;
    });
    if let Some(note) = &session.note {
        ui.label(note);
    }
    if changed {
        session.restyled();
    }
}

fn selection(ui: &mut Ui, session: &mut Session) {
    let Some((body, element)) = session.selected else {
        ui.weak("Click a triangle for its number.");
        return;
    };
    let partners = session.partners();
    let bodies = &session.stage.content.bodies;
    let name = |body: usize| bodies.get(body).map_or("", |shown| short(&shown.name));
    let Some(shown) = bodies.get(body) else {
        return;
    };
    let Ok(held) = session.stage.scene().body(shown.id) else {
        return;
    };
    let corners = held.elements().corners(element as usize);
    let mut text = format!(
        "{} {element} of {} (body {body})\nvertices {}",
        kind(held.kind()),
        name(body),
        corners
            .iter()
            .map(|&vertex| shown.vertex(vertex).to_string())
            .collect::<Vec<_>>()
            .join(", ")
    );
    match partners.len() {
        0 => text.push_str("\ncollides with nothing"),
        n => {
            text.push_str(&format!("\ncollides with {}:", counted(n, "element")));
            for &(other, element) in partners.iter().take(MAX_PARTNERS) {
                text.push_str(&format!("\n  {element} of {}", name(other)));
            }
            if n > MAX_PARTNERS {
                text.push_str(&format!("\n  and {} more", n - MAX_PARTNERS));
            }
        }
    }
    ui.label(&text);
    if ui.button("Copy").clicked() {
        ui.ctx().copy_text(text);
    }
}

fn kind(kind: impinge::BodyKind) -> &'static str {
    match kind {
        impinge::BodyKind::Tetrahedra => "tetrahedron",
        impinge::BodyKind::Triangles => "triangle",
        impinge::BodyKind::Edges => "edge",
        impinge::BodyKind::Points => "point",
    }
}

fn actions(ui: &mut Ui, session: &mut Session) {
    ui.horizontal_wrapped(|ui| {
        let next = ui
            .button("Next place")
            .on_hover_text("Fly to the next place of collision (J)");
        if next.clicked() {
            session.next_place(1);
        }
        if ui
            .button("See all")
            .on_hover_text("Fly to where all bodies are seen (F)")
            .clicked()
        {
            session.frame_all();
        }
        if ui
            .button("Save picture")
            .on_hover_text(
                "Asks where (S). Hidden bodies are in it: the command that makes it again has no option for them.",
            )
            .clicked()
        {
            session.ask_where();
        }
        let is_moved = session.is_moved();
        if ui
            .add_enabled(is_moved, egui::Button::new("Put bodies back"))
            .on_hover_text("Undo all moves: bodies are where their files have them")
            .clicked()
        {
            session.put_back();
        }
    });
    if let Some((ix, n)) = session.place {
        ui.label(format!("place {} of {n}", ix + 1));
    }
    if let Some(path) = &mut session.saving {
        let label = ui.label("Save the picture as");
        let text = ui.text_edit_singleline(path).labelled_by(label.id);
        if !text.lost_focus() && !text.has_focus() {
            text.request_focus();
        }
        let is_entered = text.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter));
        ui.horizontal(|ui| {
            if ui.button("Save").clicked() || is_entered {
                session.save();
            } else if ui.button("Cancel").clicked() {
                session.saving = None;
            }
        });
    }
    if let Some(saved) = session.saved.clone() {
        ui.label(format!("saved {}; again by:", saved.path.display()));
        ui.label(RichText::new(&saved.command).monospace().small());
        if ui.button("Copy command").clicked() {
            ui.ctx().copy_text(saved.command);
        }
    }
}

fn help(ui: &mut Ui) {
    for (key, what) in KEYS {
        ui.label(RichText::new(format!("{key}: {what}")).small());
    }
    for text in [
        "Drag a body: move it; with Shift: turn it",
        "Drag beside the bodies, or with the right button: turn the view",
        "Drag with the middle button: shift the view",
        "Wheel: zoom to the pointer",
        "Rest on a body: how far the nearest other body is from there",
    ] {
        ui.label(RichText::new(text).small());
    }
}

/// The panel below: frames and their pairs.
pub(crate) fn bottom(ui: &mut Ui, session: &mut Session) {
    if session.n_frames() < 2 {
        return;
    }
    egui::Panel::bottom("timeline")
        .resizable(false)
        .exact_size(104.0)
        .show(ui, |ui| {
            ui.horizontal(|ui| {
                let text = if session.player.plays {
                    "Pause"
                } else {
                    "Play"
                };
                if ui.button(text).on_hover_text("Space").clicked() {
                    session.play_or_pause();
                }
                ui.label(format!(
                    "frame {} (0 to {})",
                    session.stage.frame_ix(),
                    session.n_frames() - 1
                ));
                ui.label(format!("{} per second", session.player.speed));
                let first = ui.button("First collision");
                if first
                    .on_hover_text("Show the first frame with a collision (B)")
                    .clicked()
                {
                    session.jump(session.timeline.first_collision());
                }
                let next = ui.button("Next collision");
                if next
                    .on_hover_text("Show the next frame with a collision (N)")
                    .clicked()
                {
                    session.jump(session.timeline.next_collision(session.stage.frame_ix()));
                }
                let mut with_earliest = session.with_earliest;
                let earliest = ui
                    .checkbox(&mut with_earliest, "Earliest impacts")
                    .on_hover_text("When the first contact happens on the way to the next frame");
                if earliest.changed() {
                    session.set_earliest(with_earliest);
                }
                let here = session.timeline.earliest.get(session.stage.frame_ix());
                if let Some(Some(earliest)) = here {
                    ui.label(match earliest {
                        Some(toi) => format!("first impact at {toi:?}"),
                        None => "no impact".to_owned(),
                    });
                }
            });
            let room = ui.available_rect_before_wrap();
            let response = ui.allocate_rect(room, Sense::click_and_drag());
            if let Some(at) = response.interact_pointer_pos()
                && room.width() > 0.0
                && (response.clicked() || response.dragged())
            {
                let part = ((at.x - room.min.x) / room.width()).clamp(0.0, 1.0);
                let frame_ix = (part * session.n_frames() as f32) as usize;
                session.jump(Some(frame_ix.min(session.n_frames() - 1)));
            }
            if let Some(at) = response.hover_pos()
                && room.width() > 0.0
            {
                let part = ((at.x - room.min.x) / room.width()).clamp(0.0, 1.0);
                let frame_ix =
                    ((part * session.n_frames() as f32) as usize).min(session.n_frames() - 1);
                let text = match &session.timeline.counts[frame_ix] {
                    Count::Pending => format!("frame {frame_ix}"),
                    Count::Pairs(n) => {
                        format!("frame {frame_ix}: {}", counted(*n as usize, "pair"))
                    }
                    Count::Failed(text) => format!("frame {frame_ix}: {text}"),
                };
                response.on_hover_text_at_pointer(text);
            }
            curve(ui, room, session);
        });
}

/// One bar per frame, or per column of pixels where there are more frames: the most pairs of its
/// frames.
fn curve(ui: &Ui, room: Rect, session: &Session) {
    let painter = ui.painter_at(room);
    painter.rect_filled(room, 2.0, Color32::from_gray(235));
    let counts = &session.timeline.counts;
    let n_frames = counts.len();
    if room.width() < 1.0 || n_frames == 0 {
        return;
    }
    let pairs = |count: &Count| match count {
        Count::Pairs(n) => *n,
        _ => 0,
    };
    let most = counts.iter().map(pairs).max().unwrap_or(0).max(1);
    let n_columns = n_frames.min(room.width() as usize).max(1);
    let width = room.width() / n_columns as f32;
    // Bars begin and end between pixels, each where the one before ends: rounded apart, they would
    // have stripes between them.
    let scale = ui.ctx().pixels_per_point();
    let edge = |column: usize| {
        let x = room.min.x + column as f32 * width;
        (x * scale).round() / scale
    };
    for column in 0..n_columns {
        let begin = column * n_frames / n_columns;
        let end = ((column + 1) * n_frames / n_columns).max(begin + 1);
        let frames = &counts[begin..end.min(n_frames)];
        let x = room.min.x + column as f32 * width;
        let bar = |height: f32, color: Color32| {
            let min = Pos2::new(edge(column), room.max.y - height);
            let max = Pos2::new(edge(column + 1), room.max.y);
            painter.rect_filled(Rect::from_min_max(min, max), 0.0, color);
        };
        if frames.iter().any(|count| matches!(count, Count::Failed(_))) {
            bar(room.height(), RED);
            continue;
        }
        if frames.contains(&Count::Pending) {
            bar(2.0, Color32::from_gray(200));
            continue;
        }
        match frames.iter().map(pairs).max().unwrap_or(0) {
            0 => bar(1.0, Color32::from_gray(160)),
            // The root, so that few pairs beside many can be seen.
            n => bar(
                3.0 + (room.height() - 8.0) * (n as f32 / most as f32).sqrt(),
                BAR,
            ),
        }
        let steps = &session.timeline.earliest;
        let first = steps[begin.min(steps.len())..end.min(steps.len())]
            .iter()
            .filter_map(|earliest| earliest.flatten())
            .reduce(f64::min);
        if let Some(toi) = first {
            let center = Pos2::new(x + (toi as f32) * width, room.min.y + 4.0);
            painter.circle_filled(center, 2.0, IMPACT);
        }
    }
    let x = room.min.x + (session.stage.frame_ix() as f32 + 0.5) / n_frames as f32 * room.width();
    painter.line_segment(
        [Pos2::new(x, room.min.y), Pos2::new(x, room.max.y)],
        Stroke::new(2.0, CURSOR),
    );
}

/// The last part of a path.
fn short(name: &str) -> &str {
    name.rsplit(['/', '\\']).next().unwrap_or(name)
}

/// `1,028 pairs`
fn counted(n: usize, what: &str) -> String {
    let plural = if n == 1 { "" } else { "s" };
    format!("{} {what}{plural}", grouped(n))
}

fn grouped(n: usize) -> String {
    let digits = n.to_string();
    let mut text = String::new();
    for (ix, digit) in digits.chars().enumerate() {
        if ix > 0 && (digits.len() - ix).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_grouped() {
        assert_eq!(counted(1, "pair"), "1 pair");
        assert_eq!(counted(0, "pair"), "0 pairs");
        assert_eq!(counted(1_234_567, "pair"), "1,234,567 pairs");
        assert_eq!(counted(123, "pair"), "123 pairs");
    }

    #[test]
    fn names_of_files_are_shown_without_folders() {
        assert_eq!(short("/a/b.obj"), "b.obj");
        assert_eq!(short("b.obj"), "b.obj");
    }
}
