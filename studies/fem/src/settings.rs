//! Settings of a simulation.

use crate::error::{Error, check};

/// Solid ground: the half-space where `normal · x < height`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ground {
    /// The upward direction, of any length except 0.
    pub normal: [f64; 3],
    /// The height of the ground's surface along the unit normal, in metres.
    pub height: f64,
}

/// Rayleigh damping: the damping matrix is `mass` · M + `stiffness` · K. Backward Euler also damps
/// by itself, and more for longer steps.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Damping {
    /// Share of the mass matrix, in 1/s, 0 or more.
    pub mass: f64,
    /// Share of the stiffness matrix, in s, 0 or more.
    pub stiffness: f64,
}

/// How a simulation runs.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Time step in s, above 0.
    pub dt: f64,
    /// Acceleration of gravity in m/s².
    pub gravity: [f64; 3],
    /// Solid ground, if there is any.
    pub ground: Option<Ground>,
    /// Rayleigh damping.
    pub damping: Damping,
    /// Hardness of contact, above 0: the pressure, in multiples of Young's modulus, where bodies
    /// overlap by the length of an edge.
    pub contact_stiffness: f64,
    /// Coefficient of friction between bodies and with the ground, 0 or more.
    pub friction: f64,
    /// Whether parts of one solid push each other too.
    pub self_contact: bool,
    /// Residual at which the solver stops, relative to the right side, above 0.
    pub tolerance: f64,
    /// The most iterations of the solver per step, at least 1.
    pub max_iterations: usize,
    /// Threads; 0 means one per core. The result does not depend on it.
    pub threads: usize,
}

impl Default for Settings {
    /// 5 ms per step, gravity along -y, no ground, no damping, contact of 4 moduli, friction 0.3, a
    /// residual of 1e-5.
    fn default() -> Self {
        Settings {
            dt: 5e-3,
            gravity: [0.0, -9.81, 0.0],
            ground: None,
            damping: Damping::default(),
            contact_stiffness: 4.0,
            friction: 0.3,
            self_contact: false,
            tolerance: 1e-5,
            max_iterations: 1000,
            threads: 0,
        }
    }
}

impl Settings {
    pub(crate) fn check(&self) -> Result<(), Error> {
        const POSITIVE: &str = "a number above 0";
        const NOT_NEGATIVE: &str = "a number, 0 or more";
        check("time step", self.dt, self.dt > 0.0, POSITIVE)?;
        for gravity in self.gravity {
            check("gravity", gravity, true, "a finite number")?;
        }
        if let Some(ground) = self.ground {
            let length = ground.normal.iter().map(|x| x * x).sum::<f64>().sqrt();
            check(
                "length of the ground's normal",
                length,
                length.is_normal(),
                POSITIVE,
            )?;
            check(
                "height of the ground",
                ground.height,
                true,
                "a finite number",
            )?;
        }
        for (what, value) in [
            ("mass damping", self.damping.mass),
            ("stiffness damping", self.damping.stiffness),
            ("friction", self.friction),
        ] {
            check(what, value, value >= 0.0, NOT_NEGATIVE)?;
        }
        for (what, value) in [
            ("contact stiffness", self.contact_stiffness),
            ("solver tolerance", self.tolerance),
        ] {
            check(what, value, value > 0.0, POSITIVE)?;
        }
        for (what, value, ok, allowed) in [
            (
                "solver iterations",
                self.max_iterations,
                self.max_iterations > 0,
                "1 or more",
            ),
            ("threads", self.threads, self.threads <= 1024, "0 to 1024"),
        ] {
            check(what, value as f64, ok, allowed)?;
        }
        Ok(())
    }
}
