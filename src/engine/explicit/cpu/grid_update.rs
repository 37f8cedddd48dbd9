//! Grid update: sum the tiles, v_i = p_i / m_i + dt g, then walls axis by axis, then colliders in
//! scene order.
//!
//! In: tiles (forces are already in their momenta). Out: node velocities, and what surfaces took.
//! One thread per grid block; a node's sum runs over the tiles in the order of their blocks, a
//! surface's sum over its blocks in their order.

use rayon::prelude::*;

use super::simulation::Block;
use super::tables::Tables;
use super::tile::{BLOCK, Layout, MASS, Node};
use gridfall_core::maths::real::Real;
use gridfall_core::sim::collider::{NORMAL_STEP_DX, Placed};
use gridfall_core::sim::contact::{respond, wall_side};
use gridfall_core::sim::reaction::{self, Reaction};
use gridfall_core::sim::setup::{Axis, Contact, Setup};

/// Node velocities on sparse blocks of 4^D nodes.
#[derive(Clone, Debug, Default)]
pub struct Grid<T, const D: usize> {
    tables: Tables<D>,
    /// With the mass as last component.
    velocities: Vec<Node<T>>,
}

/// A node as tests see it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeState {
    pub grid: usize,
    /// Node i of grid s lies at (i + s/4) dx; z is 0 in 2D.
    pub index: [i32; 3],
    /// kg.
    pub mass: f64,
    /// Forces of the coming step included (kg·m/s).
    pub momentum: [f64; 3],
    /// After the last grid update (m/s).
    pub velocity: [f64; 3],
}

impl<T: Real, const D: usize> Grid<T, D> {
    /// The nodes that the tiles of `blocks` reach.
    pub fn new(blocks: &[Block<T, D>], layout: &Layout, period: &[Option<i32>; D]) -> Self {
        let corners: Vec<[i32; D]> = blocks.iter().map(|b| b.coordinates).collect();
        let tables = Tables::new(&corners, layout, period);
        let velocities = vec![[T::ZERO; 4]; tables.nodes()];
        Self { tables, velocities }
    }

    /// Copies the velocities of a tile's nodes.
    pub fn load_tile(&self, tile: usize, into: &mut [Node<T>]) {
        for (node, &slot) in into.iter_mut().zip(self.tables.tile(tile)) {
            *node = self.velocities[slot as usize];
        }
    }

    #[inline(always)]
    fn sum(&self, node: usize, tiles: &[Node<T>]) -> Node<T> {
        let mut total = [T::ZERO; 4];
        for &entry in self.tables.entries(node) {
            let part = &tiles[entry as usize];
            for c in 0..4 {
                total[c] += part[c];
            }
        }
        total
    }

    /// Updates the velocities; the impulses that surfaces take. `shift`: where node 0 of each grid
    /// lies (dx).
    pub fn update(
        &mut self,
        setup: &Setup,
        tiles: &[Node<T>],
        shift: [f64; 2],
        dt_s: f64,
        time_s: f64,
    ) -> Vec<Reaction> {
        let fall: [T; D] = std::array::from_fn(|a| T::from_f64(dt_s * setup.gravity[a]));
        let present = setup.colliders.iter().zip(reaction::WALLS..).filter(|(c, _)| c.is_present(time_s));
        let present: Vec<Surface> =
            present.map(|(c, index)| Surface { index, contact: c.contact, collider: c.at(time_s) }).collect();
        let mut velocities = std::mem::take(&mut self.velocities);
        let nodes = self.tables.block_nodes();
        let blocks = velocities.par_chunks_exact_mut(nodes).zip(&self.tables.blocks).enumerate();
        let taken: Vec<Taken> = blocks
            .map(|(index, (block, corner))| {
                let near = near(setup, &present, corner);
                let mut taken = Taken { setup, sums: Vec::new() };
                for (local, velocity) in block.iter_mut().enumerate() {
                    let node = self.sum(index * nodes + local, tiles);
                    *velocity = [T::ZERO; 4];
                    // Momentum over a mass that is not a normal number would be noise; such a node
                    // adds nothing to its particles.
                    if node[MASS] < T::TINY {
                        continue;
                    }
                    let v = std::array::from_fn(|a| node[a] / node[MASS] + fall[a]);
                    let (g, i) = Tables::node(corner, local);
                    let at = At { node: i, shift: shift[g], mass: node[MASS] };
                    let v = walls(setup, v, &at, &mut taken);
                    let v = near.iter().fold(v, |v, surface| collide(setup, surface, v, &at, &mut taken));
                    velocity[..D].copy_from_slice(&v);
                    velocity[MASS] = node[MASS];
                }
                taken
            })
            .collect();
        self.velocities = velocities;
        let mut impulses = vec![Reaction::default(); reaction::surfaces(setup)];
        taken.iter().for_each(|taken| reaction::add_all(&mut impulses, &taken.sums));
        // Each grid carries the full mass.
        impulses.iter().map(|sum| sum.times(1.0 / self.tables.grids as f64)).collect()
    }

