//! Which side of a thin collider particles are on, and which nodes lie beyond it: what is on one side
//! must not move with what is on the other (docs/NUMERICS.md, "Both sides of a plate"; the aim is that of
//! compatible particle-in-cell, Hu et al. 2018, the means are not).
//!
//! A particle near a plate has a side: the axis along which it is away from it. Particles of a side have
//! nodes to themselves, in a layer of their own. At a node on their side of the plate they share its velocity
//! with all others there; at one beyond it they share it with those that are beyond it as well. So all
//! weights count, momentum is conserved, and nothing is felt through the plate.
//!
//! Particles far from plates have no side, nor have those in slots so narrow that one side of the slot
//! cannot be told from the other side of the plate: they are at home at every node, as without plates.

use super::collider::{ALWAYS, Collider, NORMAL_STEP_DX, Placed, Primitive, SdfOp};
use super::pair;
use super::setup::{ContactAt, Integrator, Setup};
use super::timestep::max_collider_speed_m_s;

/// Layers of nodes: of no side, and of +x, −x, +y, −y, +z, −z. Twins of the constants: wgsl/explicit/beyond.wgsl.
pub const LAYERS: usize = 7;

/// How far beyond a plate nodes are looked for (dx): the reach of a kernel, along the diagonal of a cell.
pub const REACH_DX: f64 = 4.0;

/// How far particles may move before they are asked again for their sides (dx).
pub const WAY_DX: f64 = 1.0;

/// The room that a particle must have in front of a plate (dx): what lies behind what is in front of it must
/// not be taken for what lies behind the plate.
pub const FREE_DX: f64 = REACH_DX + 3.0;

/// Distance below which a place is in a plate (dx); twice that is the least step in which plates are looked for.
pub const TOUCHING_DX: f64 = 1.0 / 16.0;

/// How much larger than others the component of a normal is that gives the axis of a side: at 45°, rounding does not
/// decide.
pub const CLEARLY: f64 = 1.001;

/// Of the faces of a plate that a node is inside of, how much nearer that of negative sides must be to be its own (dx):
/// nodes on the middle have a side, and rounding does not decide which.
pub const TIE_DX: f64 = 1.0 / 32.0;

/// Whether particles have sides in this scene. Bodies with contact of their own have nodes to themselves already;
/// implicit steps have no sides.
pub fn acts(setup: &Setup) -> bool {
    setup.contact_at == ContactAt::Particles
        && setup.integrator != Integrator::Implicit
        && !pair::is_parted(setup)
        && setup.colliders.iter().any(|c| is_thin(c, setup))
}

/// Layers of nodes in this scene, whatever asks for them.
pub fn layers(setup: &Setup) -> usize {
    if acts(setup) { LAYERS } else { pair::contacts(setup).len() }
}

fn is_thin(collider: &Collider, setup: &Setup) -> bool {
    !collider.grip && half_thickness(&collider.sdf.ops, setup.dimension) < 0.5 * REACH_DX * setup.dx
}

/// Half of the least thickness of a solid (m), or less.
fn half_thickness(ops: &[SdfOp], dimension: usize) -> f64 {
    let mut stack: Vec<f64> = Vec::new();
    for op in ops {
        let own = match op {
            SdfOp::Primitive { primitive, .. } => match *primitive {
                Primitive::Box(h) => h[..dimension].iter().fold(f64::INFINITY, |least, &h| least.min(h)),
                Primitive::Sphere(r) | Primitive::Capsule(r, _) | Primitive::Torus(_, r) => r,
                Primitive::Cylinder(r, h) => r.min(h),
                Primitive::Cone(below, above, h) => below.max(above).min(h),
                Primitive::HalfSpace => f64::INFINITY,
                Primitive::Grid(ref field, scale) => scale * field.half_thickness(),
            },
            SdfOp::Union => stack.pop().unwrap_or(0.0).min(stack.pop().unwrap_or(0.0)),
            SdfOp::Shell(thickness) => 0.5 * thickness.min(2.0 * stack.pop().unwrap_or(0.0)),
            // What is left of a solid may be thin anywhere.
            SdfOp::Intersection | SdfOp::Difference => {
                stack.truncate(stack.len().saturating_sub(2));
                0.0
            }
        };
        stack.push(own);
    }
    stack.pop().unwrap_or(f64::INFINITY)
}

/// Steps of `dt_s` after which particles are asked again, if none is faster than `speed_m_s` at their start: a
/// power of two.
pub fn steps_between(setup: &Setup, speed_m_s: f64, dt_s: f64) -> u64 {
    let gravity = setup.gravity.iter().map(|g| g * g).sum::<f64>().sqrt();
    let fastest = speed_m_s + gravity * setup.frame_s + max_collider_speed_m_s(setup);
    let steps = WAY_DX * setup.dx / (fastest * dt_s);
    if steps < 2.0 { 1 } else { steps.min(1e9).log2().floor().exp2() as u64 }
}

