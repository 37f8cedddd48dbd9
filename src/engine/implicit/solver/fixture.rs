//! A small elastic problem that the solvers are tested with: jittered neo-Hookean particles in an
//! irregular body, soft on one side and stiff on the other, with a few sliding nodes.

use std::collections::BTreeMap;

use nalgebra::DMatrix;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::hierarchy::block_key;
use super::objective::{Freedom, LinearOperator, NodeId, NodeVectors, Objective, Splitting};
use super::sparse::Bsr;
use gridfall_core::maths::linalg::{
    Matrix, Vector, add_scaled, apply, cofactor, det, identity, mul, mul_transpose, trace, transpose,
};

/// Nodes with weight and gradient.
type Touched<const D: usize> = Vec<(NodeId<D>, f64, Vector<f64, D>)>;
/// A particle's nodes with the gradients of their weights.
type Stencil<const D: usize> = Vec<(usize, Vector<f64, D>)>;

pub struct Body<const D: usize> {
    nodes: Vec<NodeId<D>>,
    freedoms: Vec<Freedom<D>>,
    masses: Vec<f64>,
    scales: Vec<f64>,
    particles: Vec<Particle<D>>,
    period: [Option<i32>; D],
    dt_s: f64,
}

struct Particle<const D: usize> {
    x: Vector<f64, D>,
    volume: f64,
    mu: f64,
    lambda: f64,
    f: Matrix<f64, D>,
    stencil: Stencil<D>,
}

/// What a body is made of.
#[derive(Clone, Copy)]
pub struct Recipe<const D: usize> {
    pub cells: [i32; D],
    /// Young's moduli at the low and high end of the first axis.
    pub youngs: [f64; 2],
    /// Two grids, shifted as the compact kernel's.
    pub dual: bool,
    pub sliding: bool,
    pub period: [Option<i32>; D],
    pub seed: u64,
}

const DX: f64 = 0.02;
const DENSITY: f64 = 2000.0;

/// Quadratic B-spline and its slope, in cells.
fn spline(u: f64) -> (f64, f64) {
    let a = u.abs();
    if a < 0.5 {
        (0.75 - a * a, -2.0 * u)
    } else if a < 1.5 {
        (0.5 * (1.5 - a).powi(2), (a - 1.5) * u.signum())
    } else {
        (0.0, 0.0)
    }
}

/// Nodes within a quadratic kernel of width `scale` dx around x (cells) on every grid, with weight
/// and gradient; two grids share the gradient.
fn stencil<const D: usize>(x: &Vector<f64, D>, scale: f64, dual: bool, period: [Option<i32>; D]) -> Touched<D> {
    let shifts: &[f64] = if dual { &[0.25, -0.25] } else { &[0.0] };
    let mut nodes = Vec::new();
    for (grid, shift) in shifts.iter().enumerate() {
        let base: [i32; D] = std::array::from_fn(|a| (x[a] / scale - shift - 0.5).floor() as i32);
        for k in 0..3usize.pow(D as u32) {
            let mut index = [0; D];
            let mut axis = [(0.0, 0.0); D];
            for a in 0..D {
                index[a] = base[a] + (k / 3usize.pow(a as u32) % 3) as i32;
                axis[a] = spline(x[a] / scale - shift - index[a] as f64);
                index[a] = period[a].map_or(index[a], |n| index[a].rem_euclid(n / scale as i32));
            }
            let weight = axis.iter().map(|w| w.0).product();
            let product = |a: usize| (0..D).map(|b| if a == b { axis[b].1 } else { axis[b].0 }).product::<f64>();
            let gradient = std::array::from_fn(|a| product(a) / (scale * DX) / shifts.len() as f64);
            nodes.push((NodeId { grid: grid as u8, index }, weight, gradient));
        }
    }
    nodes
}

