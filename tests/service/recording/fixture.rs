//! A small problem, a stand-in for an engine, and access to the Python reader.

use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicU64, Ordering};

use gridfall_core::sim::collider::{ALWAYS, Collider, Motion, Primitive, Sdf, SdfOp};
use gridfall_core::sim::particles::{IDENTITY, Particles};
use gridfall_core::sim::reaction::Reaction;
use gridfall_core::sim::setup::{Axis, Body, Contact, ContactKind, Implicit, Integrator, OutputField, Problem, Setup};
use gridfall_engine::{Backend, Control, Engine, EngineError, FrameStats, Solve, StateError};
use gridfall_recording::Appearance;
use gridfall_recording::run::{self, FrameReport, Observer, Outputs, RunError, Subject, Summary};
use gridfall_scene::schema::Scene;
use serde_json::{Value, json};

/// A stand-in for an engine: particles fly freely and stretch a little.
pub struct Ballistic {
    backend: Backend,
    problem: Problem,
    pub state: Particles,
    time_s: f64,
    frame: u64,
    /// Fails when it computes this frame.
    fails_at: Option<u64>,
}

pub const STEPS: u64 = 4;

impl Ballistic {
    pub fn new(problem: &Problem, fails_at: Option<u64>) -> Self {
        let backend = Backend {
            kind: "cpu".into(),
            device: "paper and pencil".into(),
            driver: String::new(),
            software: false,
            reason: "it is a test".into(),
        };
        Self { backend, problem: problem.clone(), state: problem.particles.clone(), time_s: 0.0, frame: 0, fails_at }
    }
}

impl Ballistic {
    /// What an implicit engine would report of the last frame: its last step did not converge.
    fn solves(&self, frame_s: f64) -> Vec<Solve> {
        let dt_s = frame_s / STEPS as f64;
        let solve = |n: u32| Solve {
            time_s: self.time_s - f64::from(STEPS as u32 - n) * dt_s,
            dt_s,
            iterations: n,
            inner_iterations: 10 * n,
            residual: 1e-8 * f64::from(n * n),
            halvings: n % 2,
            levels: 3,
            nonzeros: 1 << 40,
            converged: n < STEPS as u32,
        };
        (1..=STEPS as u32).map(solve).collect()
    }
}

impl Engine for Ballistic {
    fn backend(&self) -> &Backend {
        &self.backend
    }

    fn advance_frame(&mut self, frame_s: f64, control: &dyn Control) -> Result<FrameStats, EngineError> {
        if control.canceled() {
            return Err(EngineError::Canceled);
        }
        self.frame += 1;
        if Some(self.frame) == self.fails_at {
            return Err(EngineError::Diverged { step: 4 * self.frame, time_s: self.time_s, what: "as ordered".into() });
        }
        for p in 0..self.state.len() {
            for a in 0..3 {
                self.state.x[p][a] += frame_s * self.state.v[p][a];
                self.state.v[p][a] += frame_s * self.problem.setup.gravity[a];
            }
            self.state.f[p][0] *= 1.001;
        }
        self.time_s += frame_s;
        let reactions =
            (0..11).map(|n| Reaction { force: [self.frame as f64, 0.5 * f64::from(n), 0.0], torque: [-1.0; 3] });
        let reactions = reactions.collect();
        Ok(FrameStats {
            steps: STEPS,
            dt_s: frame_s / STEPS as f64,
            isolated_reset: self.frame % 2,
            reactions,
            solves: if self.problem.setup.integrator == Integrator::Implicit { self.solves(frame_s) } else { vec![] },
        })
    }

    fn append(&mut self, particles: Particles) -> Result<(), EngineError> {
        self.state.append(particles);
        Ok(())
    }

    fn snapshot(&mut self) -> Result<Particles, EngineError> {
        Ok(self.state.clone())
    }

    fn save(&mut self, to: &mut dyn Write) -> Result<(), StateError> {
        to.write_all(&self.frame.to_le_bytes())?;
        to.write_all(&self.time_s.to_le_bytes())?;
        let state = &self.state;
        let values = state.x.iter().chain(&state.v).flatten().chain(state.f.iter().map(|f| &f[0]));
        Ok(values.map(|value| value.to_le_bytes()).try_for_each(|bytes| to.write_all(&bytes))?)
    }

