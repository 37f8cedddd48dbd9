//! Liquids, at 20 °C.
//!
//! The real bulk modulus of water makes steps of some 1e-6 s at cells of a centimetre, and no flow
//! of a laboratory's size shows the difference. So these have one of 1 MPa, as weakly compressible
//! methods do (Monaghan 1994), and a notice says so.

use super::sources::{COLE, CRC, HERE, MONAGHAN, SEGUR};
use super::{Preset, Quantity, q};

const SOFT: &str = "sound at 30 m/s: right for flows up to 3 m/s, columns up to half a metre";

/// K (Pa) of a liquid in the program, and in reality.
const fn bulk(real: f64) -> Quantity {
    q("bulk_modulus", 1e6, [1e4, 5e9], &[MONAGHAN, CRC]).note(SOFT).real(real)
}

pub const PRESETS: &[Preset] = &[
    Preset {
        name: "water",
        title: "Water",
        model: "weakly-compressible-fluid",
        about: "Fresh water at 20 °C, with a numerical bulk modulus.",
        limits: "No surface tension, no air, no turbulence below the cells. Its sound is slower than the real one: \
                 water hammers and shocks are not right.",
        values: &[
            q("density", 998.2, [997.0, 1000.0], &[CRC]),
            bulk(2.2e9),
            q("gamma", 7.15, [7.0, 7.15], &[COLE]),
            q("viscosity", 1.002e-3, [0.8e-3, 1.8e-3], &[CRC]),
        ],
    },
    Preset {
        name: "seawater",
        title: "Seawater",
        model: "weakly-compressible-fluid",
        about: "Water with 35 g/kg of salt at 20 °C, with a numerical bulk modulus.",
        limits: "As for water.",
        values: &[
            q("density", 1025.0, [1020.0, 1030.0], &[CRC]),
            bulk(2.4e9),
            q("gamma", 7.15, [7.0, 7.15], &[COLE]),
            q("viscosity", 1.08e-3, [0.9e-3, 1.9e-3], &[CRC]),
        ],
    },
    Preset {
        name: "glycerine",
        title: "Glycerine",
        model: "weakly-compressible-fluid",
        about: "Pure glycerine at 20 °C, a thousand times as viscous as water; syrup and honey are alike.",
        limits: "As for water. A few percent of water or a few degrees halve its viscosity.",
        values: &[
            q("density", 1261.0, [1250.0, 1265.0], &[CRC]),
            bulk(4.6e9),
            q("gamma", 7.15, [7.0, 7.15], &[HERE]).note("water's, which matters only where it is compressed much"),
            q("viscosity", 1.41, [0.6, 12.0], &[SEGUR]),
        ],
    },
];
