//! What surfaces do to the nodes of an implicit step, decided at its start: walls of the domain, grips, and
//! colliders where these act on nodes.
//!
//! Sticky surfaces prescribe a node's velocity. Slip surfaces, and separating ones that the node
//! would run into, prescribe its normal component: the node may slide. A surface's velocity at a
//! node is its displacement there during the step, divided by dt, so that what sticks to a turning
//! grip turns rigidly, however long the step.

use rayon::prelude::*;

use super::friction::Drag;
use super::topology::Topology;
use super::transfer::Node;
use crate::implicit::solver::objective::{Freedom, NodeId};
use gridfall_core::maths::linalg::{Vector, dot};
use gridfall_core::sim::collider::{Collider, NORMAL_STEP_DX, rotate};
use gridfall_core::sim::contact::wall_side;
use gridfall_core::sim::reaction::{self, Reaction};
use gridfall_core::sim::setup::{Axis, Contact, ContactAt, ContactKind, Setup};

/// Nodes lighter than this fraction of the heaviest move freely, without forces: they would only
/// make the system ill-conditioned.
const LIGHTEST: f64 = 1e-12;
/// Two normals at a smaller angle than this (its sine) count as one.
const PARALLEL: f64 = 1e-6;

/// Pull of separating surfaces, as a fraction of their push, that a step may keep.
const PULL: f64 = 0.05;

/// A surface at a node.
#[derive(Clone, Copy, Debug)]
struct Touch<const D: usize> {
    /// Its place in [`gridfall_core::sim::reaction`]'s order.
    surface: usize,
    contact: Contact,
    /// Out of the surface; orthogonal to those of the earlier touches.
    normal: Vector<f64, D>,
    /// Of the surface (m/s).
    velocity: Vector<f64, D>,
    /// From the surface's centre of motion to the node (m).
    arm: [f64; 3],
}

/// What a node may do in this step.
#[derive(Clone, Debug)]
struct Rule<const D: usize> {
    /// None: the velocity is prescribed.
    freedom: Option<Freedom<D>>,
    /// Velocity (m/s) at the step's end that the solver starts from; what is prescribed of it
    /// stays.
    velocity: Vector<f64, D>,
    touches: Vec<Touch<D>>,
}

/// The rules of all nodes of a step.
pub struct Boundary<const D: usize> {
    /// Of the nodes that are in the system, which come first.
    pub freedoms: Vec<Freedom<D>>,
    /// Velocities (m/s) at the step's end: where the solver starts, and what is prescribed.
    pub velocities: Vec<Vector<f64, D>>,
    touched: Vec<(u32, Vec<Touch<D>>)>,
}

/// A collider that is present, with its place among all surfaces.
struct Present<'a> {
    surface: usize,
    collider: &'a Collider,
}

impl<const D: usize> Boundary<D> {
    /// Decides for a step of `dt` (s) from `time_s`, and renumbers the nodes so that those of the
    /// system come first.
    pub fn new(setup: &Setup, topology: &mut Topology<D>, nodes: &mut Vec<Node<D>>, time_s: f64, dt: f64) -> Self {
        let heaviest = nodes.iter().map(|node| node.mass).fold(0.0, f64::max);
        let holds = |c: &Collider| (c.grip || setup.contact_at == ContactAt::Nodes) && c.is_present(time_s);
        let colliders = setup.colliders.iter().zip(reaction::WALLS..).filter(|(c, _)| holds(c));
        let present: Vec<Present> = colliders.map(|(collider, surface)| Present { surface, collider }).collect();
        let rule = |i: usize| {
            let falling: Vector<f64, D> = std::array::from_fn(|a| nodes[i].velocity[a] + dt * setup.gravity[a]);
            if nodes[i].mass < LIGHTEST * heaviest {
                return Rule { freedom: None, velocity: falling, touches: Vec::new() };
            }
            let node = &topology.nodes[i];
            let x = topology.position(setup, node);
            let touches = touches(setup, &present, &on_walls(setup, node, topology.dx), x, &falling, time_s, dt);
            decide(falling, touches)
        };
        let rules: Vec<Rule<D>> = (0..nodes.len()).into_par_iter().with_min_len(256).map(rule).collect();
        let inside = |i: &u32| rules[*i as usize].freedom.is_some();
        let (system, others): (Vec<u32>, Vec<u32>) = (0..nodes.len() as u32).partition(inside);
        let old: Vec<u32> = system.iter().chain(&others).copied().collect();
        topology.renumber(&old);
        *nodes = old.iter().map(|&i| nodes[i as usize]).collect();
        let touched = old.iter().enumerate().filter(|(_, was)| !rules[**was as usize].touches.is_empty());
        Self {
            freedoms: system.iter().map(|&i| rules[i as usize].freedom.expect("in the system")).collect(),
            velocities: old.iter().map(|&i| rules[i as usize].velocity).collect(),
            touched: touched.map(|(at, &was)| (at as u32, rules[was as usize].touches.clone())).collect(),
        }
    }