/// The colliders that have sides, at an instant.
pub struct Plates<'a> {
    placed: Vec<Placed<'a>>,
    dx: f64,
    dimension: usize,
}

impl<'a> Plates<'a> {
    /// None where particles have no sides.
    pub fn of(setup: &'a Setup, time_s: f64) -> Self {
        let none = Self { placed: Vec::new(), dx: setup.dx, dimension: setup.dimension };
        if acts(setup) { Self::new(setup, time_s) } else { none }
    }

    pub fn new(setup: &'a Setup, time_s: f64) -> Self {
        let acting = setup.colliders.iter().filter(|c| !c.grip && c.is_present(time_s));
        Self { placed: acting.map(|c| c.at(time_s)).collect(), dx: setup.dx, dimension: setup.dimension }
    }

    /// The layer of a particle at `x` (m).
    pub fn layer(&self, x: [f64; 3]) -> u32 {
        let Some((nearest, distance)) = self.nearest(x) else { return 0 };
        if distance > REACH_DX * self.dx {
            return 0;
        }
        // Differences across a thin plate are short, but have the right direction.
        let n = nearest.normal(x, NORMAL_STEP_DX * self.dx);
        let larger = |a: usize, best: usize| n[a].abs() > CLEARLY * n[best].abs();
        let a = (1..self.dimension).fold(0, |best, a| if larger(a, best) { a } else { best });
        let layer = 1 + 2 * a as u32 + u32::from(n[a] < 0.0);
        let away = direction(layer);
        // Not from the plate itself, where particles that are pressed on it are.
        let before = std::array::from_fn(|a| x[a] + 3.0 * TOUCHING_DX * self.dx * away[a]);
        let thin = self.through(x, away.map(|e| -e), REACH_DX + WAY_DX).is_some();
        if thin && self.through(before, away, FREE_DX).is_none() { layer } else { 0 }
    }

    /// Whether a node at `x` (m) lies beyond a plate for particles of a layer.
    pub fn is_beyond(&self, x: [f64; 3], layer: u32) -> bool {
        if layer == 0 {
            return false;
        }
        let Some((_, distance)) = self.nearest(x) else { return false };
        if distance > REACH_DX * self.dx {
            return false;
        }
        let toward = direction(layer);
        let Some(ahead) = self.through(x, toward, REACH_DX) else { return false };
        if distance > TOUCHING_DX * self.dx {
            return true;
        }
        // Inside: its own face is the nearer one.
        let tie = if layer % 2 == 1 { TIE_DX } else { -TIE_DX };
        self.through(x, toward.map(|e| -e), REACH_DX).is_some_and(|behind| ahead > behind + tie * self.dx)
    }

    /// Whether nodes that lie beyond a plate always do.
    pub fn are_still(setup: &Setup) -> bool {
        let acting = || setup.colliders.iter().filter(|c| !c.grip);
        acting().all(|c| !c.motion.moves() && c.present_s == ALWAYS)
    }

    /// Whether any plate is near enough to a place (m) that nodes within `around` (m) of it may lie beyond it.
    pub fn reach(&self, x: [f64; 3], around: f64) -> bool {
        self.placed.iter().any(|p| p.distance(x) <= around + REACH_DX * self.dx + p.slack())
    }

    fn nearest(&self, x: [f64; 3]) -> Option<(&Placed<'a>, f64)> {
        let all = self.placed.iter().map(|placed| (placed, placed.distance(x)));
        all.reduce(|best, next| if next.1 < best.1 { next } else { best })
    }

    /// How far (m) along a unit vector the way leads out of a plate again that it goes through within `most` dx.
    fn through(&self, x: [f64; 3], way: [f64; 3], most: f64) -> Option<f64> {
        let touching = TOUCHING_DX * self.dx;
        let (mut gone, mut entered) = (0.0, false);
        while gone <= most * self.dx {
            let there = std::array::from_fn(|a| x[a] + gone * way[a]);
            let distance = self.nearest(there)?.1;
            if distance > touching && entered {
                return Some(gone);
            }
            entered |= distance <= touching;
            gone += distance.abs().max(2.0 * touching);
        }
        None
    }
}

