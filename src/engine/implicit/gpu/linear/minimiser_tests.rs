//! Whole minimisations against Newton's method in f64: E = ½ Δvᵀ A Δv − bᵀΔv + ¼ κ Σ m_i |Δv_i|⁴
//! with the matrix of a step.

use nalgebra::{DMatrix, DVector, Matrix3};

use super::minimiser::Minimiser;
use super::problem_tests::{KERNELS, Sample, read_field, scene, write_field};
use crate::gpu::device::test_gpu;
use crate::gpu::memory::{Memory, Scope, storage, uniform};
use crate::gpu::program::{Dispatch, Dispatches, Workgroups};
use crate::gpu::{Gpu, Shader, Variant};
use crate::implicit::gpu::interface::{Evaluate, System, sizes};
use gridfall_core::sim::settings::{Implicit, Method, Smoother};
use gridfall_core::sim::setup::Kernel;

/// ∇E and partial sums of E. Rows as in product.wgsl.
const GRADIENT: &str = "// uses implicit/linear/freedom, implicit/linear/product, implicit/linear/reduce

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> columns: array<u32>;
@group(0) @binding(2) var<storage, read> values: array<f32>;
@group(0) @binding(3) var<storage, read> freedoms: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> b: array<f32>;
@group(0) @binding(5) var<storage, read> kappa: f32;
@group(0) @binding(6) var<storage, read> control: array<u32, 4>;
@group(0) @binding(7) var<storage, read> trial: array<f32>;
@group(0) @binding(8) var<storage, read_write> gradient: array<f32>;
@group(0) @binding(9) var<storage, read_write> sums: array<f32>;
@group(0) @binding(10) var<storage, read> masses: array<f32>;
@group(0) @binding(11) var<storage, read> anchors: array<f32>;

fn gathered(row: u32) -> vec3<f32> {
    return vec3<f32>(trial[row], trial[level.stride + row], trial[2u * level.stride + row]);
}

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = level.stride;
    let row = group.x * ROWS + lane % ROWS;
    let wanted = row < level.rows && control[0] == 0u;
    let ax = product(row, lane, wanted);
    var own = 0.0;
    if (lane < ROWS && wanted) {
        let v = gathered(row);
        let quartic = kappa * masses[row];
        let f = vec3<f32>(b[row], b[n + row], b[2u * n + row]);
        let g = projected(freedoms[row], ax - f + quartic * dot(v, v) * v);
        for (var a = 0u; a < 3u; a++) {
            gradient[a * n + row] = g[a];
        }
        own = dot(v, 0.5 * ax - f) + 0.25 * quartic * dot(v, v) * dot(v, v);
    }
    let total = summed(lane, own);
    if (lane == 0u && control[0] == 0u) {
        sums[group.x] = total;
    }
}
";

const ENERGY: &str = "// uses implicit/linear/level, implicit/linear/reduce

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> sums: array<f32>;
@group(0) @binding(2) var<storage, read_write> energy: vec2<f32>;

@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) lane: u32) {
    var own = 0.0;
    for (var k = lane; 32u * k < level.rows; k += 256u) {
        own += sums[k];
    }
    let total = summed(lane, own);
    if (lane == 0u) {
        energy = vec2<f32>(total, 0.0);
    }
}
";

struct Quartic {
    list: Dispatches,
}

impl Quartic {
    fn new(gpu: &Gpu, system: &System, b: &DVector<f64>, kappa: f32) -> Self {
        let (rows, stride) = (system.rows, system.stride);
        let shape = super::layout::Level { rows, stride, blocks: [1; 3], grids: 1, ..Default::default() };
        let n = stride as usize;
        let buffers =
            vec![uniform("level", size_of_val(&shape)), storage("b", 12 * n), storage("kappa", 4), storage("sums", n)];
        let memory = Memory::new(gpu, &sizes(buffers, stride)).unwrap();
        memory.write(gpu, "level", 0, &[shape]);
        memory.write(gpu, "kappa", 0, &[kappa]);
        write_field(gpu, memory.get("b"), n, b);
        let scope = Scope::of(&memory).and(&system.memory);
        let variant = Variant::of_kernel(system.kernel);
        let mut list = Dispatches::default();
        for (name, text, groups) in [("gradient", GRADIENT, rows.div_ceil(32)), ("energy", ENERGY, 1)] {
            let shader = Shader::of_text(name, text, variant, gpu.workgroup).unwrap_or_else(|e| panic!("{e}"));
            list.push(Dispatch::of(gpu, gpu.program(name, shader), Workgroups::Grid([groups, 1]), &scope));
        }
        Self { list }
    }
}

