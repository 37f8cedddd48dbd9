//! A step of a real scene to test with, uploaded, and dense f64 matrices of its hierarchy.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Matrix3};
use rand::{Rng, rngs::StdRng};

use crate::contract::NoControl;
use crate::gpu::Gpu;
use crate::implicit::gpu::interface::{NO_NODE, System, slots};
use crate::implicit::physics::discretisation::Discretisation;
use crate::implicit::physics::potential::Potential;
use crate::implicit::physics::state::setups;
use crate::implicit::solver::objective::{Freedom, NodeId, NodeVectors, Objective};
use crate::implicit::solver::sparse::Bsr;
use gridfall_core::sim::setup::{Kernel, Problem};
use gridfall_scene::{self as scene, Limits};

pub const KERNELS: [Kernel; 2] = [Kernel::Quadratic, Kernel::Compact];
const DT_S: f64 = 0.02;

/// A soft and a stiff half, jittered, on a slip floor and against a slip wall where they meet
/// (nodes slide along planes and a line); or, if `periodic`, all around along y.
pub fn scene(kernel: Kernel, periodic: bool, stiff_pa: f64) -> Problem {
    let kernel = if kernel == Kernel::Quadratic { "quadratic" } else { "compact" };
    let (boundary, width) =
        if periodic { (r#""y": "periodic""#, 0.8) } else { (r#""y-": { "contact": "slip" }"#, 0.35) };
    let json = format!(
        r#"{{ "gridfall": 1, "name": "slab", "dimension": 3,
        "domain": {{ "min": [0, 0, 0], "max": [1.6, 0.8, 0.8], "dx": 0.1,
             "boundary": {{ "z-": {{ "contact": "slip" }}, {boundary} }} }},
        "materials": {{ "soft": {{ "model": "fixed-corotated", "density": 1000, "youngs_modulus": 1e5,
             "poissons_ratio": 0.3 }},
                        "stiff": {{ "model": "neo-hookean", "density": 2000, "youngs_modulus": {stiff_pa},
             "poissons_ratio": 0.4 }} }},
        "bodies": [
          {{ "name": "a", "material": "soft", "sampling": "jittered",
             "shape": {{ "box": {{ "min": [0.5, 0, 0], "max": [0.7, {width}, 0.15] }} }} }},
          {{ "name": "b", "material": "stiff", "sampling": "jittered",
             "shape": {{ "box": {{ "min": [0.7, 0, 0.05], "max": [0.9, {width}, 0.2] }} }} }} ],
        "time": {{ "end": 1, "frame_rate": 10 }},
        "solver": {{ "integrator": "implicit", "kernel": "{kernel}", "transfer": "apic", "precision": "f64" }} }}"#,
    );
    let scene = scene::parse(&json).unwrap_or_else(|faults| panic!("{faults:?}"));
    scene::problem(&scene, &Limits::default()).unwrap_or_else(|faults| panic!("{faults:?}"))
}

/// What the device is given, in f64 and by node.
pub struct Sample {
    pub kernel: Kernel,
    pub ids: Vec<NodeId<3>>,
    pub freedoms: Vec<Freedom<3>>,
    pub period: [Option<i32>; 3],
    pub matrix: Bsr<f64, 3>,
    pub masses: Vec<f64>,
    pub scales: Vec<f64>,
    pub start: NodeVectors<3>,
}

impl Sample {
    /// Of the step's potential at its start.
    pub fn new(problem: &Problem) -> Self {
        let bodies = setups::<3>(&problem.setup);
        let step = Discretisation::<3>::new(&problem.setup, &bodies, &problem.particles, 0.0, DT_S);
        let potential = Potential::new(&problem.setup, &bodies, &step, &NoControl);
        let start = potential.start();
        Self {
            kernel: problem.setup.kernel,
            ids: potential.nodes().to_vec(),
            freedoms: potential.freedoms().to_vec(),
            period: potential.period(),
            matrix: potential.hessian(&start),
            masses: potential.masses().to_vec(),
            scales: potential.scales().to_vec(),
            start,
        }
    }

    pub fn rows(&self) -> usize {
        self.ids.len()
    }

