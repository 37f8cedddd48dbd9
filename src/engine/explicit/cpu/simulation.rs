//! The explicit simulation, generic in scalar and dimension, as stages that tests can call one at a time.

use rayon::prelude::*;

use super::bin::{self, Place};
use super::chunk::{Chunk, LANES, MatrixLanes, State, matrix};
use super::constants::{BodySetup, Constants, Relaxation};
use super::fill::{self, Around, WallRoom};
use super::flow;
use super::g2p::{self, Moves};
use super::grid_update::{Gathered, Grid, Tiles};
use super::interpolation::{Interpolation, interpolation};
use super::narrow::Narrow;
use super::p2g;
use super::sides;
use super::tile::{BLOCK, Node};
use super::touch::{self as touching, Contacts, Taken};
use gridfall_core::material::{Damping, Law};
use gridfall_core::maths::linalg::{double_dot, scaled_identity, to_row_major};
use gridfall_core::maths::real::Real;
use gridfall_core::sim::pair;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::reaction::{self, Reaction};
use gridfall_core::sim::setup::{Axis, Setup};
use gridfall_core::sim::side;
use gridfall_core::sim::surface;
use gridfall_core::sim::timestep::{Extremes, demands_at_rest_1_s2};
use gridfall_core::sim::touch::{self, Springs, Touch};
use gridfall_core::sim::volume;

/// 4 cells an axis that hold particles.
#[derive(Clone, Debug)]
pub struct Block<T, const D: usize> {
    /// Of its particles, see [`pair`] and [`side`].
    pub field: u32,
    /// Lowest cell / 4.
    pub coordinates: [i32; D],
    pub chunks: Vec<Chunk<T, D>>,
    /// Positions (dx, relative to the block) that are at most a cell outside the walls.
    pub inside: [[T; 2]; D],
    /// Where the planes of sticky walls are (dx, relative to the block); beyond all positions where
    /// there is none.
    pub planes: [[T; 2]; D],
    /// Where walls cut the block's nodes.
    pub walls: Option<Box<WallRoom<T, D>>>,
}

/// A particle simulation whose stages have the names of the GPU's.
pub struct Simulation<T, const D: usize> {
    pub(super) constants: Constants<T, D>,
    pub(super) setup: Setup,
    interpolation: Box<dyn Interpolation<T, D>>,
    pub(super) blocks: Vec<Block<T, D>>,
    /// One tile a block, filled by P2G.
    pub(super) tiles: Vec<Node<T>>,
    /// Rest volumes at the nodes of the tiles, over dx^d; empty unless materials differ.
    pub(super) volumes: Vec<T>,
    pub(super) grid: Grid<T, D>,
    /// Of contact at the particles, by body; empty where colliders act on nodes.
    pub(super) springs: Vec<Springs>,
    /// What colliders have taken since the last grid update from particles that they stopped.
    pub(super) stopped: Vec<Reaction>,
    /// What they take by the springs in the last transfer to the grid.
    pub(super) pressed: Vec<Reaction>,
    /// Time that particles have reached (s).
    pub(super) time_s: f64,
}

impl<T: Real, const D: usize> Simulation<T, D> {
    pub fn new(setup: &Setup, particles: Particles) -> Self {
        let fields = pair::fields(setup);
        let bodies = setup.bodies.iter().zip(demands_at_rest_1_s2(setup)).zip(&fields);
        let bodies = bodies.map(|((body, demand), &field)| BodySetup {
            law: Law::new(&setup.materials[body.material]),
            damping: Damping::of(&setup.materials[body.material]),
            mass: T::from_f64(body.mass),
            volume0: T::from_f64(body.volume0),
            demand: T::from_f64(demand),
            cells: T::from_f64(body.volume0 / setup.dx.powi(D as i32)),
            relaxation: Relaxation::of(setup, body),
            field: field as u32,
        });
        let bodies: Vec<BodySetup<T>> = bodies.collect();
        let follows = bodies.iter().any(|body| body.relaxation.is_some());
        let interpolation = interpolation(setup.kernel);
        let periodic = |a: usize| matches!(setup.axes[a], Axis::Periodic).then_some(setup.cells[a] as i32);
        let constants = Constants {
            dx: T::from_f64(setup.dx),
            bodies,
            transfer: setup.transfer,
            layout: interpolation.layout(),
            period: std::array::from_fn(periodic),
            follows,
            mixed: follows && volume::is_mixed(setup),
            sided: side::acts(setup),
        };
        let springs = if touch::acts(setup) {
            setup.bodies.iter().map(|body| Springs::of(setup, body)).collect()
        } else {
            Vec::new()
        };
        let mut simulation = Self {
            constants,
            setup: setup.clone(),
            interpolation,
            blocks: Vec::new(),
            tiles: Vec::new(),
            volumes: Vec::new(),
            grid: Grid::default(),
            springs,
            stopped: vec![Reaction::default(); reaction::surfaces(setup)],
            pressed: vec![Reaction::default(); reaction::surfaces(setup)],
            time_s: 0.0,
        };
        simulation.load(particles);
        simulation
    }