impl Evaluate for Quartic {
    fn record(&self, pass: &mut wgpu::ComputePass) {
        self.list.record(pass);
    }

    /// A is there already; what κ adds to it is left out, so that there is something to learn on
    /// the way.
    fn record_hessian(&self, _: &mut wgpu::ComputePass) {}

    fn fall_m_s(&self) -> f64 {
        0.0
    }
}

/// Within f32's reach up to this contrast; from 1e8 Pa on the compact pair's noise floor lies
/// above, at 2e-8.
const TOLERANCE: f64 = 1e-8;

/// One problem with its solution.
struct Case {
    sample: Sample,
    system: System,
    evaluate: Quartic,
    matrix: DMatrix<f64>,
    b: DVector<f64>,
    kappa: f64,
}

impl Case {
    fn new(gpu: &Gpu, kernel: Kernel, stiff_pa: f64, kappa: f64) -> Self {
        let sample = Sample::new(&scene(kernel, false, stiff_pa));
        let system = sample.upload(gpu);
        // Forces that bend and stretch: an acceleration that varies over some cells.
        let mut b = DVector::zeros(3 * sample.rows());
        for (i, (id, s)) in sample.ids.iter().zip(&sample.projections()).enumerate() {
            let [x, y, z] = id.index.map(f64::from);
            let push = nalgebra::Vector3::new((0.7 * x + y).sin(), (0.5 * x).cos(), (0.4 * x - 0.3 * z).sin());
            let value = s * push * (0.2 * sample.masses[i]);
            b.rows_mut(3 * i, 3).copy_from(&value.map(|x| f64::from(x as f32)));
        }
        let evaluate = Quartic::new(gpu, &system, &b, kappa as f32);
        let matrix = sample.dense_matrix();
        Self { sample, system, evaluate, matrix, b, kappa }
    }

    /// ∇E, and what it is of E's Hessian beside A.
    fn gradient(&self, x: &DVector<f64>) -> (DVector<f64>, DMatrix<f64>) {
        let mut g = &self.matrix * x - &self.b;
        let mut h = DMatrix::zeros(x.len(), x.len());
        for (i, s) in self.sample.projections().iter().enumerate() {
            let kappa = self.kappa * self.sample.masses[i];
            let v: nalgebra::Vector3<f64> = x.fixed_rows::<3>(3 * i).into();
            let value = s * (g.fixed_rows::<3>(3 * i) + kappa * v.norm_squared() * v);
            g.fixed_rows_mut::<3>(3 * i).copy_from(&value);
            let block = kappa * (v.norm_squared() * Matrix3::identity() + 2.0 * v * v.transpose());
            h.fixed_view_mut::<3, 3>(3 * i, 3 * i).copy_from(&(s * block * s));
        }
        (g, h)
    }

    fn residual(&self, x: &DVector<f64>) -> f64 {
        let g = self.gradient(x).0;
        let n = self.sample.rows();
        let sum: f64 = (0..n).map(|i| g.rows(3 * i, 3).norm_squared() / self.sample.scales[i].powi(2)).sum();
        (sum / n as f64).sqrt()
    }

    /// Newton's method from the start.
    fn solution(&self) -> DVector<f64> {
        let mut x = super::problem_tests::dense(&self.sample.start);
        for _ in 0..30 {
            if self.residual(&x) < 1e-13 {
                return x;
            }
            let (g, h) = self.gradient(&x);
            x -= (&self.matrix + h).cholesky().expect("positive definite").solve(&g);
        }
        panic!("Newton's method does not converge: {:e}", self.residual(&x))
    }

    /// Of two velocity increments over the second, in the energy norm of A.
    fn distance(&self, x: &DVector<f64>, y: &DVector<f64>) -> f64 {
        let norm = |x: &DVector<f64>| x.dot(&(&self.matrix * x)).sqrt();
        norm(&(x - y)) / norm(y)
    }

    fn run(&self, gpu: &Gpu, minimiser: &mut Minimiser) -> (DVector<f64>, crate::contract::Solve) {
        let stride = self.system.stride as usize;
        self.system.memory.write(gpu, "anchors", 0, &self.sample.anchors(stride));
        write_field(gpu, self.system.get("dv"), stride, &super::problem_tests::dense(&self.sample.start));
        let solve = minimiser.minimise(gpu, &self.system, &self.evaluate).unwrap();
        (read_field(gpu, self.system.get("dv"), stride, self.sample.rows()), solve)
    }
}

