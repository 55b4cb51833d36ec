//! Where the bodies of a scene are: their positions, the positions at the end of a step, and the
//! transforms that move them.

use std::sync::Arc;

use crate::scene::Body;
use crate::scene::bodies::Scene;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::position_rows::PositionRows;
use crate::scene::positions::{Given, NewPositions, Positions, Real};
use crate::scene::transform::{Affine, RestPose};

impl Scene {
    /// Moves the vertices: `(v, 3)` positions, as many as the body has vertices, and finite. The
    /// precision may differ from frame to frame. A new step starts: the body stands still until
    /// its end positions are [set](Scene::set_end_positions).
    ///
    /// A slice, and a reference to a `Vec`, an array or [`Positions`], is copied. A `Vec` and
    /// `Positions` are taken over, and an `Arc` of something that has rows is shared, without a
    /// copy: the body drops it when it gets other positions or is removed. Two shared arrays serve
    /// a simulation: write the one that the scene has dropped, give it, and go on with the other.
    /// What is copied is checked now, and so are up to 32,768 positions that are not. More of them
    /// are read once, by the next question, whose error names a bad vertex.
    ///
    /// ```
    /// use std::sync::Arc;
    /// use impinge::Scene;
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// let corners = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// let body = scene.add_triangles(&[[0, 1, 2]], &corners)?;
    /// let mut frames = [vec![[0.0f32; 3]; 3], vec![[0.0f32; 3]; 3]].map(Arc::new);
    /// for step in 0..10u8 {
    ///     let frame = &mut frames[usize::from(step % 2)];
    ///     let next = Arc::get_mut(frame).expect("dropped by the scene");
    ///     next[1] = [1.0, 0.0, step.into()];
    ///     scene.set_positions(body, Arc::clone(frame))?;
    /// }
    /// assert_eq!(scene.body(body)?.positions().point(1), [1.0, 0.0, 9.0]);
    /// # Ok(()) }
    /// ```
    ///
    /// Where a body must write its positions ([`positions_mut`](Scene::positions_mut),
    /// [`set_transform`](Scene::set_transform)), it copies a shared array first.
    ///
    /// # Errors
    /// A wrong number of positions, or one that is refused: the body keeps its old positions then.
    pub fn set_positions<'a>(
        &mut self,
        body: BodyId,
        positions: impl Into<NewPositions<'a>>,
    ) -> Result<(), Error> {
        let positions = positions.into();
        let target = self.moved_body(body)?;
        let is_checked = target.check_now(body, &positions)?;
        store(&mut target.positions, positions);
        target.has_moved(is_checked);
        Ok(())
    }

    /// Sets the vertex positions at the end of a step, `(v, 3)`, copied or not as by
    /// [`set_positions`](Scene::set_positions). Each vertex moves from
    /// [`positions`](crate::Body::positions) to its end position on a straight line at constant
    /// speed. They hold until the next [`set_positions`](Scene::set_positions),
    /// [`positions_mut`](Scene::positions_mut), [`set_transform`](Scene::set_transform),
    /// [`remesh`](Scene::remesh) or [`clear_end_positions`](Scene::clear_end_positions), or until
    /// the step is [taken](crate::Advance::apply); a shared array is dropped then. A body that has
    /// none stands still. For a rigid body, see [`set_end_transform`](Scene::set_end_transform).
    ///
    /// If start and end have different precisions, the single-precision one is widened, which is
    /// exact.
    ///
    /// # Errors
    /// A wrong number of positions, or one that is refused: the body keeps its old end positions
    /// then.
    pub fn set_end_positions<'a>(
        &mut self,
        body: BodyId,
        positions: impl Into<NewPositions<'a>>,
    ) -> Result<(), Error> {
        let positions = positions.into();
        let target = self.moved_body(body)?;
        target.check(body, &positions)?;
        let mut end = target.end.take().unwrap_or_else(|| f32::store(&[]));
        store(&mut end, positions);
        target.set_end(end, false);
        Ok(())
    }

    /// Refuses positions of a body that were written in place, or taken over, and are not finite,
    /// as questions about it do.
    ///
    /// # Errors
    /// The id names no body; positions that are refused.
    #[doc(hidden)]
    pub fn check_positions(&self, body: BodyId) -> Result<(), Error> {
        self.body(body)?.check_once(body)
    }

    /// The same of all bodies that move, whether they are asked about or not.
    pub(crate) fn check_moving(&self) -> Result<(), Error> {
        let mut moving = self
            .bodies()
            .filter(|(_, body)| body.end_positions().is_some());
        moving.try_for_each(|(id, body)| body.check_once(id))
    }

    /// Clears a body's end positions: it stands still.
    ///
    /// # Errors
    /// The id names no body.
    pub fn clear_end_positions(&mut self, body: BodyId) -> Result<(), Error> {
        self.moved_body(body)?.clear_end();
        Ok(())
    }

    /// The positions of a body that stores `R`, to be written in place without a copy. The next
    /// detection checks them, and its error names a bad vertex. End positions are cleared, as by
    /// [`set_positions`](Scene::set_positions).
    ///
    /// # Errors
    /// The id names no body, or it stores the other precision.
    pub fn positions_mut<R: Real>(&mut self, body: BodyId) -> Result<&mut [[R; 3]], Error> {
        let target = self.moved_body(body)?;
        target.has_moved(false);
        stored(body, &mut target.positions).map(|stored| stored.own().as_mut_slice())
    }

    /// Moves a body by an affine matrix, such as a rigid motion, without passing its vertices
    /// again. It moves the [rest positions](crate::Body::rest_positions), such as those given last
    /// ([`add`](Scene::add), [`set_positions`](Scene::set_positions), [`remesh`](Scene::remesh)). A
    /// second transform replaces the first; they do not accumulate, also where a step whose end a
    /// [transform](Scene::set_end_transform) set was [taken](crate::Advance::apply) in between.
    ///
    /// Answers are exact for the moved vertices. These are rounded in a fixed way, so they have the
    /// same bits on every backend: row `[a, b, c, d]` of the matrix takes `(x, y, z)` to
    /// `((a x + b y) + c z) + d`. Each product and each sum is rounded to `f64` in this order, none
    /// is fused with another, and the last sum is rounded once more to the precision of the rest
    /// positions. So a rotation deforms a body by the rounding error.
    ///
    /// End positions are cleared, as by [`set_positions`](Scene::set_positions).
    ///
    /// ```
    /// use impinge::{Positions, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// let corners = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// let body = scene.add_triangles(&[[0, 1, 2]], &corners)?;
    /// let [x, y] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]];
    /// let up = [x, y, [0.0, 0.0, 1.0, 0.5], [0.0, 0.0, 0.0, 1.0]];
    /// scene.set_transform(body, &up)?;
    /// assert_eq!(scene.body(body)?.positions().point(1), [1.0, 0.0, 0.5]);
    /// assert_eq!(scene.body(body)?.rest_positions().point(1), [1.0, 0.0, 0.0]);
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// The id names no body; a matrix that is not finite, or whose last row is not `[0, 0, 0, 1]`;
    /// rest positions that were written in place and are refused; a moved position that is refused.
    /// The body is unchanged then.
    pub fn set_transform(&mut self, body: BodyId, matrix: &[[f64; 4]; 4]) -> Result<(), Error> {
        let matrix = Affine::new(matrix)?;
        let target = self.moved_body(body)?;
        target.check_once(body)?;
        matrix.check(body, target.rest_positions())?;
        let rest = match target.motion.take() {
            Some(motion) => motion.rest,
            None => {
                let none = f32::store(&[]);
                Arc::new(std::mem::replace(&mut target.positions, none))
            }
        };
        matrix.write(&rest, &mut target.positions);
        target.has_moved(true);
        let matrix = Some(matrix);
        target.motion = Some(Box::new(RestPose { rest, matrix }));
        Ok(())
    }

    /// Sets where a step takes a body, by an affine matrix: its end positions are the
    /// [rest positions](crate::Body::rest_positions) moved by the matrix, rounded as by
    /// [`set_transform`](Scene::set_transform), and hold as long as any
    /// [end positions](Scene::set_end_positions). The two matrices of a step are those of its two
    /// ends; both start from rest, neither from the other.
    ///
    /// **Each vertex goes straight, at constant speed, from its rounded position to its rounded
    /// end position**, not along the arc of a turn, and each point of an element goes straight
    /// with its vertices. What is proven of a step is proven of this motion. Halfway through a
    /// turn the body is smaller, by a factor of the cosine of half the angle; half a turn takes
    /// it through its axis.
    ///
    /// At each moment, a point at distance r from the axis of a screw motion by the angle w
    /// (radians) is at most r w² / 8 away from where that motion would have it, plus the rounding
    /// of the two ends. So a large turn is cut into n equal steps with
    /// `n = ceil(w * sqrt(r / (8.0 * d)))`, where r is that of the farthest vertex and `d` the
    /// deviation that is allowed. With 2 d (d of each of two bodies) as
    /// [`separation`](crate::Query::separation), a step that is free is free for the screw motion
    /// as well, up to that rounding.
    ///
    /// After a step, call `set_transform` with the matrix of its end: the positions are then the
    /// end positions, bit by bit. Or take it by [`apply`](crate::Advance::apply), which gives the
    /// body the positions reached. The rest positions stay the same: the next matrix begins with
    /// them, too.
    ///
    /// ```
    /// use impinge::Scene;
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// let corners = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 0.1]];
    /// let blade = scene.add_triangles(&[[0, 1, 2]], &corners)?;
    /// let turned = |angle: f64| {
    ///     let (sin, cos) = angle.sin_cos();
    ///     let [x, y] = [[cos, -sin, 0.0, 0.0], [sin, cos, 0.0, 0.0]];
    ///     [x, y, [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
    /// };
    /// // A half turn, of which no step may leave the arc by more than 0.01.
    /// let (angle, radius, deviation) = (std::f64::consts::PI, 2.0, 0.01);
    /// let n = (angle * f64::sqrt(radius / (8.0 * deviation))).ceil();
    /// assert_eq!(n, 16.0);
    /// for step in 0..16 {
    ///     scene.set_transform(blade, &turned(angle * f64::from(step) / n))?;
    ///     scene.set_end_transform(blade, &turned(angle * f64::from(step + 1) / n))?;
    ///     // ... ask about the step
    /// }
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// As [`set_transform`](Scene::set_transform); the body keeps its old end positions then.
    pub fn set_end_transform(&mut self, body: BodyId, matrix: &[[f64; 4]; 4]) -> Result<(), Error> {
        let matrix = Affine::new(matrix)?;
        let target = self.moved_body(body)?;
        target.check_once(body)?;
        matrix.check(body, target.rest_positions())?;
        let mut end = target.end.take().unwrap_or_else(|| f32::store(&[]));
        matrix.write(target.rest_positions(), &mut end);
        target.set_end(end, true);
        Ok(())
    }

    /// Gives a body checked positions, which a step has reached. `keeps_rest`: transforms go on
    /// from its rest positions.
    ///
    /// # Errors
    /// The id names no body.
    pub(crate) fn take_checked_step(
        &mut self,
        body: BodyId,
        positions: &Positions,
        keeps_rest: bool,
    ) -> Result<(), Error> {
        let target = self.moved_body(body)?;
        let pose = keeps_rest.then(|| RestPose {
            matrix: None,
            ..target.rest_pose()
        });
        target.put_beside(positions, pose);
        Ok(())
    }

    /// Restores what a saved body had besides its rest positions and its transform: where it was,
    /// if these do not say so, where the next step ends, and whether a transform made this end.
    ///
    /// # Errors
    /// As [`set_positions`](Scene::set_positions) and
    /// [`set_end_positions`](Scene::set_end_positions).
    #[doc(hidden)]
    pub fn restore_step(
        &mut self,
        body: BodyId,
        reached: Option<&Positions>,
        end: Option<&Positions>,
        by_transform: bool,
    ) -> Result<(), Error> {
        if let Some(reached) = reached {
            let target = self.moved_body(body)?;
            target.check(body, &reached.into())?;
            let pose = target.rest_pose();
            target.put_beside(reached, Some(pose));
        }
        if let Some(end) = end {
            self.set_end_positions(body, end)?;
            self.moved_body(body)?.is_end_transformed = by_transform;
        }
        Ok(())
    }
}

