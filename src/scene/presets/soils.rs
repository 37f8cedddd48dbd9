//! Sand, gravel and clay. Densities of sand and gravel are dry.

use super::sources::{BOLTON, BOWLES, HERE, LAMBE, LEPS, MITARAI, RICHEFEU, TERZAGHI};
use super::{Preset, q};

const GRAINS: &str = "The modulus does not grow with pressure, and neither strength nor dilatancy change as it shears. \
                      No water in the pores, no rate, no crushing of grains.";
const UNDRAINED: &str = "Undrained: for loads that come within hours. No drainage, no softening by remoulding, no \
                         rate. It keeps its strength where it is torn.";

pub const PRESETS: &[Preset] = &[
    Preset {
        name: "dry-sand",
        title: "Dry loose sand",
        model: "mohr-coulomb",
        about: "Poured quartz sand, as in hourglasses: 33° at constant volume, no dilatancy.",
        limits: GRAINS,
        values: &[
            q("density", 1430.0, [1330.0, 1600.0], &[TERZAGHI, LAMBE]),
            q("youngs_modulus", 15e6, [10e6, 25e6], &[BOWLES]),
            q("poissons_ratio", 0.3, [0.2, 0.4], &[BOWLES]),
            q("friction_angle_degrees", 33.0, [30.0, 36.0], &[BOLTON]),
            q("cohesion", 0.0, [0.0, 0.0], &[BOLTON]),
            q("dilatancy_angle_degrees", 0.0, [0.0, 5.0], &[BOLTON]),
        ],
    },
    Preset {
        name: "dense-sand",
        title: "Dense sand",
        model: "mohr-coulomb",
        about: "Compacted dry quartz sand at its peak strength.",
        limits: "It stays at its peak: real sand falls back to 33° after some percent of shear, in bands. The modulus \
                 does not grow with pressure. No water in the pores, no rate.",
        values: &[
            q("density", 1750.0, [1650.0, 1890.0], &[TERZAGHI, LAMBE]),
            q("youngs_modulus", 60e6, [50e6, 81e6], &[BOWLES]),
            q("poissons_ratio", 0.3, [0.2, 0.4], &[BOWLES]),
            q("friction_angle_degrees", 43.0, [38.0, 46.0], &[BOLTON])
                .note("33° + 3 I_R, I_R = 3.3 at a relative density of 0.8 and 100 kPa"),
            q("cohesion", 0.0, [0.0, 0.0], &[BOLTON]),
            q("dilatancy_angle_degrees", 12.5, [8.0, 20.0], &[BOLTON]).note("what is above 33° is 0.8 ψ: 10°/0.8"),
        ],
    },
    Preset {
        name: "wet-sand",
        title: "Wet sand",
        model: "mohr-coulomb",
        about: "Moist fine sand, as in sandcastles: bridges of water hold the grains.",
        limits: "The cohesion is of the right order only: it depends on the size of the grains and is there at any \
                 pressure, and it comes back where torn parts meet again. No flow of water.",
        values: &[
            q("density", 1600.0, [1500.0, 1800.0], &[TERZAGHI]).note("loose sand with a tenth of its mass in water"),
            q("youngs_modulus", 15e6, [10e6, 25e6], &[BOWLES]),
            q("poissons_ratio", 0.3, [0.2, 0.4], &[BOWLES]),
            q("friction_angle_degrees", 33.0, [30.0, 36.0], &[BOLTON]),
            q("cohesion", 500.0, [100.0, 2000.0], &[RICHEFEU, MITARAI])
                .note("hundreds of pascals for grains of some tenths of a millimetre"),
            q("dilatancy_angle_degrees", 0.0, [0.0, 5.0], &[BOLTON]),
        ],
    },
    Preset {
        name: "gravel",
        title: "Gravel",
        model: "mohr-coulomb",
        about: "Angular gravel, as under railway tracks.",
        limits: "Grains of a size that cells should not be below. The angle falls with pressure, and here it does not. \
                 No crushing.",
        values: &[
            q("density", 1700.0, [1430.0, 2300.0], &[LAMBE]),
            q("youngs_modulus", 100e6, [50e6, 200e6], &[BOWLES]),
            q("poissons_ratio", 0.3, [0.15, 0.35], &[BOWLES]),
            q("friction_angle_degrees", 42.0, [38.0, 50.0], &[LEPS]),
            q("cohesion", 0.0, [0.0, 0.0], &[LEPS]),
            q("dilatancy_angle_degrees", 5.0, [0.0, 12.0], &[HERE]).note("loosely tipped; compacted has more"),
        ],
    },
    Preset {
        name: "soft-clay",
        title: "Soft clay",
        model: "mohr-coulomb",
        about: "Saturated clay that fingers mould easily, undrained: φ = 0, and the cohesion is s_u.",
        limits: UNDRAINED,
        values: &[
            q("density", 1770.0, [1580.0, 1900.0], &[TERZAGHI]),
            q("youngs_modulus", 10e6, [5e6, 25e6], &[BOWLES]),
            q("poissons_ratio", 0.49, [0.45, 0.5], &[BOWLES]).note("0.5 where no water can leave"),
            q("friction_angle_degrees", 0.0, [0.0, 0.0], &[TERZAGHI]).note("undrained"),
            q("cohesion", 20e3, [12.5e3, 25e3], &[TERZAGHI]).note("half of the unconfined strength, 25 to 50 kPa"),
            q("dilatancy_angle_degrees", 0.0, [0.0, 0.0], &[TERZAGHI]).note("undrained"),
        ],
    },
    Preset {
        name: "stiff-clay",
        title: "Stiff clay",
        model: "mohr-coulomb",
        about: "Saturated clay that a thumb dents with effort, undrained: φ = 0, and the cohesion is s_u.",
        limits: UNDRAINED,
        values: &[
            q("density", 2070.0, [1900.0, 2150.0], &[TERZAGHI]),
            q("youngs_modulus", 40e6, [15e6, 100e6], &[BOWLES]),
            q("poissons_ratio", 0.49, [0.45, 0.5], &[BOWLES]).note("0.5 where no water can leave"),
            q("friction_angle_degrees", 0.0, [0.0, 0.0], &[TERZAGHI]).note("undrained"),
            q("cohesion", 75e3, [50e3, 100e3], &[TERZAGHI]).note("half of the unconfined strength, 100 to 200 kPa"),
            q("dilatancy_angle_degrees", 0.0, [0.0, 0.0], &[TERZAGHI]).note("undrained"),
        ],
    },
];
