//! One child process and its answers.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::process::{ChildStdin, Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use impinge::CancelToken;
use serde_json::Value;

use crate::marks::MarkRuns;
use crate::row::{ErrorKind, Row};
use crate::worker::{MARKS, NOTES};

/// How often a waiting thread checks for cancellation.
const GLANCE: Duration = Duration::from_millis(50);

/// How many bytes of a child's standard error are kept: the last ones.
const KEPT: usize = 4096;

/// A running child. Dropping it kills it.
pub struct Child {
    process: std::process::Child,
    /// `None` once the child should end.
    input: Option<ChildStdin>,
    answers: Receiver<String>,
    /// Returns the last bytes of standard error once that is closed.
    complaints: Option<JoinHandle<String>>,
}

/// The result of asking a child.
pub enum Answer {
    /// The row of the mesh.
    Row(Box<Row>),
    /// No answer within the time limit.
    TooLate,
    /// The caller cancelled the run.
    Cancelled,
    /// The child ended, or printed a line that is not a row.
    Ended { kind: ErrorKind, message: String },
}

impl Child {
    /// Starts a child with pipes for input, output and errors.
    pub fn start(mut command: Command) -> io::Result<Self> {
        let mut process = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()?;
        let missing = || io::Error::other("a pipe to the child is missing");
        let output = process.stdout.take().ok_or_else(missing)?;
        let errors = process.stderr.take().ok_or_else(missing)?;
        let (sender, answers) = mpsc::channel();
        std::thread::Builder::new().spawn(move || {
            for line in BufReader::new(output).lines() {
                // Stop if the receiver is gone, or if the child does not print UTF-8.
                if !line.is_ok_and(|line| sender.send(line).is_ok()) {
                    return;
                }
            }
        })?;
        let complaints = std::thread::Builder::new().spawn(move || last_of(errors))?;
        Ok(Child {
            input: process.stdin.take(),
            process,
            answers,
            complaints: Some(complaints),
        })
    }

    /// Asks for the row of one mesh, which has this path. After any other answer than a row, drop
    /// the child.
    pub fn ask(
        &mut self,
        question: &Value,
        path: &str,
        timeout: Option<Duration>,
        cancel: &CancelToken,
    ) -> Answer {
        let started = Instant::now();
        let question = format!("{question}\n");
        let asked = self.input.as_mut().map(|input| {
            input.write_all(question.as_bytes())?;
            input.flush()
        });
        if !matches!(asked, Some(Ok(()))) {
            return self.ended();
        }
        loop {
            if cancel.is_cancelled() {
                return Answer::Cancelled;
            }
            let left = timeout.map(|timeout| timeout.saturating_sub(started.elapsed()));
            match self
                .answers
                .recv_timeout(left.unwrap_or(GLANCE).min(GLANCE))
            {
                Ok(line) => {
                    let value = serde_json::from_str(&line).ok();
                    return match value.as_ref().and_then(of_child) {
                        Some(row) if row.path == path => Answer::Row(Box::new(row)),
                        _ => Answer::Ended {
                            kind: ErrorKind::Crash,
                            message: format!(
                                "the child process printed a line that is not a row: {line}"
                            ),
                        },
                    };
                }
                Err(RecvTimeoutError::Disconnected) => return self.ended(),
                Err(RecvTimeoutError::Timeout) if left.is_some_and(|left| left.is_zero()) => {
                    return Answer::TooLate;
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }

    /// The reason why the child has ended.
    fn ended(&mut self) -> Answer {
        self.input = None;
        // The child has closed its output: it ends by itself, or is killed.
        let status = self.wait_or_kill();
        let complaints = self.complaints.take().and_then(|reader| reader.join().ok());
        let complaints = complaints.unwrap_or_default();
        let is_short = [
            "memory allocation of",
            "Cannot allocate memory",
            "os error 12",
            "os error 11",
        ]
        .iter()
        .any(|sign| complaints.contains(sign));
        let kind = if is_short {
            ErrorKind::Memory
        } else {
            ErrorKind::Crash
        };
        let how = status.map_or_else(|error| error.to_string(), |status| status.to_string());
        // The message alone, without the trace that some programs print after it.
        let said = complaints.lines().map(str::trim);
        let said = said.take_while(|line| *line != "stack backtrace:");
        let said = said.filter(|line| !line.starts_with("note: "));
        let said = said.collect::<Vec<_>>().join("\n");
        let message = match said.trim() {
            "" => format!("the child process ended: {how}"),
            said => format!("the child process ended: {how}: {said}"),
        };
        Answer::Ended { kind, message }
    }

    fn wait_or_kill(&mut self) -> io::Result<ExitStatus> {
        for _ in 0..20 {
            if let Some(status) = self.process.try_wait()? {
                return Ok(status);
            }
            std::thread::sleep(GLANCE);
        }
        self.process.kill()?;
        self.process.wait()
    }
}

impl Drop for Child {
    fn drop(&mut self) {
        // These fail only if the child has already ended.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// The row of a child's line, with its notes and the marks that were asked for.
fn of_child(value: &Value) -> Option<Row> {
    let mut row = Row::from_json(value)?;
    if let Some(marks) = value.get(MARKS) {
        row.marks = Some(MarkRuns::from_json(marks)?);
    }
    if let Some(Value::Array(notes)) = value.get(NOTES) {
        let notes = notes.iter().filter_map(Value::as_str);
        row.notes = notes.map(str::to_owned).collect();
    }
    Some(row)
}

/// Reads to the end and returns the last bytes as text.
fn last_of(mut from: impl Read) -> String {
    let mut kept = Vec::new();
    let mut chunk = [0u8; 1024];
    while let Ok(n @ 1..) = from.read(&mut chunk) {
        kept.extend_from_slice(&chunk[..n]);
        kept.drain(..kept.len().saturating_sub(KEPT));
    }
    String::from_utf8_lossy(&kept).into_owned()
}
