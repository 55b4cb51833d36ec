//! The bodies where they are now: a frame's positions, moved by the user's matrices.

use impinge::{BodyId, Scene};

use crate::content::Content;

pub(crate) type Matrix = [[f64; 4]; 4];

pub(crate) const IDENTITY: Matrix = [
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, 1.0, 0.0],
    [0.0, 0.0, 0.0, 1.0],
];

/// A content in one of its frames.
#[derive(Clone)]
pub(crate) struct Stage {
    pub content: Content,
    /// One per body, in the order of the content's bodies.
    pub moves: Vec<Matrix>,
    frame_ix: usize,
}

impl Stage {
    pub fn new(content: Content) -> Self {
        Stage {
            moves: vec![IDENTITY; content.bodies.len()],
            content,
            frame_ix: 0,
        }
    }

    pub fn scene(&self) -> &Scene {
        &self.content.scene
    }

    pub fn frame_ix(&self) -> usize {
        self.frame_ix
    }

    pub fn id(&self, body: usize) -> Option<BodyId> {
        self.content.bodies.get(body).map(|shown| shown.id)
    }

    /// Moves all bodies to where they are in a frame.
    pub fn pose(&mut self, frame_ix: usize) -> Result<(), String> {
        if let Some(frames) = &self.content.frames {
            for (id, positions) in frames.read(frame_ix)? {
                self.content
                    .scene
                    .set_positions(id, &positions)
                    .map_err(|error| format!("frame {frame_ix}: {error}"))?;
                let bodies = &self.content.bodies;
                let body = bodies.iter().position(|shown| shown.id == id);
                if let Some(body) = body.filter(|&body| self.moves[body] != IDENTITY) {
                    let matrix = self.moves[body];
                    self.place(body, matrix)?;
                }
            }
        }
        self.frame_ix = frame_ix;
        Ok(())
    }

    /// Moves a body by a matrix, from where the frame has it. If it is refused, the body stays
    /// where it was.
    pub fn place(&mut self, body: usize, matrix: Matrix) -> Result<(), String> {
        let Some(id) = self.id(body) else {
            return Err(match self.content.bodies.len() {
                1 => format!("body {body} is moved, but there is one, number 0"),
                n => format!("body {body} is moved, but there are {n}, counted from 0"),
            });
        };
        self.content
            .scene
            .set_transform(id, &matrix)
            .map_err(|error| error.to_string())?;
        self.moves[body] = matrix;
        Ok(())
    }

    /// Sets the positions of the next frame as the end of a step. Returns false if there is no next
    /// frame.
    pub fn set_ends(&mut self, scratch: &mut Stage) -> Result<bool, String> {
        let next = self.frame_ix + 1;
        if next >= self.content.n_frames() {
            return Ok(false);
        }
        // Frames place only the bodies that they have.
        for (body, &matrix) in self.moves.iter().enumerate() {
            if scratch.moves[body] != matrix {
                scratch.place(body, matrix)?;
            }
        }
        scratch.pose(next)?;
        let ids: Vec<BodyId> = self.content.bodies.iter().map(|shown| shown.id).collect();
        for id in ids {
            let end = scratch
                .scene()
                .body(id)
                .map_err(|error| error.to_string())?;
            let end = end.positions().clone();
            let scene = &mut self.content.scene;
            scene
                .set_end_positions(id, end)
                .map_err(|error| format!("frame {next}: {error}"))?;
        }
        Ok(true)
    }

    /// The lowest and highest coordinates of the corners of an element; `None` without such a
    /// body.
    pub fn element_bounds(&self, body: usize, element: u32) -> Option<[[f64; 3]; 2]> {
        let body = self.scene().body(self.id(body)?).ok()?;
        let mut bounds = NOTHING;
        for &vertex in body.elements().corners(element as usize) {
            include(&mut bounds, body.positions().point(vertex as usize));
        }
        Some(bounds)
    }

    /// The lowest and highest coordinates of the vertices of a body, or of all of them; `None`
    /// without any.
    pub fn bounds(&self, only: Option<usize>) -> Option<[[f64; 3]; 2]> {
        let mut bounds = NOTHING;
        for (ix, shown) in self.content.bodies.iter().enumerate() {
            if only.is_some_and(|only| only != ix) {
                continue;
            }
            let Ok(body) = self.scene().body(shown.id) else {
                continue;
            };
            for vertex in 0..body.n_vertices() {
                include(&mut bounds, body.positions().point(vertex));
            }
        }
        (bounds[0][0] <= bounds[1][0]).then_some(bounds)
    }
}

/// The box of no points.
const NOTHING: [[f64; 3]; 2] = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];

/// Extends a box to a point.
pub(crate) fn include(bounds: &mut [[f64; 3]; 2], point: [f64; 3]) {
    for k in 0..3 {
        bounds[0][k] = bounds[0][k].min(point[k]);
        bounds[1][k] = bounds[1][k].max(point[k]);
    }
}
