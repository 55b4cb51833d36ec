//! The bodies in the middle of the window, and what the mouse does there.

use eframe::egui::{self, PointerButton, Pos2, Rect, Response, Sense, Tooltip, Ui};

use crate::drag::{self, Drag};
use crate::panel;
use crate::pick::dot;
use crate::session::Session;

/// A notch of a mouse wheel (50 points) is a factor of about 1.16.
const ZOOM: f64 = 0.003;

/// Shows the bodies, and moves them or the view.
pub(crate) fn show(ui: &mut Ui, session: &mut Session) {
    egui::CentralPanel::no_frame().show(ui, |ui| {
        let rect = ui.available_rect_before_wrap();
        let response = ui.allocate_rect(rect, Sense::click_and_drag());
        // A window of one pixel has no room for bodies.
        if !(rect.width() >= 1.0 && rect.height() >= 1.0) {
            return;
        }
        session.set_aspect(aspect(rect));
        pointer(&response, rect, session);
        session.refresh(ui.ctx());
        let scale = ui.ctx().pixels_per_point();
        let size = [rect.width(), rect.height()].map(|x| (x * scale).round().max(1.0) as u32);
        if let Some(id) = session.draw(size) {
            let whole = Rect::from_min_max(Pos2::ZERO, Pos2::new(1.0, 1.0));
            ui.painter().image(id, rect, whole, egui::Color32::WHITE);
        }
        under_pointer(&response, rect, session);
        overlay(ui, rect, session);
        legend(ui, rect, session);
    });
}

fn aspect(rect: Rect) -> f64 {
    f64::from(rect.width()) / f64::from(rect.height())
}

/// A point of the window as a point of the view: -1 to 1, upwards.
fn in_view(rect: Rect, at: Pos2) -> [f64; 2] {
    let part = (at - rect.min) / rect.size();
    [f64::from(2.0 * part.x - 1.0), f64::from(1.0 - 2.0 * part.y)]
}

fn pointer(response: &Response, rect: Rect, session: &mut Session) {
    let ctx = &response.ctx;
    let button = [
        PointerButton::Primary,
        PointerButton::Secondary,
        PointerButton::Middle,
    ]
    .into_iter()
    .find(|&button| response.drag_started_by(button));
    if let Some(button) = button {
        let from = ctx.input(|input| input.pointer.press_origin());
        let shift = ctx.input(|input| input.modifiers.shift);
        session.drag = from.map(|from| begin(session, rect, from, button, shift));
        session.land();
    }
    let delta = response.drag_delta();
    if let Some(drag) = session.drag
        && delta != egui::Vec2::ZERO
    {
        go_on(
            session,
            drag,
            f64::from(rect.height()),
            [f64::from(delta.x), f64::from(delta.y)],
        );
    }
    if response.drag_stopped() {
        if session.drags_body() {
            session.released();
        }
        session.drag = None;
    }
    if response.clicked()
        && let Some(at) = response.interact_pointer_pos()
    {
        let hit = session.hit(aspect(rect), in_view(rect, at));
        session.select(hit.map(|hit| (hit.body, hit.element)));
    }
    if let Some(at) = response.hover_pos() {
        let scrolled = ctx.input(|input| f64::from(input.smooth_scroll_delta().y));
        let pinched = ctx.input(|input| f64::from(input.zoom_delta()));
        let factor = (-ZOOM * scrolled).exp() / pinched.max(1e-3);
        if factor != 1.0 {
            zoom(session, rect, at, factor);
        }
    }
}

/// Says what is under a pointer that rests.
fn under_pointer(response: &Response, rect: Rect, session: &mut Session) {
    let is_free = session.drag.is_none() && !session.player.plays;
    let Some(at) = response.hover_pos().filter(|_| is_free) else {
        return;
    };
    if Tooltip::should_show_tooltip(response, false)
        && let Some(text) = session.under(aspect(rect), in_view(rect, at))
    {
        response.clone().on_hover_text_at_pointer(text);
    }
}

