//! The line search and the step to what it accepts against the same in f64, with energies and
//! gradients that are given.

use nalgebra::DVector;
use rand::{SeedableRng, rngs::StdRng};

use super::hierarchy::Hierarchy;
use super::layout::{ACCEPTED, BROKEN, DROPPED, INDEFINITE, State};
use super::lbfgs::Lbfgs;
use super::problem_tests::{Sample, distance, random, read_field, scene, write_field};
use crate::gpu::Variant;
use crate::gpu::device::test_gpu;
use crate::gpu::program::{Dispatches, Programs, Tools};
use crate::implicit::gpu::interface::System;
use gridfall_core::sim::settings::Implicit;
use gridfall_core::sim::setup::Kernel;

/// Roundings of differences, and of sums of a thousand products.
const ROUNDING: f64 = 1e-5;
/// Energy at the start.
const ENERGY: [f32; 2] = [64.0, -1e-7];

struct Search<'a> {
    tools: Tools<'a>,
    sample: &'a Sample,
    system: System,
    hierarchy: Hierarchy,
    lbfgs: Lbfgs,
}

impl<'a> Search<'a> {
    fn new(tools: Tools<'a>, sample: &'a Sample) -> Self {
        let system = sample.upload(tools.gpu);
        let hierarchy = Hierarchy::new(tools, &system, &Implicit::default(), None).unwrap();
        let lbfgs = Lbfgs::new(tools.gpu, system.stride).unwrap();
        Self { tools, sample, system, hierarchy, lbfgs }
    }

    fn run(&self, list: Dispatches) -> State {
        list.submit(self.tools.gpu).unwrap();
        self.lbfgs.state(self.tools.gpu).unwrap()
    }

    fn write(&self, buffer: &wgpu::Buffer, x: &DVector<f64>) {
        write_field(self.tools.gpu, buffer, self.system.stride as usize, x);
    }

    fn read(&self, buffer: &wgpu::Buffer) -> DVector<f64> {
        read_field(self.tools.gpu, buffer, self.system.stride as usize, self.sample.rows())
    }

    /// What an evaluation at the trial would leave.
    fn evaluate(&self, energy: [f32; 2], gradient: &DVector<f64>) {
        self.system.memory.write(self.tools.gpu, "energy", 0, &energy);
        self.write(self.system.get("gradient"), gradient);
    }

    /// Σ |∇E_i|² / scale_i².
    fn residual2(&self, gradient: &DVector<f64>) -> f64 {
        let scales = self.sample.scales.iter().enumerate();
        scales.map(|(i, scale)| gradient.rows(3 * i, 3).norm_squared() / scale.powi(2)).sum()
    }

    /// Takes E and `g` at the start.
    fn adopt(&self, energy: [f32; 2], g: &DVector<f64>) -> State {
        self.system.memory.write(self.tools.gpu, "control", 0, &[0u32; 4]);
        self.evaluate(energy, g);
        self.write(self.lbfgs.get("g"), g);
        self.run(self.lbfgs.adopt(self.tools, &self.system, &self.hierarchy))
    }

    /// Begins to search along −z. Gives z as it is in the directions that nodes can move in.
    fn turn(&self, z: &DVector<f64>) -> (State, DVector<f64>) {
        let place = self.hierarchy.levels[0].x(self.hierarchy.result);
        self.write(place, z);
        let state = self.run(self.lbfgs.forward(self.tools, &self.system, &self.hierarchy));
        (state, self.read(place))
    }

    fn attempt(&self) -> DVector<f64> {
        self.run(self.lbfgs.attempt(self.tools, &self.system, &self.hierarchy));
        self.read(self.system.get("trial"))
    }

    fn judge(&self, energy: [f32; 2], gradient: &DVector<f64>) -> State {
        self.evaluate(energy, gradient);
        self.run(self.lbfgs.judge(self.tools, &self.system, &self.hierarchy))
    }
}

fn near(a: f32, b: f64) -> bool {
    (f64::from(a) - b).abs() < ROUNDING * b.abs()
}

