//! Diagnostics of a frame: conserved quantities, energies and extremes over all particles.

mod columns;
mod solver;

pub use columns::Value;
use columns::columns;
pub use solver::SolverRow;

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::moments::moment_matrix;
use super::particles::Particles;
use super::reaction::{Reaction, Surface, named_surfaces};
use super::setup::{Setup, Transfer};
use super::stats::FrameStats;
use crate::material;
use crate::maths::linalg::determinant;

columns! {
/// One row of diagnostics. The field names are the columns of the CSV, the keys of the JSON and the
/// fields of the protobuf.
Row {
    /// Frame number; 0 is the initial state.
    frame: u64,
    /// Simulated time (s).
    time_s: f64,
    /// Sub-steps of this frame.
    steps: u64,
    /// Mean sub-step (s).
    dt_s: f64,
    /// Total mass (kg; 2D: kg/m, and so on for all that follows).
    mass_kg: f64,
    /// Linear momentum (kg m/s).
    momentum_x: f64,
    /// Linear momentum (kg m/s).
    momentum_y: f64,
    /// Linear momentum (kg m/s).
    momentum_z: f64,
    /// Angular momentum about the origin, the affine part included (kg m²/s).
    angular_momentum_x: f64,
    /// Angular momentum about the origin, the affine part included (kg m²/s).
    angular_momentum_y: f64,
    /// Angular momentum about the origin, the affine part included (kg m²/s).
    angular_momentum_z: f64,
    /// Σ ½ m v² of the particles (J).
    kinetic_j: f64,
    /// Σ ½ m tr(B Cᵀ), the kinetic energy of the affine velocities (J).
    affine_j: f64,
    /// Σ V0 ψ(F), the stored energy of the materials (J).
    strain_j: f64,
    /// −Σ m g·x, the potential of gravity, zero at the origin (J).
    gravity_j: f64,
    /// Largest particle speed (m/s).
    max_speed: f64,
    /// Smallest volume ratio det F.
    min_J: f64,
    /// Particles reset in this frame because they were alone on their nodes.
    isolated_reset: u64,
    /// Outer iterations of the implicit integrator in this frame; 0 in explicit runs, as in the
    /// next two columns.
    iterations: u64,
    /// Largest residual at the end of a step, in the norm of the tolerance.
    residual: f64,
    /// Halvings of the line searches.
    halvings: u64,
    ;
    /// Reactions of the problem's surfaces, in the order of [`named_surfaces`]. Their columns
    /// follow the fixed ones.
    reactions: Vec<(Surface, Reaction)>,
}
}

impl Row {
    /// Measures a frame whose particles are all at hand; [`Totals`] takes them in parts.
    pub fn measure(setup: &Setup, particles: &Particles, frame: u64, time_s: f64, stats: &FrameStats) -> Self {
        let mut totals = Totals::default();
        totals.add(setup, particles);
        totals.row(setup, frame, time_s, stats)
    }

    /// The header line of the CSV, without line end. Characters of a collider's name that would
    /// break the line become `_`.
    pub fn csv_header(setup: &Setup) -> String {
        let surfaces = named_surfaces(setup);
        let plain = |name: String| name.replace(|c: char| c.is_control() || c == ',' || c == '"', "_");
        let dynamic = surfaces.iter().flat_map(Surface::columns).map(plain);
        Self::COLUMNS.iter().map(|name| name.to_string()).chain(dynamic).collect::<Vec<_>>().join(",")
    }

    /// The row as a line of CSV, without line end. Numbers round-trip.
    pub fn csv(&self) -> String {
        let dynamic = self.reactions.iter().flat_map(|(surface, reaction)| surface.values(reaction).map(Value::Real));
        self.values().into_iter().chain(dynamic).map(Value::csv).collect::<Vec<_>>().join(",")
    }
}