    /// Replaces all particle states, and bins. What `particles` holds is given up piece by piece,
    /// as soon as it is stored in the simulation's scalar: at no time are there two copies.
    pub fn load(&mut self, mut particles: Particles) {
        touch::begin(&self.setup, &mut particles, self.time_s);
        let (origin, dx) = (self.setup.origin, self.setup.dx);
        let (cell, period) = (self.constants.layout.cell, self.constants.period);
        self.clear();
        let home = |x: &[f64; 3]| {
            let x = std::array::from_fn(|a| (x[a] - origin[a]) / dx);
            bin::home::<f64, D>(cell, &period, [0; D], x)
        };
        let place = |(i, (x, body)): (usize, (&[f64; 3], &u32))| {
            let field = self.constants.bodies[*body as usize].field;
            Place { block: bin::pack(field, home(x).0), id: i as u32, at: i as u32 }
        };
        let places = particles.x.par_iter().zip(&particles.body).enumerate().map(place).collect();
        let mut states = Narrow::<T, D>::new(particles, &self.constants, |x| home(x).1, dx);
        let body = std::mem::take(&mut states.body);
        self.place(places, &body, states, Narrow::write, |_, _| {});
        self.start_frame();
    }

    /// What a frame starts from: particles in order of (block, index), and ∇v that acts in stresses from the affine
    /// state, so that a run continued from a snapshot is the run that was not interrupted.
    pub fn start_frame(&mut self) {
        self.sort();
        let (constants, interpolation) = (&self.constants, &self.interpolation);
        self.blocks.par_iter_mut().flat_map_iter(|block| &mut block.chunks).for_each(|chunk| {
            if chunk.state.grad_v().is_some() {
                let rates = interpolation.affine_rates(constants, chunk);
                chunk.state.grad_v().into_iter().for_each(|grad_v| *grad_v = rates);
            }
        });
    }

    /// Particles that there are.
    pub fn count(&self) -> usize {
        self.blocks.iter().flat_map(|block| &block.chunks).map(|chunk| chunk.count).sum()
    }

    /// Full states of the particles `ids`, in sampling order.
    pub fn particles(&self, ids: std::ops::Range<usize>) -> Particles {
        let count = ids.len();
        let mut p = Particles {
            x: vec![[0.0; 3]; count],
            v: vec![[0.0; 3]; count],
            b: vec![[0.0; 9]; count],
            f: vec![[0.0; 9]; count],
            plastic: vec![0.0; count],
            body: vec![0; count],
            touch: self.springs.first().map_or(Vec::new(), |springs| vec![Touch::new(springs); count]),
        };
        for block in &self.blocks {
            for chunk in &block.chunks {
                for l in (0..chunk.count).filter(|&l| ids.contains(&(chunk.id[l] as usize))) {
                    self.read(block, chunk, l, &mut p, chunk.id[l] as usize - ids.start);
                }
            }
        }
        p
    }

    /// Writes the state of a lane to entry `to` of `p`.
    fn read(&self, block: &Block<T, D>, chunk: &Chunk<T, D>, l: usize, p: &mut Particles, to: usize) {
        for a in 0..D {
            let mut x = (BLOCK * block.coordinates[a]) as f64 + chunk.x[a][l].to_f64();
            if let Some(period) = self.constants.period[a] {
                x = x.rem_euclid(period as f64);
            }
            p.x[to][a] = self.setup.origin[a] + self.setup.dx * x;
            p.v[to][a] = chunk.v[a][l].to_f64();
        }
        p.b[to] = to_row_major(&matrix(&chunk.b, l), 0.0).map(|b| b * self.setup.dx);
        (p.f[to], p.plastic[to]) = match &chunk.state {
            State::Solid { f, plastic, .. } => (to_row_major(&matrix(f, l), 1.0), plastic[l].to_f64()),
            State::Fluid { j, .. } => {
                let stretch = j[l].to_f64().powf(1.0 / D as f64);
                (to_row_major(&scaled_identity::<f64, D>(stretch), 1.0), 0.0)
            }
        };
        if let Some(touches) = &chunk.touch {
            p.touch[to] = touches[l];
        }
        p.body[to] = chunk.body;
    }

