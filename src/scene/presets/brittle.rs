//! Solids that break: here they yield at the load at which the real ones break.
//!
//! Mohr and Coulomb's surface through the uniaxial strengths f_c in compression and f_t in tension:
//! sin φ = (f_c − f_t)/(f_c + f_t), c = f_c (1 − sin φ)/(2 cos φ).

use super::sources::{CUFFEY, EUROCODE_1, EUROCODE_2, PETROVIC, SCHULSON};
use super::{Preset, q};

const LIMITS: &str = "It does not soften: strength stays where the real one cracks, so loads at first failure are \
                      right, and what comes after is not. No rate, no creep.";

pub const PRESETS: &[Preset] = &[
    Preset {
        name: "concrete",
        title: "Concrete C30/37",
        model: "mohr-coulomb",
        about: "Plain concrete, 30 MPa in compression and 2.9 MPa in tension.",
        limits: LIMITS,
        values: &[
            q("density", 2400.0, [2200.0, 2500.0], &[EUROCODE_1]),
            q("youngs_modulus", 33e9, [27e9, 44e9], &[EUROCODE_2]),
            q("poissons_ratio", 0.2, [0.1, 0.2], &[EUROCODE_2]),
            q("friction_angle_degrees", 55.5, [50.0, 60.0], &[EUROCODE_2]).note("of f_c = 30 MPa and f_t = 2.9 MPa"),
            q("cohesion", 4.66e6, [2e6, 7e6], &[EUROCODE_2]).note("of the same strengths"),
            q("dilatancy_angle_degrees", 10.0, [0.0, 20.0], &[super::sources::HERE])
                .note("small: it grows a little as it fails"),
        ],
    },
    Preset {
        name: "ice",
        title: "Ice",
        model: "mohr-coulomb",
        about: "Fresh-water ice at −10 °C, hit fast: 10 MPa in compression and 1.4 MPa in tension.",
        limits: LIMITS,
        values: &[
            q("density", 917.0, [830.0, 923.0], &[CUFFEY]),
            q("youngs_modulus", 9.3e9, [9e9, 11.2e9], &[SCHULSON, PETROVIC]),
            q("poissons_ratio", 0.325, [0.29, 0.33], &[SCHULSON]),
            q("friction_angle_degrees", 49.0, [40.0, 60.0], &[PETROVIC]).note("of f_c = 10 MPa and f_t = 1.4 MPa"),
            q("cohesion", 1.87e6, [1e6, 4e6], &[PETROVIC]).note("of the same strengths"),
            q("dilatancy_angle_degrees", 0.0, [0.0, 20.0], &[super::sources::HERE]).note("not measured"),
        ],
    },
];