impl Body {
    /// Copies positions that are shared with their owners.
    pub(super) fn own_positions(&mut self) {
        self.positions.own();
        if let Some(end) = &mut self.end {
            end.own();
        }
        if let Some(motion) = &mut self.motion {
            Arc::make_mut(&mut motion.rest).own();
        }
    }

    /// From where transforms start, taken out of the body.
    fn rest_pose(&mut self) -> RestPose {
        match self.motion.take() {
            Some(motion) => *motion,
            None => RestPose {
                rest: Arc::new(self.positions.clone()),
                matrix: None,
            },
        }
    }

    /// Sets checked positions beside a rest pose, or as one.
    fn put_beside(&mut self, positions: &Positions, pose: Option<RestPose>) {
        store(&mut self.positions, positions.into());
        self.has_moved(true);
        self.motion = pose.map(Box::new);
    }
}

/// The positions, if they are of this precision.
fn stored<R: Real>(body: BodyId, positions: &mut Positions) -> Result<&mut PositionRows<R>, Error> {
    let stored = positions.precision();
    R::stored(positions).ok_or(Error::WrongPrecision {
        body,
        stored,
        asked: if stored == "f32" { "f64" } else { "f32" },
    })
}

/// Stores checked positions. Memory of the body's own is reused.
fn store(stored: &mut Positions, new: NewPositions<'_>) {
    match new.0 {
        Given::F32(rows) => copy(stored, rows),
        Given::F64(rows) => copy(stored, rows),
        Given::Whole(positions) => *stored = positions,
    }
}

fn copy<R: Real>(stored: &mut Positions, rows: &[[R; 3]]) {
    match R::stored(stored) {
        Some(own) if own.len() == rows.len() => own.copy_from(rows),
        _ => *stored = R::store(rows),
    }
}
