//! Predicted cost of explicit and implicit integration of a problem, and which of the two `auto`
//! chooses.
//!
//! Both predictions are for the state at time 0. The explicit step is the stable one
//! ([`super::timestep`]). The implicit step is the one that the motion of particles over the grid
//! allows (Wang et al. 2020, HOT, §6: CFL-rate stepping). The ratio of the two speeds decides. It
//! is about the same on CPUs and GPUs, so the choice does not depend on the device.

use super::pair;
use super::particles::Particles;
use super::setup::{Integrator, Method, Setup};
use super::source::Source;
use super::timestep::{Bound, MIN_IMPLICIT_STEP_S, StepPlan, crossing_s, initial_extremes, limits, plan_steps};
use super::touch;

/// Explicit particle-steps per second: fixed corotated, f32, two cores of a server
/// (docs/BENCHMARKS.md, fixed-corotated-pair small).
const EXPLICIT_PARTICLE_STEPS_PER_S: f64 = 9e6;
/// Implicit particle-steps per second: HOT at ε = 1e-7 on the same cores, quadratic kernel. The
/// first frames of the reduced HOT scenes reached between 13 thousand (donut, 25 iterations per
/// step) and 135 thousand (faceless, 3). The value is low, so that nearly even cases stay explicit
/// (docs/BENCHMARKS.md).
const IMPLICIT_PARTICLE_STEPS_PER_S: f64 = 2e4;

/// Why alternating directions do not run with colliders that act on particles.
const ADMM_TOUCHES: &str = "the method `admm` has colliders act on nodes only";

/// One way to integrate a problem, with its predicted cost.
#[derive(Clone, Debug, PartialEq)]
pub struct Prediction {
    /// Steps that the rules allow (s), the shortest first.
    pub limits: Vec<(f64, Bound)>,
    /// Steps of the first frame.
    pub plan: StepPlan,
    /// Steps of the whole run, if the step stays as it is.
    pub steps: u64,
    /// Particles times steps.
    pub particle_steps: f64,
    /// Wall time on two cores of a server (s).
    pub two_cores_s: f64,
}

impl Prediction {
    fn new(setup: &Setup, mut limits: Vec<(f64, Bound)>, particle_steps_per_s: f64) -> Self {
        limits.retain(|limit| limit.0.is_finite());
        limits.sort_by(|a, b| a.0.total_cmp(&b.0));
        let plan = plan_steps(&limits, setup.frame_s);
        let particle_steps = particle_frames(setup) * plan.steps as f64;
        Self {
            limits,
            plan,
            steps: plan.steps.saturating_mul(u64::from(setup.frames)),
            particle_steps,
            two_cores_s: particle_steps / particle_steps_per_s,
        }
    }
}

/// The explicit prediction.
pub fn explicit(setup: &Setup, particles: &Particles) -> Prediction {
    let limits = limits(setup, &initial_extremes(setup, particles), setup.frame_s);
    Prediction::new(setup, limits, EXPLICIT_PARTICLE_STEPS_PER_S)
}

/// The implicit prediction, whether or not the problem's materials can run implicitly.
pub fn implicit(setup: &Setup, particles: &Particles) -> Prediction {
    let crossing = crossing_s(setup, initial_extremes(setup, particles).speed_m_s);
    let mut limits = vec![(crossing.max(MIN_IMPLICIT_STEP_S), Bound::ParticleSpeed), (setup.frame_s, Bound::Frame)];
    limits.extend(setup.max_dt_s.map(|dt| (dt, Bound::MaxDt)));
    Prediction::new(setup, limits, IMPLICIT_PARTICLE_STEPS_PER_S)
}

/// The prediction for the integrator that the problem runs with.
pub fn chosen(setup: &Setup, particles: &Particles) -> Prediction {
    match setup.integrator {
        Integrator::Implicit => implicit(setup, particles),
        _ => explicit(setup, particles),
    }
}