#[test]
fn minima_are_newtons_and_repeatable() {
    let gpu = test_gpu();
    for kernel in KERNELS {
        for smoother in [Smoother::Chebyshev, Smoother::GaussSeidel] {
            let settings =
                Implicit { method: Method::Hot, smoother, tolerance: Some(TOLERANCE), ..Implicit::default() };
            let mut minimiser = Minimiser::new(kernel, settings);
            for (stiff_pa, kappa) in [(1e6, 0.0), (1e7, 0.01)] {
                let case = Case::new(&gpu, kernel, stiff_pa, kappa);
                let (x, solve) = case.run(&gpu, &mut minimiser);
                let solution = case.solution();
                println!(
                    "{kernel:?} {smoother:?} {stiff_pa:e} κ {kappa:e}: {solve:?}, off by {:e}",
                    case.distance(&x, &solution)
                );
                assert!(solve.converged && solve.residual <= TOLERANCE);
                // The device's own view of its residual is that of f64, to the roundings of its
                // gradient.
                assert!(case.residual(&x) < 1.5 * TOLERANCE, "{:e}", case.residual(&x));
                // ε bounds forces; soft modes have little of them.
                assert!(case.distance(&x, &solution) < 0.1);
                // Sweeps need more as stiffness grows, as published; the polynomial does not.
                assert!(smoother == Smoother::GaussSeidel || solve.iterations < 25);
                let (again, same) = case.run(&gpu, &mut minimiser);
                assert!(again == x && same == solve, "twice the same");
            }
        }
    }
}

/// The tolerance of Newton's method is the relative error, in the norm of the masses, whatever the
/// stiffness.
#[test]
fn newtons_error_is_its_tolerance() {
    let gpu = test_gpu();
    for kernel in KERNELS {
        for stiff_pa in [1e5, 1e7, 1e9, 1e10] {
            let case = Case::new(&gpu, kernel, stiff_pa, 0.01);
            let solution = case.solution();
            let size =
                |x: &DVector<f64>| (0..x.len()).map(|k| case.sample.masses[k / 3] * x[k] * x[k]).sum::<f64>().sqrt();
            for tolerance in [1e-2, 2e-3] {
                let settings = Implicit { tolerance: Some(tolerance), ..Implicit::default() };
                let (x, solve) = case.run(&gpu, &mut Minimiser::new(kernel, settings));
                let error = size(&(&x - &solution)) / size(&solution);
                println!("{kernel:?} {stiff_pa:e} Pa, {tolerance:e}: {solve:?}, off by {error:e}");
                assert!(solve.converged && solve.residual <= tolerance);
                // The cycle leaves what follows a stiff body to conjugate gradients, and so does the estimate.
                let most = if stiff_pa > 1e9 { 3.0 } else { 2.0 };
                assert!(error <= most * tolerance, "off by {error:e}, and takes it for {:e}", solve.residual);
                let (again, same) = case.run(&gpu, &mut Minimiser::new(kernel, settings));
                assert!(again == x && same == solve, "twice the same");
            }
        }
    }
}

#[test]
fn rounding_ends_the_loop_and_is_owned_up_to() {
    let gpu = test_gpu();
    let case = Case::new(&gpu, Kernel::Quadratic, 1e8, 0.1);
    let mut minimiser = Minimiser::new(
        Kernel::Quadratic,
        Implicit { method: Method::Hot, tolerance: Some(1e-14), ..Implicit::default() },
    );
    let (x, solve) = case.run(&gpu, &mut minimiser);
    println!("{solve:?}, in f64 {:e}", case.residual(&x));
    assert!(!solve.converged && solve.residual > 1e-14);
    assert!(solve.iterations < 60, "stops where rounding is all that is left");
    assert!(case.residual(&x) < 1e-7);
}

#[test]
fn a_limit_on_iterations_and_a_start_that_is_not_finite() {
    let gpu = test_gpu();
    let case = Case::new(&gpu, Kernel::Quadratic, 1e8, 0.1);
    let mut minimiser =
        Minimiser::new(Kernel::Quadratic, Implicit { method: Method::Hot, max_iterations: 1, ..Implicit::default() });
    let (_, solve) = case.run(&gpu, &mut minimiser);
    assert!(!solve.converged && solve.iterations == 1 && solve.inner_iterations == 1 && solve.levels == 3, "{solve:?}");
    let stride = case.system.stride as usize;
    let far = DVector::from_element(3 * case.sample.rows(), 1e12);
    write_field(&gpu, case.system.get("dv"), stride, &far);
    let solve = minimiser.minimise(&gpu, &case.system, &case.evaluate).unwrap();
    assert!(!solve.converged && solve.residual.is_infinite() && solve.iterations == 0, "{solve:?}");
    let control: Vec<u32> = case.system.memory.read(&gpu, "control", 4).unwrap();
    assert_eq!(control[0], 0);
}
