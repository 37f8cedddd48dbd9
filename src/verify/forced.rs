//! The CPU's stages at a prescribed step, stable or not.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use gridfall_core::sim::moments::moment_matrix;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::{Problem, Transfer};
use gridfall_engine::explicit::cpu::{NodeState, Stages, stages};

/// A simulation at a fixed step, without the engine's guards.
pub struct Forced {
    stages: Box<dyn Stages>,
    dt_s: f64,
    time_s: f64,
    /// Whether to keep the nodes of each step.
    watched: bool,
    nodes: Vec<NodeState>,
}

impl Forced {
    pub fn new(problem: &Problem, dt_s: f64) -> Self {
        let mut stages = stages(&problem.setup, problem.particles.clone());
        stages.start_frame();
        stages.p2g(dt_s);
        Self { stages, dt_s, time_s: 0.0, watched: false, nodes: Vec::new() }
    }

    /// Keeps the nodes of every step as they are after its grid update.
    pub fn watch_nodes(mut self) -> Self {
        self.watched = true;
        self
    }

    /// One step. Returns the largest speed (m/s) after it. The result is infinite once a particle
    /// has moved a cell in a step, has left the domain, or has no finite speed. The simulation
    /// cannot continue after that.
    pub fn step(&mut self) -> f64 {
        self.stages.grid_update(self.dt_s, self.time_s, self.dt_s);
        if self.watched {
            self.nodes = self.stages.nodes();
        }
        let moved = self.stages.g2p2g(self.dt_s, self.dt_s);
        self.time_s += self.dt_s;
        if moved.diverged || moved.outside || !moved.max_speed_m_s.is_finite() {
            return f64::INFINITY;
        }
        if moved.strayed {
            self.stages.bin();
            self.stages.p2g(self.dt_s);
        }
        moved.max_speed_m_s
    }

    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    pub fn dt_s(&self) -> f64 {
        self.dt_s
    }

    /// Nodes of the last step, if they are watched.
    pub fn nodes(&self) -> &[NodeState] {
        &self.nodes
    }

    pub fn particles(&self) -> Particles {
        self.stages.particles()
    }
}

/// Adds noise, uniform in ±`size` of each unit, to v (m/s), C (1/s) and F of every particle.
/// Seeded.
pub fn add_noise(problem: &mut Problem, size: f64, seed: u64) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let d = problem.setup.dimension;
    for p in 0..problem.particles.len() {
        let x = problem.particles.x[p];
        let units = std::array::from_fn(|a| (x[a] - problem.setup.origin[a]) / problem.setup.dx);
        let moment = moment_matrix(problem.setup.kernel, units, problem.setup.dx, d);
        let mut c = [0.0; 9];
        for i in 0..d {
            problem.particles.v[p][i] += random.random_range(-size..size);
            for j in 0..d {
                c[3 * i + j] = random.random_range(-size..size);
                problem.particles.f[p][3 * i + j] += random.random_range(-size..size);
            }
        }
        if problem.setup.transfer != Transfer::Pic {
            for k in 0..9 {
                problem.particles.b[p][k] += (0..3).map(|j| c[3 * (k / 3) + j] * moment[3 * j + k % 3]).sum::<f64>();
            }
        }
    }
}
