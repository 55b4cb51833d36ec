//! The panels: the answer and switches at the side, the timeline below.

use eframe::egui::{self, Color32, Pos2, Rect, RichText, Sense, Stroke, Ui};
use impinge::{Method, SharedVertex};

use crate::input::KEYS;
use crate::options::{Backend, Shows};
use crate::session::Session;
use crate::timeline::Count;

/// The colour of messages, and of the first collision.
pub(crate) const RED: Color32 = Color32::from_rgb(190, 30, 45);
const BAR: Color32 = Color32::from_rgb(214, 39, 40);
const CURSOR: Color32 = Color32::from_rgb(27, 95, 217);
const IMPACT: Color32 = Color32::from_rgb(240, 160, 30);
/// The most partners that are listed.
const MAX_PARTNERS: usize = 12;

/// The panel at the side.
pub(crate) fn side(ui: &mut Ui, session: &mut Session) {
    egui::Panel::right("side")
        .resizable(false)
        .exact_size(252.0)
        .show(ui, |ui| {
            egui::ScrollArea::vertical().show(ui, |ui| {
                answer(ui, session);
                ui.separator();
                questions(ui, session);
                ui.separator();
                shown(ui, session);
                ui.separator();
                selection(ui, session);
                actions(ui, session);
                ui.collapsing("Keys and mouse", help);
            });
        });
}

fn answer(ui: &mut Ui, session: &Session) {
    let Some(answer) = &session.answer else {
        ui.heading("no answer");
        return;
    };
    ui.heading(counted(answer.pairs.len(), "pair"));
    ui.label(RichText::new(format!("hash {:016x}", answer.pairs.hash())).monospace());
    ui.label(format!("{:.3} ms, {}", answer.ms, answer.how));
    for (shown, colliding) in session.stage.content.bodies.iter().zip(&answer.colliding) {
        let [r, g, b] = shown.colors.colliding;
        let n = session
            .stage
            .scene()
            .body(shown.id)
            .map_or(0, |body| body.n_primitives());
        let name = short(&shown.name);
        let text = format!(
            "{name}: {} of {} collide",
            grouped(colliding.len()),
            grouped(n)
        );
        ui.label(RichText::new(text).color(Color32::from_rgb(r, g, b)))
            .on_hover_text(&shown.name);
    }
    if session.player.plays || session.options.measure.is_some() {
        let fps = 1e3 / session.frame_ms.max(1e-3);
        ui.weak(format!("{fps:.0} frames per second"));
    }
}

/// Switches that change what is asked, or how it is found.
fn questions(ui: &mut Ui, session: &mut Session) {
    let before = session.question;
    let question = &mut session.question;
    ui.checkbox(&mut question.within, "Self-collision");
    ui.horizontal(|ui| {
        ui.label("Neighbours");
        ui.radio_value(
            &mut question.shared_vertex,
            SharedVertex::Resolve,
            "resolve",
        );
        ui.radio_value(&mut question.shared_vertex, SharedVertex::Skip, "skip");
    });
    ui.horizontal(|ui| {
        ui.label("Method");
        ui.radio_value(&mut question.method, Method::Clusters, "clusters");
        ui.radio_value(&mut question.method, Method::Cells, "cells");
        ui.radio_value(&mut question.method, Method::Naive, "naive");
    });
    ui.horizontal(|ui| {
        ui.label("On the");
        ui.radio_value(&mut question.backend, Backend::Cpu, "CPU");
        ui.add_enabled_ui(question.method != Method::Naive, |ui| {
            ui.radio_value(&mut question.backend, Backend::Gpu, "GPU");
        });
    });
    session.asked(before);
}

