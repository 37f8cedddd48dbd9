//! Bodies that meet at nodes: where two fields have mass, each pair exchanges an impulse, before gravity and
//! surfaces act.
//!
//! All is told by the fields' masses m at the node and in the 5^d nodes around it on its own grid:
//!
//!   s = m over that of a full node,   g = ∇s by central differences
//!   f = |Σ g| / Σ |g| over the 3^d nodes around: 1 on a flat face, less beside edges
//!   n ∝ (f_a^128 + EDGE) g_a/s_a − (f_b^128 + EDGE) g_b/s_b
//!
//! So the flatter face gives the normal: were it that of an edge which slides on a face, the edge would
//! plough. Of two edges that lie on each other, the parts of ∇ ln s along both cancel.
//!
//! A pair is in contact if it approaches along n (Bardenhagen), and if the two together fill the node, each
//! of them with m over the most beside it along n, which is what it has inside (after Nairn's criterion of
//! volume). What it does then is [`pair::impulse`].
//!
//! In: sums of the tiles. Out: the nodes' momenta after contact, and what fills them over all fields.
//! One thread a grid block, that of the lowest field where several are; pairs in the order of fields.

use rayon::prelude::*;

use super::constants::Constants;
use super::tables::Tables;
use super::tile::{Layout, MASS, Node};
use gridfall_core::maths::linalg::{Vector, dot};
use gridfall_core::maths::real::Real;
use gridfall_core::sim::pair::{self, EDGE, FULL, LEAST_ROOM};
use gridfall_core::sim::setup::{Contact, Setup};

/// Nodes that are looked at on each side of a node.
const REACH: i32 = 2;
const WINDOW: usize = 2 * REACH as usize + 1;

/// Nodes of all fields.
pub struct Fields<'a, T, const D: usize> {
    pub setup: &'a Setup,
    pub constants: &'a Constants<T, D>,
    pub tables: &'a Tables<D>,
    pub nodes: Vec<Node<T>>,
    /// Mass of a full node of each field (kg).
    pub full: Vec<T>,
    /// Rest volumes over dx^d; empty if nobody asks.
    pub volumes: Vec<T>,
}

/// What contact makes of a node: its momentum, and what fills it over all fields.
type Met<T> = (usize, Node<T>, T);

impl<T: Real, const D: usize> Fields<'_, T, D> {
    /// The nodes after contact, and what fills them over all fields.
    pub fn meet(mut self) -> (Vec<Node<T>>, Vec<T>) {
        let contacts = pair::contacts(self.setup);
        let blocks = (0..self.tables.blocks.len()).into_par_iter();
        let met: Vec<Vec<Met<T>>> = blocks.map(|block| self.block(block, &contacts)).collect();
        for (slot, node, filled) in met.into_iter().flatten() {
            self.nodes[slot] = node;
            if let Some(volume) = self.volumes.get_mut(slot) {
                *volume = filled;
            }
        }
        (self.nodes, self.volumes)
    }

    /// What contact changes at the nodes of a block and of those of other fields in its place.
    fn block(&self, block: usize, contacts: &[Contact]) -> Vec<Met<T>> {
        let (field, corner) = self.tables.blocks[block];
        let there = |f: usize| self.tables.block(f as u32, corner).map(|block| (f, block));
        let here: Vec<(usize, usize)> = (0..contacts.len()).filter_map(there).collect();
        let mut met = Vec::new();
        if here.len() < 2 || here[0].0 != field as usize {
            return met;
        }
        let size = self.tables.block_nodes();
        for local in 0..size {
            let first = met.len();
            let slots = here.iter().map(|&(_, block)| block * size + local);
            let filled = slots.clone().filter_map(|slot| self.volumes.get(slot)).copied().sum();
            met.extend(slots.map(|slot| (slot, self.nodes[slot], filled)));
            let has_mass = |k: &usize| met[first + k].1[MASS] >= T::TINY;
            let held: Vec<usize> = (0..here.len()).filter(has_mass).collect();
            if held.len() > 1 {
                let (grid, node) = Tables::node(&corner, local);
                let stand_ins = StandIns::new(self.setup, &self.constants.layout, grid, node);
                let face = |&k: &usize| (k, self.face(here[k].0, grid, node, &stand_ins));
                let faces: Vec<_> = held.iter().map(face).collect();
                for (i, (a, face)) in faces.iter().enumerate() {
                    for (b, other) in &faces[i + 1..] {
                        let Some(n) = normal(face, other) else { continue };
                        let contact = pair::between(contacts, here[*a].0, here[*b].0);
                        exchange(&mut met[first..], [*a, *b], &contact, &n);
                    }
                }
            }
        }
        met
    }

    fn mass(&self, field: usize, grid: usize, node: [i32; D]) -> T {
        let wrap = |a: usize| self.constants.period[a].map_or(node[a], |period| node[a].rem_euclid(period));
        let slot = self.tables.slot(field as u32, grid, std::array::from_fn(wrap));
        slot.map_or(T::ZERO, |slot| self.nodes[slot][MASS])
    }

    /// The face of a field at one of its nodes.
    fn face(&self, field: usize, grid: usize, node: [i32; D], stand_ins: &StandIns<D>) -> Face<T, D> {
        let full = self.full[field];
        let share = |offset: [i32; D]| {
            let (mut there, mut scale) = (node, 1.0);
            for a in 0..D {
                let (step, factor) = stand_ins.0[a][(offset[a] + REACH) as usize];
                there[a] += step;
                scale *= factor;
            }
            self.mass(field, grid, there) * T::from_f64(scale) / full
        };
        let window: Vec<T> = around(REACH).map(share).collect();
        let at = |o: [i32; D], a: usize, step: i32| {
            let place = |k: usize| (o[k] + REACH + if k == a { step } else { 0 }) as usize;
            window[(0..D).rev().fold(0, |at, k| at * WINDOW + place(k))]
        };
        let slope = |o: [i32; D]| -> [T; D] { std::array::from_fn(|a| (at(o, a, 1) - at(o, a, -1)) * T::HALF) };
        let (mut sum, mut total) = ([T::ZERO; D], T::ZERO);
        for o in around(1) {
            let g = slope(o);
            total += dot(&g, &g).sqrt();
            sum = std::array::from_fn(|a| sum[a] + g[a]);
        }
        let o = [0; D];
        let here = at(o, 0, 0);
        Face {
            slope: slope(o).map(|g| g / here),
            flat: if total > T::ZERO { dot(&sum, &sum).sqrt() / total } else { T::ZERO },
            filled: std::array::from_fn(|a| here / here.max(at(o, a, -1)).max(at(o, a, 1))),
        }
    }
}

