//! L-BFGS and its line search as dispatches: the two-loop recursion around the V-cycle, tries, and
//! the step to the one that was accepted. All scalars stay on the device.

use std::collections::VecDeque;

use wgpu::{BindingResource, Buffer};

use super::hierarchy::Hierarchy;
use super::kernels::{Kernel, Program, Tools};
use super::layout;
use super::level::{Level, SLOT, buffer, slot};
use crate::gpu::device::Gpu;
use crate::implicit::gpu::interface::System;

/// Pairs that are kept.
const WINDOW: usize = 8;

/// Device memory of the minimisation, for systems of one stride.
pub struct Lbfgs {
    pub stride: u32,
    /// ∇E at the iterate.
    pub g: Buffer,
    /// One pair more than are kept, for the newest, which may be dropped.
    s: Vec<Buffer>,
    y: Vec<Buffer>,
    /// ρ and α of the pairs, a slot each.
    pairs: Buffer,
    slopes: Buffer,
    residuals: Buffer,
    pub state: Buffer,
    /// The places of the pairs that are kept, oldest first.
    kept: VecDeque<usize>,
}

impl Lbfgs {
    pub fn new(gpu: &Gpu, stride: u32) -> Self {
        let field = |label| buffer(gpu, label, 12 * u64::from(stride));
        Self {
            stride,
            g: field("g"),
            s: (0..=WINDOW).map(|_| field("s")).collect(),
            y: (0..=WINDOW).map(|_| field("y")).collect(),
            pairs: buffer(gpu, "pairs", SLOT * (WINDOW as u64 + 1)),
            slopes: buffer(gpu, "slopes", 1024),
            residuals: buffer(gpu, "residuals", 1024),
            state: buffer(gpu, "state", size_of::<layout::State>() as u64),
            kept: VecDeque::new(),
        }
    }

    /// Forgets all pairs; false if there were none.
    pub fn clear(&mut self) -> bool {
        let any = !self.kept.is_empty();
        self.kept.clear();
        any
    }

    fn free(&self) -> usize {
        (0..=WINDOW).find(|k| !self.kept.contains(k)).expect("one more than are kept")
    }

    /// Keeps the pair that the last [`Lbfgs::step`] wrote.
    pub fn keep(&mut self) {
        let newest = self.free();
        if self.kept.len() == WINDOW {
            self.kept.pop_front();
        }
        self.kept.push_back(newest);
    }

    fn pair(&self, k: usize) -> BindingResource<'_> {
        slot(&self.pairs, k as u32)
    }

    /// First loop: ∇E → the right-hand side of the V-cycle (Nocedal & Wright, algorithm 7.4).
    pub fn backward(&self, tools: Tools, finest: &Level) -> Program {
        let mut program = Program::default();
        let newest_first: Vec<usize> = self.kept.iter().rev().copied().collect();
        let s = |k: Option<&usize>| k.map_or(&self.g, |&k| &self.s[k]);
        let mut from = 0;
        let bound = [&finest.uniform, &self.g, s(newest_first.first()), &finest.b, &finest.partials[from]];
        program.push_whole(tools, Kernel::Begin, &bound, finest.by_sum());
        for (n, &k) in newest_first.iter().enumerate() {
            let [shape, sums, y, next, q, partials] = [
                &finest.uniform,
                &finest.partials[from],
                &self.y[k],
                s(newest_first.get(n + 1)),
                &finest.b,
                &finest.partials[1 - from],
            ]
            .map(|b| b.as_entire_binding());
            program.push(tools, Kernel::Backward, &[shape, sums, self.pair(k), y, next, q, partials], finest.by_sum());
            from = 1 - from;
        }
        program
    }

    /// Second loop, and the start of the line search along −z, z the V-cycle's answer.
    pub fn forward(&self, tools: Tools, system: &System, hierarchy: &Hierarchy) -> Program {
        let mut program = Program::default();
        let finest = &hierarchy.levels[0];
        let z = &finest.x[hierarchy.result];
        let y = |k: Option<&usize>| k.map_or(&self.g, |&k| &self.y[k]);
        let mut from = 0;
        let bound = [&finest.uniform, &system.freedoms, y(self.kept.front()), z, &finest.partials[from]];
        program.push_whole(tools, Kernel::Project, &bound, finest.by_sum());
        for (n, &k) in self.kept.iter().enumerate() {
            let [shape, sums, s, next, z, partials] = [
                &finest.uniform,
                &finest.partials[from],
                &self.s[k],
                y(self.kept.get(n + 1)),
                z,
                &finest.partials[1 - from],
            ]
            .map(|b| b.as_entire_binding());
            program.push(tools, Kernel::Forward, &[shape, sums, self.pair(k), s, next, z, partials], finest.by_sum());
            from = 1 - from;
        }
        let bound = [&finest.uniform, &finest.partials[from], &self.state, &system.control];
        program.push_whole(tools, Kernel::Search, &bound, [1, 1]);
        program
    }

    /// The trial of the line search.
    pub fn attempt(&self, tools: Tools, system: &System, hierarchy: &Hierarchy) -> Program {
        let mut program = Program::default();
        let finest = &hierarchy.levels[0];
        let z = &finest.x[hierarchy.result];
        let bound = [&finest.uniform, &system.control, &self.state, &system.dv, z, &system.trial];
        program.push_whole(tools, Kernel::Attempt, &bound, finest.by_row());
        program
    }

    fn measure(&self, program: &mut Program, tools: Tools, system: &System, hierarchy: &Hierarchy) {
        let finest = &hierarchy.levels[0];
        let z = &finest.x[hierarchy.result];
        let bound =
            [&finest.uniform, &system.control, z, &system.gradient, &system.scales, &self.slopes, &self.residuals];
        program.push_whole(tools, Kernel::Measure, &bound, finest.by_sum());
    }

    /// The verdict on the trial once it is evaluated.
    pub fn judge(&self, tools: Tools, system: &System, hierarchy: &Hierarchy) -> Program {
        let mut program = Program::default();
        self.measure(&mut program, tools, system, hierarchy);
        let finest = &hierarchy.levels[0];
        let bound = [&finest.uniform, &self.slopes, &self.residuals, &system.energy, &self.state, &system.control];
        program.push_whole(tools, Kernel::Decide, &bound, [1, 1]);
        program
    }

    /// Energy and residual of the start, once it is evaluated.
    pub fn adopt(&self, tools: Tools, system: &System, hierarchy: &Hierarchy) -> Program {
        let mut program = Program::default();
        self.measure(&mut program, tools, system, hierarchy);
        let bound = [&hierarchy.levels[0].uniform, &self.residuals, &system.energy, &self.state];
        program.push_whole(tools, Kernel::Adopt, &bound, [1, 1]);
        program
    }

    /// To the accepted trial, if there is one, with a new pair.
    pub fn step(&self, tools: Tools, system: &System, finest: &Level) -> Program {
        let mut program = Program::default();
        let k = self.free();
        let partials = &finest.partials[0];
        let bound = [
            &finest.uniform,
            &self.state,
            &system.trial,
            &system.gradient,
            &system.dv,
            &self.g,
            &self.s[k],
            &self.y[k],
            partials,
        ];
        program.push_whole(tools, Kernel::Accept, &bound, finest.by_sum());
        let [shape, sums, state] = [&finest.uniform, partials, &self.state].map(|b| b.as_entire_binding());
        program.push(tools, Kernel::Finish, &[shape, sums, self.pair(k), state], [1, 1]);
        program
    }
}

