//! The explicit solver, generic in scalar, kernel and dimension, as stages that tests can call one at a time.

use rayon::prelude::*;

use super::bin;
use super::chunk::{Chunk, LANES, Stencils, matrix, set_matrix};
use super::g2p::{self, Moves};
use super::grid_update::Grid;
use super::p2g;
use super::tile::{self, BLOCK, Node};
use crate::material::Law;
use crate::sim::kernel::Kernel;
use crate::sim::linalg::{det, double_dot, from_row_major, scaled_identity, to_row_major};
use crate::sim::particles::Particles;
use crate::sim::problem::{Axis, Problem, Transfer};
use crate::sim::real::Real;

/// What all particles of a body share.
#[derive(Clone, Copy, Debug)]
pub struct BodySetup<T> {
    pub law: Law<T>,
    /// Of one particle (kg).
    pub mass: T,
    /// Of one particle at rest (m³; 2D: m²).
    pub volume0: T,
}

/// What stays the same during a run, in the solver's scalar.
#[derive(Clone, Debug)]
pub struct Setup<T, const D: usize, const G: usize> {
    pub dx: T,
    pub bodies: Vec<BodySetup<T>>,
    /// Forces by ∇w instead of D⁻¹ (x_i − x_p) w, ∇v likewise.
    pub gradient_form: bool,
    /// Particles carry B.
    pub affine: bool,
    /// Lowest node of a tile, per grid, relative to its block.
    pub lowest: [i32; G],
    /// Cells per axis if periodic.
    pub period: [Option<i32>; D],
}

/// 4 cells an axis that hold particles.
#[derive(Clone, Debug)]
pub struct Block<T, const D: usize> {
    /// Lowest cell / 4.
    pub coordinates: [i32; D],
    pub chunks: std::ops::Range<usize>,
    /// Positions (dx, relative to the block) that are at most a cell outside the walls.
    pub inside: [[T; 2]; D],
}

/// A particle simulation whose stages have the names of the GPU's.
pub struct Solver<T, K, const D: usize, const G: usize, const W: usize> {
    pub(super) setup: Setup<T, D, G>,
    pub(super) problem: Problem,
    pub(super) chunks: Vec<Chunk<T, D>>,
    pub(super) blocks: Vec<Block<T, D>>,
    /// One tile a block, filled by P2G.
    pub(super) tiles: Vec<Node<T>>,
    pub(super) grid: Grid<T, D, G>,
    kernel: std::marker::PhantomData<K>,
}

impl<T: Real, K: Kernel<G, W>, const D: usize, const G: usize, const W: usize> Solver<T, K, D, G, W> {
    pub(super) const TILE: usize = tile::size(D, G, W);

    pub fn new(problem: &Problem) -> Self {
        let bodies = problem.bodies.iter().map(|body| BodySetup {
            law: Law::new(&problem.materials[body.material]),
            mass: T::from_f64(body.mass),
            volume0: T::from_f64(body.volume0),
        });
        let setup = Setup {
            dx: T::from_f64(problem.dx),
            bodies: bodies.collect(),
            gradient_form: problem.transfer != Transfer::Mls,
            affine: problem.transfer != Transfer::Pic,
            lowest: tile::lowest::<K, G, W>(),
            period: std::array::from_fn(|a| {
                matches!(problem.axes[a], Axis::Periodic).then_some(problem.cells[a] as i32)
            }),
        };
        let mut solver = Self {
            setup,
            problem: Problem { particles: Particles::default(), ..problem.clone() },
            chunks: Vec::new(),
            blocks: Vec::new(),
            tiles: Vec::new(),
            grid: Grid::default(),
            kernel: std::marker::PhantomData,
        };
        solver.load(&problem.particles);
        solver
    }

    /// Replaces all particle states, and bins.
    pub fn load(&mut self, particles: &Particles) {
        let (origin, dx, period) = (self.problem.origin, self.problem.dx, self.setup.period);
        let laws: Vec<Law<T>> = self.setup.bodies.iter().map(|b| b.law).collect();
        let home = |i: usize| {
            let x = std::array::from_fn(|a| (particles.x[i][a] - origin[a]) / dx);
            bin::home::<f64, K, D, G, W>(&period, [0; D], x)
        };
        let place = |i: usize| bin::Place { block: bin::pack(home(i).0), id: i as u32, at: i as u32 };
        let places = (0..particles.len()).into_par_iter().map(place).collect();
        self.place(places, &particles.body, |i, chunk, lane| {
            let (_, local) = home(i);
            let f = from_row_major::<f64, 3>(&particles.f[i]);
            for a in 0..D {
                chunk.x[a][lane] = T::from_f64(local[a]);
                chunk.v[a][lane] = T::from_f64(particles.v[i][a]);
            }
            set_matrix(&mut chunk.b, lane, &from_row_major(&particles.b[i].map(|b| b / dx)));
            let state = match laws[particles.body[i] as usize] {
                Law::WeaklyCompressibleFluid(_) => scaled_identity(T::from_f64(det(&f))),
                _ => from_row_major(&particles.f[i]),
            };
            set_matrix(&mut chunk.f, lane, &state);
            chunk.id[lane] = i as u32;
        });
        self.start_frame();
    }

    /// What a frame starts from: particles in order of (block, index), and ∇v of fluids from the affine state, so that
    /// a run continued from a snapshot is the run that was not interrupted.
    pub fn start_frame(&mut self) {
        self.bin();
        let setup = &self.setup;
        self.chunks.par_iter_mut().for_each(|chunk| {
            if !setup.affine || !matches!(setup.bodies[chunk.body as usize].law, Law::WeaklyCompressibleFluid(_)) {
                return;
            }
            let stencils = Stencils::<T, D, G, W>::new::<K>(&chunk.x);
            for l in 0..LANES {
                let c = stencils.times_inverse_moment::<K>(&matrix(&chunk.b, l), l);
                set_matrix(&mut chunk.grad_v, l, &c.map(|row| row.map(|c| c / setup.dx)));
            }
        });
    }

