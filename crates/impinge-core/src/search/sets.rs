//! Disjoint sets of numbers (union-find), with path halving (Tarjan and van Leeuwen 1984).

use crate::scene::error::Error;
use crate::search::sink::{grow, with_capacity};

/// Disjoint sets of the numbers from 0 on. The lowest number of a set stands for it.
#[derive(Debug, Clone, Default)]
pub(crate) struct Sets(Vec<u32>);

impl Sets {
    /// `n` sets of one number each. `what` is what errors call them.
    pub fn new(n: usize, what: &'static str) -> Result<Self, Error> {
        let mut sets = with_capacity(n, what)?;
        sets.extend((0u32..).take(n));
        Ok(Sets(sets))
    }

    /// Adds a set of one number, and returns the number.
    pub fn add(&mut self, what: &'static str) -> Result<u32, Error> {
        grow(&mut self.0, 1, what)?;
        let new = self.0.len() as u32;
        self.0.push(new);
        Ok(new)
    }

    /// How many numbers there are.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// The number that stands for the set of `x`.
    pub fn find(&mut self, mut x: u32) -> u32 {
        while self.0[x as usize] != x {
            let above = self.0[self.0[x as usize] as usize];
            self.0[x as usize] = above;
            x = above;
        }
        x
    }

    /// Joins two sets.
    pub fn join(&mut self, x: u32, y: u32) {
        let (x, y) = (self.find(x), self.find(y));
        self.0[x.max(y) as usize] = x.min(y);
    }
}
