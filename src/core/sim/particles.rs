//! Particle states as exchanged between engines, recordings and diagnostics.

use super::touch::Touch;

/// States of all particles at a frame boundary, in the order in which the bodies were sampled.
///
/// All arrays have equal length. 2D scenes use the first two components of vectors, with zero z and
/// F_zz = 1. Matrices are row-major 3 × 3.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Particles {
    /// Position (m), in scene coordinates.
    pub x: Vec<[f64; 3]>,
    /// Velocity (m/s).
    pub v: Vec<[f64; 3]>,
    /// APIC affine moment B = ½ Σ_s Σ_i w v_i (x_i - x_p)ᵀ (m²/s); the velocity's affine part is
    /// C = B D⁻¹ (NUMERICS §1).
    pub b: Vec<[f64; 9]>,
    /// Deformation gradient F. A fluid's is J^(1/d) I, because its law uses only J.
    pub f: Vec<[f64; 9]>,
    /// Plastic state: the one scalar that some laws have besides F (see their files in
    /// [`crate::material`]); 0 for the others.
    pub plastic: Vec<f64>,
    /// Index into [`crate::sim::setup::Setup::bodies`].
    pub body: Vec<u32>,
    /// What they remember of contact; of the first particles only, or of none, where the others have
    /// met nothing yet.
    pub touch: Vec<Touch>,
}

impl Particles {
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// Appends other particles. If there are none yet, takes over their memory.
    pub fn append(&mut self, others: Self) {
        fn put<T>(these: &mut Vec<T>, mut others: Vec<T>) {
            if these.is_empty() {
                *these = others;
            } else {
                these.reserve_exact(others.len());
                these.append(&mut others);
            }
        }
        put(&mut self.x, others.x);
        put(&mut self.v, others.v);
        put(&mut self.b, others.b);
        put(&mut self.f, others.f);
        put(&mut self.plastic, others.plastic);
        put(&mut self.body, others.body);
        put(&mut self.touch, others.touch);
    }

    pub fn is_empty(&self) -> bool {
        self.x.is_empty()
    }
}

/// The 3 × 3 identity, row-major.
pub const IDENTITY: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
