//! Grid update: sum the tiles, let bodies meet that have nodes of their own ([`super::pairs`]),
//! v_i = p_i / m_i + dt g, then walls axis by axis, then colliders in scene order.
//!
//! In: tiles (forces are already in their momenta). Out: node velocities, and what surfaces took.
//! One thread per grid block; a node's sum runs over the tiles in the order of their blocks, a
//! surface's sum over its blocks in their order.

use rayon::prelude::*;

use super::constants::Constants;
use super::pairs::Fields;
use super::sides::{self, Layers};
use super::simulation::Block;
use super::tables::{ROW, Run, Tables};
use super::tile::{BLOCK, Layout, MASS, Node, position};
use super::walls::Walls;
use gridfall_core::maths::real::Real;
use gridfall_core::sim::collider::{NORMAL_STEP_DX, Placed};
use gridfall_core::sim::contact::respond;
use gridfall_core::sim::pair;
use gridfall_core::sim::reaction::{self, Reaction};
use gridfall_core::sim::setup::{Contact, ContactAt, Setup};
use gridfall_core::sim::side::Plates;

/// Node velocities on sparse blocks of 4^D nodes.
#[derive(Clone, Debug, Default)]
pub struct Grid<T, const D: usize> {
    pub(super) tables: Tables<D>,
    /// With the mass as last component.
    velocities: Vec<Node<T>>,
    /// Share of each node's room outside colliders; empty without any, and if no particle asks.
    room: Vec<T>,
    /// Rest volume at each node over dx^d; empty unless materials differ.
    filled: Vec<T>,
    /// Masses and momenta after bodies have met; empty if none has nodes of its own.
    met: Vec<Node<T>>,
    /// Whether each node lies beyond a plate for its layer; empty where particles have no sides.
    beyond: Vec<bool>,
}

/// What P2G has summed by tiles.
pub struct Tiles<'a, T> {
    pub nodes: &'a [Node<T>],
    /// Rest volumes over dx^d; empty unless materials differ.
    pub volumes: &'a [T],
}

/// What G2P reads at the nodes of a tile.
pub struct Gathered<T> {
    pub velocities: Vec<Node<T>>,
    /// Empty if nothing is known of them.
    room: Vec<T>,
    filled: Vec<T>,
    /// Whether a collider takes room from a node.
    cut: bool,
}

impl<T: Real> Gathered<T> {
    pub fn new(nodes: usize) -> Self {
        Self { velocities: vec![[T::ZERO; 4]; nodes], room: Vec::new(), filled: Vec::new(), cut: false }
    }

    /// Share of each node's room outside colliders, if any has less than all.
    pub fn room(&self) -> Option<&[T]> {
        self.cut.then_some(&self.room)
    }

    /// Rest volume at each node over dx^d, if it is known.
    pub fn filled(&self) -> Option<&[T]> {
        (!self.filled.is_empty()).then_some(&self.filled)
    }
}

/// A node as tests see it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeState {
    /// Of the bodies whose node it is, see [`gridfall_core::sim::pair`].
    pub field: u32,
    pub grid: usize,
    /// Node i of grid s lies at (i + s/4) dx; z is 0 in 2D.
    pub index: [i32; 3],
    /// kg.
    pub mass: f64,
    /// Forces of the coming step included, contact not (kg·m/s).
    pub momentum: [f64; 3],
    /// After the last grid update (m/s).
    pub velocity: [f64; 3],
}

impl<T: Real, const D: usize> Grid<T, D> {
    /// The nodes that the tiles of `blocks` reach.
    pub fn new(blocks: &[Block<T, D>], layout: &Layout, period: &[Option<i32>; D]) -> Self {
        let corners: Vec<(u32, [i32; D])> = blocks.iter().map(|b| (b.field, b.coordinates)).collect();
        let tables = Tables::new(&corners, layout, period);
        let velocities = vec![[T::ZERO; 4]; tables.nodes()];
        Self { tables, velocities, room: Vec::new(), filled: Vec::new(), met: Vec::new(), beyond: Vec::new() }
    }

    /// Copies what G2P reads at a tile's nodes.
    pub fn load_tile(&self, tile: usize, into: &mut Gathered<T>) {
        let slots = self.tables.tile(tile);
        for (node, &slot) in into.velocities.iter_mut().zip(slots) {
            *node = self.velocities[slot as usize];
        }
        for (from, to) in [(&self.room, &mut into.room), (&self.filled, &mut into.filled)] {
            to.clear();
            if !from.is_empty() {
                to.extend(slots.iter().map(|&slot| from[slot as usize]));
            }
        }
        into.cut = into.room.iter().any(|&share| share < T::ONE);
    }

