//! Disjoint sets of numbers.

/// Sets of the numbers below some n, at first each alone.
pub struct Union(Vec<u32>);

impl Union {
    pub fn new(n: usize) -> Self {
        Self((0..n as u32).collect())
    }

    /// The number that stands for the set of `n`.
    pub fn find(&mut self, n: u32) -> u32 {
        let mut n = n;
        while self.0[n as usize] != n {
            // Halves the way of all that come later.
            self.0[n as usize] = self.0[self.0[n as usize] as usize];
            n = self.0[n as usize];
        }
        n
    }

    /// Makes one set of those of `a` and `b`. The smaller number stands for it.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.find(a), self.find(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}
