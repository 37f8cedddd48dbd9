//! Every operator of the V-cycle against dense f64 matrices, with planted errors, for both kernels,
//! with sliding nodes and around a period.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Matrix3, SymmetricEigen};
use rand::{SeedableRng, rngs::StdRng};

use super::coarse;
use super::hierarchy::{Hierarchy, prolong, residual, restrict};
use super::level::Level;
use super::problem_tests::{KERNELS, Sample, distance, prolongation, random, read_field, scene, write_field};
use super::smoother;
use crate::gpu::device::test_gpu;
use crate::gpu::memory::SLOT;
use crate::gpu::program::{Dispatches, Programs, Tools};
use crate::gpu::{Gpu, Variant};
use crate::implicit::gpu::interface::{NO_NODE, System, slots};
use crate::implicit::solver::objective::NodeId;
use gridfall_core::sim::settings::{Implicit, Smoother};

/// Rounding of sums of a hundred blocks in f32, the largest being much larger than the sum: some
/// hundred units of 6e-8.
const ROUNDING: f64 = 1e-5;

fn ids(gpu: &Gpu, level: &Level) -> Vec<NodeId<3>> {
    let raw: Vec<[i32; 4]> = level.memory.read(gpu, "ids", level.shape.rows as usize).unwrap();
    raw.iter().map(|&[x, y, z, grid]| NodeId { grid: grid as u8, index: [x, y, z] }).collect()
}

/// A level's matrix as the device applies it: rows have the sums that it knows.
fn matrix(gpu: &Gpu, system: &System, level: &Level) -> DMatrix<f64> {
    let (n, stride) = (level.shape.rows as usize, level.shape.stride as usize);
    let anchors: Vec<f32> = level.memory.read(gpu, "anchors", 10 * stride).unwrap();
    let mut dense = blocks(gpu, system, level);
    for (i, a, c) in (0..n).flat_map(|i| (0..9).map(move |k| (i, k / 3, k % 3))) {
        let (sum, follows) = ((0..n).map(|j| dense[(3 * i + a, 3 * j + c)]).sum::<f64>(), anchors[9 * stride + i]);
        dense[(3 * i + a, 3 * follows as usize + c)] += f64::from(anchors[(3 * a + c) * stride + i]) - sum;
    }
    dense
}

/// A level's blocks.
fn blocks(gpu: &Gpu, system: &System, level: &Level) -> DMatrix<f64> {
    let (n, stride) = (level.shape.rows as usize, level.shape.stride as usize);
    let slots = slots(system.kernel) as usize;
    let columns: Vec<u32> = level.memory.read(gpu, "columns", slots * stride).unwrap();
    let values: Vec<f32> = level.memory.read(gpu, "values", 9 * slots * stride).unwrap();
    let mut dense = DMatrix::zeros(3 * n, 3 * n);
    for (row, slot) in (0..n).flat_map(|row| (0..slots).map(move |slot| (row, slot))) {
        let column = columns[slot * stride + row];
        for (a, c) in (0..3).flat_map(|a| (0..3).map(move |c| (a, c))) {
            let value = values[(slot * 9 + 3 * a + c) * stride + row];
            if column == NO_NODE {
                assert_eq!(value, 0.0, "no neighbour, no block");
            } else {
                dense[(3 * row + a, 3 * column as usize + c)] += f64::from(value);
            }
        }
    }
    dense
}

/// Largest difference of entries over the largest entry.
fn off(a: &DMatrix<f64>, b: &DMatrix<f64>) -> f64 {
    let d = (a - b).amax() / b.amax();
    if d.is_nan() { f64::INFINITY } else { d }
}

/// A hierarchy with its matrices, and dense twins: matrices as the device has them, and
/// prolongations with S.
struct Twin {
    system: System,
    hierarchy: Hierarchy,
    matrices: Vec<DMatrix<f64>>,
    prolongations: Vec<DMatrix<f64>>,
}

