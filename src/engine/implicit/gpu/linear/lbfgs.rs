//! L-BFGS and its line search as dispatches: the two-loop recursion around the V-cycle, tries, and
//! the step to the one that was accepted. All scalars stay on the device.

use std::collections::VecDeque;

use wgpu::{BindingResource, Buffer};

use super::hierarchy::Hierarchy;
use super::layout;
use super::level::Level;
use super::stages::{ADOPT, ATTEMPT, BACKWARD, BEGIN, FORWARD, JUDGE, PROJECT, SEARCH, STEP, Stage, append};
use crate::contract::EngineError;
use crate::gpu::Gpu;
use crate::gpu::memory::{Memory, SLOT, Scope, slot, storage};
use crate::gpu::program::{Dispatches, Tools};
use crate::implicit::gpu::interface::{System, sizes};

/// Pairs that are kept.
const WINDOW: usize = 8;
/// The vectors of the pairs: one pair more than are kept, for the newest, which may be dropped.
const S: [&str; WINDOW + 1] = ["s0", "s1", "s2", "s3", "s4", "s5", "s6", "s7", "s8"];
const Y: [&str; WINDOW + 1] = ["y0", "y1", "y2", "y3", "y4", "y5", "y6", "y7", "y8"];

/// Device memory of the minimisation, for systems of one stride.
pub struct Lbfgs {
    pub stride: u32,
    /// `g`, ∇E at the iterate; the vectors of the pairs; `pairs`, ρ and α of each in a slot of its
    /// own; `slopes`, `residuals` and `state` of the line search.
    memory: Memory,
    /// The places of the pairs that are kept, oldest first.
    kept: VecDeque<usize>,
}

impl Lbfgs {
    /// Errors: [`EngineError::Capacity`] when a buffer does not fit the device.
    pub fn new(gpu: &Gpu, stride: u32) -> Result<Self, EngineError> {
        let field = |name| storage(name, 12 * stride as usize);
        let mut buffers = vec![
            field("g"),
            storage("pairs", SLOT as usize * (WINDOW + 1)),
            storage("slopes", 1024),
            storage("residuals", 1024),
            storage("state", size_of::<layout::State>()),
        ];
        buffers.extend(S.map(field));
        buffers.extend(Y.map(field));
        Ok(Self { stride, memory: Memory::new(gpu, &sizes(buffers, stride))?, kept: VecDeque::new() })
    }

    pub fn get(&self, name: &str) -> &Buffer {
        self.memory.get(name)
    }

    pub fn state(&self, gpu: &Gpu) -> Result<layout::State, EngineError> {
        Ok(self.memory.read(gpu, "state", 1)?[0])
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
        slot(self.get("pairs"), k)
    }

    /// s or y of a pair, or ∇E without one.
    fn of_pair(&self, names: &[&str], k: Option<&usize>) -> &Buffer {
        self.get(k.map_or("g", |&k| names[k]))
    }

    /// First loop: ∇E → the right-hand side of the V-cycle (Nocedal & Wright, algorithm 7.4).
    pub fn backward(&self, tools: Tools, finest: &Level) -> Dispatches {
        let mut list = Dispatches::default();
        let newest_first: Vec<usize> = self.kept.iter().rev().copied().collect();
        let s = |k| ("s", self.of_pair(&S, k));
        let q = ("q", finest.get("b"));
        append(&mut list, tools, BEGIN, finest, &finest.scope(0, &[s(newest_first.first()), q]).and(&self.memory));
        for (n, &k) in newest_first.iter().enumerate() {
            let own = [("y", self.get(Y[k])), s(newest_first.get(n + 1)), q];
            append(&mut list, tools, BACKWARD, finest, &finest.scope(n % 2, &own).with_part("pair", self.pair(k)));
        }
        list
    }

    /// Second loop, and the start of the line search along −z, z the V-cycle's answer.
    pub fn forward(&self, tools: Tools, system: &System, hierarchy: &Hierarchy) -> Dispatches {
        let mut list = Dispatches::default();
        let finest = &hierarchy.levels[0];
        let y = |k| ("y", self.of_pair(&Y, k));
        let z = ("z", finest.x(hierarchy.result));
        append(&mut list, tools, PROJECT, finest, &finest.scope(0, &[y(self.kept.front()), z]).and(&system.memory));
        for (n, &k) in self.kept.iter().enumerate() {
            let own = [("s", self.get(S[k])), y(self.kept.get(n + 1)), z];
            append(&mut list, tools, FORWARD, finest, &finest.scope(n % 2, &own).with_part("pair", self.pair(k)));
        }
        let scope = finest.scope(self.kept.len() % 2, &[]);
        append(&mut list, tools, SEARCH, finest, &self.with_system(scope, system));
        list
    }