/// Sums over the particles of a frame, which may be added in parts.
///
/// Sums are accumulated in f64 with compensation, in an order that depends only on the particles.
/// The result is therefore the same for any number of threads, and accurate to a few units in the
/// last place.
///
/// A particle represents the velocity field v + C (x − x_p) weighted by its kernel. With
/// B = Σ w v (x_i − x_p)ᵀ and D = Σ w (x_i − x_p)(x_i − x_p)ᵀ, its angular momentum beyond x_p × v
/// is L_k = ε_kij B_ji, and its kinetic energy beyond ½ v² is ½ tr(B Cᵀ), C = B D⁻¹ (Jiang et al.
/// 2015, "The affine particle-in-cell method", §5). PIC has neither.
#[derive(Clone, Copy, Default)]
pub struct Totals(Tally);

impl Totals {
    /// If the length of every part is a multiple of this, the sums equal those of the whole, bit
    /// for bit.
    pub const PART: usize = 4096;

    /// Adds the next particles in sampling order.
    pub fn add(&mut self, setup: &Setup, particles: &Particles) {
        let partials: Vec<Tally> = (0..particles.len())
            .into_par_iter()
            .chunks(Self::PART)
            .map(|chunk| {
                let mut tally = Tally::default();
                chunk.into_iter().for_each(|p| tally.add_particle(setup, particles, p));
                tally
            })
            .collect();
        partials.iter().for_each(|partial| self.0.merge(partial));
    }

    /// Adds what a device has summed up of a domain at `origin` (m), under `gravity` (m/s²).
    pub fn add_sums(&mut self, origin: [f64; 3], gravity: [f64; 3], sums: &Sums) {
        let p = sums.momentum;
        let about_origin = cross(origin, p);
        let spin: [f64; 3] = std::array::from_fn(|k| sums.spin[k] + about_origin[k]);
        let potential = -sums.gravity_work - sums.mass * dot(gravity, origin);
        let [kinetic, affine, strain] = [sums.kinetic, sums.affine, sums.strain];
        let terms = [sums.mass, p[0], p[1], p[2], spin[0], spin[1], spin[2], kinetic, affine, strain, potential];
        self.0.sums.iter_mut().zip(terms).for_each(|(sum, term)| sum.add(term));
        self.0.max_speed2 = self.0.max_speed2.max(sums.max_speed2);
        self.0.min_j = self.0.min_j.min(sums.min_j);
    }

    /// The diagnostics of the frame.
    pub fn row(&self, setup: &Setup, frame: u64, time_s: f64, stats: &FrameStats) -> Row {
        let total = &self.0;
        let [mass_kg, px, py, pz, lx, ly, lz, kinetic_j, affine_j, strain_j, gravity_j] =
            total.sums.map(|sum| sum.value());
        Row {
            frame,
            time_s,
            steps: stats.steps,
            dt_s: stats.dt_s,
            mass_kg,
            momentum_x: px,
            momentum_y: py,
            momentum_z: pz,
            angular_momentum_x: lx,
            angular_momentum_y: ly,
            angular_momentum_z: lz,
            kinetic_j,
            affine_j,
            strain_j,
            gravity_j,
            max_speed: total.max_speed2.sqrt(),
            min_J: total.min_j,
            isolated_reset: stats.isolated_reset,
            iterations: stats.solves.iter().map(|solve| u64::from(solve.iterations)).sum(),
            residual: stats.solves.iter().map(|solve| solve.residual).fold(0.0, f64::max),
            halvings: stats.solves.iter().map(|solve| u64::from(solve.halvings)).sum(),
            reactions: named_surfaces(setup)
                .into_iter()
                .map(|surface| {
                    let reaction = stats.reactions.get(surface.index).copied().unwrap_or_default();
                    (surface, reaction)
                })
                .collect(),
        }
    }
}

/// Sums over some particles as a device takes them: about the domain's corner, so that f32 loses nothing in domains
/// far from the origin. Mass need not come with the particles whose it is, for all that follows is linear.
#[derive(Clone, Copy, Debug)]
pub struct Sums {
    pub mass: f64,
    pub momentum: [f64; 3],
    /// Angular momentum about the corner.
    pub spin: [f64; 3],
    pub kinetic: f64,
    pub affine: f64,
    pub strain: f64,
    /// Σ m g·(x − corner) (J).
    pub gravity_work: f64,
    /// Largest v² (m²/s²).
    pub max_speed2: f64,
    pub min_j: f64,
}

