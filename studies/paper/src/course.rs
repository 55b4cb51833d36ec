//! A scene that moves frame by frame.

use impinge::{BodyId, Query, Scene};

use crate::error::Error;
use crate::options::SceneName;
use crate::report::Moment;

/// Two bodies and their positions in each frame.
pub(crate) trait Course {
    /// The benchmark.
    fn name(&self) -> SceneName;
    /// A description of the meshes, for the report.
    fn mesh(&self) -> &str;
    /// A description of the motion, for the report.
    fn motion(&self) -> String;
    /// Whether generated bodies stand in for scans.
    fn is_stand_in(&self) -> bool;
    /// The bodies in their current pose.
    fn scene(&self) -> &Scene;
    /// Their ids.
    fn bodies(&self) -> [BodyId; 2];
    /// How many frames there are.
    fn n_frames(&self) -> usize;
    /// Moves the bodies to their positions in a frame. Frames may be requested in any order.
    fn pose(&mut self, frame: usize) -> Result<(), Error>;

    /// The frame for the picture, given the counts of each frame: the frame with the most pairs,
    /// unless a course overrides this.
    fn picture_frame(&self, moments: &[Moment]) -> usize {
        let fullest = moments.iter().max_by_key(|moment| moment.n_pairs);
        fullest.map_or(0, |moment| moment.frame)
    }

    /// Pairs between the two bodies.
    fn query(&self) -> Query {
        let [a, b] = self.bodies();
        Query::between(a, b)
    }

    /// Elements of each body.
    fn n_elements(&self) -> Vec<usize> {
        let bodies = self.scene().bodies();
        bodies.map(|(_, body)| body.n_elements()).collect()
    }
}

/// `n` frames spread over a course of `n_frames`, or all frames if there are fewer. The ends are
/// avoided: contact grows during a course, and frames in its middle are typical.
pub(crate) fn spread(n: usize, n_frames: usize) -> impl Iterator<Item = usize> {
    let n = n.min(n_frames);
    (0..n).map(move |k| (2 * k + 1) * n_frames / (2 * n))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_spread() {
        assert_eq!(spread(3, 100).collect::<Vec<_>>(), [16, 50, 83]);
        assert_eq!(spread(3, 2).collect::<Vec<_>>(), [0, 1]);
        assert_eq!(spread(5, 5).collect::<Vec<_>>(), [0, 1, 2, 3, 4]);
        assert_eq!(spread(3, 0).count(), 0);
    }
}
