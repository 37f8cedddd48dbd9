//! What explicit and implicit integration of a problem are predicted to cost, and which of them `auto` stands for.
//!
//! Both predictions are of the state at time 0: the explicit step is the stable one ([`super::timestep`]), the implicit one is what the
//! motion of particles over the grid allows (Wang et al. 2020, HOT, §6: CFL-rate stepping). The ratio of the two speeds decides; it is
//! about the same on CPUs and GPUs, so that the choice does not depend on the device.

use super::problem::{Integrator, Method, Problem};
use super::source::Source;
use super::timestep::{Bound, StepPlan, initial_extremes, limits, max_collider_speed_m_s, plan_steps};

/// Explicit particle-steps a second, fixed corotated, f32, two cores of a server (docs/BENCHMARKS.md, fixed-corotated-pair small).
const EXPLICIT_PARTICLE_STEPS_PER_S: f64 = 9e6;
/// Implicit particle-steps a second, HOT at ε = 1e-7 on the same cores, quadratic kernel: the first frames of the reduced HOT scenes had 13 thousand
/// (donut, 25 iterations a step) to 135 thousand (faceless, 3); low, so that what is nearly even stays explicit (docs/BENCHMARKS.md).
const IMPLICIT_PARTICLE_STEPS_PER_S: f64 = 2e4;

/// The shortest implicit step (s); whatever moves faster than cfl dx in it is an error of the scene.
pub const MIN_IMPLICIT_STEP_S: f64 = 1e-6;

/// One way to integrate a problem, and what it is predicted to cost.
#[derive(Clone, Debug, PartialEq)]
pub struct Prediction {
    /// Steps that the rules allow (s), the shortest first.
    pub limits: Vec<(f64, Bound)>,
    /// The first frame's steps.
    pub plan: StepPlan,
    /// Steps of the whole run, if the step stays as it is.
    pub steps: u64,
    /// Particles times steps.
    pub particle_steps: f64,
    /// Wall time on two cores of a server (s).
    pub two_cores_s: f64,
}

impl Prediction {
    fn new(problem: &Problem, mut limits: Vec<(f64, Bound)>, particle_steps_per_s: f64) -> Self {
        limits.retain(|limit| limit.0.is_finite());
        limits.sort_by(|a, b| a.0.total_cmp(&b.0));
        let plan = plan_steps(&limits, problem.frame_s);
        let particle_steps = particle_frames(problem) * plan.steps as f64;
        Self {
            limits,
            plan,
            steps: plan.steps.saturating_mul(u64::from(problem.frames)),
            particle_steps,
            two_cores_s: particle_steps / particle_steps_per_s,
        }
    }
}

/// The explicit prediction.
pub fn explicit(problem: &Problem) -> Prediction {
    let limits = limits(problem, &initial_extremes(problem), problem.frame_s);
    Prediction::new(problem, limits, EXPLICIT_PARTICLE_STEPS_PER_S)
}

/// The implicit prediction, whether or not the problem's materials can run implicitly.
pub fn implicit(problem: &Problem) -> Prediction {
    let speed = initial_extremes(problem).speed_m_s.max(max_collider_speed_m_s(problem));
    let gravity = problem.gravity.iter().map(|g| g * g).sum::<f64>().sqrt();
    // cfl dx = (v + g dt) dt: with what gravity adds to v within the step.
    let way = problem.cfl * problem.dx;
    let crossing = 2.0 * way / (speed + (speed * speed + 4.0 * gravity * way).sqrt());
    let mut limits = vec![(crossing.max(MIN_IMPLICIT_STEP_S), Bound::ParticleSpeed), (problem.frame_s, Bound::Frame)];
    limits.extend(problem.max_dt_s.map(|dt| (dt, Bound::MaxDt)));
    Prediction::new(problem, limits, IMPLICIT_PARTICLE_STEPS_PER_S)
}

/// The prediction of the integrator that the problem runs with.
pub fn chosen(problem: &Problem) -> Prediction {
    if problem.integrator == Integrator::Implicit { implicit(problem) } else { explicit(problem) }
}

/// Why a problem cannot run implicitly, if it cannot.
pub fn implicit_fault(problem: &Problem) -> Option<String> {
    let of = |body: &super::problem::Body| &problem.materials[body.material];
    let fluid = problem.bodies.iter().find(|body| of(body).is_fluid());
    let plastic = problem.bodies.iter().find(|body| !of(body).is_elastic());
    match (fluid, plastic) {
        (Some(body), _) => Some(format!("the fluid '{}' can run explicitly only", body.name)),
        (_, Some(body)) if problem.implicit.method == Method::Admm => {
            Some(format!("the method `admm` is for elastic materials, and that of '{}' is plastic", body.name))
        }
        _ => None,
    }
}