#[cfg(test)]
mod tests {
    use rand::{SeedableRng, rngs::StdRng};

    use super::super::kernels::Pipelines;
    use super::super::problem_tests::{Sample, distance, gpu, random, read_field, scene, write_field};
    use super::*;
    use crate::explicit::gpu::readback::read;
    use gridfall_core::sim::settings::Implicit;
    use gridfall_core::sim::setup::Kernel;

    /// The recursion in f64 with the V-cycle's answer given, against the device's; and a wrong
    /// order of pairs must show.
    #[test]
    fn two_loop_recursion() {
        let seed = 77;
        println!("seed {seed}");
        let (gpu, rng) = (gpu(), &mut StdRng::seed_from_u64(seed));
        let pipelines = Pipelines::new(Kernel::Quadratic);
        let tools = Tools { gpu: &gpu, pipelines: &pipelines };
        let sample = Sample::new(&scene(Kernel::Quadratic, false, 1e6));
        let system = sample.upload(&gpu);
        let hierarchy = Hierarchy::new(tools, &system, &Implicit::default(), None).unwrap();
        let (finest, n, stride) = (&hierarchy.levels[0], sample.rows(), system.stride as usize);
        let mut lbfgs = Lbfgs::new(&gpu, system.stride);
        let projections = sample.projections();
        let field = |rng: &mut StdRng| {
            let mut x = random(3 * n, rng);
            for (i, s) in projections.iter().enumerate() {
                let value = s * x.rows(3 * i, 3);
                x.rows_mut(3 * i, 3).copy_from(&value);
            }
            x
        };
        let mut pairs = Vec::new();
        for _ in 0..WINDOW + 2 {
            let k = lbfgs.free();
            let s = field(rng);
            let y = &s * 2.0 + 0.2 * field(rng);
            write_field(&gpu, &lbfgs.s[k], stride, &s);
            write_field(&gpu, &lbfgs.y[k], stride, &y);
            let rho = (1.0 / y.dot(&s)) as f32;
            gpu.queue.write_buffer(&lbfgs.pairs, SLOT * k as u64, bytemuck::bytes_of(&rho));
            lbfgs.keep();
            pairs.push((s, y));
        }
        let pairs = &pairs[2..];
        let (g, z0) = (field(rng), field(rng));
        write_field(&gpu, &lbfgs.g, stride, &g);
        lbfgs.backward(tools, finest).submit(&gpu).unwrap();
        write_field(&gpu, &finest.x[hierarchy.result], stride, &z0);
        lbfgs.forward(tools, &system, &hierarchy).submit(&gpu).unwrap();
        let q = read_field(&gpu, &finest.b, stride, n);
        let z = read_field(&gpu, &finest.x[hierarchy.result], stride, n);
        let state: layout::State = read(&gpu, &lbfgs.state, 1).unwrap()[0];

        let recursion = |order: &[usize]| {
            let (mut q, mut z, mut alphas) = (g.clone(), z0.clone(), vec![0.0; order.len()]);
            for &k in order.iter().rev() {
                let (s, y) = &pairs[k];
                alphas[k] = s.dot(&q) / s.dot(y);
                q -= alphas[k] * y;
            }
            for &k in order {
                let (s, y) = &pairs[k];
                z += (alphas[k] - y.dot(&z) / s.dot(y)) * s;
            }
            (q, z)
        };
        let mut order: Vec<usize> = (0..WINDOW).collect();
        let (right_q, right_z) = recursion(&order);
        // A sum of a thousand products, twice eight times.
        assert!(distance(&q, &right_q) < 1e-5 && distance(&z, &right_z) < 1e-5, "{}", distance(&z, &right_z));
        let slope = -right_z.dot(&g);
        assert!((f64::from(state.slope) - slope).abs() < 1e-4 * right_z.norm() * g.norm(), "{}", state.slope);
        order.swap(2, 5);
        assert!(distance(&z, &recursion(&order).1) > 1e-5, "not noticed");
    }
}
