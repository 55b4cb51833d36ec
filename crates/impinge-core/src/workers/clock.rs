//! The only module that reads the time. [`Instant`] is the standard library's. In a browser, where
//! that one panics, it is the page's clock.

pub use web_time::Instant;