#[test]
fn a_line_search_halves_accepts_and_steps() {
    let seed = 91;
    println!("seed {seed}");
    let (gpu, rng) = (test_gpu(), &mut StdRng::seed_from_u64(seed));
    let programs = Programs::new(Variant::of_kernel(Kernel::Compact));
    let sample = Sample::new(&scene(Kernel::Compact, false, 1e6));
    let search = Search::new(Tools { gpu: &gpu, programs: &programs }, &sample);
    let n = 3 * sample.rows();
    // The new pair's curvature, and whether it is kept.
    for (curvature, kept) in [(2.0, true), (-2.0, false)] {
        let [dv, g, noise] = [0; 3].map(|_| random(n, rng));
        search.write(search.system.get("dv"), &dv);
        let start = search.adopt(ENERGY, &g);
        assert!(start.energy == ENERGY && start.flags == 0);
        assert!(near(start.residual2, search.residual2(&g)), "{start:?}");

        let (begun, z) = search.turn(&(&g + 0.1 * random(n, rng)));
        assert!(begun.flags == 0 && begun.alpha == 1.0 && begun.halvings == 0, "{begun:?}");
        assert!(distance(&search.attempt(), &(&dv - &z)) < ROUNDING);
        let refused = search.judge([ENERGY[0] + 1.0, 0.0], &noise);
        assert!(refused.flags == 0 && refused.alpha == 0.5 && refused.halvings == 1, "{refused:?}");
        assert!(refused.energy == ENERGY && refused.residual2 == start.residual2, "{refused:?}");
        let trial = search.attempt();
        assert!(distance(&trial, &(&dv - 0.5 * &z)) < ROUNDING);

        let s = -0.5 * &z;
        let gradient = &g + curvature * &s + 0.1 * &noise;
        let lower = [ENERGY[0], 2.0 * ENERGY[1]];
        let accepted = search.judge(lower, &gradient);
        assert!(accepted.flags == ACCEPTED && accepted.energy == lower, "{accepted:?}");
        assert!(near(accepted.residual2, search.residual2(&gradient)), "{accepted:?}");
        assert!(!near(accepted.residual2, search.residual2(&g)), "not noticed");
        assert_eq!(search.attempt(), trial, "the search has ended");

        let finest = &search.hierarchy.levels[0];
        let stepped = search.run(search.lbfgs.step(search.tools, &search.system, finest));
        let [dv, g, s0, y0] = [search.system.get("dv"), search.lbfgs.get("g")]
            .into_iter()
            .chain(["s0", "y0"].map(|name| search.lbfgs.get(name)))
            .map(|buffer| search.read(buffer))
            .collect::<Vec<_>>()
            .try_into()
            .unwrap();
        let y = curvature * &s + 0.1 * &noise;
        assert_eq!(dv, trial);
        assert!(distance(&g, &gradient) < ROUNDING && distance(&s0, &s) < ROUNDING && distance(&y0, &y) < ROUNDING);
        assert!(distance(&y0, &(1.001 * &y)) > ROUNDING, "not noticed");
        assert_eq!(stepped.flags, if kept { ACCEPTED } else { ACCEPTED | DROPPED });
        let rho: Vec<f32> = gpu.read(search.lbfgs.get("pairs"), 1).unwrap();
        assert!(!kept || near(rho[0], 1.0 / s.dot(&y)), "{rho:?}");
    }
}

/// Where E levels off in its rounding, the slope decides; what is not finite is never accepted.
#[test]
fn verdicts_are_those_of_the_rule() {
    let seed = 92;
    println!("seed {seed}");
    let (gpu, rng) = (test_gpu(), &mut StdRng::seed_from_u64(seed));
    let programs = Programs::new(Variant::of_kernel(Kernel::Quadratic));
    let sample = Sample::new(&scene(Kernel::Quadratic, false, 1e6));
    let search = Search::new(Tools { gpu: &gpu, programs: &programs }, &sample);
    let g = random(3 * sample.rows(), rng);
    // A unit of rounding of E, of which four may be gained.
    let unit = 5.9604645e-8 * ENERGY[0];
    for (change, share, accepted) in [
        (0.0, 1.0, true),
        (-unit, -5.0, true),
        (3.0 * unit, 0.7, true),
        (3.0 * unit, -0.7, true),
        (3.0 * unit, 0.9, false),
        (3.0 * unit, -0.9, false),
        (5.0 * unit, 0.1, false),
        (f32::NAN, 0.1, false),
        (f32::INFINITY, 0.1, false),
        (-unit, f64::NAN, false),
        (-unit, f64::INFINITY, false),
    ] {
        search.adopt(ENERGY, &g);
        search.turn(&g);
        let state = search.judge([ENERGY[0], ENERGY[1] + change], &(share * &g));
        assert_eq!(state.flags == ACCEPTED, accepted, "ΔE {change:e}, slope {share} of the first: {state:?}");
        assert_eq!(state.halvings, u32::from(!accepted));
    }
    search.adopt(ENERGY, &g);
    let (up, _) = search.turn(&(-&g));
    assert!(up.flags == INDEFINITE && up.slope > 0.0, "{up:?}");
    assert_eq!(search.judge([0.0; 2], &g).flags, INDEFINITE, "nothing is tried");
    assert_eq!(search.adopt([f32::INFINITY, 0.0], &g).flags, BROKEN);
    assert_eq!(search.adopt(ENERGY, &(f64::NAN * &g)).flags, BROKEN);
}
