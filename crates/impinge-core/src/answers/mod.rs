//! Answers: what a detector hands to its user, one file per kind of question.

pub(crate) mod advance;
mod areas;
pub(crate) mod candidates;
pub(crate) mod changes;
pub(crate) mod closest;
pub(crate) mod hits;
pub(crate) mod home;
pub(crate) mod impacts;
pub(crate) mod near;
pub(crate) mod neighbours;
pub(crate) mod numbering;
pub(crate) mod pairs;
pub(crate) mod places;
pub(crate) mod reached;
pub(crate) mod safe;
pub(crate) mod stencil;
pub(crate) mod stencils;
pub(crate) mod truncation;