impl<const D: usize> Body<D> {
    pub fn new(recipe: Recipe<D>) -> Self {
        println!("seed {}", recipe.seed);
        let mut rng = ChaCha8Rng::seed_from_u64(recipe.seed);
        let period = recipe.period;
        let volume = (0.5 * DX).powi(D as i32);
        let mut particles = Vec::new();
        let mut stencils = Vec::new();
        let steps: usize = recipe.cells.iter().map(|&n| 2 * n as usize).product();
        for k in 0..steps {
            let mut rest = k;
            let x: Vector<f64, D> = std::array::from_fn(|a| {
                let place = rest % (2 * recipe.cells[a] as usize);
                rest /= 2 * recipe.cells[a] as usize;
                (place as f64 + rng.random_range(0.2..0.8)) / 2.0
            });
            // A notch, so that the outline is irregular.
            let part: [f64; D] = std::array::from_fn(|a| x[a] / recipe.cells[a] as f64);
            if part[0] > 0.3 && part[0] < 0.5 && part[D - 1] > 0.5 && period == [None; D] {
                continue;
            }
            let young = if part[0] < 0.5 { recipe.youngs[0] } else { recipe.youngs[1] };
            let poisson = 0.3;
            let f = std::array::from_fn(|a| {
                std::array::from_fn(|b| if a == b { 1.0 } else { 0.0 } + rng.random_range(-0.004..0.004))
            });
            let (mu, lambda) =
                (young / (2.0 + 2.0 * poisson), young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)));
            particles.push(Particle { x, volume, mu, lambda, f, stencil: Vec::new() });
            stencils.push(stencil(&x, 1.0, recipe.dual, period));
        }
        let mut ids: Vec<NodeId<D>> = stencils.iter().flatten().map(|(id, ..)| *id).collect();
        ids.sort_by_key(block_key);
        ids.dedup();
        let number: BTreeMap<NodeId<D>, usize> = ids.iter().enumerate().map(|(i, id)| (*id, i)).collect();
        let (mut masses, mut scales) = (vec![0.0; ids.len()], vec![0.0; ids.len()]);
        let dt_s = 1.0 / 48.0;
        for (particle, stencil) in particles.iter_mut().zip(&stencils) {
            let modulus = particle.lambda + 2.0 * particle.mu;
            for (id, weight, gradient) in stencil {
                let i = number[id];
                masses[i] += weight * volume * DENSITY;
                scales[i] += weight * volume * DENSITY * modulus;
                particle.stencil.push((i, *gradient));
            }
        }
        (0..ids.len()).for_each(|i| scales[i] *= 24.0 * DX * DX * dt_s / masses[i]);
        let freedom = |id: &NodeId<D>| match (recipe.sliding, id.index[D - 1], id.index[0]) {
            (true, ..=2, ..=1) => Freedom::Line(unit([0.0, 1.0, 0.0])),
            (true, ..=2, ..=8) => Freedom::Plane(unit([0.0, 0.0, 1.0])),
            (true, ..=2, 9..=11) => Freedom::Plane(unit([0.6, 0.0, 0.8])),
            _ => Freedom::Free,
        };
        let freedoms = ids.iter().map(freedom).collect();
        Self { nodes: ids, freedoms, masses, scales, particles, period, dt_s }
    }

    fn deformation(&self, particle: &Particle<D>, dv: &NodeVectors<D>) -> Matrix<f64, D> {
        let mut growth = identity();
        for (i, gradient) in &particle.stencil {
            for a in 0..D {
                for b in 0..D {
                    growth[a][b] += self.dt_s * dv[*i][a] * gradient[b];
                }
            }
        }
        mul(&growth, &particle.f)
    }

    /// ∂P/∂F of a particle, its negative eigenvalues set to zero.
    fn derivative(&self, particle: &Particle<D>, dv: &NodeVectors<D>) -> DMatrix<f64> {
        let f = self.deformation(particle, dv);
        let (cofactor, j) = (cofactor(&f), det(&f));
        let inverse_transpose = cofactor.map(|row| row.map(|x| x / j));
        let derivative = DMatrix::from_fn(D * D, D * D, |r, c| {
            let mut df = [[0.0; D]; D];
            df[c / D][c % D] = 1.0;
            let inner = mul(&inverse_transpose, &mul(&transpose(&df), &inverse_transpose));
            let rate = trace(&mul(&transpose(&inverse_transpose), &df));
            let mut dp = df.map(|row| row.map(|x| particle.mu * x));
            dp = add_scaled(&dp, particle.mu - particle.lambda * j.ln(), &inner);
            dp = add_scaled(&dp, particle.lambda * rate, &inverse_transpose);
            dp[r / D][r % D]
        });
        let mut eigen = (0.5 * (&derivative + derivative.transpose())).symmetric_eigen();
        eigen.eigenvalues.apply(|value| *value = value.max(0.0));
        eigen.recompose()
    }

    fn assemble(
        &self,
        stencils: &[Stencil<D>],
        masses: &[f64],
        freedoms: &[Freedom<D>],
        dv: &NodeVectors<D>,
    ) -> Bsr<f64, D> {
        let mut rows: Vec<BTreeMap<u32, Matrix<f64, D>>> = vec![BTreeMap::new(); masses.len()];
        for (i, row) in rows.iter_mut().enumerate() {
            row.insert(i as u32, identity::<f64, D>().map(|row| row.map(|x| x * masses[i])));
        }
        for (particle, stencil) in self.particles.iter().zip(stencils) {
            let derivative = self.derivative(particle, dv);
            let factor = self.dt_s * self.dt_s * particle.volume * self.copies();
            let along: Vec<Vector<f64, D>> = stencil.iter().map(|(_, g)| apply(&transpose(&particle.f), g)).collect();
            for ((i, _), u) in stencil.iter().zip(&along) {
                // u · ∂P/∂F, by component of the row and entry of the column's dF.
                let half: [Matrix<f64, D>; D] = std::array::from_fn(|a| {
                    let entry =
                        |b: usize, l: usize| (0..D).map(|k| u[k] * derivative[(D * a + k, D * b + l)]).sum::<f64>();
                    std::array::from_fn(|b| std::array::from_fn(|l| factor * entry(b, l)))
                });
                for ((j, _), v) in stencil.iter().zip(&along) {
                    let block = rows[*i].entry(*j as u32).or_insert([[0.0; D]; D]);
                    for (a, b) in (0..D * D).map(|ab| (ab / D, ab % D)) {
                        block[a][b] += (0..D).map(|l| half[a][b][l] * v[l]).sum::<f64>();
                    }
                }
            }
        }
        let projections: Vec<_> = freedoms.iter().map(|freedom| freedom.projection()).collect();
        let mut matrix = Bsr { row_start: vec![0], columns: Vec::new(), blocks: Vec::new() };
        for (i, row) in rows.into_iter().enumerate() {
            for (j, block) in row {
                let mut projected = block;
                if let Some(s) = &projections[i] {
                    projected = mul(s, &projected);
                }
                if let Some(s) = &projections[j as usize] {
                    projected = mul(&projected, s);
                }
                if let (Some(s), true) = (&projections[i], i == j as usize) {
                    let fill = add_scaled(&identity(), -1.0, s);
                    projected = add_scaled(&projected, trace(&block) / D as f64, &fill);
                }
                matrix.columns.push(j);
                matrix.blocks.push(projected);
            }
            matrix.row_start.push(matrix.columns.len());
        }
        matrix
    }

    /// 2 with two grids, which both carry full mass and force.
    fn copies(&self) -> f64 {
        if self.nodes.iter().any(|id| id.grid == 1) { 2.0 } else { 1.0 }
    }
}