/// All offsets of at most `reach` on each axis, the first axis fastest.
fn around<const D: usize>(reach: i32) -> impl Iterator<Item = [i32; D]> {
    let width = 2 * reach as usize + 1;
    (0..width.pow(D as u32)).map(move |k| std::array::from_fn(|a| (k / width.pow(a as u32) % width) as i32 - reach))
}

/// What the masses of a field say of its surface at a node.
struct Face<T, const D: usize> {
    /// ∇ ln s (1/dx).
    slope: Vector<T, D>,
    flat: T,
    /// The node's mass over the most along each axis.
    filled: [T; D],
}

/// The normal towards the first of two faces, if they touch.
fn normal<T: Real, const D: usize>(a: &Face<T, D>, b: &Face<T, D>) -> Option<Vector<T, D>> {
    let weight = |face: &Face<T, D>| (0..7).fold(face.flat, |f, _| f * f) + T::from_f64(EDGE);
    let (p, q) = (weight(a), weight(b));
    let n: Vector<T, D> = std::array::from_fn(|k| p * a.slope[k] - q * b.slope[k]);
    let size = dot(&n, &n).sqrt();
    let first = |best: usize, k: usize| if n[k].abs() > n[best].abs() { k } else { best };
    let along = (1..D).fold(0, first);
    let touch = a.filled[along] + b.filled[along] >= T::from_f64(FULL);
    (touch && size > T::ZERO).then(|| n.map(|c| c / size))
}

/// The impulse of a pair, which the first takes along n.
fn exchange<T: Real, const D: usize>(met: &mut [Met<T>], [a, b]: [usize; 2], contact: &Contact, n: &Vector<T, D>) {
    let velocity = |node: &Node<T>| std::array::from_fn(|k| node[k] / node[MASS]);
    let (v, u): (Vector<T, D>, Vector<T, D>) = (velocity(&met[a].1), velocity(&met[b].1));
    let impulse = pair::impulse(contact, [met[a].1[MASS], met[b].1[MASS]], [&v, &u], n);
    for k in 0..D {
        met[a].1[k] += impulse[k];
        met[b].1[k] -= impulse[k];
    }
}

/// By axis and offset of a window's nodes, which node stands for them, and what its mass counts for. A wall
/// cuts off mass that has no slope: what it cuts off is more of the same.
struct StandIns<const D: usize>([[(i32, f64); WINDOW]; D]);

impl<const D: usize> StandIns<D> {
    fn new(setup: &Setup, layout: &Layout, grid: usize, node: [i32; D]) -> Self {
        Self(std::array::from_fn(|a| {
            let share = |step: i32| {
                let x = f64::from(node[a] + step) + layout.shift[grid];
                layout.inside_walls(&setup.axes[a], setup.cells[a], x)
            };
            std::array::from_fn(|k| {
                let mut step = k as i32 - REACH;
                while step != 0 && share(step) < LEAST_ROOM {
                    step -= step.signum();
                }
                (step, if step == 0 { 1.0 } else { share(0) / share(step) })
            })
        }))
    }
}
