//! `gridfall verify`: named cases with a known answer, on the engines of this build.
//!
//! A case states its claim and the source of its answer, simulates, and reports rows of expected
//! value, result and tolerance. Cases with closed forms run on every engine. Cases that prescribe
//! their own step use the CPU's stages.

mod boundaries;
mod damped_bar;
mod earth_pressure;
mod faces;
mod forced;
mod granular;
mod implicit;
mod implicit_bodies;
mod kernels;
mod meeting;
mod moduli;
mod motion;
mod report;
mod session;
mod setup;
mod sides;
mod single_particle;
mod sliding_block;
mod sticky_walls;
mod stiffness_sweep;
mod still_water;
mod von_neumann;
mod water_level;

pub use report::{Curve, Row, Rule, curve_csv, number};
pub use session::{Extent, Session, Target};

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use gridfall_engine::choice::Devices;
use rayon::ThreadPoolBuilder;

/// A claim about the simulation that can be checked.
pub struct Case {
    pub name: &'static str,
    /// What must hold, in one line.
    pub claim: &'static str,
    /// Where the expected values come from.
    pub source: &'static str,
    /// Whether it runs on the GPU as well; otherwise it needs the CPU's stages.
    pub gpu: bool,
    /// Part of a quick run.
    pub quick: bool,
    run: fn(&mut Session) -> Result<(), gridfall_engine::EngineError>,
}

/// All cases, in the order in which they are shown.
pub const CASES: &[Case] = &[
    motion::FREE_FALL,
    motion::COLLIDING_SPHERES,
    motion::ROTATING_ROD,
    sliding_block::SLIDING_BLOCK,
    meeting::MEETING_BODIES,
    moduli::ELASTIC_WAVES,
    moduli::FREE_BAR,
    moduli::CANTILEVER,
    damped_bar::DAMPED_BAR,
    still_water::STILL_WATER,
    sticky_walls::POISEUILLE,
    sticky_walls::SHEARED_LAYER,
    faces::SHEARED_BLOCK,
    sides::SIDES_OF_A_PLATE,
    earth_pressure::EARTH_PRESSURE,
    granular::ANGLE_OF_REPOSE,
    water_level::WATER_LEVEL,
    granular::GRANULAR_COLUMN,
    stiffness_sweep::STIFFNESS_SWEEP,
    von_neumann::VON_NEUMANN,
    single_particle::SINGLE_PARTICLE,
    boundaries::SPINNING_DISK,
    boundaries::COLLISIONS,
    implicit::IMPLICIT_BAR,
    implicit::IMPLICIT_CONVERGENCE,
    implicit::IMPLICIT_CANTILEVER,
    implicit::IMPLICIT_YIELD,
    implicit_bodies::STIFF_BAR,
    implicit_bodies::ROLLS_AND_TIPS,
    implicit_bodies::IMPLICIT_METAL,
    kernels::STICKY_FLOOR,
    kernels::HOLLOW_CYLINDER,
];

/// Results of a case.
#[derive(Debug, Default)]
pub struct Outcome {
    pub rows: Vec<Row>,
    pub curves: Vec<Curve>,
    /// How long it took.
    pub wall: Duration,
}

/// On what cases run, and how much of them.
#[derive(Clone, Copy)]
pub struct Scope<'a> {
    pub devices: &'a Devices,
    pub targets: &'a [Target],
    pub extent: Extent,
    /// Told of each value as it is found.
    pub log: &'a (dyn Fn(&str) + Sync),
}

/// Runs cases, as many at a time as there are threads, and shares the threads out: most cases are too small for more
/// than one. `done` is told of each in the order given.
pub fn run(cases: &[&'static Case], scope: Scope, mut done: impl FnMut(&'static Case, Outcome)) {
    let threads = rayon::current_num_threads();
    let workers = threads.min(cases.len());
    let next = AtomicUsize::new(0);
    let (sender, finished) = mpsc::channel();
    std::thread::scope(|scoped| {
        for _ in 0..workers {
            let (sender, next) = (sender.clone(), &next);
            scoped.spawn(move || {
                // A stage of a small scene takes less time than it takes to hand it to threads that others use as well.
                let own = ThreadPoolBuilder::new().num_threads(threads / workers);
                let own = own.build().expect("threads can be started");
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(case) = cases.get(index) else { break };
                    // Nobody listens if `done` has panicked.
                    let _ = sender.send((index, own.install(|| run_case(case, scope))));
                }
            });
        }
        drop(sender);
        let (mut early, mut told) = (BTreeMap::new(), 0);
        for (index, outcome) in finished {
            early.insert(index, outcome);
            while let Some(outcome) = early.remove(&told) {
                done(cases[told], outcome);
                told += 1;
            }
        }
    });
}

/// Runs a case on each of its targets, if the extent includes it. A simulation that ends in an
/// error is a failing row.
fn run_case(case: &Case, scope: Scope) -> Outcome {
    let begin = Instant::now();
    let mut outcome = Outcome::default();
    for &target in scope.targets {
        if (target == Target::Gpu && !case.gpu) || (scope.extent == Extent::Quick && !case.quick) {
            continue;
        }
        let mut session = Session::new(case.name, target, scope);
        if let Err(error) = (case.run)(&mut session) {
            session.failed(&error);
        }
        outcome.rows.append(&mut session.rows);
        outcome.curves.append(&mut session.curves);
    }
    outcome.wall = begin.elapsed();
    outcome
}
