//! Metals: elastic, then flowing at constant stress.

use super::sources::{CALLISTER, EUROCODE_1, EUROCODE_3};
use super::{Preset, q};

const LIMITS: &str = "No hardening, no dependence on rate or temperature, no fracture: necks and cracks are not right.";

pub const PRESETS: &[Preset] = &[
    Preset {
        name: "steel",
        title: "Mild steel",
        model: "von-mises",
        about: "Structural steel S 235, with its real modulus.",
        limits: LIMITS,
        values: &[
            q("density", 7850.0, [7750.0, 8050.0], &[EUROCODE_1]),
            q("youngs_modulus", 210e9, [190e9, 215e9], &[EUROCODE_3]),
            q("poissons_ratio", 0.3, [0.27, 0.3], &[EUROCODE_3]),
            q("yield_stress", 235e6, [235e6, 460e6], &[EUROCODE_3]),
        ],
    },
    Preset {
        name: "aluminium",
        title: "Aluminium 6061-T6",
        model: "von-mises",
        about: "The aluminium of profiles, frames and machined parts.",
        limits: LIMITS,
        values: &[
            q("density", 2700.0, [2640.0, 2810.0], &[CALLISTER]),
            q("youngs_modulus", 69e9, [69e9, 73e9], &[CALLISTER]),
            q("poissons_ratio", 0.33, [0.33, 0.35], &[CALLISTER]),
            q("yield_stress", 276e6, [34e6, 505e6], &[CALLISTER]).note("55 MPa where it is annealed"),
        ],
    },
    Preset {
        name: "copper",
        title: "Copper",
        model: "von-mises",
        about: "Hot-rolled C11000, the copper of pipes and wires.",
        limits: LIMITS,
        values: &[
            q("density", 8890.0, [8890.0, 8960.0], &[CALLISTER]),
            q("youngs_modulus", 115e9, [115e9, 130e9], &[CALLISTER]),
            q("poissons_ratio", 0.33, [0.33, 0.36], &[CALLISTER]),
            q("yield_stress", 69e6, [33e6, 310e6], &[CALLISTER]).note("310 MPa where it is cold-worked"),
        ],
    },
    Preset {
        name: "lead",
        title: "Lead",
        model: "von-mises",
        about: "Chemical lead, so soft that a fall dents it.",
        limits: "No creep, which real lead has at room temperature; no hardening, no dependence on rate, no fracture.",
        values: &[
            q("density", 11340.0, [11300.0, 11350.0], &[CALLISTER]),
            q("youngs_modulus", 13.5e9, [13.5e9, 17e9], &[CALLISTER]),
            q("poissons_ratio", 0.44, [0.42, 0.45], &[CALLISTER]),
            q("yield_stress", 7e6, [6e6, 8e6], &[CALLISTER]),
        ],
    },
];
