//! Exact arithmetic behind everything that moves: integers of any size, polynomials in Bernstein
//! form, real roots. Contact geometry takes its coordinates from the same integers.
//!
//! What it does: holds the polynomials in time that decide first contacts, isolates their roots in
//! (0, 1], tells the sign of another polynomial at a root, and rounds a root down to a float. All
//! of it exactly.
//!
//! Cost: a decision needs a few hundred multiplications of numbers below 400 bits, which fit
//! without allocation. Larger numbers (coordinates of very different size) go to the heap and take
//! longer; nothing can overflow.
//!
//! Invariant: no rounding and no tolerance. Floating-point numbers appear only as guesses that are
//! checked.

pub(super) mod fixed;
mod integer;
mod polynomial;
mod quotient;
mod roots;
mod unit;

pub(super) use fixed::{Coordinate, Eight, Factor, Four, Two, Whole};
pub use integer::Integer;
pub(super) use integer::{common_integers, parts};
pub(super) use polynomial::{Polynomial, PolynomialVector, cross, difference, dot, square_of_sum};
pub use quotient::unit_of;
pub(super) use roots::{Root, Roots, Time, floor_between, floor_of_share};
pub(super) use unit::Unit;
