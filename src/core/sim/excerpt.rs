//! The particles of a frame that are recorded and drawn. Nothing else is kept of a frame while the
//! next one is computed.

use std::sync::Arc;

use super::particles::Particles;

/// Particles whose states are wanted of frames.
#[derive(Clone, Debug, Default)]
pub struct Choice {
    /// Their indices in sampling order, ascending. Those that sources have yet to emit may be among them.
    pub ids: Arc<[u32]>,
    /// Whether their deformation is wanted too.
    pub deformation: bool,
}

/// States of chosen particles, in the order of their choice. Arrays have equal length, except
/// that those of the deformation are empty where nothing that is recorded needs it. Particles that
/// sources have yet to emit are left out.
#[derive(Clone, Debug, Default)]
pub struct Excerpt {
    /// Number of particles in the choice, including those yet to be emitted.
    pub selected: usize,
    deformation: bool,
    /// Position (m).
    pub x: Vec<[f64; 3]>,
    /// Velocity (m/s).
    pub v: Vec<[f64; 3]>,
    /// Deformation gradient.
    pub f: Vec<[f64; 9]>,
    pub plastic: Vec<f64>,
    /// Index of the body.
    pub body: Vec<u32>,
}

impl Excerpt {
    /// An empty excerpt with room for a choice.
    pub fn of(choice: &Choice) -> Self {
        let n = choice.ids.len();
        let deformed = if choice.deformation { n } else { 0 };
        Self {
            selected: n,
            deformation: choice.deformation,
            x: Vec::with_capacity(n),
            v: Vec::with_capacity(n),
            f: Vec::with_capacity(deformed),
            plastic: Vec::with_capacity(deformed),
            body: Vec::with_capacity(n),
        }
    }

    /// Takes the chosen particles from a part of all particles, which starts with the particle
    /// `first`. Parts come in order.
    pub fn take(&mut self, choice: &Choice, first: usize, part: &Particles) {
        for &id in &choice.ids[self.x.len()..] {
            let at = id as usize - first;
            if at >= part.len() {
                break;
            }
            self.x.push(part.x[at]);
            self.v.push(part.v[at]);
            self.body.push(part.body[at]);
            if self.deformation {
                self.f.push(part.f[at]);
                self.plastic.push(part.plastic[at]);
            }
        }
    }

    /// How many of a selection within this one exist.
    pub fn present(&self, within: &[u32]) -> usize {
        within.partition_point(|&k| (k as usize) < self.x.len())
    }
}
