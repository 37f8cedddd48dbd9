//! The method comparison of the HOT paper (Wang et al. 2020, §7): each reduced scene is run with
//! each method, and time and iterations are recorded.

use std::time::{Duration, Instant};

use serde::Serialize;

use super::spelled;
use gridfall_core::sim::setup::{Kernel, Method, Problem, Setup};
use gridfall_engine::{Control, Engine, EngineError};
use gridfall_recording::run;
use gridfall_scene::{self as scene, Fault, Limits};

/// The reduced scenes: names without `-small`, and documents.
pub const SCENES: [(&str, &str); 11] = [
    ("twist", include_str!("../../scenes/twist-small.json")),
    ("boxes", include_str!("../../scenes/boxes-small.json")),
    ("donut", include_str!("../../scenes/donut-small.json")),
    ("armacat-soft", include_str!("../../scenes/armacat-soft-small.json")),
    ("armacat-stiff", include_str!("../../scenes/armacat-stiff-small.json")),
    ("chain", include_str!("../../scenes/chain-small.json")),
    ("boards", include_str!("../../scenes/boards-small.json")),
    ("wheel", include_str!("../../scenes/wheel-small.json")),
    ("faceless", include_str!("../../scenes/faceless-small.json")),
    ("sauce", include_str!("../../scenes/sauce-small.json")),
    (SWEEP, include_str!("../../scenes/stiffness-sweep-small.json")),
];

/// The scene that is run once for each modulus of [`SWEEP_MODULI`] (the paper's Fig. 20).
const SWEEP: &str = "stiffness-sweep";
const SWEEP_MODULI: [&str; 6] = ["1e5", "1e6", "1e7", "1e8", "1e9", "1e10"];

/// The label of HOT as in the paper: its smoother, its coarse solve, one hierarchy per step.
const PUBLISHED: &str = "hot-published";

/// The default method, which is stopped by its error.
const NEWTON: &str = "newton";

/// The method that the others are compared with.
pub const REFERENCE: &str = "hot";

/// Labels of everything that can be compared, the reference first: the methods as scenes spell
/// them, and HOT as published.
pub fn labels() -> Vec<String> {
    let methods = Method::ALL.map(|method| spelled(&method));
    std::iter::once(REFERENCE.to_owned())
        .chain([PUBLISHED.to_owned()])
        .chain(methods.into_iter().filter(|name| name != REFERENCE))
        .collect()
}

/// One run of a scene by a method.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    pub scene: String,
    /// What was varied in the scene; empty for the unchanged scene.
    pub variant: String,
    pub method: String,
    pub kernel: Kernel,
    /// `cpu` or `gpu`.
    pub engine: String,
    pub steps: usize,
    /// Wall time of the frames (s).
    pub time_s: f64,
    pub outer_iterations: u64,
    pub inner_iterations: u64,
    /// True if every step converged to the tolerance, and all frames were run.
    pub converged: bool,
    /// The same, by frame.
    pub frame_time_s: Vec<f64>,
    pub frame_outer_iterations: Vec<u64>,
    pub frame_inner_iterations: Vec<u64>,
}

/// A run to be done.
#[derive(Clone, Debug)]
pub struct Case {
    pub scene: &'static str,
    pub variant: String,
    pub method: String,
    document: &'static str,
    sets: Vec<String>,
}

impl Case {
    /// Every named scene in all its variants, with every kernel, tolerance and method. The methods
    /// of one problem follow each other.
    pub fn all(scenes: &[String], methods: &[String], kernels: &[Kernel], tolerances: &[f64]) -> Vec<Self> {
        let mut cases = Vec::new();
        for (scene, document) in SCENES.iter().filter(|(name, _)| scenes.iter().any(|scene| scene == name)) {
            let moduli = if *scene == SWEEP { &SWEEP_MODULI[..] } else { &[""] };
            for modulus in moduli {
                for kernel in kernels {
                    for tolerance in tolerances {
                        let case = |method: &String| Self::new(scene, document, modulus, *kernel, *tolerance, method);
                        cases.extend(methods.iter().map(case));
                    }
                }
            }
        }
        cases
    }

