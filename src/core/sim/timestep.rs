//! The stable time step: bulk and single-particle bounds by kernel, transfer and dimension, the
//! viscous limit and the particle CFL condition.
//!
//! Elastic bounds have the form dt ≤ dx sqrt(ρ / modulus) with a modulus linear in λ and μ,
//! ρ = m / V0:
//! * **Bulk** (Von Neumann analysis, one particle in each cell; Bai & Schroeder, "Stability
//!   analysis of explicit MPM", Fig. 4): dt ≤ f dx / c, c² = (λ + 2μ) / ρ. For the compact kernel
//!   the worst mode is not a plane P wave, so c² = (2λ + 2μ) / ρ must hold as well.
//! * **Single particle** (same paper, eq. 4): dt ≤ dx sqrt(ρ / (η_μ μ + η_λ dλ/2)),
//!   η = ξ dx² (r - k/2).
//!
//! A viscosity μ_v acts with the velocity gradient of the previous step. One mode of amplitude u
//! and strain F then obeys u' = (b - dt σ_v) u - dt σ_e F, F' = F + dt u'. It leaves the unit
//! circle through -1, when dt² σ_e + 2 dt σ_v = 2 (1 + b). Without viscosity this is the elastic
//! bound T_e² = 2 (1 + b) / σ_e. Without elasticity it is T_v
//! = (1 + b) / σ_v = T_e(λ = 0, μ = μ_v)² / 2. Together the two require (dt / T_e)² + dt / T_v ≤ 1.
//! This holds for bulk and single-particle modes alike (derived here; the tests check it on lone
//! particles).
//!
//! The damping of solids is a viscosity with the moduli t_d λ and t_d μ: σ_v = t_d σ_e in every mode, so
//! dt² + 2 t_d dt ≤ T_e². However a transfer keeps velocities: a mode that changes its sign from step to step has
//! F = dt ∇v / 2, so its stress is (dt/2 + t_d) times the stiffness times ∇v. With damping a step dt is at its bound
//! where one of sqrt(dt² + 2 t_d dt) is without.
//!
//! These bounds hold at rest. **Away from rest** a particle's stiffness ρ0 c² changes with F (Sun,
//! Shinar & Schroeder 2020, see [`crate::material`]), and the step changes with its square root.
//! Engines measure for every particle the ratio s of its stiffness to that at rest. They report the
//! largest *demand* s / dt_rest² (1/s²). Viscosity does not grow with s, so where it has a part in dt_rest the demand
//! is a little too large. [`SAFETY`] covers what may change within a frame. A frame
//! is re-planned when the demand has grown beyond [`REPLAN`] of the bound itself, or when a
//! particle's F changes by more than [`MAX_GROWTH`] in a step.

mod plan;

use std::f64::consts::FRAC_1_SQRT_2;

use serde::Serialize;

use super::setup::{Body, Kernel, Material, Setup, Transfer};
use super::touch::{self, Springs};
use crate::material;

pub use plan::{
    Extremes, MAX_GROWTH, MIN_IMPLICIT_STEP_S, REPLAN, REPLAN_DEMAND, SHRINK, StepPlan, crossing_s, initial_extremes,
    limits, max_collider_speed_m_s, plan_frame, plan_steps,
};

/// Share of the elastic and viscous bounds that is used. The bounds are sharp, and hold for small
/// strain.
pub const SAFETY: f64 = 0.9;

/// The rule that limits a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "rule")]
pub enum Bound {
    /// Elastic waves in the bulk of a body.
    Bulk { body: usize },
    /// A lone particle of a body on its nodes.
    SingleParticle { body: usize },
    /// Explicit viscosity of a body, or its damping.
    Viscosity { body: usize },
    /// Materials that are stiffer under their present deformation than at rest.
    Deformation,
    /// Motion of particles over the grid.
    ParticleSpeed,
    /// `solver.max_dt`.
    MaxDt,
    /// One step per frame is enough.
    Frame,
}