    /// What friction does to nodes that a solve presses on surfaces with these `impulses` (N s),
    /// see [`Self::reactions`].
    pub fn drags(&self, impulses: &[Vector<f64, D>]) -> Vec<Drag<D>> {
        let rubbing =
            self.touched.iter().flat_map(|(node, touches)| touches.iter().map(|touch| (*node as usize, touch)));
        rubbing
            .filter(|(node, touch)| touch.contact.friction > 0.0 && *node < self.freedoms.len())
            .filter_map(|(node, touch)| {
                let strength = touch.contact.friction * dot(&impulses[node], &touch.normal);
                let Touch { normal, velocity, .. } = *touch;
                (strength > 0.0).then_some(Drag { node, strength, normal, velocity })
            })
            .collect()
    }

    /// Releases nodes that a separating surface pulls back instead of pushing, if that is more than
    /// noise: if all surfaces together pull more than `PULL` of their push. Returns whether any
    /// node was released.
    pub fn release(&mut self, impulses: &[Vector<f64, D>]) -> bool {
        let (mut pull, mut push) = (0.0, 0.0);
        let mut pulled = Vec::new();
        for (at, (node, touches)) in self.touched.iter().enumerate() {
            if let [Touch { contact: Contact { kind: ContactKind::Separate, .. }, normal, .. }] = touches[..] {
                let pressed = dot(&impulses[*node as usize], &normal);
                push += pressed.max(0.0);
                if pressed < 0.0 {
                    pull -= pressed;
                    pulled.push(at);
                }
            }
        }
        if pull <= PULL * push {
            return false;
        }
        for &at in &pulled {
            self.freedoms[self.touched[at].0 as usize] = Freedom::Free;
            self.touched[at].1.clear();
        }
        !pulled.is_empty()
    }

    /// The impulses (N s) that surfaces take in a solved step. `impulses` are what they gave each
    /// node: ∇E before projection and without friction, whose part then lies along the surface.
    pub fn reactions(&self, setup: &Setup, share: f64, impulses: &[Vector<f64, D>]) -> Vec<Reaction> {
        let mut sums = vec![Reaction::default(); reaction::surfaces(setup)];
        for (node, touches) in &self.touched {
            let mut rest = impulses[*node as usize];
            let mut parts: Vec<Vector<f64, D>> = Vec::with_capacity(touches.len());
            for touch in touches {
                let normal = dot(&rest, &touch.normal);
                let part =
                    if touch.contact.kind == ContactKind::Sticky { rest } else { touch.normal.map(|n| normal * n) };
                (0..D).for_each(|a| rest[a] -= part[a]);
                parts.push(part);
            }
            if let Some(k) = touches.iter().position(|touch| touch.contact.friction > 0.0) {
                (0..D).for_each(|a| parts[k][a] += rest[a]);
            }
            for (touch, part) in touches.iter().zip(parts) {
                let mut taken = [0.0; 3];
                (0..D).for_each(|a| taken[a] = -share * part[a]);
                sums[touch.surface].take(taken, touch.arm);
            }
        }
        sums
    }
}

/// The walls that a node belongs to, 0 the lower and 1 the upper; `dx` (m) may be that of a
/// coarsened grid.
fn on_walls<const D: usize>(setup: &Setup, node: &NodeId<D>, dx: f64) -> [Option<usize>; D] {
    let coarsening = (dx / setup.dx).round() as i32;
    std::array::from_fn(|a| wall_side(node.index[a] * coarsening, setup.cells[a] as i32))
}

/// Surfaces that act on a node that would move with `falling` (m/s) without them.
fn touches<const D: usize>(
    setup: &Setup,
    present: &[Present],
    walls: &[Option<usize>; D],
    x: [f64; 3],
    falling: &Vector<f64, D>,
    time_s: f64,
    dt: f64,
) -> Vec<Touch<D>> {
    let mut found = Vec::new();
    let mut meet = |touch: Touch<D>| {
        let approach: f64 = (0..D).map(|a| (falling[a] - touch.velocity[a]) * touch.normal[a]).sum();
        if touch.contact.kind != ContactKind::Separate || approach < 0.0 {
            found.push(touch);
        }
    };
    for a in 0..D {
        let Axis::Walls(contacts) = &setup.axes[a] else { continue };
        if let Some(side) = walls[a] {
            let mut normal = [0.0; D];
            normal[a] = if side == 0 { 1.0 } else { -1.0 };
            meet(Touch { surface: 2 * a + side, contact: contacts[side], normal, velocity: [0.0; D], arm: [0.0; 3] });
        }
    }
    for Present { surface, collider } in present {
        let placed = collider.at(time_s);
        if placed.distance(x) > 0.0 {
            continue;
        }
        let normal = placed.normal(x, NORMAL_STEP_DX * setup.dx);
        let (from, to) = (&placed.motion.pose, collider.motion.pose(time_s + dt));
        let turned = rotate(&to.rotation, from.to_start(x));
        meet(Touch {
            surface: *surface,
            contact: collider.contact,
            normal: std::array::from_fn(|a| normal[a]),
            velocity: std::array::from_fn(|a| (turned[a] + to.translation[a] - x[a]) / dt),
            arm: std::array::from_fn(|a| x[a] - placed.motion.center[a]),
        });
    }
    found
}

