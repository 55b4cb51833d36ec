//! The child's side: paths in, rows out, one line of JSON each.

use std::io::{self, BufRead, Write};
use std::path::Path;

use serde_json::Value;

use crate::analysis::Options;
use crate::file::check_file;

/// The key under which a child says the marks of a row, for its parent alone.
pub const MARKS: &str = "marks";
/// The same of its notes.
pub const NOTES: &str = "notes";

/// Answers each line of `input`, a path as a JSON string, with the row of its mesh on a line of
/// `output`, until the input ends.
///
/// # Errors
/// A line that is not a JSON string; an error of input or output.
pub fn serve(input: impl BufRead, mut output: impl Write, options: &Options) -> io::Result<()> {
    for line in input.lines() {
        let Value::String(path) = serde_json::from_str(&line?)? else {
            return Err(io::Error::new(
                io::ErrorKind::InvalidData,
                "expected a path as a JSON string",
            ));
        };
        let row = check_file(Path::new(&path), options);
        let mut object = row.to_json();
        if let Some(marks) = &row.marks {
            object[MARKS] = marks.to_json();
        }
        if !row.notes.is_empty() {
            object[NOTES] = row.notes.into();
        }
        writeln!(output, "{object}")?;
        output.flush()?;
    }
    Ok(())
}
