//! Figures 4 and 6: a frame of each benchmark, its colliding primitives red and blue.

use crate::course::Course;
use crate::error::Error;

/// A file of the report.
#[derive(Debug, Clone, PartialEq)]
pub struct File {
    /// Its name in the report's folder.
    pub name: String,
    /// What it holds.
    pub bytes: Vec<u8>,
}

/// Draws pictures, where there is something to draw them with.
#[derive(Default)]
pub(crate) struct Painter {
    pub files: Vec<File>,
}

impl Painter {
    pub fn paint(
        &mut self,
        _course: &dyn Course,
        _rows: &[[u32; 4]],
    ) -> Result<Option<String>, Error> {
        Ok(None)
    }
}
