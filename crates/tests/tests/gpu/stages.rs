//! The buffers of a frame, each too small.

use impinge_core::Capacities;

/// Makes the room of a buffer too small.
pub type Shrink = fn(&mut Capacities);

/// Each buffer, and how it is made too small.
pub const STAGES: [(&str, Shrink); 7] = [
    ("queue", |room| room.queue = 3),
    ("items", |room| room.items = 2),
    ("kept", |room| room.kept = 9),
    ("entries", |room| room.entries = 7),
    ("candidates", |room| room.candidates = 5),
    ("pairs", |room| room.pairs = 1),
    ("unsure", |room| room.unsure = 1),
];
