//! The only room that asks for the time: [`Instant`] is the standard library's, and in a browser, where that one
//! panics, the page's clock.

pub use web_time::Instant;
