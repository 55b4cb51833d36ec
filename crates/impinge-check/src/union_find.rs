//! Disjoint sets of numbers: union by index, path halving (Tarjan and van Leeuwen 1984).

/// Sets of the numbers 0 to n - 1; at first each number is a set of its own.
pub struct UnionFind {
    parents: Vec<u32>,
}

impl UnionFind {
    /// `n` sets of one number each.
    pub fn new(n: u32) -> Self {
        UnionFind {
            parents: (0..n).collect(),
        }
    }

    /// How many numbers there are.
    pub fn len(&self) -> u32 {
        self.parents.len() as u32
    }

    /// The smallest number in the set of `x`.
    pub fn root(&mut self, mut x: u32) -> u32 {
        loop {
            let parent = self.parents[x as usize];
            if parent == x {
                return x;
            }
            let grandparent = self.parents[parent as usize];
            self.parents[x as usize] = grandparent;
            x = grandparent;
        }
    }

    /// Joins two sets. The smaller root stays, so the result does not depend on the order of
    /// unions.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.parents[a.max(b) as usize] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use super::UnionFind;

    #[test]
    fn sets_join() {
        let mut sets = UnionFind::new(6);
        sets.join(4, 2);
        sets.join(5, 4);
        sets.join(1, 1);
        let roots: Vec<u32> = (0..6).map(|x| sets.root(x)).collect();
        assert_eq!(roots, [0, 1, 2, 3, 2, 2]);
    }
}