/// From a plate to a side.
fn direction(layer: u32) -> [f64; 3] {
    let (a, sign) = ((layer as usize - 1) / 2, if layer % 2 == 1 { 1.0 } else { -1.0 });
    std::array::from_fn(|k| if k == a { sign } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::collider::{Motion, Sdf};
    use crate::sim::fixture::{problem, solid_and_fluid};
    use crate::sim::setup::{Contact, ContactKind};

    const DX: f64 = 0.1;

    /// A box of half extents `half` (dx), turned by `angle` about z, its middle at the origin.
    fn boxed(half: [f64; 3], angle: f64) -> Collider {
        let rotation = crate::sim::collider::axis_angle([0.0, 0.0, 1.0], angle);
        let primitive = Primitive::Box(half.map(|h| h * DX));
        Collider {
            name: "plate".into(),
            sdf: Sdf { ops: vec![SdfOp::Primitive { primitive, rotation, translation: [0.0; 3] }] },
            contact: Contact { kind: ContactKind::Slip, friction: 0.0 },
            motion: Motion::default(),
            present_s: ALWAYS,
            grip: false,
        }
    }

    fn plates<'a>(colliders: &'a [Collider]) -> Plates<'a> {
        Plates { placed: colliders.iter().map(|c| c.at(0.0)).collect(), dx: DX, dimension: 3 }
    }

    fn at(x: [f64; 3]) -> [f64; 3] {
        x.map(|x| x * DX)
    }

    #[test]
    fn particles_above_and_below_a_plate_have_sides() {
        for half in [1.5, 1.0, 0.1, 0.0] {
            let plate = [boxed([20.0, half, 20.0], 0.0)];
            let plates = plates(&plate);
            for height in [0.001, 0.03, 0.25, 0.8] {
                let layer = |y: f64| plates.layer(at([0.3, y, -0.2]));
                assert_eq!([layer(half + height), layer(-half - height)], [3, 4], "{half} {height}");
                for (node, beyond) in [(half + height, false), (-half - height, true)] {
                    let node = at([0.5, node, 0.1]);
                    let sides = [3, 4].map(|side| plates.is_beyond(node, side));
                    // So near a sheet a node may be of either side, but is of one.
                    let right = height < TOUCHING_DX && sides[0] != sides[1] || sides == [beyond, !beyond];
                    assert!(right, "{half} {height} {sides:?}");
                    assert!(!plates.is_beyond(node, 0));
                }
            }
            assert_eq!([9.0, -9.0].map(|y| plates.layer(at([0.0, half + y, 0.0]))), [0, 0]);
            // Every node inside belongs to one side.
            for k in -10..=10 {
                let node = at([0.5, 0.1 * f64::from(k) * half, 0.1]);
                assert!(plates.is_beyond(node, 3) != plates.is_beyond(node, 4), "{half} {k}");
            }
        }
    }

    #[test]
    fn tilted_plates_have_two_sides_too() {
        for degrees in [10.0f64, 44.9, 45.1, 70.0, 135.0] {
            let plate = [boxed([20.0, 0.1, 20.0], degrees.to_radians())];
            let plates = plates(&plate);
            let n = [degrees.to_radians().sin(), degrees.to_radians().cos(), 0.0];
            let above = |d: f64| at(n.map(|n| n * d));
            let sides = [0.2, -0.2].map(|d| plates.layer(above(d)));
            assert!(sides[0] != 0 && sides[1] != 0 && sides[0] != sides[1], "{degrees}: {sides:?}");
            for (k, side) in sides.into_iter().enumerate() {
                let beyond = [0.3, 1.0, -0.3, -1.0].map(|d| plates.is_beyond(above(d), side));
                assert_eq!(beyond, [k == 1, k == 1, k == 0, k == 0], "{degrees}, side {side}");
            }
        }
    }

    #[test]
    fn thick_walls_edges_and_narrow_slots_have_none() {
        let thick = [boxed([20.0, 6.0, 20.0], 0.0)];
        assert_eq!(plates(&thick).layer(at([0.0, 6.2, 0.0])), 0);
        let plate = [boxed([20.0, 0.1, 20.0], 0.0)];
        assert_eq!(plates(&plate).layer(at([20.5, 0.0, 0.0])), 0);
        let slot = |width: f64| {
            let mut upper = boxed([20.0, 0.1, 20.0], 0.0);
            upper.motion.center = [0.0; 3];
            if let SdfOp::Primitive { translation, .. } = &mut upper.sdf.ops[0] {
                translation[1] = width * DX;
            }
            let both = [boxed([20.0, 0.1, 20.0], 0.0), upper];
            plates(&both).layer(at([0.0, 0.4, 0.0]))
        };
        assert_eq!([slot(5.0), slot(9.0)], [0, 3]);
    }

    #[test]
    fn scenes_without_plates_have_no_sides() {
        let mut setup = problem(3, DX, solid_and_fluid(), &[(0, [0.4; 3], [0.6; 3])]).setup;
        setup.contact_at = ContactAt::Particles;
        setup.dx = DX;
        for (half, thin) in [(6.0, false), (0.5, true)] {
            setup.colliders = vec![boxed([20.0, half, 20.0], 0.0)];
            assert_eq!(acts(&setup), thin);
        }
    }
}