impl Default for Sums {
    /// Of no particles.
    fn default() -> Self {
        let (mass, kinetic, affine, strain, gravity_work, max_speed2) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        let (momentum, spin, min_j) = ([0.0; 3], [0.0; 3], f64::INFINITY);
        Self { mass, momentum, spin, kinetic, affine, strain, gravity_work, max_speed2, min_j }
    }
}

/// Running sums and extremes.
#[derive(Clone, Copy)]
struct Tally {
    /// mass, momentum (3), angular momentum (3), kinetic, affine, strain, gravity.
    sums: [Sum; 11],
    max_speed2: f64,
    min_j: f64,
}

impl Default for Tally {
    fn default() -> Self {
        Self { sums: [Sum::default(); 11], max_speed2: 0.0, min_j: f64::INFINITY }
    }
}

impl Tally {
    fn add_particle(&mut self, setup: &Setup, particles: &Particles, p: usize) {
        let (x, v, f) = (particles.x[p], particles.v[p], &particles.f[p]);
        let body = &setup.bodies[particles.body[p] as usize];
        let m = body.mass;
        let b = if setup.transfer == Transfer::Pic { [0.0; 9] } else { particles.b[p] };
        let c = affine_velocity(setup, x, &b);
        let spin = cross(x, v);
        let speed2 = dot(v, v);
        let terms = [
            m,
            m * v[0],
            m * v[1],
            m * v[2],
            m * (spin[0] + b[7] - b[5]),
            m * (spin[1] + b[2] - b[6]),
            m * (spin[2] + b[3] - b[1]),
            0.5 * m * speed2,
            0.5 * m * (0..9).map(|k| b[k] * c[k]).sum::<f64>(),
            body.volume0
                * material::energy_density(&setup.materials[body.material], setup.dimension, f, particles.plastic[p]),
            -m * dot(setup.gravity, x),
        ];
        self.sums.iter_mut().zip(terms).for_each(|(sum, term)| sum.add(term));
        self.max_speed2 = self.max_speed2.max(speed2);
        self.min_j = self.min_j.min(determinant(f));
    }

    fn merge(&mut self, other: &Self) {
        self.sums.iter_mut().zip(other.sums).for_each(|(sum, part)| {
            sum.add(part.sum);
            sum.add(part.correction);
        });
        self.max_speed2 = self.max_speed2.max(other.max_speed2);
        self.min_j = self.min_j.min(other.min_j);
    }
}

/// Neumaier's compensated sum.
#[derive(Clone, Copy, Default)]
struct Sum {
    sum: f64,
    correction: f64,
}

impl Sum {
    fn add(&mut self, x: f64) {
        let t = self.sum + x;
        self.correction += if self.sum.abs() >= x.abs() { (self.sum - t) + x } else { (x - t) + self.sum };
        self.sum = t;
    }

    fn value(self) -> f64 {
        self.sum + self.correction
    }
}

/// C = B D⁻¹ at a particle (1/s), row-major.
fn affine_velocity(setup: &Setup, x: [f64; 3], b: &[f64; 9]) -> [f64; 9] {
    let position = std::array::from_fn(|a| (x[a] - setup.origin[a]) / setup.dx);
    let mut d = moment_matrix(setup.kernel, position, setup.dx, setup.dimension);
    for a in 0..3 {
        // D is singular along the empty third axis of 2D, and for the linear kernel on a node. B is
        // zero there too.
        if d[4 * a] < 1e-12 * setup.dx * setup.dx {
            d[4 * a] = setup.dx * setup.dx;
        }
    }
    let inverse = Matrix3::from_row_slice(&d).try_inverse().expect("D is positive definite");
    let c = Matrix3::from_row_slice(b) * inverse;
    std::array::from_fn(|k| c[(k / 3, k % 3)])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests;
