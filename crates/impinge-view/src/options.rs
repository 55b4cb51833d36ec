//! How a window begins, and what is asked of a scene.

use std::path::PathBuf;
use std::sync::Arc;

use impinge::{Method, Query, SharedVertex};
use impinge_render::{Camera, Focus};

use crate::content::Content;

/// Where detection runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Backend {
    /// The CPU: below some hundred thousand triangles, this is the fastest.
    #[default]
    Cpu,
    /// The device that draws the window.
    Gpu,
}

/// What is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Shows {
    /// All faces.
    #[default]
    Everything,
    /// The faces of elements that collide.
    Colliding,
    /// Intersection curves, and no faces.
    Curves,
}

impl Shows {
    /// The next one, in turns.
    pub(crate) fn next(self) -> Self {
        match self {
            Shows::Everything => Shows::Colliding,
            Shows::Colliding => Shows::Curves,
            Shows::Curves => Shows::Everything,
        }
    }
}

/// The state in which a window begins; the user may change all of it.
#[derive(Debug, Clone)]
pub struct Options {
    /// Whether pairs within each body are found too. `None`: only if there is one body.
    pub within: Option<bool>,
    /// Which pairs of neighbours within a body are reported.
    pub shared_vertex: SharedVertex,
    /// The method; all give the same pairs.
    pub method: Method,
    /// Where detection runs; the pairs are the same.
    pub backend: Backend,
    /// The first frame to show. `None`: the first one with a collision, as soon as it is known;
    /// without any, the first.
    pub frame: Option<usize>,
    /// Whether frames play from the beginning, unless a frame with a collision is shown.
    pub plays: bool,
    /// The direction from which the scene is seen.
    pub camera: Camera,
    /// What is in the middle of the view, and from how far it is seen. `None`: everything is seen.
    pub focus: Option<Focus>,
    /// What is drawn.
    pub shows: Shows,
    /// Whether intersection curves are drawn over it.
    pub curves: bool,
    /// Matrices that move bodies, by their number.
    pub moves: Vec<(usize, [[f64; 4]; 4])>,
    /// Width and height of the window in points, and of saved pictures in pixels.
    pub size: [u32; 2],
    /// The folder that is suggested for pictures.
    pub folder: PathBuf,
    /// The command that opened the window.
    pub command: Command,
    /// Reads the files that the user opens or drops. `None`: that is not possible.
    pub opener: Option<Opener>,
    /// Shows so many frames as fast as it can, prints how many there were per second, and closes
    /// the window.
    pub measure: Option<u32>,
}

/// Makes a content of files, on a thread of its own, and the command that opens a window with them.
#[derive(Clone)]
pub struct Opener(pub Arc<Open>);

/// What an [`Opener`] calls. The error is a message for the user.
type Open = dyn Fn(&[PathBuf]) -> Result<(Content, Command), String> + Send + Sync;

impl std::fmt::Debug for Opener {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Opener")
    }
}

/// The words of a command that opens this window, without options that the window knows.
#[derive(Debug, Clone, Default)]
pub struct Command(pub Vec<String>);

impl Default for Options {
    fn default() -> Self {
        Options {
            within: None,
            shared_vertex: SharedVertex::Resolve,
            method: Method::Clusters,
            backend: Backend::default(),
            frame: None,
            plays: true,
            camera: Camera::default(),
            focus: None,
            shows: Shows::default(),
            curves: false,
            moves: Vec::new(),
            size: [1280, 800],
            folder: PathBuf::from("."),
            command: Command::default(),
            opener: None,
            measure: None,
        }
    }
}

/// What is asked in each frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Question {
    pub within: bool,
    pub shared_vertex: SharedVertex,
    pub method: Method,
    pub backend: Backend,
}

impl Question {
    pub fn query(&self) -> Query {
        let query = match self.within {
            true => Query::all(),
            false => Query::between_all(),
        };
        query.shared_vertex(self.shared_vertex)
    }

    /// Whether two questions have the same answer.
    pub fn same_pairs(&self, other: &Question) -> bool {
        self.within == other.within && self.shared_vertex == other.shared_vertex
    }
}

impl Command {
    /// The command line, quoted for a shell where necessary.
    pub fn line(&self, more: &[String]) -> String {
        let words = self.0.iter().chain(more);
        let quoted: Vec<String> = words.map(|word| quote(word)).collect();
        quoted.join(" ")
    }
}

fn quote(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "-_./,:=+@%".contains(c);
    match !word.is_empty() && word.chars().all(is_plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', r"'\''")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_quoted_where_a_shell_needs_it() {
        let command = Command(vec!["impinge".into(), "view".into(), "a b.obj".into()]);
        let more = ["it's".to_owned(), "run_%04d.ply".to_owned()];
        assert_eq!(
            command.line(&more),
            r"impinge view 'a b.obj' 'it'\''s' run_%04d.ply"
        );
    }
}