    #[inline(always)]
    fn sum(&self, node: usize, tiles: &[Node<T>]) -> Node<T> {
        let mut total = [T::ZERO; 4];
        for entry in self.tables.entries(node) {
            let part = &tiles[entry];
            for c in 0..4 {
                total[c] += part[c];
            }
        }
        total
    }

    /// [`Self::sum`] of the nodes of a row.
    #[inline(always)]
    fn sums(&self, row: usize, tiles: &[Node<T>]) -> [Node<T>; ROW] {
        let mut total = [[T::ZERO; 4]; ROW];
        for &Run { entry, at, count } in self.tables.runs(row) {
            let parts = &tiles[entry as usize..entry as usize + count as usize];
            // Places that are known here stay in registers.
            for k in 0..ROW {
                if let Some(part) = parts.get(k.wrapping_sub(at as usize)) {
                    for c in 0..4 {
                        total[k][c] += part[c];
                    }
                }
            }
        }
        total
    }

    fn volume(&self, node: usize, volumes: &[T]) -> T {
        self.tables.entries(node).map(|entry| volumes[entry]).sum()
    }

    /// Mass of a node and its velocity before contact. None for a mass that is not a normal number:
    /// the velocity would be noise, and such a node adds nothing to its particles.
    #[inline(always)]
    pub(super) fn free(&self, slot: usize, tiles: &[Node<T>], fall: &[T; D]) -> Option<(T, [T; D])> {
        let node = if self.met.is_empty() { self.sum(slot, tiles) } else { self.met[slot] };
        Self::fallen(node, fall)
    }

    #[inline(always)]
    fn fallen(node: Node<T>, fall: &[T; D]) -> Option<(T, [T; D])> {
        (node[MASS] >= T::TINY).then(|| (node[MASS], std::array::from_fn(|a| node[a] / node[MASS] + fall[a])))
    }