    fn restore(&mut self, from: &mut dyn Read) -> Result<(), StateError> {
        let mut word = || -> io::Result<[u8; 8]> {
            let mut bytes = [0; 8];
            from.read_exact(&mut bytes)?;
            Ok(bytes)
        };
        (self.frame, self.time_s) = (u64::from_le_bytes(word()?), f64::from_le_bytes(word()?));
        let state = &mut self.state;
        let values = state.x.iter_mut().chain(&mut state.v).flatten().chain(state.f.iter_mut().map(|f| &mut f[0]));
        for value in values {
            *value = f64::from_le_bytes(word()?);
        }
        Ok(())
    }
}

/// Counts frames; cancels after a given number.
pub struct Watch {
    frames: AtomicU64,
    cancel_after: u64,
}

impl Watch {
    pub fn new(cancel_after: u64) -> Self {
        Self { frames: AtomicU64::new(0), cancel_after }
    }
}

impl Control for Watch {
    fn canceled(&self) -> bool {
        self.frames.load(Ordering::SeqCst) >= self.cancel_after
    }
}

impl Observer for Watch {
    fn frame(&self, report: &FrameReport) {
        assert_eq!(report.frame, self.frames.fetch_add(1, Ordering::SeqCst));
        assert_eq!(report.steps, STEPS * report.frame);
        assert_eq!(report.row.frame, report.frame);
    }
}

pub fn scene() -> Scene {
    serde_json::from_value(json!({
        "gridfall": 1, "name": "recording test",
        "domain": { "min": [0, 0, 0], "max": [2, 1, 1], "dx": 0.05 },
        "gravity": [0, 0, -9.81],
        "materials": {
            "jelly": { "model": "fixed-corotated", "density": 1000, "youngs_modulus": 1e4, "poissons_ratio": 0.3 },
            "water": { "model": "weakly-compressible-fluid", "density": 1000, "bulk_modulus": 1e5 }
        },
        "bodies": [
            { "name": "cube", "material": "jelly",
              "shape": { "box": { "min": [0.2, 0.2, 0.5], "max": [0.5, 0.5, 0.8] } } },
            { "name": "pool", "material": "water",
              "shape": { "box": { "min": [0.8, 0.1, 0.1], "max": [1.8, 0.9, 0.4] } } }
        ],
        "time": { "end": 0.25, "frame_rate": 20 },
        "output": { "fields": ["velocity", "J", "von_mises", "pressure"] }
    }))
    .unwrap()
}

