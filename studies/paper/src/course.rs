//! A scene that moves, frame by frame, whatever moves it.

use impinge::{BodyId, Query, Scene};

use crate::error::Error;
use crate::options::SceneName;
use crate::report::Moment;

/// Two bodies and where they are in each frame.
pub(crate) trait Course {
    /// The benchmark.
    fn name(&self) -> SceneName;
    /// What the bodies are made of, for the report.
    fn mesh(&self) -> &str;
    /// How they move, for the report.
    fn motion(&self) -> String;
    /// Whether generated bodies stand in for scans.
    fn is_stand_in(&self) -> bool;
    /// The bodies as they are now.
    fn scene(&self) -> &Scene;
    /// Their ids.
    fn bodies(&self) -> [BodyId; 2];
    /// How many frames there are.
    fn n_frames(&self) -> usize;
    /// Moves the bodies to where they are in a frame. Any frame may be asked for at any time.
    fn pose(&mut self, frame: usize) -> Result<(), Error>;

    /// The frame to be shown, given what each frame found: that with the most pairs, unless a course
    /// knows better.
    fn picture_frame(&self, moments: &[Moment]) -> usize {
        let fullest = moments.iter().max_by_key(|moment| moment.n_pairs);
        fullest.map_or(0, |moment| moment.frame)
    }

    /// Pairs between the two bodies.
    fn query(&self) -> Query {
        let [a, b] = self.bodies();
        Query::between(a, b)
    }

    /// Primitives of each body.
    fn n_primitives(&self) -> Vec<usize> {
        let bodies = self.scene().bodies();
        bodies.map(|(_, body)| body.n_primitives()).collect()
    }
}

/// `n` frames spread over a course of `n_frames`, or all where there are fewer. Ends are left out: contact
/// grows as a course goes on, and its middle is what most frames are like.
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