    fn new(
        scene: &'static str,
        document: &'static str,
        modulus: &str,
        kernel: Kernel,
        tolerance: f64,
        method: &str,
    ) -> Self {
        let mut sets = vec![
            "solver.integrator=implicit".to_owned(),
            format!("solver.kernel={}", spelled(&kernel)),
            // As in the paper, and for all methods the same.
            "solver.contact=nodes".to_owned(),
        ];
        // Newton's method keeps its own tolerance: ε is of another norm.
        if method != NEWTON {
            sets.push(format!("solver.implicit.tolerance={tolerance:e}"));
        }
        if method == PUBLISHED {
            sets.push("solver.implicit.method=hot".into());
            sets.push("solver.implicit.smoother=gauss-seidel".into());
            sets.push("solver.implicit.coarse_solve=adaptive".into());
            sets.push("solver.implicit.rebuild=false".into());
        } else {
            sets.push(format!("solver.implicit.method={method}"));
        }
        if !modulus.is_empty() {
            sets.push(format!("materials.middle.youngs_modulus={modulus}"));
        }
        let usual = tolerance == 1e-7;
        let tolerance = if usual { String::new() } else { format!("ε {tolerance:e}") };
        let variant = [modulus.to_owned(), tolerance].into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>();
        Self { scene, variant: variant.join(", "), method: method.into(), document, sets }
    }

    /// The problem, shortened to `frames` if it has more.
    ///
    /// # Errors
    /// The faults of a scene that the method cannot run.
    pub fn problem(&self, frames: u32) -> Result<Problem, Vec<Fault>> {
        let scene = scene::parse_with(self.document, &self.sets)?;
        let mut problem = scene::problem(&scene, &Limits::default())?;
        problem.setup.frames = problem.setup.frames.min(frames);
        Ok(problem)
    }

    /// Runs the problem on an engine that has loaded it, for `limit` at most. A run that takes
    /// longer or fails counts as not converged. The error is returned with it.
    pub fn run(&self, setup: &Setup, engine: &mut dyn Engine, limit: Duration) -> (Row, Option<EngineError>) {
        let clock = Clock { end: Instant::now() + limit };
        let mut row = Row {
            scene: self.scene.into(),
            variant: self.variant.clone(),
            method: self.method.clone(),
            kernel: setup.kernel,
            engine: engine.backend().kind.clone(),
            steps: 0,
            time_s: 0.0,
            outer_iterations: 0,
            inner_iterations: 0,
            converged: true,
            frame_time_s: vec![],
            frame_outer_iterations: vec![],
            frame_inner_iterations: vec![],
        };
        for frame in 0..setup.frames {
            let begin = Instant::now();
            let stats = run::advance(setup, engine, frame, &clock);
            let wall_s = begin.elapsed().as_secs_f64();
            row.time_s += wall_s;
            let stats = match stats {
                Ok(stats) => stats,
                Err(error) => {
                    row.converged = false;
                    return (row, Some(error));
                }
            };
            let outer = stats.solves.iter().map(|solve| u64::from(solve.iterations)).sum();
            let inner = stats.solves.iter().map(|solve| u64::from(solve.inner_iterations)).sum();
            row.steps += stats.solves.len();
            row.outer_iterations += outer;
            row.inner_iterations += inner;
            row.converged &= stats.solves.iter().all(|solve| solve.converged);
            row.frame_time_s.push(wall_s);
            row.frame_outer_iterations.push(outer);
            row.frame_inner_iterations.push(inner);
        }
        (row, None)
    }
}

/// Ends a run that takes too long.
struct Clock {
    end: Instant,
}

impl Control for Clock {
    fn canceled(&self) -> bool {
        Instant::now() > self.end
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scene_runs_with_every_method_that_can() {
        let scenes: Vec<String> = SCENES.iter().map(|(name, _)| (*name).to_owned()).collect();
        let labels = labels();
        assert_eq!((labels[0].as_str(), labels.len()), (REFERENCE, Method::ALL.len() + 1));
        let cases = Case::all(&scenes, &labels, &[Kernel::Quadratic], &[1e-7]);
        assert_eq!(cases.len(), (SCENES.len() - 1 + SWEEP_MODULI.len()) * labels.len());
        let plastic = ["boxes", "donut", "boards", "wheel", "sauce"];
        for case in cases.iter().filter(|case| case.variant.is_empty() || case.variant == "1e9") {
            let scene = scene::parse_with(case.document, &case.sets).unwrap_or_else(|faults| panic!("{faults:?}"));
            let refused = scene::check(&scene, &Limits::default()).is_err();
            assert_eq!(
                refused,
                case.method == "admm" && plastic.contains(&case.scene),
                "{} {}",
                case.scene,
                case.method
            );
            assert_eq!(scene.solver.implicit.tolerance, (case.method != NEWTON).then_some(1e-7));
        }
        let stiff = cases.iter().find(|case| case.variant == "1e10" && case.method == PUBLISHED).unwrap();
        let scene = scene::parse_with(stiff.document, &stiff.sets).unwrap();
        assert_eq!(scene.materials["middle"].elastic().unwrap().youngs_modulus, 1e10);
        assert_eq!(spelled(&scene.solver.implicit.smoother), "gauss-seidel");
    }
}
