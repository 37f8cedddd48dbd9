//! The states of a step's particles, in the order of their groups.

use super::topology::Topology;
use gridfall_core::material::Law;
use gridfall_core::maths::linalg::{Matrix, Vector, from_row_major, to_row_major};
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::Setup;
use gridfall_core::sim::touch::Touch;

/// What all particles of a body share.
#[derive(Clone, Copy, Debug)]
pub struct BodySetup {
    pub law: Law<f64>,
    /// Of one particle (kg).
    pub mass: f64,
    /// Of one particle at rest (m³; 2D: m²).
    pub volume0: f64,
    /// ‖∂P/∂F‖ at rest (Pa), the law's characteristic stiffness (HOT §5.2).
    pub characteristic: f64,
}

/// Setups of all bodies of a problem.
pub fn setups<const D: usize>(setup: &Setup) -> Vec<BodySetup> {
    let of_body = |body: &gridfall_core::sim::setup::Body| {
        let law = Law::new(&setup.materials[body.material]);
        let characteristic = law.characteristic::<D>();
        BodySetup { law, mass: body.mass, volume0: body.volume0, characteristic }
    };
    setup.bodies.iter().map(of_body).collect()
}

/// Particles in the order of a topology.
pub struct State<const D: usize> {
    pub x: Vec<Vector<f64, D>>,
    pub v: Vec<Vector<f64, D>>,
    /// B (m²/s).
    pub b: Vec<Matrix<f64, D>>,
    pub f: Vec<Matrix<f64, D>>,
    pub plastic: Vec<f64>,
    pub body: Vec<u32>,
    /// Empty where no faces act on particles.
    pub touch: Vec<Touch>,
}

pub fn vector<const D: usize>(x: &[f64; 3]) -> Vector<f64, D> {
    std::array::from_fn(|a| x[a])
}

impl<const D: usize> State<D> {
    /// Particles as `topology` orders them.
    pub fn sorted(particles: &Particles, topology: &Topology<D>) -> Self {
        let ids = || topology.order.iter().map(|&id| id as usize);
        Self {
            x: ids().map(|i| vector(&particles.x[i])).collect(),
            v: ids().map(|i| vector(&particles.v[i])).collect(),
            b: ids().map(|i| from_row_major(&particles.b[i])).collect(),
            f: ids().map(|i| from_row_major(&particles.f[i])).collect(),
            plastic: ids().map(|i| particles.plastic[i]).collect(),
            body: ids().map(|i| particles.body[i]).collect(),
            touch: ids().filter_map(|i| particles.touch.get(i)).copied().collect(),
        }
    }

    /// The same in another order: the i-th was `order[i]`.
    pub fn permuted(&self, order: &[u32]) -> Self {
        fn pick<V: Copy>(values: &[V], order: &[u32]) -> Vec<V> {
            order.iter().map(|&i| values[i as usize]).collect()
        }
        Self {
            x: pick(&self.x, order),
            v: pick(&self.v, order),
            b: pick(&self.b, order),
            f: pick(&self.f, order),
            plastic: pick(&self.plastic, order),
            body: pick(&self.body, order),
            touch: if self.touch.is_empty() { Vec::new() } else { pick(&self.touch, order) },
        }
    }

    /// Writes the states back in the particles' own order.
    pub fn store(&self, topology: &Topology<D>, particles: &mut Particles) {
        for (p, &id) in topology.order.iter().enumerate() {
            let id = id as usize;
            particles.x[id][..D].copy_from_slice(&self.x[p]);
            particles.v[id][..D].copy_from_slice(&self.v[p]);
            particles.b[id] = to_row_major(&self.b[p], 0.0);
            particles.f[id] = to_row_major(&self.f[p], 1.0);
            particles.plastic[id] = self.plastic[p];
            if let Some(touch) = self.touch.get(p) {
                particles.touch[id] = *touch;
            }
        }
    }
}