    /// What the particles ask of the coming steps; C = B D⁻¹.
    pub fn extremes(&self) -> Extremes {
        let reach = T::from_f64((D as f64).sqrt() * self.setup.dx);
        let of_chunk = |chunk: &Chunk<T, D>| {
            let rates = self.interpolation.affine_rates(&self.constants, chunk);
            let body = &self.constants.bodies[chunk.body as usize];
            let mut scratch = rates;
            let demand = body.demand * p2g::stress(&body.law, chunk, &mut scratch).max(T::ONE);
            let (mut speed, mut rate, mut node) = (T::ZERO, T::ZERO, T::ZERO);
            for l in 0..chunk.count {
                let c = matrix(&rates, l);
                let (cc, vv) = (double_dot(&c, &c), (0..D).map(|a| chunk.v[a][l] * chunk.v[a][l]).sum::<T>());
                (rate, speed) = (rate.max(cc), speed.max(vv));
                node = node.max(vv.sqrt() + reach * cc.sqrt());
            }
            [speed, rate, node, demand].map(T::to_f64)
        };
        let max = |a: [f64; 4], b: [f64; 4]| std::array::from_fn(|k| a[k].max(b[k]));
        let [speed, rate, node_speed_m_s, demand_1_s2] =
            self.blocks.par_iter().flat_map_iter(|block| &block.chunks).map(of_chunk).reduce(|| [0.0; 4], max);
        Extremes { speed_m_s: speed.sqrt(), affine_rate_1_s: rate.sqrt(), node_speed_m_s, demand_1_s2 }
    }

    /// Particles → tiles, forces for a step of `dt_s` included.
    pub fn p2g(&mut self, dt_s: f64) {
        self.step_blocks(0.0, dt_s, Passes { g2p: false, p2g: true, resets: false });
    }

    /// Tiles → node velocities at the end of a step of `dt_s` that starts at `time_s`; the impulses that surfaces take.
    ///
    /// The particles then move for `move_s` (s), or not at all.
    pub fn grid_update(&mut self, dt_s: f64, time_s: f64, move_s: f64) -> Vec<Reaction> {
        self.time_s = time_s;
        let tiles = Tiles { nodes: &self.tiles, volumes: &self.volumes };
        let mut impulses = self.grid.update(&self.setup, &self.constants, &tiles, dt_s, time_s, move_s);
        for taken in [&mut self.stopped, &mut self.pressed] {
            reaction::add_all(&mut impulses, taken);
            taken.fill(Reaction::default());
        }
        impulses
    }

    /// Node velocities → particles; the last step of a frame, which resets particles that are alone.
    pub fn g2p(&mut self, dt_s: f64) -> Moves<T> {
        self.step_blocks(dt_s, 0.0, Passes { g2p: true, p2g: false, resets: true })
    }

    /// [`Self::g2p`] at the end of a part of a frame, which resets nothing.
    pub fn end_part(&mut self, dt_s: f64) -> Moves<T> {
        self.step_blocks(dt_s, 0.0, Passes { g2p: true, p2g: false, resets: false })
    }

    /// [`Self::g2p`] and the next step's [`Self::p2g`], with forces for `next_s`, while a block's
    /// particles are in cache. If particles strayed from their tiles, these are not usable: bin,
    /// then P2G.
    pub fn g2p2g(&mut self, dt_s: f64, next_s: f64) -> Moves<T> {
        self.step_blocks(dt_s, next_s, Passes { g2p: true, p2g: true, resets: false })
    }