/// The freedom that surfaces leave a node.
fn decide<const D: usize>(falling: Vector<f64, D>, touches: Vec<Touch<D>>) -> Rule<D> {
    // As in the explicit step, the last sticky surface wins.
    if let Some(sticky) = touches.iter().rev().find(|touch| touch.contact.kind == ContactKind::Sticky) {
        return Rule { freedom: None, velocity: sticky.velocity, touches: vec![*sticky] };
    }
    // Orthonormal directions are fixed one after the other.
    let mut velocity = falling;
    let mut kept: Vec<Touch<D>> = Vec::new();
    for touch in touches {
        let mut normal = touch.normal;
        for before in &kept {
            let along = dot(&normal, &before.normal);
            (0..D).for_each(|a| normal[a] -= along * before.normal[a]);
        }
        let length = dot(&normal, &normal).sqrt();
        if length < PARALLEL {
            continue;
        }
        let normal = normal.map(|n| n / length);
        // The surface prescribes v·n along its original normal; the component along the new
        // direction follows from those that are fixed already.
        let missing: f64 = (0..D).map(|a| (touch.velocity[a] - velocity[a]) * touch.normal[a]).sum::<f64>() / length;
        (0..D).for_each(|a| velocity[a] += missing * normal[a]);
        kept.push(Touch { normal, ..touch });
    }
    let freedom = match kept.as_slice() {
        [] => Some(Freedom::Free),
        [one] => Some(Freedom::Plane(one.normal)),
        [one, two] if D == 3 => {
            let (a, b) = (&one.normal, &two.normal);
            let cross = |i: usize, j: usize| a[i] * b[j] - a[j] * b[i];
            let t = [cross(1, 2), cross(2, 0), cross(0, 1)];
            Some(Freedom::Line(std::array::from_fn(|k| t[k])))
        }
        _ => None,
    };
    Rule { freedom, velocity, touches: kept }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn touch(kind: ContactKind, normal: [f64; 3], velocity: [f64; 3]) -> Touch<3> {
        Touch { surface: 0, contact: Contact { kind, friction: 0.0 }, normal, velocity, arm: [0.0; 3] }
    }

    #[test]
    fn surfaces_that_meet_leave_a_line_and_hold_their_normal_velocities() {
        let s = 0.5f64.sqrt();
        let slanted = touch(ContactKind::Slip, [s, s, 0.0], [0.2, 0.4, 9.0]);
        let floor = touch(ContactKind::Slip, [1.0, 0.0, 0.0], [-0.3, 7.0, 7.0]);
        let rule = decide([1.0, 2.0, 3.0], vec![floor, slanted]);
        let Some(Freedom::Line(t)) = rule.freedom else { panic!("{rule:?}") };
        assert!((t[2].abs() - 1.0).abs() < 1e-15, "{t:?}");
        for touch in [&floor, &slanted] {
            let relative: f64 = (0..3).map(|a| (rule.velocity[a] - touch.velocity[a]) * touch.normal[a]).sum();
            assert!(relative.abs() < 1e-14);
        }
        assert_eq!(rule.velocity[2], 3.0);
        // The same surface twice is one.
        let rule = decide([1.0, 2.0, 3.0], vec![floor, floor]);
        assert_eq!(rule.freedom, Some(Freedom::Plane([1.0, 0.0, 0.0])));
        // A third direction leaves nothing, and neither does a sticky surface.
        let wall = touch(ContactKind::Slip, [0.0, 0.0, 1.0], [0.0; 3]);
        assert!(decide([1.0, 2.0, 3.0], vec![floor, slanted, wall]).freedom.is_none());
        let grip = touch(ContactKind::Sticky, [0.0, 1.0, 0.0], [5.0, 6.0, 7.0]);
        let rule = decide([1.0, 2.0, 3.0], vec![floor, grip]);
        assert!(rule.freedom.is_none() && rule.velocity == [5.0, 6.0, 7.0]);
    }
}
