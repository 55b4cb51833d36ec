//! The child's side: paths in, rows out, one line of JSON each.

#[cfg(unix)]
use std::ffi::OsString;
use std::io::{self, BufRead, Write};
#[cfg(unix)]
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::analysis::Options;
use crate::file::check_file;

/// The key under which a child says the marks of a row, for its parent alone.
pub const MARKS: &str = "marks";
/// The same of its notes.
pub const NOTES: &str = "notes";

/// The line that asks for a mesh: its path as a JSON string or, where that is not UTF-8, as an array
/// of its bytes; `None` where paths that are not Unicode have no bytes.
pub fn question(path: &Path) -> Option<Value> {
    if let Some(text) = path.to_str() {
        return Some(text.into());
    }
    #[cfg(unix)]
    return Some(path.as_os_str().as_bytes().into());
    #[cfg(not(unix))]
    None
}

/// The path of a [`question`].
fn asked(question: &Value) -> Option<PathBuf> {
    match question {
        Value::String(path) => Some(path.into()),
        #[cfg(unix)]
        Value::Array(bytes) => {
            let byte = |value: &Value| u8::try_from(value.as_u64()?).ok();
            let bytes: Option<Vec<u8>> = bytes.iter().map(byte).collect();
            Some(OsString::from_vec(bytes?).into())
        }
        _ => None,
    }
}

/// Answers each line of `input`, a path as a JSON string, or an array of its bytes where it is not
/// UTF-8, with the row of its mesh on a line of `output`, until the input ends.
///
/// # Errors
/// A line that is no path; an error of input or output.
pub fn serve(input: impl BufRead, mut output: impl Write, options: &Options) -> io::Result<()> {
    for line in input.lines() {
        let Some(path) = asked(&serde_json::from_str(&line?)?) else {
            return Err(io::Error::new(
                io::ErrorKind::InvalidData,
                "expected a path as a JSON string or an array of its bytes",
            ));
        };
        let row = check_file(&path, options);
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
