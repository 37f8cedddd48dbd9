//! Particle states on their way from f64 in scene coordinates to the chunks: in the simulation's
//! scalar, relative to their blocks.

use super::chunk::{Chunk, State, set_matrix};
use super::constants::Constants;
use gridfall_core::maths::linalg::{Matrix, determinant, from_row_major, scaled_identity};
use gridfall_core::maths::real::Real;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::touch::Touch;

/// Particle states by index in sampling order.
pub struct Narrow<T, const D: usize> {
    /// dx, from the block's node 0.
    x: Vec<[T; D]>,
    v: Vec<[T; D]>,
    /// B / dx (m/s).
    b: Vec<Matrix<T, D>>,
    /// F; of a fluid J on the diagonal.
    f: Vec<Matrix<T, D>>,
    plastic: Vec<T>,
    pub body: Vec<u32>,
    /// Empty where colliders act on nodes.
    touch: Vec<Touch>,
}

impl<T: Real, const D: usize> Narrow<T, D> {
    /// `local` takes a position (m) to its block. Each array takes the place of the one that it is
    /// made from: `collect` works in place.
    pub fn new(
        particles: Particles,
        constants: &Constants<T, D>,
        local: impl Fn(&[f64; 3]) -> [f64; D],
        dx: f64,
    ) -> Self {
        let Particles { x, v, b, f, plastic, body, touch } = particles;
        let small = |v: [f64; D]| v.map(T::from_f64);
        let state = |(f, body): ([f64; 9], &u32)| {
            if constants.bodies[*body as usize].is_fluid() {
                scaled_identity(T::from_f64(determinant(&f)))
            } else {
                from_row_major(&f)
            }
        };
        Self {
            v: v.into_iter().map(|v| std::array::from_fn(|a| T::from_f64(v[a]))).collect(),
            b: b.into_iter().map(|b| from_row_major(&b.map(|b| b / dx))).collect(),
            f: f.into_iter().zip(&body).map(state).collect(),
            plastic: plastic.into_iter().map(T::from_f64).collect(),
            x: x.into_iter().map(|x| small(local(&x))).collect(),
            body,
            touch,
        }
    }

    /// Writes a particle to a lane of a chunk.
    pub fn write(&self, i: usize, chunk: &mut Chunk<T, D>, lane: usize) {
        for a in 0..D {
            chunk.x[a][lane] = self.x[i][a];
            chunk.v[a][lane] = self.v[i][a];
        }
        set_matrix(&mut chunk.b, lane, &self.b[i]);
        match &mut chunk.state {
            State::Solid { f, plastic, .. } => {
                set_matrix(f, lane, &self.f[i]);
                plastic[lane] = self.plastic[i];
            }
            State::Fluid { j, .. } => j[lane] = self.f[i][0][0],
        }
        if let (Some(to), Some(&from)) = (&mut chunk.touch, self.touch.get(i)) {
            to[lane] = from;
        }
        chunk.id[lane] = i as u32;
    }
}