/// Why a problem cannot run implicitly; `None` if it can.
pub fn implicit_fault(setup: &Setup) -> Option<String> {
    let of = |body: &super::setup::Body| &setup.materials[body.material];
    let fluid = setup.bodies.iter().find(|body| of(body).is_fluid());
    let damped = setup.bodies.iter().find(|body| of(body).damping() > 0.0);
    let parted = setup.bodies.iter().find(|body| pair::own(body).is_some());
    let plastic = setup.bodies.iter().find(|body| !of(body).is_elastic());
    match (fluid, damped, plastic) {
        (Some(body), ..) => Some(format!("the fluid '{}' can run explicitly only", body.name)),
        (_, Some(body), _) => Some(format!("'{}' has damping, which explicit steps alone have", body.name)),
        (_, _, Some(body)) if setup.implicit.method == Method::Admm => {
            Some(format!("the method `admm` is for elastic materials, and that of '{}' is plastic", body.name))
        }
        _ => parted
            .map(|body| format!("'{}' has contact with other bodies, which explicit runs have only", body.name))
            .or_else(|| (setup.implicit.method == Method::Admm && touch::acts(setup)).then(|| ADMM_TOUCHES.into())),
    }
}

/// Why a problem's particles are too fast for implicit steps; `None` if they are not.
pub fn too_fast_for_implicit(setup: &Setup, particles: &Particles) -> Option<String> {
    let speed_m_s = initial_extremes(setup, particles).speed_m_s;
    let shortest_s = MIN_IMPLICIT_STEP_S.min(setup.frame_s);
    (speed_m_s * shortest_s > setup.dx).then(|| {
        let cells = speed_m_s * shortest_s / setup.dx;
        format!("at {speed_m_s:.3e} m/s a particle crosses {cells:.1} cells in the shortest implicit step")
    })
}

/// The integrator that `asked` resolves to, and why, in a sentence.
pub fn choose(setup: &Setup, particles: &Particles, asked: Integrator) -> (Integrator, String) {
    if asked != Integrator::Auto {
        return (asked, "the scene asks for it".into());
    }
    if let Some(fault) = implicit_fault(setup).or_else(|| too_fast_for_implicit(setup, particles)) {
        return (Integrator::Explicit, fault);
    }
    let (explicit, implicit) = (explicit(setup, particles), implicit(setup, particles));
    let steps = |p: &Prediction| format!("{} steps of {:.1e} s", p.steps, p.plan.dt_s);
    let reason = |better: &Prediction, other: &Prediction, of: &str| {
        let times = other.two_cores_s / better.two_cores_s;
        format!("predicted to be {times:.1} times as fast as {of}: {} against {}", steps(better), steps(other))
    };
    if implicit.two_cores_s < explicit.two_cores_s {
        (Integrator::Implicit, reason(&implicit, &explicit, "explicit"))
    } else {
        (Integrator::Explicit, reason(&explicit, &implicit, "implicit"))
    }
}