/// The first components; of the last axis's the third, so that a normal stays one in 2D.
fn unit<const D: usize>(v: [f64; 3]) -> Vector<f64, D> {
    if D == 2 && v[1] == 0.0 {
        return std::array::from_fn(|a| v[2 * a]);
    }
    if D == 2 {
        return std::array::from_fn(|a| [1.0, 0.0][a]);
    }
    std::array::from_fn(|a| v[a])
}

impl<const D: usize> Objective<D> for Body<D> {
    fn nodes(&self) -> &[NodeId<D>] {
        &self.nodes
    }

    fn freedoms(&self) -> &[Freedom<D>] {
        &self.freedoms
    }

    fn period(&self) -> [Option<i32>; D] {
        self.period
    }

    fn masses(&self) -> &[f64] {
        &self.masses
    }

    fn scales(&self) -> &[f64] {
        &self.scales
    }

    fn start(&self) -> NodeVectors<D> {
        vec![[0.0; D]; self.nodes.len()]
    }

    /// Small deformations: nothing turns.
    fn tangent(&self, dv: &NodeVectors<D>, _elastic: bool) -> Bsr<f64, D> {
        self.hessian(dv)
    }

    fn least_change(&self) -> f64 {
        0.0
    }

    fn energy(&self, dv: &NodeVectors<D>) -> f64 {
        let mut gradient = dv.clone();
        self.energy_and_gradient(dv, &mut gradient)
    }

