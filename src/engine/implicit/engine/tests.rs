//! The frame loop over steps whose outcomes are given.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use super::*;
use crate::contract::NoControl;
use gridfall_core::sim::setup::Problem;
use gridfall_scene::{self as scene, Limits};

/// A step as it was begun: time, length, whether again.
type Begun = (f64, f64, bool);

struct Scripted {
    problem: Problem,
    outcomes: VecDeque<Moved>,
    revises: bool,
    begun: Rc<RefCell<Vec<Begun>>>,
    kept: Rc<RefCell<u32>>,
}

impl Stepper for Scripted {
    fn setup(&self) -> &Setup {
        &self.problem.setup
    }
    fn live(&self) -> usize {
        self.problem.particles.len()
    }
    fn begin(&mut self, time_s: f64, dt_s: f64, again: bool) -> Result<(), EngineError> {
        self.begun.borrow_mut().push((time_s, dt_s, again));
        Ok(())
    }
    fn minimise(&mut self, _control: &dyn Control) -> Result<Solve, EngineError> {
        Ok(Solve { iterations: 2, inner_iterations: 3, halvings: 1, levels: 4, converged: true, ..Solve::default() })
    }
    fn revise(&mut self) -> Result<bool, EngineError> {
        Ok(self.revises)
    }
    fn finish(&mut self) -> Result<Moved, EngineError> {
        Ok(self.outcomes.pop_front().unwrap_or(AT_REST))
    }
    fn keep(&mut self) {
        *self.kept.borrow_mut() += 1;
    }
    fn before(&self) -> Result<Cow<'_, Particles>, EngineError> {
        Ok(Cow::Borrowed(&self.problem.particles))
    }
    fn append(&mut self, particles: Particles) -> Result<(), EngineError> {
        self.problem.particles.append(particles);
        Ok(())
    }
    fn snapshot(&self) -> Result<Particles, EngineError> {
        Ok(self.problem.particles.clone())
    }
    fn save(&self, _to: &mut dyn Write) -> Result<(), StateError> {
        Ok(())
    }
    fn restore(&mut self, _from: &mut dyn Read) -> Result<(), StateError> {
        Ok(())
    }
}

/// How a step ends that is kept.
const AT_REST: Moved = Moved { farthest_dx: 0.0, max_speed_m_s: 0.0, lost: None, outside: None, impulses: Vec::new() };
fn too_far() -> Moved {
    Moved { farthest_dx: 1.5, ..AT_REST }
}

/// A block at rest without gravity: nothing but the outcomes shortens steps.
fn problem() -> Problem {
    let json = r#"{ "gridfall": 1, "name": "rest", "gravity": [0, 0, 0],
        "domain": { "min": [0, 0, 0], "max": [1, 1, 1], "dx": 0.125 },
        "materials": { "gum": { "model": "fixed-corotated", "density": 1000, "youngs_modulus": 1e5,
          "poissons_ratio": 0.3 } },
        "bodies": [ { "name": "block", "material": "gum", "shape": { "box": { "min": [0.25, 0.25, 0.25],
          "max": [0.5, 0.5, 0.5] } } } ],
        "time": { "end": 1, "frame_rate": 10 }, "solver": { "integrator": "implicit" } }"#;
    let scene = scene::parse(json).unwrap_or_else(|faults| panic!("{faults:?}"));
    scene::problem(&scene, &Limits::default()).unwrap_or_else(|faults| panic!("{faults:?}"))
}

struct Run {
    engine: ImplicitEngine,
    begun: Rc<RefCell<Vec<Begun>>>,
    kept: Rc<RefCell<u32>>,
}

fn run(problem: Problem, revises: bool, outcomes: &[Moved]) -> Run {
    let (begun, kept) = (Rc::default(), Rc::default());
    let stepper = Scripted {
        problem,
        outcomes: outcomes.iter().cloned().collect(),
        revises,
        begun: Rc::clone(&begun),
        kept: Rc::clone(&kept),
    };
    let speed_m_s = max_speed_m_s(&stepper.problem.particles);
    Run { engine: ImplicitEngine::of(Box::new(stepper), Backend::this_cpu("test"), speed_m_s), begun, kept }
}

#[test]
fn a_step_that_is_too_long_is_begun_again_with_half_its_length() {
    let Run { mut engine, begun, kept } = run(problem(), false, &[too_far(), too_far(), AT_REST]);
    let stats = engine.advance_frame(0.1, &NoControl).unwrap();
    let expected = [(0.0, 0.1, false), (0.0, 0.05, true), (0.0, 0.025, true), (0.025, 0.075, false)];
    for (begun, expected) in begun.borrow().iter().zip(expected) {
        assert!((begun.0 - expected.0).abs() + (begun.1 - expected.1).abs() < 1e-12 && begun.2 == expected.2);
    }
    assert_eq!((begun.borrow().len(), *kept.borrow(), stats.steps), (4, 2, 2));
    assert_eq!(stats.solves[1].time_s, 0.1);
}

#[test]
fn a_step_that_is_minimised_twice_counts_both() {
    let effort = |revises| {
        let solve = run(problem(), revises, &[]).engine.advance_frame(0.1, &NoControl).unwrap().solves[0];
        (solve.iterations, solve.inner_iterations, solve.halvings, solve.levels)
    };
    assert_eq!(effort(false), (2, 3, 1, 4));
    assert_eq!(effort(true), (4, 6, 2, 4));
}

#[test]
fn failures_say_what_and_where() {
    let fail = |outcome: Moved| {
        let error = run(problem(), false, &vec![outcome; 50]).engine.advance_frame(0.1, &NoControl).unwrap_err();
        (error.code(), error.to_string())
    };
    let (code, text) = fail(Moved { lost: Some(3), ..AT_REST });
    assert!(code == "diverged" && text.contains("particle 3 (body \"block\") is no longer finite"), "{text}");
    let (code, text) = fail(too_far());
    assert!(code == "diverged" && text.contains("more than a cell") && text.contains("without bound"), "{text}");
    let (code, text) = fail(Moved { outside: Some(2), ..AT_REST });
    assert!(code == "left_domain" && text.contains("particle 2 (body \"block\") leaves from [0."), "{text}");
}

#[test]
fn what_crosses_cells_in_the_shortest_step_fails_before_it_is_tried() {
    for speed in [1.3e5, 1e30] {
        let mut problem = problem();
        problem.particles.v[5] = [0.0, -speed, 0.0];
        // The solve would leave it at rest.
        let Run { mut engine, begun, .. } = run(problem, false, &[]);
        let error = engine.advance_frame(0.1, &NoControl).unwrap_err();
        assert_eq!((error.code(), begun.borrow().len()), ("diverged", 0));
        assert!(error.to_string().contains("particle 5 (body \"block\") moves at 1"), "{error}");
    }
    let mut problem = problem();
    problem.particles.v[5] = [0.0, -1.2e5, 0.0];
    run(problem, false, &[]).engine.advance_frame(1e-5, &NoControl).unwrap();
}

#[test]
fn time_passes_without_particles() {
    let mut empty = problem();
    empty.particles = Particles::default();
    let Run { mut engine, begun, .. } = run(empty, false, &[]);
    assert_eq!(engine.advance_frame(0.1, &NoControl).unwrap(), FrameStats::default());
    engine.append(problem().particles).unwrap();
    engine.advance_frame(0.1, &NoControl).unwrap();
    assert_eq!(begun.borrow()[0].0, 0.1);
}