fn twin(tools: Tools, sample: &Sample, settings: &Implicit) -> Twin {
    let system = sample.upload(tools.gpu);
    let hierarchy = Hierarchy::new(tools, &system, settings, None).unwrap();
    hierarchy.matrices.submit(tools.gpu).unwrap();
    hierarchy.invert_coarsest(tools.gpu).unwrap();
    let levels = &hierarchy.levels;
    let matrices = levels.iter().map(|level| matrix(tools.gpu, &system, level)).collect();
    let mut prolongations: Vec<DMatrix<f64>> = Vec::new();
    for (l, pair) in levels.windows(2).enumerate() {
        let [fine, coarse] = [&pair[0], &pair[1]].map(|level| ids(tools.gpu, level));
        let mut p = prolongation(&fine, &coarse, pair[0].shape.period, pair[1].shape.factor);
        assert!(p.column_iter().all(|column| column.amax() > 0.0), "coarse nodes exist only where they are hit");
        assert!((0..p.nrows()).all(|i| p.row(i).sum() == 1.0), "all parents are there");
        if l == 0 {
            for (i, s) in sample.projections().iter().enumerate() {
                let rows = s * p.rows(3 * i, 3);
                p.rows_mut(3 * i, 3).copy_from(&rows);
            }
        }
        prolongations.push(p);
    }
    Twin { system, hierarchy, matrices, prolongations }
}

/// The finest matrix without what was added in directions that nodes cannot move in.
fn uncompleted(sample: &Sample) -> DMatrix<f64> {
    let mut a = sample.dense_matrix();
    for (i, s) in sample.projections().iter().enumerate() {
        let block = s * a.fixed_view::<3, 3>(3 * i, 3 * i) * s;
        a.fixed_view_mut::<3, 3>(3 * i, 3 * i).copy_from(&block);
    }
    a
}

fn each_case(check: impl Fn(Tools, &Sample, &mut StdRng)) {
    let seed = 4207;
    println!("seed {seed}");
    let gpu = test_gpu();
    for kernel in KERNELS {
        let programs = Programs::new(Variant::of_kernel(kernel));
        for periodic in [false, true] {
            let sample = Sample::new(&scene(kernel, periodic, 1e8));
            println!("{kernel:?}, periodic {periodic}: {} nodes", sample.rows());
            check(Tools { gpu: &gpu, programs: &programs }, &sample, &mut StdRng::seed_from_u64(seed));
        }
    }
}

#[test]
fn coarse_matrices_are_galerkin_products() {
    each_case(|tools, sample, _| {
        let t = twin(tools, sample, &Implicit::default());
        assert_eq!(t.hierarchy.levels.len(), 3);
        // Eight cells around are halved once, four stay.
        let factors = [1, 2].map(|l| t.hierarchy.levels[l].shape.factor);
        assert_eq!(factors, [[2; 3], [2, if sample.period[1].is_some() { 1 } else { 2 }, 2]]);
        let columns: Vec<u32> =
            t.system.memory.read(tools.gpu, "columns", t.system.get("columns").size() as usize / 4).unwrap();
        assert_eq!(t.hierarchy.nonzeros as usize, columns.iter().filter(|&&c| c != NO_NODE).count());
        let mut operator = uncompleted(sample);
        for (l, p) in t.prolongations.iter().enumerate() {
            let rows = p.row_sum().len() / 3;
            let found = &t.matrices[l + 1];
            let galerkin = p.transpose() * &operator * p;
            // Completed blocks apart.
            let mut expected = galerkin.clone();
            let mut completed = 0;
            for j in 0..rows {
                let block = |m: &DMatrix<f64>| -> Matrix3<f64> { m.fixed_view::<3, 3>(3 * j, 3 * j).into() };
                let eigen = SymmetricEigen::new(block(&expected));
                let largest = eigen.eigenvalues.max();
                let lacking = (0..3).filter(|&k| eigen.eigenvalues[k] < 1e-6 * largest);
                for k in lacking {
                    completed += 1;
                    let v = eigen.eigenvectors.column(k);
                    let sum = block(&expected) + largest * v * v.transpose();
                    expected.fixed_view_mut::<3, 3>(3 * j, 3 * j).copy_from(&sum);
                }
            }
            println!("level {}: {rows} nodes, {completed} directions completed", l + 1);
            assert!(off(found, &expected) < ROUNDING, "level {} off by {:e}", l + 1, off(found, &expected));
            // Planted: weights of one node that are off by a hundredth.
            let mut wrong = p.clone();
            let mut column = wrong.column_mut(galerkin.diagonal().imax());
            column *= 1.01;
            let wrong = wrong.transpose() * &operator * wrong;
            assert!(off(found, &wrong) > ROUNDING, "not noticed");
            operator = galerkin;
        }
    });
}

