//! Reactions of surfaces, from the grid: forces on walls and colliders, torques on colliders.
//!
//! In a step, contact changes a node's velocity from v to v'. The surface receives the impulse
//! J = ½ Σ m (v − v') (on a single grid: without ½). With the node's arm r from the collider's
//! centre of motion at that time, it also receives the moment ½ Σ r × m (v − v'). Over a frame, the
//! sum divided by the frame's time is the mean force that the material exerts ON the surface. If
//! several surfaces act on one node, they are counted one after the other: walls by axis, then
//! colliders in scene order.

use super::setup::{Axis, Setup};

/// Number of walls. They come first, x- x+ y- y+ z- z+, whether they exist or not; then colliders.
pub const WALLS: usize = 6;

/// Linear and angular momentum, or force and torque.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reaction {
    /// Impulse (N s); divided by time, force (N; 2D: N/m).
    pub force: [f64; 3],
    /// About the collider's centre of motion; zero for walls. N m s, or N m.
    pub torque: [f64; 3],
}

impl Reaction {
    pub fn add(&mut self, other: &Self) {
        for a in 0..3 {
            self.force[a] += other.force[a];
            self.torque[a] += other.torque[a];
        }
    }

    pub fn times(&self, factor: f64) -> Self {
        Self { force: self.force.map(|f| f * factor), torque: self.torque.map(|t| t * factor) }
    }

    /// Adds an impulse (N s) that acts on the surface at an arm (m) from its centre.
    pub fn take(&mut self, impulse: [f64; 3], arm: [f64; 3]) {
        let (j, r) = (impulse, arm);
        let torque = [r[1] * j[2] - r[2] * j[1], r[2] * j[0] - r[0] * j[2], r[0] * j[1] - r[1] * j[0]];
        self.add(&Self { force: j, torque });
    }
}

/// Number of surfaces of a problem, walls of periodic axes included.
pub fn surfaces(setup: &Setup) -> usize {
    WALLS + setup.colliders.len()
}

/// Adds the surfaces' impulses one by one.
pub fn add_all(sums: &mut [Reaction], impulses: &[Reaction]) {
    sums.iter_mut().zip(impulses).for_each(|(sum, impulse)| sum.add(impulse));
}

/// A surface that diagnostics have columns for.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// `wall_x-`, …, or the collider's name.
    pub name: String,
    /// Index among all surfaces.
    pub index: usize,
}

impl Surface {
    /// Names of its columns: a wall's force, or a collider's force and torque.
    pub fn columns(&self) -> impl Iterator<Item = String> {
        const QUANTITIES: [&str; 6] = ["force_x", "force_y", "force_z", "torque_x", "torque_y", "torque_z"];
        QUANTITIES[..self.quantities()].iter().map(|quantity| format!("{}.{quantity}", self.name))
    }

    /// The values of its columns.
    pub fn values(&self, reaction: &Reaction) -> impl Iterator<Item = f64> {
        reaction.force.into_iter().chain(reaction.torque).take(self.quantities())
    }

    fn quantities(&self) -> usize {
        if self.index < WALLS { 3 } else { 6 }
    }
}

/// The name of a wall in diagnostics.
pub fn wall_name(index: usize) -> &'static str {
    ["wall_x-", "wall_x+", "wall_y-", "wall_y+", "wall_z-", "wall_z+"][index]
}

/// The surfaces that exist, in order.
pub fn named_surfaces(setup: &Setup) -> Vec<Surface> {
    let exists = |wall: &usize| wall / 2 < setup.dimension && setup.axes[wall / 2] != Axis::Periodic;
    let walls = (0..WALLS).filter(exists).map(|index| Surface { name: wall_name(index).into(), index });
    let colliders = setup.colliders.iter().zip(WALLS..);
    walls.chain(colliders.map(|(c, index)| Surface { name: c.name.clone(), index })).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_moment_is_arm_cross_impulse() {
        let mut taken = Reaction::default();
        taken.take([0.0, 2.0, 0.0], [3.0, 0.0, 0.0]);
        taken.take([0.0, 0.0, 1.0], [0.0, 1.0, 0.0]);
        assert_eq!(taken, Reaction { force: [0.0, 2.0, 1.0], torque: [1.0, 0.0, 6.0] });
        assert_eq!(taken.times(0.5).torque, [0.5, 0.0, 3.0]);
    }
}
