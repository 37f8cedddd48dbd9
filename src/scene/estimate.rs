//! What a run will cost: particles, active blocks, memory, time step and number of steps.

use gridfall_core::sim::cost::{self, Prediction};
use gridfall_core::sim::pair;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::{Axis, Integrator, Kernel, Material, Precision, Problem, Setup};
use gridfall_core::sim::side::{self, Plates};
use gridfall_core::sim::source::Source;
use gridfall_core::sim::timestep::Bound;
use gridfall_core::sim::touch;
use rayon::prelude::*;
use serde::Serialize;

use crate::memory::{DENSE_BYTES_PER_BLOCK, MATRIX_BYTES_PER_PARTICLE, memory_bytes};

/// Device memory per particle (bytes) without its deformation: two positions, binning, its body, and
/// the positions and velocities of a frame.
const DEVICE_BYTES_PER_PARTICLE: u64 = 112;
/// What a particle remembers of contact, where colliders act on particles (bytes).
const TOUCH_BYTES_PER_PARTICLE: u64 = 20;
/// Copies of the deformation on the device.
const DEFORMATION_COPIES: u64 = 3;
/// Cells of a block of the sparse grid.
const BLOCK_CELLS: u64 = 64;
/// Two grid buffers of five channels (bytes per node).
const NODE_BYTES: u64 = 40;
/// Two block lists, a bin and a work item (bytes per slot for a block).
const SLOT_BYTES: u64 = 44;
/// Two block tables (bytes per entry). Less than half of the entries are in use.
const ENTRY_BYTES: u64 = 16;

/// The cost of a run, from its state at time 0.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// At the end of the run, with everything that sources emit.
    pub particles: u64,
    /// Cells of the domain on each axis.
    pub cells: [usize; 3],
    /// Active blocks of 4³ cells (2D: 4²): those with particles and their neighbours; of each body with contact
    /// of its own apart.
    pub blocks: u64,
    /// Host memory of a run on the CPU (bytes).
    pub host_memory_bytes: u64,
    /// Device memory of a run on a GPU (bytes); absent if the scene needs what the GPU engine
    /// cannot do.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub device_memory_bytes: Option<u64>,
    /// How the run is integrated: explicit or implicit.
    pub integrator: Integrator,
    /// Why, in a sentence.
    pub integrator_reason: String,
    /// What explicit integration is predicted to cost.
    pub explicit: Integration,
    /// What implicit integration is predicted to cost; absent if a material does not support it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub implicit: Option<Integration>,
    /// Step at time 0 (s).
    pub dt_s: f64,
    /// Stable name of the rule that set the step.
    pub dt_bound: &'static str,
    /// The same in words, and what would allow a longer step.
    pub dt_reason: String,
    /// All rules and the step that each allows (s), the strictest first.
    pub dt_limits: Vec<Limit>,
    pub steps_per_frame: u64,
    /// Frames after frame 0.
    pub frames: u32,
    /// Steps of the whole run, if the step stays as it is.
    pub steps: u64,
    /// Particles times steps; run time is proportional to it.
    pub particle_steps: f64,
    /// End of the run (s of simulated time).
    pub simulated_s: f64,
}

/// A rule of the step, and what it allows.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Limit {
    /// Stable name.
    pub rule: &'static str,
    /// The body that it applies to, if it applies to one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    pub dt_s: f64,
}

/// One way to integrate a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Integration {
    /// Step at time 0 (s).
    pub dt_s: f64,
    /// Steps of the whole run, if the step stays as it is.
    pub steps: u64,
    /// Wall time typical of two cores of a server (s); the ratio of the two ways holds for other
    /// devices as well.
    pub two_cores_s: f64,
}

impl Integration {
    fn of(prediction: &Prediction) -> Self {
        Self { dt_s: prediction.plan.dt_s, steps: prediction.steps, two_cores_s: prediction.two_cores_s }
    }
}

fn dt_limits(setup: &Setup, limits: &[(f64, Bound)]) -> Vec<Limit> {
    let limit = |&(dt_s, bound): &(f64, Bound)| {
        let body = bound.body().map(|body| setup.bodies[body].name.clone());
        Limit { rule: bound.name(), body, dt_s }
    };
    limits.iter().map(limit).collect()
}

/// Estimates the cost of a problem.
pub fn estimate(problem: &Problem) -> Estimate {
    // On a thread of the pool: see `problem_with`.
    rayon::scope(|_| predict(problem))
}

fn predict(problem: &Problem) -> Estimate {
    let Problem { setup, particles } = problem;
    let (explicit, implicit) = (cost::explicit(setup, particles), cost::implicit(setup, particles));
    let chosen = if setup.integrator == Integrator::Implicit { &implicit } else { &explicit };
    let plan = chosen.plan;
    let too_fast = cost::too_fast_for_implicit(setup, particles);
    let possible = cost::implicit_fault(setup).or(too_fast).is_none();
    let total = setup.total_particles() as u64;
    let blocks = active_blocks(setup, particles) + emitted_blocks(setup);
    let fields = side::layers(setup) as u64;
    Estimate {
        particles: total,
        cells: setup.cells,
        blocks,
        host_memory_bytes: memory_bytes(total, setup.cells.map(|n| n as u64), fields, setup.integrator)
            + field_bytes(setup),
        device_memory_bytes: device_memory_bytes(setup, blocks),
        integrator: setup.integrator,
        integrator_reason: setup.integrator_reason.clone(),
        explicit: Integration::of(&explicit),
        implicit: possible.then(|| Integration::of(&implicit)),
        dt_s: plan.dt_s,
        dt_bound: plan.bound.name(),
        dt_reason: plan.bound.explain(setup),
        dt_limits: dt_limits(setup, &chosen.limits),
        steps_per_frame: plan.steps,
        frames: setup.frames,
        steps: chosen.steps,
        particle_steps: chosen.particle_steps,
        simulated_s: f64::from(setup.frames) * setup.frame_s,
    }
}

