//! Rubbers, gels and foams.

use super::sources::{BONAVIA, CORK, DOW, GENT, GIBSON, HERE, JOHNSTON, TRELOAR};
use super::{Preset, Quantity, q};

/// Rubbers and gels keep their volume: their ν is above 0.499.
const fn incompressible() -> Quantity {
    q("poissons_ratio", 0.49, [0.45, 0.4999], &[HERE])
        .note("really above 0.499: at 0.49 volume changes a little, and steps are three times as long")
}

pub const PRESETS: &[Preset] = &[
    Preset {
        name: "natural-rubber",
        title: "Natural rubber",
        model: "neo-hookean",
        about: "Vulcanised natural rubber without fillers, as in rubber bands.",
        limits: "Right to stretches of about 1.5 (within 10 % to 3 in shear); no stiffening at five times its length, \
                 no hysteresis, no tearing.",
        values: &[
            q("density", 930.0, [910.0, 970.0], &[TRELOAR]),
            q("youngs_modulus", 1.17e6, [0.7e6, 2e6], &[TRELOAR]).note("three times G = 0.39 MPa"),
            incompressible(),
        ],
    },
    Preset {
        name: "soft-rubber",
        title: "Soft rubber",
        model: "neo-hookean",
        about: "Rubber of 25 Shore A, as in erasers and soft seals.",
        limits: "As for natural rubber. The modulus follows from the hardness, within some 20 %.",
        values: &[
            q("density", 1100.0, [950.0, 1250.0], &[HERE]).note("rubber of 930 kg/m³ with some filler"),
            q("youngs_modulus", 0.92e6, [0.5e6, 1.5e6], &[GENT])
                .note("E (MPa) = 0.0981 (56 + 7.62336 S)/(0.137505 (254 − 2.54 S)) at S = 25"),
            incompressible(),
        ],
    },
    Preset {
        name: "tyre-rubber",
        title: "Tyre rubber",
        model: "neo-hookean",
        about: "Rubber of 60 Shore A, filled with carbon black, as in tyres and shoe soles.",
        limits: "As for natural rubber. Filled rubber is softer after its first stretch (Mullins), and damps.",
        values: &[
            q("density", 1150.0, [1100.0, 1250.0], &[HERE])
                .note("rubber of 930 kg/m³, a fifth of its volume carbon black of 1.8 g/cm³ or more"),
            q("youngs_modulus", 3.6e6, [2e6, 10e6], &[GENT]).note("by Gent's formula at S = 60"),
            incompressible(),
        ],
    },
    Preset {
        name: "silicone",
        title: "Silicone rubber",
        model: "neo-hookean",
        about: "PDMS (Sylgard 184, 10 : 1), cured at room temperature.",
        limits: "As for natural rubber. Hotter curing makes it up to twice as stiff.",
        values: &[
            q("density", 1030.0, [965.0, 1050.0], &[DOW]),
            q("youngs_modulus", 1.32e6, [0.5e6, 3e6], &[JOHNSTON]),
            incompressible(),
        ],
    },
    Preset {
        name: "jelly",
        title: "Jelly",
        model: "neo-hookean",
        about: "A dessert: 20 parts of water to one of gelatine.",
        limits: "Does not break, creep or melt.",
        values: &[
            q("density", 1010.0, [1000.0, 1050.0], &[HERE]).note("nearly all of it is water"),
            q("youngs_modulus", 4.3e3, [1e3, 10e3], &[BONAVIA]),
            incompressible(),
        ],
    },
    Preset {
        name: "gelatine",
        title: "Gelatine, 10 %",
        model: "neo-hookean",
        about: "Nine parts of water to one of gelatine, as in phantoms of tissue and targets of ballistics.",
        limits: "Does not break, creep or stiffen with the rate, as the real one does at impact.",
        values: &[
            q("density", 1030.0, [1000.0, 1060.0], &[HERE]).note("a tenth of it is protein of 1.3 g/cm³"),
            q("youngs_modulus", 18e3, [4.3e3, 277e3], &[BONAVIA]).note("277 kPa (2/9)^1.8, by the power law"),
            incompressible(),
        ],
    },
    Preset {
        name: "foam",
        title: "Soft foam",
        model: "neo-hookean",
        about: "Flexible open-cell polyurethane of 30 kg/m³, as in cushions.",
        limits: "Right to about 5 % of compression. There cells buckle: the plateau and the stiffening at 60 % and \
                 more are not there. No damping by air; `damping` may stand for it.",
        values: &[
            q("density", 30.0, [20.0, 60.0], &[GIBSON]),
            q("youngs_modulus", 28e3, [10e3, 110e3], &[GIBSON]).note("45 MPa (30/1200)²"),
            q("poissons_ratio", 0.3, [0.1, 0.35], &[GIBSON]),
        ],
    },
    Preset {
        name: "cork",
        title: "Cork",
        model: "stvk-hencky",
        about: "Cork as one pulls it out of bottles: hardly wider when it is pressed.",
        limits: "Right to some percent: cells collapse beyond, at about 0.7 MPa. The grain of cork is left out.",
        values: &[
            q("density", 170.0, [120.0, 240.0], &[CORK]),
            q("youngs_modulus", 13e6, [8e6, 20e6], &[CORK]).note("20 MPa along the radius of the tree"),
            q("poissons_ratio", 0.1, [0.0, 0.5], &[CORK]).note("0 to 0.1 with the radius, 0.25 to 0.5 across it"),
        ],
    },
];