    /// The trial of the line search.
    pub fn attempt(&self, tools: Tools, system: &System, hierarchy: &Hierarchy) -> Dispatches {
        self.along(ATTEMPT, tools, system, hierarchy)
    }

    /// The verdict on the trial once it is evaluated.
    pub fn judge(&self, tools: Tools, system: &System, hierarchy: &Hierarchy) -> Dispatches {
        self.along(JUDGE, tools, system, hierarchy)
    }

    /// Energy and residual of the start, once it is evaluated.
    pub fn adopt(&self, tools: Tools, system: &System, hierarchy: &Hierarchy) -> Dispatches {
        self.along(ADOPT, tools, system, hierarchy)
    }

    /// Stages of a search along −z.
    fn along(&self, stages: &[Stage], tools: Tools, system: &System, hierarchy: &Hierarchy) -> Dispatches {
        let mut list = Dispatches::default();
        let finest = &hierarchy.levels[0];
        let scope = finest.scope(0, &[("z", finest.x(hierarchy.result))]);
        append(&mut list, tools, stages, finest, &self.with_system(scope, system));
        list
    }

    /// To the accepted trial, if there is one, with a new pair.
    pub fn step(&self, tools: Tools, system: &System, finest: &Level) -> Dispatches {
        let mut list = Dispatches::default();
        let k = self.free();
        let scope = finest.scope(0, &[("s", self.get(S[k])), ("y", self.get(Y[k]))]).with_part("pair", self.pair(k));
        append(&mut list, tools, STEP, finest, &self.with_system(scope, system));
        list
    }

    fn with_system<'a>(&'a self, scope: Scope<'a>, system: &'a System) -> Scope<'a> {
        scope.and(&self.memory).and(&system.memory)
    }
}

#[cfg(test)]
mod tests {
    use rand::{SeedableRng, rngs::StdRng};

    use super::super::problem_tests::{Sample, distance, random, read_field, scene, write_field};
    use super::*;
    use crate::gpu::Variant;
    use crate::gpu::device::test_gpu;
    use crate::gpu::program::Programs;
    use gridfall_core::sim::settings::Implicit;
    use gridfall_core::sim::setup::Kernel;

    /// The recursion in f64 with the V-cycle's answer given, against the device's; and a wrong
    /// order of pairs must show.
    #[test]
    fn two_loop_recursion() {
        let seed = 77;
        println!("seed {seed}");
        let (gpu, rng) = (test_gpu(), &mut StdRng::seed_from_u64(seed));
        let programs = Programs::new(Variant::of_kernel(Kernel::Quadratic));
        let tools = Tools { gpu: &gpu, programs: &programs };
        let sample = Sample::new(&scene(Kernel::Quadratic, false, 1e6));
        let system = sample.upload(&gpu);
        let hierarchy = Hierarchy::new(tools, &system, &Implicit::default(), None).unwrap();
        let (finest, n, stride) = (&hierarchy.levels[0], sample.rows(), system.stride as usize);
        let mut lbfgs = Lbfgs::new(&gpu, system.stride).unwrap();
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
            write_field(&gpu, lbfgs.get(S[k]), stride, &s);
            write_field(&gpu, lbfgs.get(Y[k]), stride, &y);
            let rho = (1.0 / y.dot(&s)) as f32;
            lbfgs.memory.write_slot(&gpu, "pairs", k, &rho);
            lbfgs.keep();
            pairs.push((s, y));
        }
        let pairs = &pairs[2..];
        let (g, z0) = (field(rng), field(rng));
        write_field(&gpu, lbfgs.get("g"), stride, &g);
        lbfgs.backward(tools, finest).submit(&gpu).unwrap();
        write_field(&gpu, finest.x(hierarchy.result), stride, &z0);
        lbfgs.forward(tools, &system, &hierarchy).submit(&gpu).unwrap();
        let q = read_field(&gpu, finest.get("b"), stride, n);
        let z = read_field(&gpu, finest.x(hierarchy.result), stride, n);
        let state = lbfgs.state(&gpu).unwrap();

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
