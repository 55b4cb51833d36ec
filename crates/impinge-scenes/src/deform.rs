//! Deformations: the position of a vertex at a time, given its rest position.
//!
//! A frame is always computed from the rest pose, never from the frame before, so frames can be
//! computed in any order and rounding errors do not accumulate. A tuple of two deformations applies
//! the first, then the second.
//!
//! ```
//! use impinge_scenes::deform::{Deform, Drift, Wave};
//! let motion = (Wave::default(), Drift { velocity: [0.5, 0.0, 0.0] });
//! let rest = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0]];
//! let mut now = [[0.0f32; 3]; 2];
//! motion.apply(&rest, 2.0, &mut now);
//! assert!(now[0][0] == 1.0 && now[1][0] == 2.0);
//! ```

use crate::model::add;

/// Moves vertices as a function of their rest position and of time.
pub trait Deform {
    /// The position at time `t` of the vertex with rest position `p`.
    fn at(&self, p: [f32; 3], t: f32) -> [f32; 3];

    /// Overwrites `now` with the positions at time `t`, without allocating. If the arrays have
    /// different lengths, it writes the common part.
    fn apply(&self, rest: &[[f32; 3]], t: f32, now: &mut [[f32; 3]]) {
        for (now, &rest) in now.iter_mut().zip(rest) {
            *now = self.at(rest, t);
        }
    }
}

impl<A: Deform, B: Deform> Deform for (A, B) {
    fn at(&self, p: [f32; 3], t: f32) -> [f32; 3] {
        self.1.at(self.0.at(p, t), t)
    }
}

/// A travelling sine displacement, "waving":
/// `p + amplitude * displacement * sin(2 pi (p . travel - speed t) / wave_length)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wave {
    /// Height of the wave, in the length unit of the mesh.
    pub amplitude: f32,
    /// Distance from crest to crest along `travel`, above 0.
    pub wave_length: f32,
    /// How far crests move per unit of time.
    pub speed: f32,
    /// The direction in which crests move, of length 1.
    pub travel: [f32; 3],
    /// The direction along which vertices move, of length 1.
    pub displacement: [f32; 3],
}

impl Default for Wave {
    /// For meshes with a box diagonal of 1: crests travel along x, vertices move along z.
    fn default() -> Self {
        Wave {
            amplitude: 0.02,
            wave_length: 0.25,
            speed: 0.1,
            travel: [1.0, 0.0, 0.0],
            displacement: [0.0, 0.0, 1.0],
        }
    }
}

impl Deform for Wave {
    fn at(&self, p: [f32; 3], t: f32) -> [f32; 3] {
        let along: f32 = (0..3).map(|axis| p[axis] * self.travel[axis]).sum();
        let turns = (along - self.speed * t) / self.wave_length;
        let height = self.amplitude * (std::f32::consts::TAU * turns).sin();
        add(p, self.displacement.map(|d| d * height))
    }
}

/// Turns every slice perpendicular to `axis` about the axis through the origin, by
/// `rate * t` radians per unit length along it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Twist {
    /// 0, 1 or 2 for x, y or z; other numbers are taken modulo 3.
    pub axis: usize,
    /// Radians per unit length and unit of time.
    pub rate: f32,
}

impl Deform for Twist {
    fn at(&self, p: [f32; 3], t: f32) -> [f32; 3] {
        let [along, u, v] = [self.axis % 3, (self.axis + 1) % 3, (self.axis + 2) % 3];
        let (sin, cos) = (self.rate * t * p[along]).sin_cos();
        let mut turned = p;
        turned[u] = cos * p[u] - sin * p[v];
        turned[v] = sin * p[u] + cos * p[v];
        turned
    }
}

/// Moves all vertices by the same vector: `p + velocity * t`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drift {
    /// Length per unit of time.
    pub velocity: [f32; 3],
}

impl Deform for Drift {
    fn at(&self, p: [f32; 3], t: f32) -> [f32; 3] {
        add(p, self.velocity.map(|v| v * t))
    }
}

/// A stirring motion: three sine shears one after the other, each along one axis by
/// `strength * t * sin(frequency * next axis)`, which preserve volume. Distances of neighbours grow
/// by a factor of about `(strength * frequency * t)^3`, so groups of vertices that
/// are close at rest soon spread over the whole body, while the body grows by at most
/// `strength * t` along each axis. It makes any structure that was built for the rest pose
/// stale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flow {
    /// Length per unit of time.
    pub strength: f32,
    /// Radians per unit length.
    pub frequency: f32,
}

impl Default for Flow {
    /// For meshes with a box diagonal of 1.
    fn default() -> Self {
        Flow {
            strength: 0.25,
            frequency: 9.0,
        }
    }
}

impl Deform for Flow {
    fn at(&self, p: [f32; 3], t: f32) -> [f32; 3] {
        let mut p = p;
        for axis in 0..3 {
            p[axis] += self.strength * t * (self.frequency * p[(axis + 1) % 3]).sin();
        }
        p
    }
}