    /// Full particle states in sampling order.
    pub fn particles(&self) -> Particles {
        let count: usize = self.problem.bodies.iter().map(|b| b.particles.len()).sum();
        let mut p = Particles {
            x: vec![[0.0; 3]; count],
            v: vec![[0.0; 3]; count],
            b: vec![[0.0; 9]; count],
            f: vec![[0.0; 9]; count],
            body: vec![0; count],
        };
        for chunk in &self.chunks {
            let corner = self.blocks[chunk.block as usize].coordinates;
            let fluid = matches!(self.setup.bodies[chunk.body as usize].law, Law::WeaklyCompressibleFluid(_));
            for l in 0..chunk.count {
                let id = chunk.id[l] as usize;
                for a in 0..D {
                    let mut x = (BLOCK * corner[a]) as f64 + chunk.x[a][l].to_f64();
                    if let Some(period) = self.setup.period[a] {
                        x = x.rem_euclid(period as f64);
                    }
                    p.x[id][a] = self.problem.origin[a] + self.problem.dx * x;
                    p.v[id][a] = chunk.v[a][l].to_f64();
                }
                p.b[id] = to_row_major(&matrix(&chunk.b, l), 0.0).map(|b| b * self.problem.dx);
                p.f[id] = if fluid {
                    let stretch = chunk.f[0][0][l].to_f64().powf(1.0 / D as f64);
                    to_row_major(&scaled_identity::<f64, D>(stretch), 1.0)
                } else {
                    to_row_major(&matrix(&chunk.f, l), 1.0)
                };
                p.body[id] = chunk.body;
            }
        }
        p
    }

    /// Largest speed (m/s) and largest ‖C‖ (Frobenius, 1/s), C = B D⁻¹, of all particles.
    pub fn fastest(&self) -> (f64, f64) {
        let of_chunk = |chunk: &Chunk<T, D>| {
            let stencils = Stencils::<T, D, G, W>::new::<K>(&chunk.x);
            let (mut speed, mut rate) = (T::ZERO, T::ZERO);
            for l in 0..chunk.count {
                let c = stencils.times_inverse_moment::<K>(&matrix(&chunk.b, l), l);
                rate = rate.max(double_dot(&c, &c));
                speed = speed.max((0..D).map(|a| chunk.v[a][l] * chunk.v[a][l]).sum());
            }
            (speed.to_f64(), rate.to_f64())
        };
        let max = |a: (f64, f64), b: (f64, f64)| (a.0.max(b.0), a.1.max(b.1));
        let (speed, rate) = self.chunks.par_iter().map(of_chunk).reduce(|| (0.0, 0.0), max);
        (speed.sqrt(), rate.sqrt() / self.problem.dx)
    }

    /// Particles → tiles, forces for a step of `dt_s` included.
    pub fn p2g(&mut self, dt_s: f64) {
        let (setup, dt) = (&self.setup, T::from_f64(dt_s));
        let tiles = self.tiles.par_chunks_exact_mut(Self::TILE);
        tiles.zip(&self.blocks).for_each(|(tile, block)| {
            tile.fill([T::ZERO; 4]);
            for chunk in &self.chunks[block.chunks.clone()] {
                p2g::scatter::<T, K, D, G, W>(setup, chunk, dt, tile);
            }
        });
    }

    /// Tiles → node velocities at the end of a step of `dt_s` that starts at `time_s`.
    pub fn grid_update(&mut self, dt_s: f64, time_s: f64) {
        let shift = K::SHIFT;
        self.grid.update(&self.problem, &self.tiles, shift, dt_s, time_s);
    }

    /// Node velocities → particles; the last step of a frame.
    pub fn g2p(&mut self, dt_s: f64) -> Moves<T> {
        self.move_particles(dt_s, false)
    }

    /// [`Self::g2p`] and the next step's [`Self::p2g`] while a block's particles are in cache. If particles strayed from
    /// their tiles, these are not usable: bin, then P2G.
    pub fn g2p2g(&mut self, dt_s: f64) -> Moves<T> {
        self.move_particles(dt_s, true)
    }

    fn move_particles(&mut self, dt_s: f64, then_p2g: bool) -> Moves<T> {
        let (setup, grid, dt) = (&self.setup, &self.grid, T::from_f64(dt_s));
        let mut rest = self.chunks.as_mut_slice();
        let mut work = Vec::with_capacity(self.blocks.len());
        for (block, tile) in self.blocks.iter().zip(self.tiles.chunks_exact_mut(Self::TILE)) {
            let (chunks, after) = rest.split_at_mut(block.chunks.len());
            rest = after;
            work.push((block, chunks, tile));
        }
        work.into_par_iter()
            .enumerate()
            .map_init(
                || vec![[T::ZERO; 4]; Self::TILE],
                |velocities, (index, (block, chunks, tile))| {
                    grid.load_tile(index, velocities);
                    let mut moves = Moves::default();
                    tile.fill([T::ZERO; 4]);
                    for chunk in chunks {
                        let moved = g2p::gather::<T, K, D, G, W>(setup, chunk, dt, velocities, &block.inside);
                        moves = moves.and(moved);
                        if then_p2g && !(moves.strayed || moves.diverged) {
                            p2g::scatter::<T, K, D, G, W>(setup, chunk, dt, tile);
                        }
                    }
                    moves
                },
            )
            .reduce(Moves::default, Moves::and)
    }
}