fn device_memory_bytes(setup: &Setup, blocks: u64) -> Option<u64> {
    let grids = match setup.kernel {
        Kernel::Compact => 2,
        Kernel::Quadratic => 1,
        Kernel::Cubic | Kernel::Linear => return None,
    };
    let channels = |m: &Material| (if m.is_fluid() { 1 } else { 9 }) + u64::from(m.has_plastic_state());
    let channels = setup.bodies.iter().map(|b| channels(&setup.materials[b.material])).max().unwrap_or(1);
    let touch = if touch::acts(setup) { TOUCH_BYTES_PER_PARTICLE } else { 0 };
    let particle = DEVICE_BYTES_PER_PARTICLE + touch + 4 * channels * DEFORMATION_COPIES;
    let on_device = setup.dimension == 3 && setup.precision == Precision::F32;
    let particles = setup.total_particles() as u64 * particle;
    let nodes = |slots: u64| slots * BLOCK_CELLS * grids * NODE_BYTES;
    let grid = match setup.integrator {
        // In f32, matrices take half of the memory that they take on the host.
        Integrator::Implicit => {
            let layer: u64 = setup.cells.iter().map(|&n| n.div_ceil(4) as u64).product();
            let table = layer * side::layers(setup) as u64 * DENSE_BYTES_PER_BLOCK;
            table + nodes(blocks) + setup.total_particles() as u64 * MATRIX_BYTES_PER_PARTICLE / 2
        }
        _ => {
            // Room to spread before the first growth.
            let slots = blocks * 5 / 4 + 64;
            nodes(slots) + slots * SLOT_BYTES + (2 * slots).next_power_of_two() * ENTRY_BYTES
        }
    };
    on_device.then(|| particles + grid + field_bytes(setup))
}

/// Blocks that sources will fill: those of the volume that they emit, at rest, and as many adjacent
/// ones.
fn emitted_blocks(setup: &Setup) -> u64 {
    let block = (4.0 * setup.dx).powi(setup.dimension as i32);
    let volume = |source: &Source| source.total() as f64 * setup.bodies[source.body].volume0;
    (2.0 * setup.sources.iter().map(volume).sum::<f64>() / block).ceil() as u64
}

/// Memory of the colliders' sampled distances (bytes).
fn field_bytes(setup: &Setup) -> u64 {
    setup.colliders.iter().flat_map(|collider| collider.sdf.fields()).map(|(field, _)| field.bytes()).sum()
}

/// The number of blocks with particles and all their neighbours, in all layers.
fn active_blocks(setup: &Setup, particles: &Particles) -> u64 {
    let fields = pair::fields(setup);
    let bodies = || setup.bodies.iter().zip(&fields);
    let shared = |field: usize| -> Vec<[f64; 3]> {
        let of = bodies().filter(|(_, f)| **f == field);
        of.flat_map(|(body, _)| particles.x[body.particles.clone()].iter().copied()).collect()
    };
    if side::acts(setup) {
        let plates = Plates::new(setup, 0.0);
        let layers: Vec<u32> = particles.x.par_iter().map(|&x| plates.layer(x)).collect();
        let of = |layer: u32| -> Vec<[f64; 3]> {
            particles.x.iter().zip(&layers).filter(|(_, l)| **l == layer).map(|(x, _)| *x).collect()
        };
        return (0..side::LAYERS as u32).map(|layer| blocks_around(setup, &of(layer))).sum();
    }
    match pair::is_parted(setup) {
        false => blocks_around(setup, &particles.x),
        true => (0..pair::contacts(setup).len()).map(|field| blocks_around(setup, &shared(field))).sum(),
    }
}

fn blocks_around(setup: &Setup, positions: &[[f64; 3]]) -> u64 {
    let key = |b: [i64; 3]| b.iter().fold(0u64, |key, b| key << 21 | (b + 2) as u64);
    let block = |x: &[f64; 3]| -> [i64; 3] {
        // By the first nodes of the particles' kernels.
        let shift = if setup.kernel == Kernel::Compact { 0.25 } else { 0.5 };
        std::array::from_fn(|a| (((x[a] - setup.origin[a]) / setup.dx - shift) / 4.0).floor() as i64)
    };
    let mut occupied: Vec<[i64; 3]> = positions
        .par_chunks(1 << 14)
        .flat_map_iter(|xs| {
            let mut blocks: Vec<[i64; 3]> = xs.iter().map(block).collect();
            blocks.sort_unstable();
            blocks.dedup();
            blocks
        })
        .collect();
    occupied.par_sort_unstable();
    occupied.dedup();
    let reach = |a: usize| if a < setup.dimension { -1..=1 } else { 0..=0 };
    let wrap = |a: usize, b: i64| match setup.axes[a] {
        Axis::Periodic => b.rem_euclid(setup.cells[a] as i64 / 4),
        Axis::Walls(_) => b,
    };
    let mut active: Vec<u64> = occupied
        .par_iter()
        .flat_map_iter(|b| {
            let offsets = reach(0).flat_map(|i| reach(1).flat_map(move |j| reach(2).map(move |k| [i, j, k])));
            offsets.map(|o| key(std::array::from_fn(|a| wrap(a, b[a] + o[a]))))
        })
        .collect();
    active.par_sort_unstable();
    active.dedup();
    active.len() as u64
}