/// The scene as a problem, with a lattice of `spacing` in the two boxes.
pub fn problem(spacing: f64) -> Problem {
    let scene = scene();
    let mut particles = Particles::default();
    let mut bodies = Vec::new();
    let boxes = [("cube", [0.2, 0.2, 0.5], [0.5, 0.5, 0.8]), ("pool", [0.8, 0.1, 0.1], [1.8, 0.9, 0.4])];
    for (index, (name, min, max)) in boxes.into_iter().enumerate() {
        let first = particles.len();
        let count: [usize; 3] = std::array::from_fn(|a| ((max[a] - min[a]) / spacing).round() as usize);
        for k in 0..count.iter().product() {
            let i = [k % count[0], k / count[0] % count[1], k / (count[0] * count[1])];
            let x = std::array::from_fn(|a| min[a] + (i[a] as f64 + 0.5) * spacing);
            particles.x.push(x);
            particles.v.push([0.1 * x[2], 0.0, 0.3 * index as f64 * x[0]]);
            particles.b.push([0.0; 9]);
            particles.f.push(IDENTITY);
            particles.plastic.push(0.0);
            particles.body.push(index as u32);
        }
        let volume0 = spacing.powi(3);
        let particles = first..particles.len();
        bodies.push(Body {
            name: name.into(),
            material: index,
            particles,
            volume0,
            mass: 1000.0 * volume0,
            contact: None,
        });
    }
    let solid = |primitive, translation| SdfOp::Primitive { primitive, rotation: IDENTITY, translation };
    let contact = Contact { kind: ContactKind::Slip, friction: 0.0 };
    let collider = |name: &str, ops, motion: &Motion| Collider {
        name: name.into(),
        sdf: Sdf { ops },
        contact,
        motion: motion.clone(),
        present_s: if name == "post" { [0.05, 0.15] } else { ALWAYS },
        grip: false,
    };
    let spinning = Motion {
        center: [1.0, 0.5, 0.5],
        linear_velocity: [0.2, 0.0, 0.0],
        angular_velocity: [0.0, 0.0, 1.0],
        keyframes: vec![],
    };
    let still = Motion::default();
    let setup = Setup {
        name: scene.name.clone(),
        dimension: 3,
        origin: [0.0; 3],
        dx: scene.domain.dx,
        cells: [40, 20, 20],
        axes: [Axis::Walls([contact; 2]); 3],
        gravity: [0.0, 0.0, -9.81],
        materials: scene.materials.values().map(|material| material.law.clone()).collect(),
        bodies,
        sources: vec![],
        colliders: vec![
            collider("paddle", vec![solid(Primitive::Box([0.1, 0.02, 0.2]), [1.0, 0.5, 0.5])], &spinning),
            collider("ring", vec![solid(Primitive::Torus(0.2, 0.05), [0.5, 0.5, 0.2])], &still),
            collider("post", vec![solid(Primitive::Cylinder(0.05, 0.5), [0.7, 0.2, 0.5])], &still),
            collider("ball", vec![solid(Primitive::Sphere(0.1), [1.5, 0.5, 0.8])], &still),
            collider(
                "bowl",
                vec![solid(Primitive::Sphere(0.3), [0.4, 0.4, 0.5]), SdfOp::Shell(0.02)],
                &Motion { linear_velocity: [0.0, 0.0, 0.1], ..still.clone() },
            ),
        ],
        kernel: scene.solver.kernel,
        transfer: scene.solver.transfer,
        contact_at: scene.solver.contact,
        precision: scene.solver.precision,
        cfl: 0.5,
        max_dt_s: None,
        integrator: Integrator::Explicit,
        integrator_reason: String::new(),
        notices: Vec::new(),
        implicit: Implicit::default(),
        frames: 5,
        frame_s: 0.05,
        fields: vec![OutputField::Velocity, OutputField::J, OutputField::VonMises, OutputField::Pressure],
        preview_points: 200_000,
        keep_state: false,
        seed: 1,
    };
    Problem { setup, particles }
}

pub fn outputs(directory: &Path) -> Outputs {
    Outputs {
        recording: directory.join("out.mcap"),
        thumbnail: Some(directory.join("out.png")),
        diagnostics: Some(directory.join("out.csv")),
        solver: Some(directory.join("solver.csv")),
        state: Some(directory.join("state.npz")),
        checkpoints: Some(directory.join("checkpoints")),
    }
}

/// Records a run of a problem that `engine` has loaded.
pub fn run(
    scene: &Scene,
    problem: &Problem,
    engine: &mut dyn Engine,
    out: &Outputs,
    observer: &dyn Observer,
) -> Result<Summary, RunError> {
    let appearance = Appearance::new(&problem.setup, &problem.particles);
    let scene_json = scene.to_json();
    let subject = Subject { scene_json: &scene_json, setup: &problem.setup, appearance: &appearance };
    run::run(subject, engine, out, observer)
}

pub fn record(problem: &Problem, directory: &Path) -> Outputs {
    let out = outputs(directory);
    let mut engine = Ballistic::new(problem, None);
    run(&scene(), problem, &mut engine, &out, &Watch::new(u64::MAX)).unwrap();
    out
}

/// What Python reads from recordings. `GRIDFALL_PYTHON` names an interpreter with mcap,
/// mcap-protobuf-support and numpy.
pub fn python(arguments: &[&str], paths: &[PathBuf]) -> Vec<Value> {
    let interpreter = std::env::var("GRIDFALL_PYTHON").unwrap_or("python3".into());
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/read_recording.py");
    let output = Command::new(&interpreter).arg(script).args(arguments).args(paths).output();
    let output = output.unwrap_or_else(|error| panic!("cannot start {interpreter}: {error}"));
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "the Python reader refused the recording:\n{errors}");
    assert!(errors.is_empty(), "the Python reader warned:\n{errors}");
    let lines = String::from_utf8(output.stdout).unwrap();
    let recordings: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(recordings.len(), paths.len());
    recordings
}

pub fn messages<'a>(recording: &'a Value, topic: &str) -> Vec<&'a Value> {
    recording["messages"].as_array().unwrap().iter().filter(|message| message["topic"] == topic).collect()
}

pub fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}
