//! Keys.

use eframe::egui::{Context, Key, Modifiers};

use crate::session::Session;

/// Keys and what they do, for the user.
pub(crate) const KEYS: [(&str, &str); 14] = [
    ("Space", "play or pause"),
    ("Left, Right", "one frame back or on"),
    ("Home, End", "first or last frame"),
    ("[, ]", "half or double speed"),
    ("N, P", "next or previous frame with a collision"),
    ("B", "first frame with a collision"),
    ("C", "everything, only what collides, only curves"),
    ("I", "intersection curves"),
    ("J, Shift+J", "next or previous place of collision"),
    ("F", "see everything"),
    (".", "see the selected triangle"),
    ("Ctrl+Z", "undo a move"),
    ("S", "save a picture: asks where"),
    ("Escape", "select nothing; save no picture"),
];

/// Does what the keys say that were pressed since the last frame, unless a text is being edited.
pub(crate) fn keys(ctx: &Context, session: &mut Session) {
    if ctx.egui_wants_keyboard_input() {
        return;
    }
    // Consumed, so that Space presses no button that has the focus, and arrows do not move it.
    let pressed = |key| ctx.input_mut(|input| input.consume_key(Modifiers::NONE, key));
    if ctx.input_mut(|input| input.consume_key(Modifiers::COMMAND, Key::Z)) {
        session.undo();
    }
    if ctx.input_mut(|input| input.consume_key(Modifiers::SHIFT, Key::J)) {
        session.next_place(-1);
    }
    if pressed(Key::J) {
        session.next_place(1);
    }
    if pressed(Key::Space) && session.n_frames() > 1 {
        session.play_or_pause();
    }
    if pressed(Key::ArrowRight) {
        session.step(1);
    }
    if pressed(Key::ArrowLeft) {
        session.step(-1);
    }
    if pressed(Key::Home) {
        session.jump(Some(0));
    }
    if pressed(Key::End) {
        session.jump(Some(session.n_frames() - 1));
    }
    if pressed(Key::OpenBracket) {
        session.player.change_speed(0.5);
    }
    if pressed(Key::CloseBracket) {
        session.player.change_speed(2.0);
    }
    if pressed(Key::N) {
        session.jump(session.timeline.next_collision(session.stage.frame_ix()));
    }
    if pressed(Key::P) {
        session.jump(
            session
                .timeline
                .previous_collision(session.stage.frame_ix()),
        );
    }
    if pressed(Key::B) {
        session.jump(session.timeline.first_collision());
    }
    if pressed(Key::C) {
        session.shows = session.shows.next();
        session.restyled();
    }
    if pressed(Key::I) {
        session.shows_curves = !session.shows_curves;
        session.restyled();
    }
    if pressed(Key::F) {
        session.frame_all();
    }
    if pressed(Key::Period) {
        session.frame_selected();
    }
    if pressed(Key::S) {
        session.ask_where();
    }
    if pressed(Key::Escape) {
        session.select(None);
        session.dismiss();
        session.saving = None;
    }
}