    /// Offsets of the neighbour slots of a node, and whether they are on the other grid.
    fn stencil(&self, grid: u8) -> Vec<([i32; 3], bool)> {
        let cube = |low: i32, n: i32, other: bool| {
            (0..n * n * n).map(move |k| ([k / (n * n) + low, k / n % n + low, k % n + low], other))
        };
        match self.kernel {
            Kernel::Quadratic => cube(-2, 5, false).collect(),
            _ => cube(-1, 3, false).chain(cube(-1 - i32::from(grid), 4, true)).collect(),
        }
    }

    /// Into device memory, with room for a few nodes more.
    pub fn upload(&self, gpu: &Gpu) -> System {
        let mut system = System::new(gpu, self.kernel, self.rows() as u32 + 7).unwrap();
        let (n, stride) = (self.rows(), system.stride as usize);
        system.rows = n as u32;
        for a in 0..3 {
            let along = |pick: fn(i32, i32) -> i32| self.ids.iter().map(|id| id.index[a]).reduce(pick).unwrap();
            (system.lowest[a], system.periodic[a]) = (along(i32::min) - 1, self.period[a].is_some());
            system.extent[a] = (along(i32::max) + 3 - system.lowest[a]) as u32;
            if let Some(cells) = self.period[a] {
                (system.lowest[a], system.extent[a]) = (0, cells as u32);
            }
        }
        let mut columns = vec![NO_NODE; slots(self.kernel) as usize * stride];
        let mut values = vec![0.0f32; columns.len() * 9];
        let rows: BTreeMap<_, _> = self.ids.iter().enumerate().map(|(row, id)| (*id, row)).collect();
        let mut blocks = 0;
        for (row, id) in self.ids.iter().enumerate() {
            let range = self.matrix.row_start[row]..self.matrix.row_start[row + 1];
            for (slot, (offset, other)) in self.stencil(id.grid).into_iter().enumerate() {
                let wrap = |a: usize, i: i32| self.period[a].map_or(i, |cells| i.rem_euclid(cells));
                let index = std::array::from_fn(|a| wrap(a, id.index[a] + offset[a]));
                let neighbour = NodeId { grid: id.grid ^ u8::from(other), index };
                let Some(&column) = rows.get(&neighbour) else { continue };
                columns[slot * stride + row] = column as u32;
                let found = self.matrix.columns[range.clone()].binary_search(&(column as u32));
                let Ok(at) = found else { continue };
                blocks += 1;
                for (a, c) in (0..3).flat_map(|a| (0..3).map(move |c| (a, c))) {
                    values[(slot * 9 + 3 * a + c) * stride + row] = self.matrix.blocks[range.start + at][a][c] as f32;
                }
            }
        }
        assert_eq!(blocks, self.matrix.blocks.len(), "every block has a slot");
        let ids: Vec<[i32; 4]> =
            self.ids.iter().map(|id| [id.index[0], id.index[1], id.index[2], id.grid.into()]).collect();
        let freedom = |freedom: &Freedom<3>| match freedom {
            Freedom::Free => [0.0f32; 4],
            Freedom::Plane([x, y, z]) => [*x as f32, *y as f32, *z as f32, 1.0],
            Freedom::Line([x, y, z]) => [*x as f32, *y as f32, *z as f32, 2.0],
        };
        let freedoms: Vec<_> = self.freedoms.iter().map(freedom).collect();
        let narrow = |x: &[f64]| -> Vec<f32> { x.iter().map(|&x| x as f32).collect() };
        system.memory.write(gpu, "columns", 0, &columns);
        system.memory.write(gpu, "values", 0, &values);
        system.memory.write(gpu, "anchors", 0, &self.anchors(stride));
        system.memory.write(gpu, "ids", 0, &ids);
        system.memory.write(gpu, "freedoms", 0, &freedoms);
        system.memory.write(gpu, "masses", 0, &narrow(&self.masses));
        system.memory.write(gpu, "scales", 0, &narrow(&self.scales));
        write_field(gpu, system.get("dv"), stride, &dense(&self.start));
        system
    }

