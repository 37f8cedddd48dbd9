//! Whether the sources of a scene still find room for what they emit.
//!
//! The inlet of a source is its shape and one cell around it, inside the domain. A free stream fills
//! it once at most; water that is pushed on by what enters stays close to that. In a closed vessel
//! that is full, what enters has nowhere to go: there is ever more rest volume in the inlet's room.

use super::setup::Setup;

/// Rest volume over room in an inlet at which its vessel counts as full. A free stream has 0.9, one
/// that enters a pool below its surface at a fifth of the speed of sound 1.4; in a closed vessel the
/// inlet reaches 1.5 when the vessel does.
pub const FULL: f64 = 1.5;
/// Samples of an inlet along its longest axis at most.
const MOST: f64 = 64.0;

/// The inlets of a scene's sources and what is in them.
pub struct Inlets<'a> {
    setup: &'a Setup,
    /// By source: its bounds (m) and its room (m^d).
    inlets: Vec<([[f64; 3]; 2], f64)>,
    /// By source: rest volume inside (m^d).
    filled: Vec<f64>,
}

impl<'a> Inlets<'a> {
    pub fn new(setup: &'a Setup) -> Self {
        let inlets: Vec<_> = (0..setup.sources.len()).map(|n| inlet(setup, n)).collect();
        Self { setup, filled: vec![0.0; inlets.len()], inlets }
    }

    /// Begins to count anew.
    pub fn clear(&mut self) {
        self.filled.fill(0.0);
    }

    /// Counts particles in inlets: positions (m), and their bodies.
    pub fn add(&mut self, x: &[[f64; 3]], body: &[u32]) {
        for (n, (bounds, _)) in self.inlets.iter().enumerate() {
            let inside = x.iter().zip(body).filter(|(x, _)| is_inside(self.setup, n, bounds, x));
            self.filled[n] += inside.map(|(_, &body)| self.setup.bodies[body as usize].volume0).sum::<f64>();
        }
    }

    /// Whether a source is to emit at the start of `frame`.
    pub fn awaited(&self, frame: u32) -> bool {
        self.setup.sources.iter().any(|source| source.by_frame.get(frame as usize).is_some_and(|&count| count > 0))
    }

    /// The first source that is to emit at the start of `frame` into an inlet that is full, and its rest volume over
    /// its room.
    pub fn full(&self, frame: u32) -> Option<(usize, f64)> {
        let emits = |n: &usize| self.setup.sources[*n].by_frame.get(frame as usize).is_some_and(|&count| count > 0);
        let fill = |n: usize| (n, self.filled[n] / self.inlets[n].1);
        (0..self.inlets.len()).filter(emits).map(fill).find(|&(_, fill)| fill > FULL)
    }
}

fn is_inside(setup: &Setup, source: usize, [low, high]: &[[f64; 3]; 2], x: &[f64; 3]) -> bool {
    (0..setup.dimension).all(|a| x[a] >= low[a] && x[a] <= high[a])
        && setup.sources[source].sdf.distance(*x) <= setup.dx
}

/// Bounds and room of a source's inlet.
fn inlet(setup: &Setup, source: usize) -> ([[f64; 3]; 2], f64) {
    let d = setup.dimension;
    let [mut low, mut high] = setup.sources[source].sdf.bounds();
    for a in 0..d {
        low[a] = (low[a] - setup.dx).max(setup.origin[a]);
        high[a] = (high[a] + setup.dx).min(setup.origin[a] + setup.cells[a] as f64 * setup.dx);
    }
    let longest = (0..d).map(|a| high[a] - low[a]).fold(0.0, f64::max);
    let step = (0.25 * setup.dx).max(longest / MOST);
    let count = |a: usize| if a < d { ((high[a] - low[a]) / step).ceil().max(1.0) } else { 1.0 };
    let counts = [0, 1, 2].map(count);
    let size = [0, 1, 2].map(|a| (high[a] - low[a]) / counts[a]);
    let mut samples = 0u64;
    let [nx, ny, nz] = counts.map(|n| n as usize);
    for k in 0..nx * ny * nz {
        let i = [k % nx, k / nx % ny, k / (nx * ny)];
        let x = std::array::from_fn(|a| if a < d { low[a] + (i[a] as f64 + 0.5) * size[a] } else { 0.0 });
        samples += u64::from(is_inside(setup, source, &[low, high], &x));
    }
    let cell: f64 = size[..d].iter().product();
    ([low, high], samples as f64 * cell)
}