/// What `asked` stands for, and why, in a sentence.
pub fn choose(problem: &Problem, asked: Integrator) -> (Integrator, String) {
    if asked != Integrator::Auto {
        return (asked, "the scene asks for it".into());
    }
    if let Some(fault) = implicit_fault(problem) {
        return (Integrator::Explicit, fault);
    }
    let (explicit, implicit) = (explicit(problem), implicit(problem));
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

/// Particles summed over all frames, in each those that there are.
fn particle_frames(problem: &Problem) -> f64 {
    let emitted = problem.sources.iter().flat_map(|source: &Source| {
        let frames = source.by_frame.iter().enumerate();
        frames.map(|(frame, &n)| n as f64 * f64::from(problem.frames.saturating_sub(frame as u32)))
    });
    problem.particles.len() as f64 * f64::from(problem.frames) + emitted.sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridfall_scene::{self as scene, Limits};

    /// A beam of the given modulus that hangs on a wall; `solver` and `materials` replace the scene's.
    fn beam(youngs_modulus: f64, solver: &str) -> Problem {
        let scene = format!(
            r#"{{ "gridfall": 1, "name": "beam", "domain": {{ "min": [0, 0, 0], "max": [1, 0.5, 0.5], "dx": 0.125 }},
            "gravity": [0, 0, -10],
            "materials": {{
                "steel": {{ "model": "von-mises", "density": 1000, "youngs_modulus": {youngs_modulus}, "poissons_ratio": 0.3, "yield_stress": 1e6 }},
                "water": {{ "model": "weakly-compressible-fluid", "density": 1000, "bulk_modulus": 1e5 }} }},
            "bodies": [ {{ "name": "beam", "material": "steel", "shape": {{ "box": {{ "min": [0, 0, 0], "max": [0.5, 0.25, 0.25] }} }} }} ],
            "time": {{ "end": 1, "frame_rate": 20 }}, "solver": {{ {solver} }} }}"#
        );
        scene::problem(&scene::parse(&scene).unwrap(), &Limits::default()).unwrap()
    }

    #[test]
    fn auto_is_implicit_where_stiffness_makes_explicit_steps_short_and_says_so() {
        let stiff = beam(1e11, "");
        assert_eq!(stiff.integrator, Integrator::Implicit);
        assert!(stiff.integrator_reason.contains("times as fast as explicit"), "{}", stiff.integrator_reason);
        let soft = beam(1e4, "");
        assert_eq!(soft.integrator, Integrator::Explicit);
        assert!(soft.integrator_reason.contains("times as fast as implicit"), "{}", soft.integrator_reason);
        let asked = beam(1e11, r#""integrator": "explicit""#);
        assert_eq!(
            (asked.integrator, asked.integrator_reason.as_str()),
            (Integrator::Explicit, "the scene asks for it")
        );
    }

    #[test]
    fn auto_is_explicit_where_implicit_cannot_be() {
        let mut problem = beam(1e11, r#""implicit": { "method": "admm" }"#);
        assert_eq!(problem.integrator, Integrator::Explicit);
        assert!(problem.integrator_reason.contains("admm"), "{}", problem.integrator_reason);
        problem.bodies[0].material = 1;
        let (integrator, reason) = choose(&problem, Integrator::Auto);
        assert_eq!(integrator, Integrator::Explicit);
        assert!(reason.contains("fluid 'beam'"), "{reason}");
    }

    #[test]
    fn the_implicit_step_is_what_motion_over_the_grid_allows() {
        // At rest under gravity: (g dt) dt = cfl dx.
        let mut problem = beam(1e11, r#""cfl": 0.4"#);
        let free = implicit(&problem);
        let crossing = free.limits.iter().find(|limit| limit.1 == Bound::ParticleSpeed).unwrap().0;
        assert!((crossing - (0.4f64 * 0.125 / 10.0).sqrt()).abs() < 1e-12);
        // 0.0707 s is longer than the frame.
        assert_eq!((free.plan.bound, free.plan.steps, free.steps), (Bound::Frame, 1, 20));
        problem.particles.v[3] = [0.0, 0.0, 7.0];
        let fast = implicit(&problem);
        let dt = fast.limits[0].0;
        assert!(((7.0 + 10.0 * dt) * dt - 0.05).abs() < 1e-12 && fast.plan.bound == Bound::ParticleSpeed);
        assert_eq!(fast.particle_steps, (fast.steps * problem.particles.len() as u64) as f64);
        problem.max_dt_s = Some(1e-3);
        assert_eq!((implicit(&problem).plan.bound, implicit(&problem).plan.steps), (Bound::MaxDt, 50));
    }
}