#[test]
fn inverse_diagonals_and_spectra() {
    each_case(|tools, sample, rng| {
        let t = twin(tools, sample, &Implicit::default());
        for (level, a) in t.hierarchy.levels.iter().zip(&t.matrices) {
            let n = level.shape.rows as usize;
            let own = blocks(tools.gpu, &t.system, level);
            let mut scaled = a.clone();
            for (i, d) in inverses(tools.gpu, level).into_iter().enumerate() {
                let block: Matrix3<f64> = own.fixed_view::<3, 3>(3 * i, 3 * i).into();
                let error = (d * block - Matrix3::identity()).amax();
                let eigen = block.symmetric_eigenvalues();
                // f32 knows a block to a rounding of its largest entry.
                assert!(error < 4e-6 * eigen.max() / eigen.min(), "D⁻¹D off by {error:e}");
                let rows = d * a.rows(3 * i, 3);
                scaled.rows_mut(3 * i, 3).copy_from(&rows);
            }
            if level.shape.degree == 0 {
                continue;
            }
            // Power iteration, from below.
            let mut x = random(3 * n, rng);
            let mut largest: f64 = 0.0;
            for _ in 0..100 {
                let y = &scaled * &x;
                // The quotient of D⁻¹A in the inner product of A.
                largest = largest.max(y.dot(&(a * &x)) / x.dot(&(a * &x)));
                x = y.normalize();
            }
            let coefficients: Vec<[f32; 4]> = level.memory.read(tools.gpu, "coefficients", 1).unwrap();
            let ratio = f64::from(coefficients[0][2]) / largest;
            println!("λ {largest}, found {ratio} of it");
            assert!(ratio > 1.0 && ratio < 1.2, "{ratio}");
        }
    });
}

/// D⁻¹ by node, as the device has it.
fn inverses(gpu: &Gpu, level: &Level) -> Vec<Matrix3<f64>> {
    let (n, stride) = (level.shape.rows as usize, level.shape.stride as usize);
    let values: Vec<f32> = level.memory.read(gpu, "inverse", 6 * stride).unwrap();
    let inverse = |i: usize| {
        let at = |k: usize| f64::from(values[k * stride + i]);
        Matrix3::new(at(0), at(1), at(2), at(1), at(3), at(4), at(2), at(4), at(5))
    };
    (0..n).map(inverse).collect()
}

/// The polynomial in f64: x after `steps` steps from `x`, with the level's coefficients.
fn chebyshev(tools: Tools, level: &Level, a: &DMatrix<f64>, b: &DVector<f64>, x: &DVector<f64>) -> DVector<f64> {
    let (n, inverse) = (level.shape.rows as usize, inverses(tools.gpu, level));
    let words: Vec<[f32; 4]> = level.memory.read(tools.gpu, "coefficients", (SLOT / 16) as usize * 64).unwrap();
    let (lambda, range) = (f64::from(words[0][2]), f64::from(level.shape.range));
    let (theta, delta) = (0.5 * lambda * (1.0 + 1.0 / range), 0.5 * lambda * (1.0 - 1.0 / range));
    let (mut x, mut d, mut rho) = (x.clone(), DVector::zeros(3 * n), delta / theta);
    for k in 0..level.shape.degree {
        let r = b - a * &x;
        let mut z = r.clone();
        for (i, d) in inverse.iter().enumerate() {
            z.rows_mut(3 * i, 3).copy_from(&(d * r.rows(3 * i, 3)));
        }
        if k == 0 {
            d = z / theta;
        } else {
            let next = 1.0 / (2.0 * theta / delta - rho);
            d = next * rho * d + 2.0 * next / delta * z;
            rho = next;
        }
        x += &d;
    }
    x
}