    /// Sums of rows, each relative to itself.
    pub fn anchors(&self, stride: usize) -> Vec<f32> {
        let mut anchors = vec![0.0f32; 10 * stride];
        for row in 0..self.rows() {
            anchors[9 * stride + row] = row as f32;
            let blocks = &self.matrix.blocks[self.matrix.row_start[row]..self.matrix.row_start[row + 1]];
            for k in 0..9 {
                let sum: f64 = blocks.iter().map(|block| block[k / 3][k % 3]).sum();
                anchors[k * stride + row] = sum as f32;
            }
        }
        anchors
    }

    /// The matrix, dense.
    pub fn dense_matrix(&self) -> DMatrix<f64> {
        let mut dense = DMatrix::zeros(3 * self.rows(), 3 * self.rows());
        for row in 0..self.rows() {
            for at in self.matrix.row_start[row]..self.matrix.row_start[row + 1] {
                for (a, c) in (0..3).flat_map(|a| (0..3).map(move |c| (a, c))) {
                    dense[(3 * row + a, 3 * self.matrix.columns[at] as usize + c)] = self.matrix.blocks[at][a][c];
                }
            }
        }
        dense
    }

    /// S of every node.
    pub fn projections(&self) -> Vec<Matrix3<f64>> {
        let matrix = |s: [[f64; 3]; 3]| Matrix3::from_fn(|a, c| s[a][c]);
        self.freedoms.iter().map(|f| f.projection().map_or(Matrix3::identity(), matrix)).collect()
    }
}

/// Prolongation from coarse nodes to fine ones without S: weight 1 for an even index, ½ for both
/// neighbours of an odd one, by axis; along an axis whose `factor` is 1 each to its like. `period`
/// is the fine nodes'.
pub fn prolongation(fine: &[NodeId<3>], coarse: &[NodeId<3>], period: [i32; 3], factor: [i32; 3]) -> DMatrix<f64> {
    let mut p = DMatrix::zeros(3 * fine.len(), 3 * coarse.len());
    for (j, parent) in coarse.iter().enumerate() {
        for (i, child) in fine.iter().enumerate().filter(|(_, child)| child.grid == parent.grid) {
            let distance = |a: usize| {
                let (d, cells) = (child.index[a] - factor[a] * parent.index[a], period[a]);
                if cells == 0 { d } else { (d + cells / 2).rem_euclid(cells) - cells / 2 }
            };
            let weight: f64 =
                (0..3).map(|a| (1.0 - f64::from(distance(a).abs()) / f64::from(factor[a])).max(0.0)).product();
            (0..3).for_each(|a| p[(3 * i + a, 3 * j + a)] = weight);
        }
    }
    p
}

/// A field as one vector, node by node.
pub fn dense(field: &NodeVectors<3>) -> DVector<f64> {
    DVector::from_iterator(3 * field.len(), field.iter().flatten().copied())
}

/// Random, within [−1, 1], in f32's numbers.
pub fn random(n: usize, rng: &mut StdRng) -> DVector<f64> {
    DVector::from_fn(n, |_, _| f64::from(rng.random_range(-1.0f32..1.0)))
}

pub fn write_field(gpu: &Gpu, buffer: &wgpu::Buffer, stride: usize, x: &DVector<f64>) {
    let mut values = vec![0.0f32; 3 * stride];
    (0..x.len()).for_each(|k| values[k % 3 * stride + k / 3] = x[k] as f32);
    gpu.queue.write_buffer(buffer, 0, bytemuck::cast_slice(&values));
}

pub fn read_field(gpu: &Gpu, buffer: &wgpu::Buffer, stride: usize, rows: usize) -> DVector<f64> {
    let values: Vec<f32> = gpu.read(buffer, 3 * stride).unwrap();
    DVector::from_fn(3 * rows, |k, _| f64::from(values[k % 3 * stride + k / 3]))
}

/// |a − b| over the larger of |b| and a floor.
pub fn distance(a: &DVector<f64>, b: &DVector<f64>) -> f64 {
    let d = (a - b).norm() / b.norm();
    if d.is_nan() { f64::INFINITY } else { d }
}