/// Particles summed over all frames; each frame counts those that exist in it.
fn particle_frames(setup: &Setup) -> f64 {
    let emitted = setup.sources.iter().flat_map(|source: &Source| {
        let frames = source.by_frame.iter().enumerate();
        frames.map(|(frame, &n)| n as f64 * f64::from(setup.frames.saturating_sub(frame as u32)))
    });
    setup.initial_particles() as f64 * f64::from(setup.frames) + emitted.sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::parameters::{Elastic, Elasticity, Material, VonMises};
    use crate::sim::fixture;
    use crate::sim::setup::{Contact, ContactKind, Problem};

    /// A steel beam of the given modulus under gravity, at rest; the second material is a fluid.
    fn beam(youngs_modulus: f64) -> Problem {
        let elastic = Elastic { density: 1000.0, youngs_modulus, poissons_ratio: 0.3, damping: 0.0 };
        let Elastic { density, poissons_ratio, .. } = elastic;
        let elasticity = Elasticity::default();
        let steel = VonMises { density, youngs_modulus, poissons_ratio, yield_stress: 1e6, elasticity, damping: 0.0 };
        let materials = vec![Material::VonMises(steel), fixture::solid_and_fluid().remove(1)];
        let mut problem = fixture::problem(3, 0.125, materials, &[(0, [0.0; 3], [0.5, 0.25, 0.25])]);
        problem.setup.gravity = [0.0, 0.0, -10.0];
        (problem.setup.frames, problem.setup.frame_s) = (20, 1.0 / 20.0);
        problem
    }

    fn chosen(problem: &Problem, asked: Integrator) -> (Integrator, String) {
        choose(&problem.setup, &problem.particles, asked)
    }

    #[test]
    fn auto_is_implicit_where_stiffness_makes_explicit_steps_short_and_says_so() {
        let (integrator, reason) = chosen(&beam(1e11), Integrator::Auto);
        assert_eq!(integrator, Integrator::Implicit);
        assert!(reason.contains("times as fast as explicit"), "{reason}");
        let (integrator, reason) = chosen(&beam(1e4), Integrator::Auto);
        assert_eq!(integrator, Integrator::Explicit);
        assert!(reason.contains("times as fast as implicit"), "{reason}");
        let asked = chosen(&beam(1e11), Integrator::Explicit);
        assert_eq!(asked, (Integrator::Explicit, "the scene asks for it".into()));
    }

    #[test]
    fn auto_is_explicit_where_implicit_cannot_be() {
        let mut problem = beam(1e11);
        problem.setup.implicit.method = Method::Admm;
        let (integrator, reason) = chosen(&problem, Integrator::Auto);
        assert_eq!(integrator, Integrator::Explicit);
        assert!(reason.contains("admm"), "{reason}");
        problem.setup.implicit.method = Method::Hot;
        let Material::VonMises(steel) = &mut problem.setup.materials[0] else { panic!("the first is steel") };
        steel.damping = 1e-6;
        let (integrator, reason) = chosen(&problem, Integrator::Auto);
        assert_eq!(integrator, Integrator::Explicit);
        assert!(reason.contains("'body 0' has damping"), "{reason}");
        problem.setup.bodies[0].material = 1;
        let (integrator, reason) = chosen(&problem, Integrator::Auto);
        assert_eq!(integrator, Integrator::Explicit);
        assert!(reason.contains("fluid 'body 0'"), "{reason}");
    }

    #[test]
    fn auto_is_explicit_where_bodies_have_contact() {
        let mut problem = beam(1e11);
        problem.setup.bodies[0].contact = Some(Contact { kind: ContactKind::Sticky, friction: 0.0 });
        assert_eq!(chosen(&problem, Integrator::Auto).0, Integrator::Implicit);
        problem.setup.bodies[0].contact = Some(Contact { kind: ContactKind::Separate, friction: 0.1 });
        let (integrator, reason) = chosen(&problem, Integrator::Auto);
        assert_eq!(integrator, Integrator::Explicit);
        assert!(reason.contains("'body 0' has contact with other bodies"), "{reason}");
    }

    #[test]
    fn auto_is_explicit_where_particles_are_too_fast_for_implicit_steps() {
        let mut problem = beam(1e11);
        problem.particles.v[3] = [1.2e5, 0.0, 0.0];
        assert!(too_fast_for_implicit(&problem.setup, &problem.particles).is_none());
        problem.particles.v[3] = [2.5e5, 0.0, 0.0];
        let (integrator, reason) = chosen(&problem, Integrator::Auto);
        assert_eq!(integrator, Integrator::Explicit);
        assert!(reason.contains("crosses 2.0 cells"), "{reason}");
    }

    #[test]
    fn the_implicit_step_is_what_motion_over_the_grid_allows() {
        // At rest under gravity: (g dt) dt = cfl dx.
        let Problem { mut setup, mut particles } = beam(1e11);
        setup.cfl = 0.4;
        let free = implicit(&setup, &particles);
        let crossing = free.limits.iter().find(|limit| limit.1 == Bound::ParticleSpeed).unwrap().0;
        assert!((crossing - (0.4f64 * 0.125 / 10.0).sqrt()).abs() < 1e-12);
        // 0.0707 s is longer than the frame.
        assert_eq!((free.plan.bound, free.plan.steps, free.steps), (Bound::Frame, 1, 20));
        particles.v[3] = [0.0, 0.0, 7.0];
        let fast = implicit(&setup, &particles);
        let dt = fast.limits[0].0;
        assert!(((7.0 + 10.0 * dt) * dt - 0.05).abs() < 1e-12 && fast.plan.bound == Bound::ParticleSpeed);
        assert_eq!(fast.particle_steps, (fast.steps * particles.len() as u64) as f64);
        setup.max_dt_s = Some(1e-3);
        let capped = implicit(&setup, &particles);
        assert_eq!((capped.plan.bound, capped.plan.steps), (Bound::MaxDt, 50));
    }
}