#[test]
fn products_transfers_and_smoothers() {
    each_case(|tools, sample, rng| {
        let gpu = tools.gpu;
        let t = twin(tools, sample, &Implicit::default());
        let levels = &t.hierarchy.levels;
        for (l, pair) in levels.windows(2).enumerate() {
            let (fine, coarse) = (&pair[0], &pair[1]);
            let (n, stride) = (fine.shape.rows as usize, fine.shape.stride as usize);
            let (m, coarse_stride) = (coarse.shape.rows as usize, coarse.shape.stride as usize);
            let (a, p) = (&t.matrices[l], &t.prolongations[l]);
            let [b, x] = [random(3 * n, rng), random(3 * n, rng)];
            write_field(gpu, fine.get("b"), stride, &b);
            write_field(gpu, fine.x(0), stride, &x);
            let mut list = Dispatches::default();
            residual(&mut list, tools, fine, 0);
            restrict(&mut list, tools, &t.system, [fine, coarse]);
            list.submit(gpu).unwrap();
            let r = read_field(gpu, fine.get("r"), stride, n);
            let off = (&r - (&b - a * &x)).amax() / (a.amax() * x.amax());
            assert!(off < ROUNDING, "product off by {off:e}");
            let restricted = read_field(gpu, coarse.get("b"), coarse_stride, m);
            assert!(distance(&restricted, &(p.transpose() * &r)) < ROUNDING, "restriction");

            let e = random(3 * m, rng);
            write_field(gpu, coarse.x(0), coarse_stride, &e);
            let mut list = Dispatches::default();
            prolong(&mut list, tools, &t.system, [fine, coarse], [0, 0]);
            list.submit(gpu).unwrap();
            // S of a coarse node that lacks directions is left to the smoother there.
            let corrected = read_field(gpu, fine.x(0), stride, n);
            assert!(distance(&corrected, &(&x + p * &e)) < ROUNDING, "prolongation");
            assert!(distance(&corrected, &(&x + 1.001 * p * &e)) > ROUNDING, "not noticed");

            write_field(gpu, fine.x(0), stride, &x);
            let mut list = Dispatches::default();
            let at = smoother::chebyshev(&mut list, tools, fine, 0, 0..fine.shape.degree);
            list.submit(gpu).unwrap();
            let smoothed = read_field(gpu, fine.x(at), stride, n);
            let expected = chebyshev(tools, fine, a, &b, &x);
            let error = (&smoothed - &expected).amax() / expected.amax();
            assert!(error < 10.0 * ROUNDING, "smoother off by {error:e}");
        }
        let (coarsest, a) = (levels.last().unwrap(), t.matrices.last().unwrap());
        let (n, stride) = (coarsest.shape.rows as usize, coarsest.shape.stride as usize);
        let b = random(3 * n, rng);
        write_field(gpu, coarsest.get("b"), stride, &b);
        let mut list = Dispatches::default();
        coarse::solve(&mut list, tools, coarsest, &t.hierarchy.memory);
        list.submit(gpu).unwrap();
        let symmetric = 0.5 * (a + a.transpose());
        let expected = symmetric.cholesky().expect("positive").solve(&b);
        let found = read_field(gpu, coarsest.x(0), stride, n);
        let error = distance(&found, &expected);
        println!("coarse solve off by {error:e}");
        assert!(error < 10.0 * ROUNDING, "coarse solve off by {error:e}");
        assert!(distance(&found, &(1.001 * expected)) > 10.0 * ROUNDING, "not noticed");
    });
}

/// A stiff body that moves as a whole holds nothing, on any level, though its blocks are rounded.
#[test]
fn what_moves_as_a_whole_has_inertia_alone() {
    let gpu = test_gpu();
    for kernel in KERNELS {
        let programs = Programs::new(Variant::of_kernel(kernel));
        let tools = Tools { gpu: &gpu, programs: &programs };
        let sample = Sample::new(&scene(kernel, false, 1e10));
        let t = twin(tools, &sample, &Implicit::default());
        // Along the walls.
        let along = |n: usize| DVector::from_fn(3 * n, |k, _| if k % 3 == 0 { 1.0 } else { 0.0 });
        let mut momentum = DVector::from_fn(3 * sample.rows(), |k, _| along(1)[k % 3] * sample.masses[k / 3]);
        for (l, level) in t.hierarchy.levels.iter().enumerate() {
            let (n, stride) = (level.shape.rows as usize, level.shape.stride as usize);
            write_field(&gpu, level.get("b"), stride, &DVector::zeros(3 * n));
            write_field(&gpu, level.x(0), stride, &along(n));
            let mut list = Dispatches::default();
            residual(&mut list, tools, level, 0);
            list.submit(&gpu).unwrap();
            let found = -read_field(&gpu, level.get("r"), stride, n);
            let (error, rounded) =
                (distance(&found, &momentum), distance(&(blocks(&gpu, &t.system, level) * along(n)), &momentum));
            println!("{kernel:?}, level {l}: off by {error:e}; by {rounded:e} with blocks alone");
            assert!(error < ROUNDING, "off by {error:e}");
            assert!(rounded > ROUNDING, "not noticed");
            momentum = match t.prolongations.get(l) {
                Some(p) => p.transpose() * &momentum,
                None => break,
            };
        }
    }
}

