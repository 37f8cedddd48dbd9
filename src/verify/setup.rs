//! Problems of cases from scene documents, so that cases take the same path as users' scenes; and
//! sums over particles.

use std::fmt;

use serde_json::{Value, json};

use super::session::Session;
use gridfall_core::sim::diagnostics;
use gridfall_core::sim::moments::moment_matrix;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::{Kernel, Problem, Transfer};
use gridfall_engine::FrameStats;
use gridfall_scene::{self as scene, Limits};

pub type Vec3 = [f64; 3];

/// The settings that affect the engines' behaviour most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scheme {
    pub dimension: usize,
    pub kernel: Kernel,
    pub transfer: Transfer,
}

impl Scheme {
    pub const fn new(dimension: usize, kernel: Kernel, transfer: Transfer) -> Self {
        Self { dimension, kernel, transfer }
    }
}

impl fmt::Display for Scheme {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = |value: Value| value.as_str().unwrap_or_default().to_string();
        write!(f, "{}D {} {}", self.dimension, name(json!(self.kernel)), name(json!(self.transfer)))
    }
}

/// The problem of a scene. `scene` has everything except version, name, dimension, time and solver.
pub fn problem(session: &Session, scheme: Scheme, mut scene: Value) -> Problem {
    let fields = scene.as_object_mut().expect("a scene is an object");
    fields.insert("gridfall".into(), json!(1));
    fields.insert("name".into(), json!("verify"));
    fields.insert("dimension".into(), json!(scheme.dimension));
    fields.insert("time".into(), json!({ "end": 1 }));
    fields.insert(
        "solver".into(),
        json!({ "kernel": scheme.kernel, "transfer": scheme.transfer, "precision": session.precision() }),
    );
    let text = scene.to_string();
    let document = scene::parse(&text).unwrap_or_else(|faults| panic!("a scene of a case has faults: {faults:#?}"));
    scene::problem(&document, &Limits::default()).unwrap_or_else(|faults| panic!("{faults:#?}"))
}

/// An isotropic elastic material of 1000 kg/m³.
pub fn elastic(model: &str, youngs_modulus_pa: f64, poissons_ratio: f64) -> Value {
    json!({ "model": model, "density": 1000, "youngs_modulus": youngs_modulus_pa, "poissons_ratio": poissons_ratio })
}

/// The first `dimension` components.
pub fn vector(dimension: usize, x: Vec3) -> Vec<f64> {
    x[..dimension].to_vec()
}

/// Sums of a state, as in recordings.
pub fn sums(problem: &Problem, particles: &Particles) -> diagnostics::Row {
    diagnostics::Row::measure(&problem.setup, particles, 0, 0.0, &FrameStats::default())
}

/// Σ m v of a range of particles (kg m/s).
pub fn momentum(problem: &Problem, particles: &Particles, range: std::ops::Range<usize>) -> Vec3 {
    let mut total = [0.0; 3];
    for p in range {
        let mass = problem.setup.bodies[particles.body[p] as usize].mass;
        (0..3).for_each(|a| total[a] += mass * particles.v[p][a]);
    }
    total
}

/// Mean position of a range of particles (m).
pub fn centre(particles: &Particles, range: std::ops::Range<usize>) -> Vec3 {
    let n = range.len() as f64;
    let mut total = [0.0; 3];
    for p in range {
        (0..3).for_each(|a| total[a] += particles.x[p][a] / n);
    }
    total
}

pub fn norm(v: Vec3) -> f64 {
    v.iter().map(|c| c * c).sum::<f64>().sqrt()
}

pub fn minus(a: Vec3, b: Vec3) -> Vec3 {
    std::array::from_fn(|k| a[k] - b[k])
}

/// Sets the velocity and the velocity gradient (1/s, row-major) of every particle from a field at
/// its position: v, and B = C D.
pub fn set_velocity(problem: &mut Problem, field: impl Fn(Vec3) -> (Vec3, [f64; 9])) {
    for p in 0..problem.particles.len() {
        let x = problem.particles.x[p];
        let (v, c) = field(x);
        problem.particles.v[p] = v;
        if problem.setup.transfer == Transfer::Pic {
            continue;
        }
        let units = std::array::from_fn(|a| (x[a] - problem.setup.origin[a]) / problem.setup.dx);
        let moment = moment_matrix(problem.setup.kernel, units, problem.setup.dx, problem.setup.dimension);
        problem.particles.b[p] =
            std::array::from_fn(|k| (0..3).map(|j| c[3 * (k / 3) + j] * moment[3 * j + k % 3]).sum());
    }
}