    fn step_blocks(&mut self, dt_s: f64, next_s: f64, passes: Passes) -> Moves<T> {
        let Passes { g2p, p2g, resets } = passes;
        let (constants, interpolation, grid) = (&self.constants, &*self.interpolation, &self.grid);
        let [dt, next] = [dt_s, next_s].map(T::from_f64);
        let tile_size = constants.layout.tile(D);
        let accompanied =
            if constants.sided && resets { sides::accompanied(&self.blocks, &constants.period) } else { Vec::new() };
        let mut volumes = self.volumes.chunks_exact_mut(tile_size);
        let tiles = self.blocks.iter_mut().zip(self.tiles.chunks_exact_mut(tile_size));
        let (setup, springs, touches) = (&self.setup, &self.springs, !self.springs.is_empty());
        let surfaces = surface::there_after(setup, self.time_s + dt_s, dt_s);
        let work: Vec<BlockWork<T, D>> = tiles.map(|(block, tile)| (block, tile, volumes.next())).collect();
        // One thread a block; a block's particles go to its own tile.
        let step = |gathered: &mut Gathered<T>, (index, work): (usize, BlockWork<T, D>)| {
            let (block, tile, mut volumes) = work;
            if g2p {
                grid.load_tile(index, gathered);
            }
            if p2g {
                tile.fill([T::ZERO; 4]);
                if let Some(volumes) = &mut volumes {
                    volumes.fill(T::ZERO);
                }
            }
            let asked = resets && !accompanied.get(index).is_some_and(|&accompanied| accompanied);
            let velocities = &gathered.velocities;
            let (room, filled) = (gathered.room(), gathered.filled());
            let around = Around { walls: block.walls.as_deref(), room, filled };
            let mut fill = fill::nothing();
            let contacts = Contacts::of(setup, springs, &surfaces, &block.coordinates);
            let [mut stopped, mut pressed] = [Taken::default(), Taken::default()];
            let mut moves = Moves::default();
            let mut scratch: MatrixLanes<T, D> = block.chunks[0].b;
            for chunk in &mut block.chunks {
                let body = &constants.bodies[chunk.body as usize];
                let mut flowed = None;
                if g2p {
                    let alone = asked.then(|| interpolation.isolated(constants, chunk, velocities));
                    interpolation.gather(constants, chunk, velocities, &around, &mut scratch, &mut fill);
                    let from = chunk.x;
                    moves =
                        moves.and(g2p::advance(constants, chunk, dt, &scratch, &fill, &block.inside, &block.planes));
                    match &contacts {
                        Some(contacts) if dt_s > 0.0 => {
                            contacts.follow(chunk, &from, body.mass.to_f64(), dt_s, &mut stopped);
                        }
                        None if touches => touching::release(springs, chunk),
                        _ => {}
                    }
                    if body.law.is_principal() {
                        flowed = Some(flow::flow(&body.law, chunk, &mut scratch));
                    }
                    if let Some(alone) = alone.filter(|alone| alone.contains(&true)) {
                        interpolation.reset(constants, chunk, &alone);
                        moves.isolated += alone.iter().filter(|&&alone| alone).count() as u64;
                    }
                }
                if p2g && !(moves.strayed || moves.diverged) {
                    let stiffening = flowed.unwrap_or_else(|| p2g::stress(&body.law, chunk, &mut scratch));
                    moves.demand = moves.demand.max(body.demand * stiffening);
                    if let Some(damping) = &body.damping {
                        p2g::damp(damping, chunk, &mut scratch);
                    }
                    let mut pushed = None;
                    if let Some(contacts) = &contacts {
                        contacts.press(chunk, next_s, pushed.insert([[T::ZERO; LANES]; D]), &mut pressed);
                    }
                    interpolation.scatter(constants, chunk, next, &scratch, pushed.as_ref(), tile);
                    if let Some(volumes) = &mut volumes {
                        interpolation.scatter_volume(constants, chunk, volumes);
                    }
                }
            }
            (moves, stopped, pressed)
        };
        let done: Vec<(Moves<T>, Taken, Taken)> =
            work.into_par_iter().enumerate().map_init(|| Gathered::new(tile_size), step).collect();
        self.time_s += dt_s;
        // A transfer that is done again replaces what springs had given.
        self.pressed.fill(Reaction::default());
        // In the order of blocks: sums are the same for any number of threads.
        done.into_iter().fold(Moves::default(), |moves, (block, stopped, pressed)| {
            stopped.add_to(&mut self.stopped);
            pressed.add_to(&mut self.pressed);
            moves.and(block)
        })
    }
}

/// What a pass over the blocks does.
#[derive(Clone, Copy, Debug)]
struct Passes {
    g2p: bool,
    p2g: bool,
    /// Whether particles that are alone are reset.
    resets: bool,
}

/// A block, its tile, and the rest volumes at the tile's nodes.
type BlockWork<'a, T, const D: usize> = (&'a mut Block<T, D>, &'a mut [Node<T>], Option<&'a mut [T]>);
