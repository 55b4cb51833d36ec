// Times of a step, and what moves at a time.

// Times are whole numbers of ticks, so a time and its difference to 1 are exact.
const TICKS: u32 = 0x1000000u;
const TICK: f32 = 0x1p-24f;
// Twice the whole step: no time.
const NONE: u32 = 2u * TICKS;

// A time as a part of the step: exact.
fn time_of(ticks: u32) -> f32 {
    return f32(ticks) * TICK;
}

// Not `mix`, which a device may compute in other ways.
fn at(d: MovingFour, time: u32) -> Four {
    return sum_four(scaled_four(d.start, time_of(TICKS - time)), scaled_four(d.end, time_of(time)));
}
