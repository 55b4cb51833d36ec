//! A camera on its way to another view.

use impinge_render::Orbit;

/// Seconds.
const DURATION: f64 = 0.4;

#[derive(Debug, Clone, Copy)]
pub(crate) struct Flight {
    from: Orbit,
    to: Orbit,
    /// Seconds since it began.
    time: f64,
}

impl Flight {
    pub fn new(from: Orbit, to: Orbit) -> Self {
        Flight {
            from,
            to,
            time: 0.0,
        }
    }

    /// The view a moment later, and whether it is the last one.
    pub fn advance(&mut self, seconds: f64) -> (Orbit, bool) {
        self.time += seconds.max(0.0);
        let t = (self.time / DURATION).min(1.0);
        if t >= 1.0 {
            return (self.to, true);
        }
        let t = t * t * (3.0 - 2.0 * t);
        let mix = |a: f64, b: f64| a + t * (b - a);
        let (from, to) = (&self.from, &self.to);
        let orbit = Orbit {
            camera: to.camera,
            target: std::array::from_fn(|k| mix(from.target[k], to.target[k])),
            distance: mix(from.distance.ln(), to.distance.ln()).exp(),
        };
        (orbit, false)
    }
}
