//! Repeats the measurements of the paper "Real-time Collision Detection with Two-level Spatial
//! Hashing on GPU": its tables and figures, with the paper's own numbers beside ours.
//!
//! [`run`] measures and returns an [`Outcome`]: a [`Report`] of plain data, and figures.
//! [`Outcome::write`] writes both as Markdown, HTML and JSON.

mod benchmark;
mod chapters;
mod contest;
mod control;
mod course;
mod document;
mod duplicates;
mod error;
mod figures;
mod finders;
mod machine;
mod markdown;
mod options;
mod pictures;
mod plots;
pub mod published;
pub mod report;
mod run;
mod samples;
mod scenes;
mod sweep;
mod volumes;
mod write;

pub use control::{Control, Progress};
pub use error::Error;
pub use machine::{Adapter, Machine};
pub use options::{Backends, Options, SceneName, Waving};
pub use pictures::File;
pub use report::Report;
pub use run::{Outcome, run};
pub use samples::Samples;
