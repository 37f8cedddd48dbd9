//! Colours of particles, the same in point clouds and pictures: a hue per body, brighter where it
//! moves fast.

use gridfall_core::sim::setup::{Material, Setup};

use crate::appearance::Appearance;

/// Linear RGB, 0 to 1.
pub type Rgb = [f32; 3];

/// Hues (sRGB) for fluids, sand, snow, metals and other solids, in the order in which a scene's bodies use them.
const FLUIDS: [[u8; 3]; 3] = [[0x16, 0x62, 0xb4], [0x10, 0x88, 0x90], [0x58, 0x4c, 0xc0]];
const SANDS: [[u8; 3]; 4] = [[0xd8, 0xae, 0x68], [0xb0, 0x7a, 0x4c], [0x8f, 0x8a, 0x84], [0xc9, 0x8b, 0x78]];
const SNOWS: [[u8; 3]; 2] = [[0xd6, 0xe4, 0xf2], [0xb4, 0xc8, 0xe0]];
const METALS: [[u8; 3]; 3] = [[0x8a, 0x96, 0xa6], [0xb8, 0x86, 0x4e], [0x5c, 0x68, 0x80]];
const SOLIDS: [[u8; 3]; 7] = [
    [0xe8, 0x5d, 0x3a],
    [0x2a, 0x9d, 0x8f],
    [0xf0, 0xa8, 0x2e],
    [0x7b, 0x5c, 0xd6],
    [0xd8, 0x43, 0x7c],
    [0x6b, 0xa8, 0x3f],
    [0x3d, 0x7d, 0xd8],
];

/// Colours of a problem's bodies.
#[derive(Clone, Debug)]
pub struct Palette {
    /// Base colour, colour at full speed, gloss.
    bodies: Vec<([Rgb; 2], f32)>,
    /// Speed at which the second colour is reached (m/s); fixed for the run, so that colours do not
    /// flicker.
    full_speed_m_s: f64,
}

impl Palette {
    pub fn new(setup: &Setup, appearance: &Appearance) -> Self {
        let (mut fluids, mut solids) = (FLUIDS.iter().cycle(), SOLIDS.iter().cycle());
        let (mut sands, mut snows, mut metals) = (SANDS.iter().cycle(), SNOWS.iter().cycle(), METALS.iter().cycle());
        let bodies = setup.bodies.iter().map(|body| {
            let (hue, lightening, gloss) = match setup.materials[body.material] {
                Material::WeaklyCompressibleFluid(_) => (fluids.next(), 0.75, 0.7),
                Material::DruckerPrager(_) | Material::MohrCoulomb(_) => (sands.next(), 0.3, 0.05),
                Material::Snow(_) => (snows.next(), 0.6, 0.05),
                Material::VonMises(_) => (metals.next(), 0.35, 0.5),
                _ => (solids.next(), 0.35, 0.2),
            };
            let base = hue.expect("a cycle has no end").map(from_srgb);
            ([base, base.map(|c| c + (0.95 - c) * lightening)], gloss)
        });
        Self { bodies: bodies.collect(), full_speed_m_s: appearance.full_speed_m_s }
    }

    /// Colour of a particle of a body at a speed (m/s).
    pub fn color(&self, body: u32, speed_m_s: f64) -> Rgb {
        let ([base, fast], _) = self.bodies[body as usize];
        let t = (speed_m_s / self.full_speed_m_s).clamp(0.0, 1.0) as f32;
        std::array::from_fn(|k| base[k] + (fast[k] - base[k]) * t * t)
    }

    /// How glossy a body is in pictures, 0 to 1.
    pub fn gloss(&self, body: u32) -> f32 {
        self.bodies[body as usize].1
    }
}

/// One channel, sRGB to linear.
pub fn from_srgb(c: u8) -> f32 {
    let c = f32::from(c) / 255.0;
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

/// One channel, linear to sRGB.
pub fn to_srgb(c: f32) -> u8 {
    let c = c.clamp(0.0, 1.0);
    let c = if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
    (c * 255.0 + 0.5) as u8
}
