//! Scenes and overrides: what is refused has faults; what is not can be estimated, written and read again, and run.

use std::time::{Duration, Instant};

use gridfall_core::sim::setup::Problem;
use gridfall_engine::Control;
use gridfall_engine::choice::{Choice, Devices};
use gridfall_scene::{self as scene, Fault, Limits, Scene};
use serde_json::{Value, json};

use super::campaign;
use super::cases::{self, Case, case};

/// So little that a case takes milliseconds.
pub const LIMITS: Limits =
    Limits { max_particles: 20_000, max_memory_bytes: 256 << 20, max_steps: 1_000_000_000, max_work: 4_000_000 };
/// Most particles of a problem that is run for a step.
const FEW: usize = 2000;

/// Values at the ends of what is allowed, and beyond.
#[rustfmt::skip]
const ENDS: &[Case] = &[
    case!(["/domain/dx" = 1e-9, "/time/end" = 1e300], []),
    case!(["/domain/dx" = 0.5, "/domain/max" = [1e9, 1e9, 1e9]], []),
    case!(["/gravity" = [1e300, (-1e300), 1e-300], "/time/end" = 1e-300], []),
    case!(["/materials/water/density" = 1e300, "/materials/water/bulk_modulus" = 1e-300], []),
];

/// A step at most, and only for so long.
struct Briefly(Instant);

impl Control for Briefly {
    fn canceled(&self) -> bool {
        self.0.elapsed() > Duration::from_secs(1)
    }
}

/// Documents: the shipped scenes, and those of the tests of faults.
pub fn documents() -> Vec<Vec<u8>> {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let mut paths: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    let changes = |base: fn() -> Value, cases: &[Case]| -> Vec<Value> {
        let make = |(changes, _): &Case| {
            let changes: Vec<(&str, Value)> = changes.iter().map(|(at, value)| (*at, value())).collect();
            cases::changed(base(), &changes)
        };
        cases.iter().map(make).collect()
    };
    let good = [cases::STRUCTURE, cases::MEANING, cases::TOGETHER, cases::MOTION, ENDS].concat();
    let changed = [changes(cases::good, &good), changes(cases::flat, cases::FLAT)];
    let poured = changes(cases::pouring, cases::SOURCES);
    let whole = [cases::good(), cases::flat(), cases::pouring()];
    let made = whole.into_iter().chain(changed.concat()).chain(poured).map(|value| value.to_string().into_bytes());
    paths.iter().map(|path| std::fs::read(path).unwrap()).chain(made).collect()
}

/// What is wrong with a document, in short.
pub fn codes(faults: &[Fault]) -> String {
    assert!(!faults.is_empty(), "refused without a fault");
    let short = |fault: &Fault| format!("{} {} ", fault.code, fault.pointer.rsplit('/').next().unwrap_or_default());
    faults.iter().take(3).map(short).collect()
}

fn judge(parsed: Result<Scene, Vec<Fault>>) -> String {
    let scene = match parsed {
        Ok(scene) => scene,
        Err(faults) => return codes(&faults),
    };
    if let Err(faults) = scene::parse(&scene.to_json()) {
        panic!("a scene is not read again: {faults:#?}");
    }
    match scene::problem(&scene, &LIMITS) {
        Ok(problem) => step(&problem),
        Err(faults) => codes(&faults),
    }
}

/// Runs a step of a small problem.
fn step(problem: &Problem) -> String {
    let estimate = scene::estimate::estimate(problem);
    let what = format!("{:?} {}", estimate.integrator, estimate.dt_bound);
    if problem.particles.len() > FEW {
        return format!("{what}, large");
    }
    let devices = Devices::open(Choice::Cpu, None).expect("there is a processor");
    let engine = devices.engine(&problem.setup, problem.particles.clone());
    let frame_s = problem.setup.frame_s.min(estimate.dt_s);
    let stats = engine.and_then(|mut engine| engine.advance_frame(frame_s, &Briefly(Instant::now())));
    format!("{what} {}", stats.map_or_else(|error| error.code(), |_| "stepped"))
}

#[test]
fn scene() {
    campaign::run("scene", documents(), |input| judge(scene::parse(&String::from_utf8_lossy(input))));
}

/// A document is the first line if it is one, and else a good one; every other line is an override.
#[test]
fn overrides() {
    let lines = [
        "solver.kernel=quadratic\nbodies.0.velocity=[0, 0, 1]\ndomain.dx=0.125",
        "/materials/wet.sand/density=1800\nname=42 = x\nsolver.max_dt=1e-4\n/a~1b/c~0d=null",
        "bodies.0={\"name\":\"c\"}\nbodies.1.shape.sphere.radius=0.1\ncolliders=[]",
        "solver.kernel\nbodies.9.name=b\nname.x=1\na..b=1\n=1\n/=1\n//=\n.=",
        "time.end=1e308\noutput.fields.0=J\ndimension=2\ngravity.0=1",
    ];
    let good = [cases::good(), cases::flat()].map(|document| format!("{document}\n{}", lines[0]));
    let corpus = lines.iter().map(|lines| lines.as_bytes().to_vec()).chain(good.map(String::into_bytes)).collect();
    let base = cases::good().to_string();
    campaign::run("overrides", corpus, |input| {
        let text = String::from_utf8_lossy(input);
        let (document, lines) = text.split_once('\n').filter(|_| text.starts_with('{')).unwrap_or((&base, &text));
        let overrides: Vec<String> = lines.split('\n').map(str::to_owned).collect();
        judge(scene::parse_with(document, &overrides))
    });
}