impl Bound {
    /// Stable name for programs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bulk { .. } => "bulk",
            Self::SingleParticle { .. } => "single-particle",
            Self::Viscosity { .. } => "viscosity",
            Self::Deformation => "deformation",
            Self::ParticleSpeed => "particle-speed",
            Self::MaxDt => "max-dt",
            Self::Frame => "frame",
        }
    }

    /// The body whose material limits the step.
    pub fn body(self) -> Option<usize> {
        match self {
            Self::Bulk { body } | Self::SingleParticle { body } | Self::Viscosity { body } => Some(body),
            _ => None,
        }
    }

    /// What limits the step, and what would lengthen it.
    pub fn explain(self, setup: &Setup) -> String {
        let name = |body: usize| setup.bodies.get(body).map_or("?", |b| b.name.as_str());
        // The compact kernel's bounds are tighter than the quadratic's, and MLS has the loosest
        // single-particle bound.
        let kernel = if setup.kernel == Kernel::Compact { ", the quadratic kernel" } else { "" };
        let transfer = if setup.transfer.is_mls() { "" } else { ", the mls transfer" };
        match self {
            Self::Bulk { body } => format!(
                "elastic waves in body '{}' (longer with a lower modulus, a higher density{kernel} or a larger dx)",
                name(body)
            ),
            Self::SingleParticle { body } => format!(
                "stability of a lone particle of body '{}' (longer with a lower modulus, a higher \
                 density{transfer}{kernel} or a larger dx)",
                name(body)
            ),
            Self::Viscosity { body } => {
                let damped = setup.bodies.get(body).is_some_and(|b| setup.materials[b.material].damping() > 0.0);
                let what = if damped { "damping" } else { "viscosity" };
                let body = name(body);
                format!("explicit {what} of body '{body}' (longer with a lower {what}{kernel} or a larger dx)")
            }
            Self::Deformation => format!(
                "materials that are stiffer under their present strain than at rest (longer with slower impacts, a \
                 lower modulus{kernel} or a larger dx)"
            ),
            Self::ParticleSpeed => {
                "particles that may cross only a share of a cell (longer with a higher solver.cfl or a larger dx)"
                    .into()
            }
            Self::MaxDt => "solver.max_dt".into(),
            Self::Frame => "the frame: one step each is enough (longer with a lower time.frame_rate)".into(),
        }
    }
}

/// Bounds of one kernel and transfer.
struct Factors {
    /// f in dt ≤ f dx / c, c² = (λ + 2μ) / ρ.
    p_wave: f64,
    /// f in dt ≤ f dx / c, c² = (2λ + 2μ) / ρ.
    plane: f64,
    /// η of μ and of λ in dt ≤ dx sqrt(ρ / (η_μ μ + η_λ dλ/2)).
    single: [f64; 2],
}

/// No such bound.
const NONE: f64 = f64::INFINITY;

/// The table of bounds.
///
/// * Quadratic and cubic: Bai & Schroeder, Fig. 4 (bulk; equal in 2D and 3D) and eq. 4 with
///   ξ dx² = 4 and 3, r = 3/2 and 1.045606 for PIC and APIC, 1 for MLS (their CPIC), k = 0 for PIC,
///   otherwise 1.
/// * Compact: not in the literature. The values come from the same two analyses, carried out
///   numerically on the dual grid; the closed forms are fitted. The bulk's worst case is one
///   particle per cell at (¼, ¾). η is the worst over positions and Poisson's ratios.
///   MLS (centred): with all coordinates at 0 or ½, p = (¼ − 1/2π)(¾ + 1/2π) and t = 1/(4π² p),
///   η_μ = (1 + d t/(1 + d t))/2p and η_λ = (1 + t/(1 + d t))/2p. A mode is stable as long as
///   2M(I + T) − dt² K ≥ 0 with T = P2G G2P. Both are sums over particles, so no arrangement at
///   rest needs less than a lone particle.
/// * Linear: the bulk factor is the minimum over positions and wave vectors of the paper's trace
///   bound. It is reached with particles on nodes: 1/√d. A lone particle at offset u in its cell
///   has η = 1 / (u (1 - u)) for PIC and half of it for APIC and MLS, which is unbounded as the
///   particle nears a node. The table takes u = 1/10. Closer to a node, a lone stiff particle of
///   this kernel can become unstable.
fn factors(kernel: Kernel, transfer: Transfer, dimension: usize) -> Factors {
    use Kernel::*;
    use Transfer::*;
    let both = |eta: f64| [eta; 2];
    let (p_wave, plane, single) = match (kernel, transfer) {
        (Quadratic, Pic) => (FRAC_1_SQRT_2, NONE, both(6.0)),
        (Quadratic, Apic) => (1.0, NONE, both(4.0)),
        (Quadratic, Mls | MlsPublished) => (1.0, NONE, both(2.0)),
        (Cubic, Pic) => (1.4033, NONE, both(3.0 * 1.045606)),
        (Cubic, Apic) => (1.7042, NONE, both(3.0 * 0.545606)),
        (Cubic, Mls | MlsPublished) => (1.3952, NONE, both(1.5)),
        (Compact, Pic) => (NONE, 0.5, both(12.108)),
        (Compact, Apic) => (NONE, FRAC_1_SQRT_2, both(if dimension == 2 { 8.356 } else { 8.955 })),
        (Compact, Mls) => (NONE, FRAC_1_SQRT_2, if dimension == 2 { [8.35542, 7.20463] } else { [8.95476, 7.02082] }),
        (Compact, MlsPublished) => (0.69468, FRAC_1_SQRT_2, both(6.054)),
        (Linear, Pic) => ((dimension as f64).sqrt().recip(), NONE, both(1.0 / 0.09)),
        (Linear, Apic | Mls | MlsPublished) => ((dimension as f64).sqrt().recip(), NONE, both(0.5 / 0.09)),
    };
    Factors { p_wave, plane, single }
}