/// Nodes by colour: those of one do not share a block of the matrix.
fn by_colour(gpu: &Gpu, level: &Level) -> Vec<Vec<usize>> {
    let (fine, apart) = if level.shape.grids == 2 { (2, 4) } else { (1, 3) };
    let counts = level.shape.period.map(|cells| match fine * cells {
        0 => apart,
        around => (apart..=around).find(|n| around % n == 0).unwrap(),
    });
    let mut colours: BTreeMap<[i32; 3], Vec<usize>> = BTreeMap::new();
    for (i, id) in ids(gpu, level).into_iter().enumerate() {
        let colour = [0, 1, 2].map(|a| (fine * id.index[a] - i32::from(id.grid)).rem_euclid(counts[a]));
        colours.entry(colour).or_default().push(i);
    }
    colours.into_values().collect()
}

#[test]
fn sweeps_are_gauss_seidels() {
    each_case(|tools, sample, rng| {
        let gpu = tools.gpu;
        let sweeps = smoother::Smoothing { kind: Smoother::GaussSeidel };
        let t = twin(tools, sample, &Implicit { smoother: sweeps.kind, ..Implicit::default() });
        for (level, a) in t.hierarchy.levels.iter().zip(&t.matrices) {
            let (n, stride) = (level.shape.rows as usize, level.shape.stride as usize);
            let [b, x] = [random(3 * n, rng), random(3 * n, rng)];
            write_field(gpu, level.get("b"), stride, &b);
            write_field(gpu, level.x(0), stride, &x);
            let mut list = Dispatches::default();
            let at = sweeps.smooth(&mut list, tools, level, 0, false).unwrap();
            list.submit(gpu).unwrap();
            let found = read_field(gpu, level.x(at), stride, n);
            let inverse = inverses(gpu, level);
            let swept = |order: &mut dyn Iterator<Item = &usize>| {
                let mut x = x.clone();
                for &i in order {
                    let step = inverse[i] * (b.rows(3 * i, 3) - a.rows(3 * i, 3) * &x);
                    let mut own = x.rows_mut(3 * i, 3);
                    own += step;
                }
                x
            };
            let there: Vec<usize> = by_colour(gpu, level).concat();
            let error = distance(&found, &swept(&mut there.iter().chain(there.iter().rev())));
            println!("{n} nodes, sweeps off by {error:e}");
            assert!(error < 10.0 * ROUNDING, "sweeps off by {error:e}");
            // Planted: back first.
            let wrong = distance(&found, &swept(&mut there.iter().rev().chain(&there)));
            assert!(wrong > 10.0 * ROUNDING, "not noticed");
        }
    });
}

#[test]
fn the_v_cycle_is_symmetric_positive_and_contracts() {
    for smoother in [Smoother::Chebyshev, Smoother::GaussSeidel] {
        each_case(|tools, sample, rng| {
            let gpu = tools.gpu;
            let t = twin(tools, sample, &Implicit { smoother, ..Implicit::default() });
            let (n, stride) = (sample.rows(), t.system.stride as usize);
            let finest = &t.hierarchy.levels[0];
            let cycle = |b: &DVector<f64>| {
                write_field(gpu, finest.get("b"), stride, b);
                t.hierarchy.cycle.submit(gpu).unwrap();
                read_field(gpu, finest.x(t.hierarchy.result), stride, n)
            };
            for _ in 0..3 {
                let [x, y] = [random(3 * n, rng), random(3 * n, rng)];
                let (mx, my) = (cycle(&x), cycle(&y));
                let skew = (y.dot(&mx) - x.dot(&my)).abs() / (x.dot(&mx) * y.dot(&my)).sqrt();
                assert!(x.dot(&mx) > 0.0 && y.dot(&my) > 0.0 && skew < 1e-4, "skew {skew:e}");
                assert_eq!(cycle(&x), mx, "twice the same");
            }
            // Richardson's iteration with it: the energy norm of the error falls fast.
            let solution = random(3 * n, rng);
            let a = &t.matrices[0];
            let energy = |e: &DVector<f64>| e.dot(&(a * e)).sqrt();
            let mut x = DVector::zeros(3 * n);
            let before = energy(&solution);
            for _ in 0..5 {
                let r = a * (&solution - &x);
                x += cycle(&r);
            }
            let factor = (energy(&(&solution - &x)) / before).powf(0.2);
            println!("{smoother:?}: error falls by {factor:.3} a cycle");
            assert!(factor < 0.6, "{factor}");
        });
    }
}
