//! What stays the same during a run, in the simulation's scalar.

use super::chunk::Kind;
use super::tile::Layout;
use gridfall_core::material::{Damping, Law};
use gridfall_core::maths::real::Real;
use gridfall_core::sim::setup::{Body, Setup, Transfer};
use gridfall_core::sim::volume;

/// What all particles of a body share.
#[derive(Clone, Copy, Debug)]
pub struct BodySetup<T> {
    pub law: Law<T>,
    pub damping: Option<Damping<T>>,
    /// Of one particle (kg).
    pub mass: T,
    /// Of one particle at rest (m³; 2D: m²).
    pub volume0: T,
    /// Demand of the material at rest, see [`gridfall_core::sim::timestep`] (1/s²).
    pub demand: T,
    /// Cells that a particle fills at rest: V0 / dx^d.
    pub cells: T,
    pub relaxation: Option<Relaxation<T>>,
    /// Whose nodes it has, see [`gridfall_core::sim::pair`].
    pub field: u32,
}

/// [`volume::Relaxation`] in the simulation's scalar.
#[derive(Clone, Copy, Debug)]
pub struct Relaxation<T> {
    /// At rest (1/s).
    pub rate: T,
    /// What a crowd adds (1/s).
    pub crowded: T,
    /// Fill that counts as full.
    pub full: T,
}

impl<T: Real> Relaxation<T> {
    pub fn of(setup: &Setup, body: &Body) -> Option<Self> {
        let volume::Relaxation { rate_1_s, crowded_1_s, full } = volume::relaxation(setup, body)?;
        let [rate, crowded, full] = [rate_1_s, crowded_1_s, full].map(T::from_f64);
        Some(Self { rate, crowded, full })
    }
}

impl<T: Real> BodySetup<T> {
    pub fn is_fluid(&self) -> bool {
        matches!(self.law, Law::WeaklyCompressibleFluid(_))
    }

    pub fn kind(&self) -> Kind {
        match (&self.law, &self.damping) {
            (Law::WeaklyCompressibleFluid(fluid), _) if fluid.viscosity == T::ZERO => Kind::Fluid,
            (Law::WeaklyCompressibleFluid(_), _) => Kind::Viscous,
            (_, Some(_)) => Kind::Damped,
            _ => Kind::Solid,
        }
    }
}

/// What stays the same during a run, in the simulation's scalar.
#[derive(Clone, Debug)]
pub struct Constants<T, const D: usize> {
    pub dx: T,
    pub bodies: Vec<BodySetup<T>>,
    pub transfer: Transfer,
    pub layout: Layout,
    /// Cells per axis if periodic.
    pub period: [Option<i32>; D],
    /// Whether the volume of some body follows what fills the room.
    pub follows: bool,
    /// Whether P2G sums rest volumes.
    pub mixed: bool,
    /// Whether particles have sides, see [`gridfall_core::sim::side`]; their layer is then their block's field.
    pub sided: bool,
}