    fn energy_and_gradient(&self, dv: &NodeVectors<D>, gradient: &mut NodeVectors<D>) -> f64 {
        let mut energy = 0.0;
        for i in 0..dv.len() {
            gradient[i] = dv[i].map(|v| self.masses[i] * v);
            energy += 0.5 * self.masses[i] * dv[i].iter().map(|v| v * v).sum::<f64>();
        }
        for particle in &self.particles {
            let f = self.deformation(particle, dv);
            let j = det(&f);
            if j <= 0.0 {
                return f64::INFINITY;
            }
            let inverse_transpose = cofactor(&f).map(|row| row.map(|x| x / j));
            let mut p = f.map(|row| row.map(|x| particle.mu * x));
            p = add_scaled(&p, particle.lambda * j.ln() - particle.mu, &inverse_transpose);
            let square: f64 = f.iter().flatten().map(|x| x * x).sum();
            let density =
                0.5 * particle.mu * (square - D as f64) - particle.mu * j.ln() + 0.5 * particle.lambda * j.ln().powi(2);
            let factor = particle.volume * self.copies();
            energy += factor * density;
            let pushed = mul_transpose(&p, &particle.f);
            for (i, g) in &particle.stencil {
                let force = apply(&pushed, g);
                (0..D).for_each(|a| gradient[*i][a] += self.dt_s * factor * force[a]);
            }
        }
        for (g, freedom) in gradient.iter_mut().zip(&self.freedoms) {
            if let Some(s) = freedom.projection() {
                *g = apply(&s, g);
            }
        }
        energy
    }

    fn hessian(&self, dv: &NodeVectors<D>) -> Bsr<f64, D> {
        let stencils: Vec<_> = self.particles.iter().map(|particle| particle.stencil.clone()).collect();
        self.assemble(&stencils, &self.masses, &self.freedoms, dv)
    }

    fn linearised<'a>(&'a self, dv: &NodeVectors<D>) -> Box<dyn LinearOperator<D> + 'a> {
        Box::new(self.hessian(dv))
    }

    fn coarse_hessian(&self, dv: &NodeVectors<D>, level: u32) -> (Vec<NodeId<D>>, Bsr<f64, D>) {
        let dual = self.copies() > 1.0;
        let scale = (1 << level) as f64;
        let stencils: Vec<_> = self.particles.iter().map(|p| stencil(&p.x, scale, dual, self.period)).collect();
        let mut ids: Vec<NodeId<D>> = stencils.iter().flatten().map(|(id, ..)| *id).collect();
        ids.sort_by_key(block_key);
        ids.dedup();
        let number: BTreeMap<NodeId<D>, usize> = ids.iter().enumerate().map(|(i, id)| (*id, i)).collect();
        let mut masses = vec![0.0; ids.len()];
        let numbered = |(stencil, particle): (&Touched<D>, &Particle<D>)| {
            stencil
                .iter()
                .map(|(id, weight, gradient)| {
                    masses[number[id]] += weight * particle.volume * DENSITY;
                    (number[id], *gradient)
                })
                .collect()
        };
        let stencils: Vec<Stencil<D>> = stencils.iter().zip(&self.particles).map(numbered).collect();
        let freedoms = vec![Freedom::Free; ids.len()];
        let matrix = self.assemble(&stencils, &masses, &freedoms, dv);
        (ids, matrix)
    }

    fn splitting<'a>(&'a self) -> Box<dyn Splitting<D> + 'a> {
        panic!("alternating directions are tested with a potential, which has laws")
    }
}