/// What a drag does that begins here.
fn begin(
    session: &mut Session,
    rect: Rect,
    from: Pos2,
    button: PointerButton,
    shift: bool,
) -> Drag {
    match button {
        PointerButton::Middle => return Drag::Shift,
        PointerButton::Secondary if shift => return Drag::Shift,
        PointerButton::Secondary => return Drag::Turn,
        _ => {}
    }
    let (aspect, at) = (aspect(rect), in_view(rect, from));
    let Some(hit) = session.hit(aspect, at) else {
        return Drag::Turn;
    };
    session.remember();
    if shift {
        let bounds = session.stage.bounds(Some(hit.body)).unwrap_or_default();
        let center = std::array::from_fn(|k| 0.5 * bounds[0][k] + 0.5 * bounds[1][k]);
        return Drag::Spin {
            body: hit.body,
            center,
        };
    }
    let [start, along] = session.orbit.ray(aspect, at);
    let point = std::array::from_fn(|k| start[k] + hit.t * along[k]);
    let depth = session
        .orbit
        .project(aspect, point)
        .map_or(1.0, |(_, depth)| depth / session.orbit.distance);
    Drag::Move {
        body: hit.body,
        depth,
    }
}

fn go_on(session: &mut Session, drag: Drag, height: f64, delta: [f64; 2]) {
    match drag {
        Drag::Turn => {
            drag::turn(&mut session.orbit, delta);
            session.viewed();
        }
        Drag::Shift => {
            let by = drag::along_view(&session.orbit, height, delta);
            for (x, by) in session.orbit.target.iter_mut().zip(by) {
                *x -= by;
            }
            session.viewed();
        }
        Drag::Move { body, depth } => {
            let is_flat =
                session.orbit.camera.projection == impinge_render::Projection::Orthographic;
            let factor = if is_flat { 1.0 } else { depth };
            let by = drag::along_view(&session.orbit, height, delta).map(|x| factor * x);
            let matrix = drag::moved(&session.stage.moves[body], by);
            session.place(body, matrix);
        }
        Drag::Spin { body, center } => {
            let matrix = drag::spun(&session.stage.moves[body], &session.orbit, center, delta);
            session.place(body, matrix);
        }
    }
}

/// Changes the distance by a factor, so that what is under the pointer stays there.
fn zoom(session: &mut Session, rect: Rect, at: Pos2, factor: f64) {
    session.land();
    let orbit = &mut session.orbit;
    // The whole range of finite distances at which single precision shows anything.
    let distance = orbit.distance * factor;
    if !(distance > 1e-30 && distance < 1e30) {
        return;
    }
    let [start, along] = orbit.ray(aspect(rect), in_view(rect, at));
    let [.., back] = orbit.axes();
    // Where the ray through the pointer meets the plane of the target.
    let height = dot(back, orbit.target) - dot(back, start);
    let t = height / dot(back, along);
    for k in 0..3 {
        let point = start[k] + t * along[k];
        orbit.target[k] = point + factor * (orbit.target[k] - point);
    }
    orbit.distance = distance;
    session.viewed();
}

/// The legend, in the lower left corner. The pointer goes through it.
fn legend(ui: &Ui, rect: Rect, session: &Session) {
    if !(rect.width() > 200.0 && rect.height() > 200.0) {
        return;
    }
    let area = egui::Area::new(egui::Id::unique("legend"))
        .order(egui::Order::Middle)
        .constrain_to(rect)
        .anchor(egui::Align2::LEFT_BOTTOM, [10.0, -10.0])
        .interactable(false);
    area.show(ui.ctx(), |ui| {
        let fill = egui::Color32::from_white_alpha(200);
        let frame = egui::Frame::new().fill(fill).inner_margin(6.0);
        frame.show(ui, |ui| panel::legend(ui, session));
    });
}

/// Texts over the bodies.
fn overlay(ui: &mut Ui, rect: Rect, session: &mut Session) {
    let text = session.messages().collect::<Vec<_>>().join("\n");
    if text.is_empty() {
        return;
    }
    let width = (rect.width() - 20.0).max(1.0);
    let room = Rect::from_min_size(rect.min + egui::vec2(10.0, 10.0), egui::vec2(width, 60.0));
    ui.scope_builder(egui::UiBuilder::new().max_rect(room), |ui| {
        egui::Frame::popup(ui.style()).show(ui, |ui| {
            ui.horizontal_wrapped(|ui| {
                ui.label(egui::RichText::new(text).color(panel::RED));
                if ui.small_button("Dismiss").clicked() {
                    session.dismiss();
                }
            });
        });
    });
}
