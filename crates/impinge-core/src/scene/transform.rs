//! Affine motion of a body: its rest positions moved by a matrix, rounded in a fixed way.

use std::sync::Arc;

use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::positions::{Positions, Real};

/// The rest positions of a body, and the matrix that moved them; `None` if a step did.
#[derive(Debug, Clone)]
pub(crate) struct RestPose {
    pub rest: Arc<Positions>,
    pub matrix: Option<Affine>,
}

/// The upper three rows of a 4 x 4 matrix whose last row is `0 0 0 1`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Affine([[f64; 4]; 3]);

impl Affine {
    /// Refuses a matrix that is not finite or not affine.
    pub fn new(matrix: &[[f64; 4]; 4]) -> Result<Self, Error> {
        let [x, y, z, last] = *matrix;
        for (row, numbers) in matrix.iter().enumerate() {
            if let Some(column) = numbers.iter().position(|number| !number.is_finite()) {
                return Err(Error::Setting {
                    setting: "transform",
                    given: format!("{} in row {row}, column {column}", numbers[column]),
                    allowed: "finite numbers",
                });
            }
        }
        if last != [0.0, 0.0, 0.0, 1.0] {
            return Err(Error::Setting {
                setting: "transform",
                given: format!("a last row of {last:?}"),
                allowed: "[0, 0, 0, 1]",
            });
        }
        Ok(Affine([x, y, z]))
    }

    pub fn matrix(&self) -> [[f64; 4]; 4] {
        let [x, y, z] = self.0;
        [x, y, z, [0.0, 0.0, 0.0, 1.0]]
    }

    /// Row `[a, b, c, d]` takes `(x, y, z)` to `((a x + b y) + c z) + d`: each product and each sum
    /// is rounded to `f64` in this order, none is fused, and the last sum is rounded to the
    /// precision of the positions.
    fn apply<R: Real>(&self, point: &[R; 3]) -> [R; 3] {
        let [x, y, z] = point.map(R::widen);
        self.0
            .map(|[a, b, c, d]| R::round(((a * x + b * y) + c * z) + d))
    }

    fn map<R: Real>(&self, rest: &[[R; 3]], to: &mut Positions) {
        match R::stored(to) {
            Some(to) if to.len() == rest.len() => {
                for (to, from) in to.own().iter_mut().zip(rest) {
                    *to = self.apply(from);
                }
            }
            _ => {
                let moved: Vec<[R; 3]> = rest.iter().map(|point| self.apply(point)).collect();
                *to = R::store(&moved);
            }
        }
    }

    /// Refuses a position that would be moved to no number; the error names the first.
    pub fn check(&self, body: BodyId, rest: &Positions) -> Result<(), Error> {
        match rest {
            Positions::F32(rest) => self.check_each(body, rest),
            Positions::F64(rest) => self.check_each(body, rest),
        }
    }

    fn check_each<R: Real>(&self, body: BodyId, rest: &[[R; 3]]) -> Result<(), Error> {
        let moved = |point| self.apply(point).map(R::widen);
        let is_bad = |point| moved(point).iter().any(|x| !x.is_finite());
        match rest.iter().position(is_bad) {
            None => Ok(()),
            Some(vertex) => Err(Error::NonFinitePosition {
                body,
                vertex,
                value: moved(&rest[vertex]),
            }),
        }
    }

    /// Writes the moved positions of `rest`.
    pub fn write(&self, rest: &Positions, to: &mut Positions) {
        match rest {
            Positions::F32(rest) => self.map(rest, to),
            Positions::F64(rest) => self.map(rest, to),
        }
    }
}