/// Bulk and single-particle bounds (s) of a material with Lamé parameters `lambda`, `mu` (Pa) and
/// density `rho` (mass over initial volume), before the safety factor.
pub fn elastic_bounds_s(setup: &Setup, lambda: f64, mu: f64, rho: f64) -> (f64, f64) {
    let f = factors(setup.kernel, setup.transfer, setup.dimension);
    // The elastic tensor grows with λ, so zero is safe for a negative λ.
    let lambda = lambda.max(0.0);
    let over = |modulus: f64| setup.dx * (rho / modulus).sqrt();
    let bulk = (f.p_wave * over(lambda + 2.0 * mu)).min(f.plane * over(2.0 * lambda + 2.0 * mu));
    let [eta_mu, eta_lambda] = f.single;
    (bulk, over(eta_mu * mu + 0.5 * eta_lambda * setup.dimension as f64 * lambda))
}

/// Lamé parameters (Pa) at rest and viscosity (Pa·s). A fluid's λ is its bulk modulus.
pub fn moduli(material: &Material) -> (f64, f64, f64) {
    match (material, material.elastic()) {
        (Material::WeaklyCompressibleFluid(fluid), _) => (fluid.bulk_modulus, 0.0, fluid.viscosity),
        (_, elastic) => {
            let (mu, lambda) = material::lame(&elastic.expect("a solid"));
            (lambda, mu, 0.0)
        }
    }
}

/// Viscosities (Pa·s) in the places of λ and μ: a fluid's, or a solid's damping.
fn viscosities(material: &Material) -> (f64, f64) {
    let (lambda, mu, viscosity) = moduli(material);
    let t_d = material.damping();
    (t_d * lambda, t_d * mu + viscosity)
}

/// Bounds of a body's material (s) including the safety factor: bulk and single particle, each with
/// viscosity.
fn body_bounds(setup: &Setup, index: usize, body: &Body) -> [(f64, Bound); 2] {
    let material = &setup.materials[body.material];
    let ((lambda, mu, _), (lambda_v, mu_v)) = (moduli(material), viscosities(material));
    let rho = body.mass / body.volume0;
    let elastic = elastic_bounds_s(setup, lambda, mu, rho);
    // The springs of contact act beside the material's own stiffness.
    let springs = touch::acts(setup).then(|| Springs::of(setup, body).bound(body.mass));
    let [stiff, damped] = springs.unwrap_or_default();
    let viscous = elastic_bounds_s(setup, lambda_v, mu_v, rho);
    let both = |elastic: f64, unit: f64| {
        let (a, b) = (1.0 / (elastic * elastic), 2.0 / (unit * unit));
        // a dt² + b dt = 1; viscosity dominates if b dt > ½.
        (plan::positive_root(a + stiff, b + damped, 1.0), 2.0 * b * b > a)
    };
    let rules = [Bound::Bulk { body: index }, Bound::SingleParticle { body: index }];
    let bounds = [both(elastic.0, viscous.0), both(elastic.1, viscous.1)];
    std::array::from_fn(|k| {
        let (dt, viscous) = bounds[k];
        (SAFETY * dt, if viscous { Bound::Viscosity { body: index } } else { rules[k] })
    })
}

fn body_bound(setup: &Setup, index: usize, body: &Body) -> (f64, Bound) {
    let [bulk, single] = body_bounds(setup, index, body);
    if bulk.0 <= single.0 { bulk } else { single }
}

/// The longest stable step (s) for materials alone, and its rule.
pub fn material_bound(setup: &Setup) -> (f64, Bound) {
    let bounds = setup.bodies.iter().enumerate().map(|(index, body)| body_bound(setup, index, body));
    bounds.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, Bound::Frame))
}

/// Demand 1/dt² of every body's material at rest, including the safety factor (1/s²).
pub fn demands_at_rest_1_s2(setup: &Setup) -> Vec<f64> {
    let demand = |(index, body): (usize, &Body)| body_bound(setup, index, body).0.powi(-2);
    setup.bodies.iter().enumerate().map(demand).collect()
}

/// Fastest wave in the materials at rest, sqrt((λ + 2μ) / ρ) (m/s).
pub fn max_wave_speed_m_s(setup: &Setup) -> f64 {
    let speed = |body: &Body| {
        let (lambda, mu, _) = moduli(&setup.materials[body.material]);
        ((lambda + 2.0 * mu) * body.volume0 / body.mass).sqrt()
    };
    setup.bodies.iter().map(speed).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests;
