//! Snow, by the parameters of the paper whose law it is.

use super::sources::{CUFFEY, STOMAKHIN};
use super::{Preset, q};

const LIMITS: &str = "Parameters that look right, found for pictures, and not measured strengths. No sintering, no \
                      rate, no temperature.";

pub const PRESETS: &[Preset] = &[
    Preset {
        name: "snow",
        title: "Packed snow",
        model: "snow",
        about: "Snow as for snowballs: the paper's own parameters.",
        limits: LIMITS,
        values: &[
            q("density", 400.0, [350.0, 450.0], &[STOMAKHIN, CUFFEY]),
            q("youngs_modulus", 1.4e5, [4.8e4, 1.4e5], &[STOMAKHIN]),
            q("poissons_ratio", 0.2, [0.2, 0.2], &[STOMAKHIN]),
            q("critical_compression", 0.025, [0.019, 0.025], &[STOMAKHIN]),
            q("critical_stretch", 0.0075, [0.005, 0.0075], &[STOMAKHIN]),
            q("hardening", 10.0, [5.0, 10.0], &[STOMAKHIN]),
        ],
    },
    Preset {
        name: "powder-snow",
        title: "Powder snow",
        model: "snow",
        about: "Dry settled snow: it breaks sooner under compression and tension, into powder.",
        limits: LIMITS,
        values: &[
            q("density", 200.0, [50.0, 300.0], &[CUFFEY]).note("settled snow has 200 to 300, new snow 50 to 70"),
            q("youngs_modulus", 1.4e5, [4.8e4, 1.4e5], &[STOMAKHIN]),
            q("poissons_ratio", 0.2, [0.2, 0.2], &[STOMAKHIN]),
            q("critical_compression", 0.019, [0.019, 0.025], &[STOMAKHIN]),
            q("critical_stretch", 0.005, [0.005, 0.0075], &[STOMAKHIN]),
            q("hardening", 10.0, [5.0, 10.0], &[STOMAKHIN]),
        ],
    },
    Preset {
        name: "wet-snow",
        title: "Wet snow",
        model: "snow",
        about: "Heavy, muddy snow: softer and more ductile.",
        limits: LIMITS,
        values: &[
            q("density", 500.0, [400.0, 800.0], &[CUFFEY]),
            q("youngs_modulus", 4.8e4, [4.8e4, 1.4e5], &[STOMAKHIN]),
            q("poissons_ratio", 0.2, [0.2, 0.2], &[STOMAKHIN]),
            q("critical_compression", 0.025, [0.019, 0.025], &[STOMAKHIN]),
            q("critical_stretch", 0.0075, [0.005, 0.0075], &[STOMAKHIN]),
            q("hardening", 5.0, [5.0, 10.0], &[STOMAKHIN]),
        ],
    },
];