/// Switches that change what is seen.
fn shown(ui: &mut Ui, session: &mut Session) {
    let before = session.shows;
    ui.radio_value(&mut session.shows, Shows::Everything, "Everything");
    ui.radio_value(&mut session.shows, Shows::Colliding, "Only what collides");
    ui.radio_value(&mut session.shows, Shows::Curves, "Only curves");
    let mut changed = before != session.shows;
    changed |= ui
        .checkbox(&mut session.shows_curves, "Intersection curves")
        .changed();
    if session.n_frames() > 1 {
        changed |= ui
            .checkbox(&mut session.shows_impacts, "Impacts by time")
            .on_hover_text("What touches on the way to the next frame: early red, late yellow")
            .changed();
    }
    ui.horizontal(|ui| {
        let label = ui.checkbox(&mut session.shows_near, "Within");
        changed |= label.changed();
        let speed = 0.02 * session.distance.max(1e-9);
        let range = 0.0..=f64::MAX;
        let value = egui::DragValue::new(&mut session.distance)
            .speed(speed)
            .range(range)
            .max_decimals(6);
        changed |= ui.add(value).labelled_by(label.id).changed() && session.shows_near;
    });
    if let Some(note) = &session.note {
        ui.label(note);
    }
    if changed {
        session.restyled();
    }
}

fn selection(ui: &mut Ui, session: &mut Session) {
    let Some((body, primitive)) = session.selected else {
        ui.weak("Click a triangle for its number.");
        return;
    };
    let partners = session.partners();
    let bodies = &session.stage.content.bodies;
    let name = |body: usize| bodies.get(body).map_or("", |shown| short(&shown.name));
    let held = bodies
        .get(body)
        .and_then(|shown| session.stage.scene().body(shown.id).ok());
    let Some(held) = held else {
        return;
    };
    let corners = held.elements().corners(primitive as usize);
    let mut text = format!(
        "{} {primitive} of {} (body {body})\nvertices {}",
        kind(held.kind()),
        name(body),
        corners
            .iter()
            .map(u32::to_string)
            .collect::<Vec<_>>()
            .join(", ")
    );
    match partners.len() {
        0 => text.push_str("\ncollides with nothing"),
        n => {
            text.push_str(&format!("\ncollides with {}:", counted(n, "primitive")));
            for &(other, primitive) in partners.iter().take(MAX_PARTNERS) {
                text.push_str(&format!("\n  {primitive} of {}", name(other)));
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

fn kind(kind: impinge::Kind) -> &'static str {
    match kind {
        impinge::Kind::Tetrahedra => "tetrahedron",
        impinge::Kind::Triangles => "triangle",
        impinge::Kind::Edges => "edge",
        impinge::Kind::Points => "point",
    }
}

fn actions(ui: &mut Ui, session: &mut Session) {
    ui.horizontal_wrapped(|ui| {
        if ui.button("Next place").clicked() {
            session.next_place(1);
        }
        if ui.button("See all").clicked() {
            session.frame_all();
        }
        if ui.button("Save picture").clicked() {
            session.save();
        }
        let is_moved = session.is_moved();
        if ui
            .add_enabled(is_moved, egui::Button::new("Put bodies back"))
            .clicked()
        {
            session.put_back();
        }
    });
    if let Some((ix, n)) = session.place {
        ui.label(format!("place {} of {n}", ix + 1));
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
                if ui.button(text).clicked() {
                    session.player.plays = !session.player.plays;
                }
                ui.label(format!(
                    "frame {} of {}",
                    session.stage.frame_ix(),
                    session.n_frames()
                ));
                ui.label(format!("{} per second", session.player.speed));
                if ui.button("First collision").clicked() {
                    session.jump(session.timeline.first_collision());
                }
                if ui.button("Next collision").clicked() {
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

/// One bar per frame, or per column of pixels where there are more frames: the most pairs of its frames.
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
    for column in 0..n_columns {
        let begin = column * n_frames / n_columns;
        let end = ((column + 1) * n_frames / n_columns).max(begin + 1);
        let frames = &counts[begin..end.min(n_frames)];
        let x = room.min.x + column as f32 * width;
        let bar = |height: f32, color: Color32| {
            let min = Pos2::new(x, room.max.y - height);
            let max = Pos2::new(x + (width - 0.5).max(0.5), room.max.y);
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