    /// All nodes with mass.
    pub fn nodes(&self, tiles: &[Node<T>]) -> Vec<NodeState> {
        let mut nodes = Vec::new();
        for slot in 0..self.velocities.len() {
            let sum = self.sum(slot, tiles);
            if sum[MASS] > T::ZERO {
                let block_nodes = self.tables.block_nodes();
                let (grid, i) = Tables::node(&self.tables.blocks[slot / block_nodes], slot % block_nodes);
                let (mut index, mut momentum, mut velocity) = ([0; 3], [0.0; 3], [0.0; 3]);
                for a in 0..D {
                    index[a] = i[a];
                    momentum[a] = sum[a].to_f64();
                    velocity[a] = self.velocities[slot][a].to_f64();
                }
                nodes.push(NodeState { grid, index, mass: sum[MASS].to_f64(), momentum, velocity });
            }
        }
        nodes
    }
}

/// A node that is being updated.
struct At<T, const D: usize> {
    node: [i32; D],
    shift: f64,
    mass: T,
}

/// What surfaces take from the nodes of a block; empty until one takes something.
struct Taken<'a> {
    setup: &'a Setup,
    sums: Vec<Reaction>,
}

impl Taken<'_> {
    /// Books the impulse that changes a node's velocity, at an arm (m) from the surface's centre.
    fn take<T: Real, const D: usize>(&mut self, surface: usize, mass: T, from: &[T; D], to: &[T; D], arm: [f64; 3]) {
        if from == to {
            return;
        }
        self.sums.resize(reaction::surfaces(self.setup), Reaction::default());
        let mut impulse = [0.0; 3];
        for a in 0..D {
            impulse[a] = mass.to_f64() * (from[a].to_f64() - to[a].to_f64());
        }
        self.sums[surface].take(impulse, arm);
    }
}

fn walls<T: Real, const D: usize>(setup: &Setup, mut v: [T; D], at: &At<T, D>, taken: &mut Taken) -> [T; D] {
    for a in 0..D {
        let Axis::Walls(contacts) = &setup.axes[a] else { continue };
        if let Some(side) = wall_side(at.node[a], setup.cells[a] as i32) {
            let mut normal = [T::ZERO; D];
            normal[a] = if side == 0 { T::ONE } else { -T::ONE };
            let after = respond(&contacts[side], &v, &normal, &[T::ZERO; D]);
            taken.take(2 * a + side, at.mass, &v, &after, [0.0; 3]);
            v = after;
        }
    }
    v
}

/// Where a node is (m), in scene coordinates.
fn position<const D: usize>(setup: &Setup, node: [i32; D], shift: f64) -> [f64; 3] {
    let mut x = [0.0; 3];
    for a in 0..D {
        x[a] = setup.origin[a] + (node[a] as f64 + shift) * setup.dx;
    }
    x
}

/// A collider at the step's time, with its place among all surfaces.
struct Surface<'a> {
    index: usize,
    contact: Contact,
    collider: Placed<'a>,
}

/// Colliders that may reach a node of the block. A distance changes by at most the distance moved
/// (and a slack of sampled shapes), so that the one at the block's middle decides.
fn near<'a, const D: usize>(setup: &Setup, present: &'a [Surface<'a>], corner: &[i32; D]) -> Vec<&'a Surface<'a>> {
    let middle = position(setup, corner.map(|c| BLOCK * c + BLOCK / 2), 0.0);
    // Nodes lie within 2¼ cells of the middle on every axis.
    let reach = 2.25 * (D as f64).sqrt() * setup.dx;
    present.iter().filter(|surface| surface.collider.distance(middle) <= reach + surface.collider.slack()).collect()
}

fn collide<T: Real, const D: usize>(
    setup: &Setup,
    Surface { index, contact, collider }: &Surface,
    v: [T; D],
    at: &At<T, D>,
    taken: &mut Taken,
) -> [T; D] {
    let x = position(setup, at.node, at.shift);
    if collider.distance(x) > 0.0 {
        return v;
    }
    let normal = collider.normal(x, NORMAL_STEP_DX * setup.dx);
    let cast = |u: [f64; 3]| std::array::from_fn(|a| T::from_f64(u[a]));
    let after = respond(contact, &v, &cast(normal), &cast(collider.velocity_at(x)));
    let center = collider.motion.center;
    taken.take(*index, at.mass, &v, &after, std::array::from_fn(|a| x[a] - center[a]));
    after
}
