//! Which frame is shown when.

/// Frames per second at the beginning.
const SPEED: f64 = 24.0;

#[derive(Debug, Clone, Copy)]
pub(crate) struct Player {
    pub plays: bool,
    /// Frames per second.
    pub speed: f64,
    /// The part of a frame that has passed.
    part: f64,
}

impl Player {
    pub fn new(plays: bool) -> Self {
        Player {
            plays,
            speed: SPEED,
            part: 0.0,
        }
    }

    /// The frame to show after so many seconds; the first one follows the last one.
    pub fn advance(&mut self, frame_ix: usize, n_frames: usize, seconds: f64) -> usize {
        if !self.plays || n_frames < 2 {
            return frame_ix;
        }
        // After a pause, as of a hidden window, it goes on where it was.
        self.part += self.speed * seconds.clamp(0.0, 0.5);
        let whole = self.part.floor();
        self.part -= whole;
        (frame_ix + whole as usize) % n_frames
    }

    /// Half or double speed, from 1/4 to 960 frames per second.
    pub fn change_speed(&mut self, factor: f64) {
        self.speed = (self.speed * factor).clamp(0.25, 960.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_follow_the_clock_and_begin_again() {
        let mut player = Player::new(true);
        player.speed = 10.0;
        assert_eq!(player.advance(0, 5, 0.25), 2);
        assert_eq!(player.advance(2, 5, 0.25), 0);
        player.plays = false;
        assert_eq!(player.advance(3, 5, 9.0), 3);
        player.change_speed(2.0);
        assert_eq!(player.speed, 20.0);
    }
}