    /// Updates the velocities; the impulses that surfaces take.
    pub fn update(
        &mut self,
        setup: &Setup,
        constants: &Constants<T, D>,
        tiles: &Tiles<T>,
        dt_s: f64,
        time_s: f64,
        move_s: f64,
    ) -> Vec<Reaction> {
        let Constants { layout, follows, .. } = constants;
        let fall: [T; D] = std::array::from_fn(|a| T::from_f64(dt_s * setup.gravity[a]));
        let present = setup.colliders.iter().zip(reaction::WALLS..).filter(|(c, _)| c.is_present(time_s));
        let present: Vec<Surface> = present
            .map(|(c, index)| Surface {
                index,
                contact: c.contact,
                grip: c.grip,
                holds: c.grip || setup.contact_at == ContactAt::Nodes,
                collider: c.over(time_s, move_s),
            })
            .collect();
        let mut velocities = std::mem::take(&mut self.velocities);
        let nodes = self.tables.block_nodes();
        self.filled.clear();
        if !tiles.volumes.is_empty() {
            self.filled =
                (0..self.tables.nodes()).into_par_iter().map(|node| self.volume(node, tiles.volumes)).collect();
        }
        if pair::is_parted(setup) {
            let sums = (0..self.tables.nodes()).into_par_iter().map(|node| self.sum(node, tiles.nodes)).collect();
            let volumes = std::mem::take(&mut self.filled);
            let full = pair::full_nodes(setup).into_iter().map(T::from_f64).collect();
            let fields = Fields { setup, constants, tables: &self.tables, nodes: sums, full, volumes };
            (self.met, self.filled) = fields.meet();
        } else if constants.sided {
            let nodes = (0..self.tables.nodes()).into_par_iter().map(|node| self.sum(node, tiles.nodes)).collect();
            if self.beyond.is_empty() || !Plates::are_still(setup) {
                self.beyond = sides::beyond(setup, constants, &self.tables, time_s);
            }
            let volumes = std::mem::take(&mut self.filled);
            let layers = Layers { tables: &self.tables, beyond: &self.beyond, nodes, volumes };
            (self.met, self.filled) = layers.join();
        }
        let mut room = std::mem::take(&mut self.room);
        let asked = *follows && !present.is_empty();
        room.resize(if asked { self.tables.nodes() } else { 0 }, T::ONE);
        let walls = Walls { setup, grid: self, tiles: tiles.nodes, fall };
        let mut rooms = room.chunks_exact_mut(nodes);
        let blocks = velocities.chunks_exact_mut(nodes).zip(&self.tables.blocks).map(|(v, c)| (v, c, rooms.next()));
        let blocks: Vec<_> = blocks.collect();
        let taken: Vec<Taken> = blocks
            .into_par_iter()
            .enumerate()
            .map(|(index, (block, (field, corner), mut room))| {
                let near = near(setup, &present, corner, *follows);
                let mut taken = Taken { setup, sums: Vec::new() };
                if let Some(room) = &mut room {
                    room.fill(T::ONE);
                }
                let met = walls.met(corner);
                let places = ROW.pow(D as u32);
                let mut row = [[T::ZERO; 4]; ROW];
                for (local, velocity) in block.iter_mut().enumerate() {
                    *velocity = [T::ZERO; 4];
                    let slot = index * nodes + local;
                    if local % ROW == 0 {
                        row = match self.met.get(slot..slot + ROW).and_then(|met| met.first_chunk()) {
                            Some(met) => *met,
                            None => self.sums(slot / ROW, tiles.nodes),
                        };
                    }
                    let free = Self::fallen(row[local % ROW], &fall);
                    if near.is_empty() && met >> (local % places) & 1 == 0 {
                        if let Some((mass, v)) = free {
                            velocity[..D].copy_from_slice(&v);
                            velocity[MASS] = mass;
                        }
                        continue;
                    }
                    let (g, i) = Tables::node(corner, local);
                    let at = At { node: i, shift: layout.shift[g], mass: free.map_or(T::ZERO, |(mass, _)| mass) };
                    if let (Some(room), false) = (&mut room, near.is_empty()) {
                        let x = position(setup, i, at.shift);
                        let beyond = self.beyond.get(slot).is_some_and(|&beyond| beyond);
                        room[local] = T::from_f64(free_share(&near, layout, setup.dx, x, beyond));
                    }
                    let Some((mass, v)) = free else { continue };
                    let v = walls.respond(D, (*field, g), i, mass, v, &mut |wall, from, to| {
                        taken.take(wall, mass, from, to, [0.0; 3]);
                    });
                    let v = near
                        .iter()
                        .filter(|surface| surface.holds)
                        .fold(v, |v, surface| collide(setup, surface, v, &at, &mut taken));
                    velocity[..D].copy_from_slice(&v);
                    velocity[MASS] = mass;
                }
                taken
            })
            .collect();
        self.velocities = velocities;
        self.room = room;
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
                let (field, corner) = self.tables.blocks[slot / block_nodes];
                let (grid, i) = Tables::node(&corner, slot % block_nodes);
                let (mut index, mut momentum, mut velocity) = ([0; 3], [0.0; 3], [0.0; 3]);
                for a in 0..D {
                    index[a] = i[a];
                    momentum[a] = sum[a].to_f64();
                    velocity[a] = self.velocities[slot][a].to_f64();
                }
                nodes.push(NodeState { field, grid, index, mass: sum[MASS].to_f64(), momentum, velocity });
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

/// A collider at the step's time, with its place among all surfaces.
struct Surface<'a> {
    index: usize,
    contact: Contact,
    grip: bool,
    /// Whether it acts on nodes.
    holds: bool,
    collider: Placed<'a>,
}

/// Colliders that may reach a node of the block, or its room if that is asked for. A distance changes by at most the
/// distance moved (and a slack of sampled shapes), so that the one at the block's middle decides.
fn near<'a, const D: usize>(
    setup: &Setup,
    present: &'a [Surface<'a>],
    corner: &[i32; D],
    room: bool,
) -> Vec<&'a Surface<'a>> {
    let middle = position(setup, corner.map(|c| BLOCK * c + BLOCK / 2), 0.0);
    // Nodes lie within 2¼ cells of the middle on every axis, and have room up to two cells from them.
    let reach = (2.25 * (D as f64).sqrt() + if room { 2.0 } else { 0.0 }) * setup.dx;
    present.iter().filter(|surface| surface.collider.distance(middle) <= reach + surface.collider.slack()).collect()
}

/// Share of a node's room outside colliders, as if their surfaces were planes; of one `beyond` a plate, the nearest
/// collider, of the room before that. Grips take none: they overlap what they hold.
fn free_share(near: &[&Surface], layout: &Layout, dx: f64, x: [f64; 3], beyond: bool) -> f64 {
    let solid = near.iter().filter(|surface| !surface.grip);
    let mut distances: Vec<f64> = solid.map(|surface| surface.collider.distance(x) / dx).collect();
    if let Some(nearest) = distances.iter_mut().min_by(|a, b| a.abs().total_cmp(&b.abs())).filter(|_| beyond) {
        *nearest = -nearest.abs();
    }
    distances.into_iter().map(layout.inside).product()
}

fn collide<T: Real, const D: usize>(
    setup: &Setup,
    Surface { index, contact, collider, .. }: &Surface,
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
