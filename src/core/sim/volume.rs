//! The volume of fluids and loose grains: their strain follows where their mass is.
//!
//! J is integrated from ∇·v, and forgets where mass is: the grid does not see all motion of
//! particles, which gather while their J stays. So a step compares J with the *fill* of the room
//! around the particle, its rest volume over its room, from the sums that the grid has anyway:
//!
//!   fill = Σ w m_i / (ρ0 Σ w V_i),   V_i = dx^d times the share of node i's weight inside walls
//!                                    and outside colliders
//!   f = max(1, fill)
//!   r = FALLING √(g/dx) + STIRRED ‖∇v‖ + CROWDED c/dx (max(0, min(f, DENSEST) − NOISE)/0.2)²
//!   J ← J + min(1, r dt) (1/min(f, FULLEST) − J)
//!   J ← (1 + dt tr ∇v) J
//!
//! with ‖∇v‖ that of the particle (Frobenius) and c² = (λ + 2μ)/ρ0 at rest. The fill is noisy, J is
//! smooth: r is slow, so that waves keep the J of ∇·v, and the two agree in the mean. It is as fast
//! as particles are stirred, since that is what makes them gather, and not as fast as sound: in stiff
//! water at rest the noise would make pressure, and pressure work. Crowds, which are more than noise,
//! dissolve faster. The goal is never above 1: at a free surface the fill is below 1, and nothing is
//! pushed or pulled there.
//!
//! In loose grains the volumetric strain takes the place of J, plastic volume included, and only
//! what is too full is corrected.

use super::pair::is_parted;
use super::setup::{Body, Setup};
use super::side;
use crate::material::Law;

/// Rate at which the difference vanishes at rest, as a share of that at which gravity crosses a cell. Half of it lets
/// the compact kernel's water sink by 4 % in a minute.
pub const FALLING: f64 = 0.06;
/// What ‖∇v‖ adds to the rate, as a share of itself.
pub const STIRRED: f64 = 0.3;
/// What crowds add at a fill of 0.2 above [`NOISE`], as a share of the rate at which sound crosses a cell.
pub const CROWDED: f64 = 0.01;
/// Fill, over that which counts as full, up to which it is noise and no crowd.
pub const NOISE: f64 = 1.1;
/// Fill, over that which counts as full, beyond which crowds dissolve no faster.
pub const DENSEST: f64 = 2.0;
/// Fill, over that which counts as full, beyond which more does not count. A bound on what particles
/// that lie on one another may do: a pressure of about half the bulk modulus.
pub const FULLEST: f64 = 1.25;
/// Fill up to which grains are left alone: packed at random, they do not fill all room evenly.
pub const LOOSE: f64 = 1.02;
/// Excess over full at which grains are corrected in full; below, in proportion, so that nothing jumps.
pub const GRADUAL: f64 = 0.02;

/// How a body's volume follows its fill.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relaxation {
    /// Share of the difference that vanishes in a time at rest (1/s).
    pub rate_1_s: f64,
    /// What a fill of 0.2 above [`NOISE`] adds (1/s); it grows with the square of the excess over [`NOISE`].
    pub crowded_1_s: f64,
    /// Fill that counts as full.
    pub full: f64,
}

/// The relaxation of a body's volume; none for materials that keep their particles in place.
pub fn relaxation(setup: &Setup, body: &Body) -> Option<Relaxation> {
    let material = &setup.materials[body.material];
    let law = Law::<f64>::new(material);
    let full = if material.is_fluid() { 1.0 } else { law.gained_volume(0.0).map(|_| LOOSE)? };
    let gravity = setup.gravity.iter().map(|g| g * g).sum::<f64>().sqrt();
    let c = (law.stiffness_at_rest() * body.volume0 / body.mass).sqrt();
    let (rate_1_s, crowded_1_s) = (FALLING * (gravity / setup.dx).sqrt(), CROWDED * c / setup.dx);
    Some(Relaxation { rate_1_s, crowded_1_s, full })
}

/// Whether bodies of different materials may share nodes, so that mass does not tell volume.
pub fn is_mixed(setup: &Setup) -> bool {
    let Some(first) = setup.bodies.first() else { return false };
    // Layers of nodes ask for volumes, too (`pair`, `side`).
    is_parted(setup) || side::acts(setup) || setup.bodies.iter().any(|body| body.material != first.material)
}
