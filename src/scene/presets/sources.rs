//! Where the presets' values are from.

/// A work that values are taken from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Source {
    /// For references to it: `Bolton 1986`.
    pub key: &'static str,
    /// Authors, year, title, where.
    pub text: &'static str,
    /// What of it was seen when its values were taken; empty where there is nothing to see.
    pub checked: &'static str,
}

const fn source(key: &'static str, text: &'static str, checked: &'static str) -> Source {
    Source { key, text, checked }
}

/// A work that was not at hand.
const UNSEEN: &str = "not at hand; take its values as typical ones, as they are commonly quoted";

pub const BOLTON: Source = source(
    "Bolton 1986",
    "Bolton, M. D. (1986): The strength and dilatancy of sands. Géotechnique 36 (1), 65–78: 33° at constant volume for \
     quartz, 3 I_R more at the peak of triaxial compression, I_R = I_D (10 − ln p') − 1.",
    "33° for quartz in its abstract; the rest as it is commonly quoted",
);
pub const BONAVIA: Source = source(
    "Bonavia 2025",
    "Bonavia, J. E. (2025): Viscoelastic material properties of gelatin with varying water to collagen mass ratios. \
     arXiv:2512.20502: 277 kPa at 2 : 1 to 4.34 kPa at 20 : 1, a power law between.",
    "both values and the power law in its abstract",
);
pub const BOWLES: Source = source(
    "Bowles 1996",
    "Bowles, J. E. (1996): Foundation analysis and design. 5th ed., McGraw-Hill, tables 2-7 (Poisson's ratio) and 2-8 \
     (modulus of elasticity).",
    UNSEEN,
);
pub const CALLISTER: Source = source(
    "Callister & Rethwisch",
    "Callister, W. D. and Rethwisch, D. G. (2009): Materials science and engineering: an introduction. 8th ed., Wiley, \
     appendix B, tables B.1 to B.4.",
    "69 GPa, 0.33 and 270 to 276 MPa of the aluminium, 115 GPa of the copper in other public tables; the rest as it \
     is commonly quoted",
);
pub const COLE: Source = source(
    "Cole 1948",
    "Cole, R. H. (1948): Underwater explosions. Princeton University Press: γ = 7.15 for water.",
    UNSEEN,
);
pub const CORK: Source = source(
    "Gibson et al. 1981",
    "Gibson, L. J., Easterling, K. E. and Ashby, M. F. (1981): The structure and mechanics of cork. Proceedings of the \
     Royal Society A 377, 99–117.",
    UNSEEN,
);
pub const CRC: Source = source(
    "CRC Handbook",
    "Rumble, J. R., ed.: CRC Handbook of Chemistry and Physics. CRC Press, tables of the density, the viscosity and \
     the speed of sound of liquids.",
    "water in other public tables; the rest as it is commonly quoted",
);
pub const CUFFEY: Source = source(
    "Cuffey & Paterson 2010",
    "Cuffey, K. M. and Paterson, W. S. B. (2010): The physics of glaciers. 4th ed., Butterworth-Heinemann, chapter 2, \
     typical densities of snow, firn and ice.",
    UNSEEN,
);
pub const DOW: Source = source(
    "Dow, Sylgard 184",
    "Dow Corning: Sylgard 184 silicone elastomer, product information (specific gravity of the cured rubber).",
    UNSEEN,
);
pub const EUROCODE_1: Source = source(
    "EN 1991-1-1",
    "EN 1991-1-1:2002: Eurocode 1. Actions on structures. Densities, self-weight, imposed loads for buildings. Annex \
     A.",
    UNSEEN,
);
pub const EUROCODE_2: Source = source(
    "EN 1992-1-1",
    "EN 1992-1-1:2004: Eurocode 2. Design of concrete structures. General rules. Table 3.1 (C30/37) and 3.1.3.",
    "30 MPa, 2.9 MPa and 33 GPa in public copies of the table",
);
pub const EUROCODE_3: Source = source(
    "EN 1993-1-1",
    "EN 1993-1-1:2005: Eurocode 3. Design of steel structures. General rules. Table 3.1 (S 235) and 3.2.6.",
    "210 GPa in a public guide that quotes it; 235 MPa is in the name of the steel",
);
pub const GENT: Source = source(
    "Gent 1958",
    "Gent, A. N. (1958): On the relation between indentation hardness and Young's modulus. Rubber Chemistry and \
     Technology 31 (4), 896–906.",
    UNSEEN,
);
pub const GIBSON: Source = source(
    "Gibson & Ashby 1997",
    "Gibson, L. J. and Ashby, M. F. (1997): Cellular solids: structure and properties. 2nd ed., Cambridge University \
     Press: E/E_s = (ρ/ρ_s)², ν ≈ 1/3 for open cells; E_s = 45 MPa, ρ_s = 1200 kg/m³ for flexible polyurethane.",
    UNSEEN,
);
pub const JOHNSTON: Source = source(
    "Johnston et al. 2014",
    "Johnston, I. D., McCluskey, D. K., Tan, C. K. L. and Tracey, M. C. (2014): Mechanical characterization of bulk \
     Sylgard 184 for microfluidics and microengineering. Journal of Micromechanics and Microengineering 24, 035017: \
     1.32 MPa cured at 25 °C, 2.97 MPa at 200 °C.",
    "both values in its abstract",
);
pub const LAMBE: Source = source(
    "Lambe & Whitman 1969",
    "Lambe, T. W. and Whitman, R. V. (1969): Soil mechanics. Wiley, table 3.2 (largest and smallest dry unit weights).",
    UNSEEN,
);
pub const LEPS: Source = source(
    "Leps 1970",
    "Leps, T. M. (1970): Review of shearing strength of rockfill. Journal of the Soil Mechanics and Foundations \
     Division, ASCE 96 (SM4), 1159–1170.",
    UNSEEN,
);
pub const MITARAI: Source = source(
    "Mitarai & Nori 2006",
    "Mitarai, N. and Nori, F. (2006): Wet granular materials. Advances in Physics 55, 1–45.",
    UNSEEN,
);
pub const MONAGHAN: Source = source(
    "Monaghan 1994",
    "Monaghan, J. J. (1994): Simulating free surface flows with SPH. Journal of Computational Physics 110, 399–406: a \
     speed of sound of ten times the flow's keeps changes of density near 1 %.",
    UNSEEN,
);
pub const PETROVIC: Source = source(
    "Petrovic 2003",
    "Petrovic, J. J. (2003): Review: Mechanical properties of ice and snow. Journal of Materials Science 38, 1–6: \
     tension 0.7 to 3.1 MPa, compression 5 to 25 MPa at −10 to −20 °C.",
    "both ranges in its abstract",
);
pub const RICHEFEU: Source = source(
    "Richefeu et al. 2006",
    "Richefeu, V., El Youssoufi, M. S. and Radjaï, F. (2006): Shear strength properties of wet granular materials. \
     Physical Review E 73, 051304: the cohesion grows with the water at first, and then no more.",
    "in its abstract, which has no value of the cohesion",
);
pub const SCHULSON: Source = source(
    "Schulson & Duval 2009",
    "Schulson, E. M. and Duval, P. (2009): Creep and fracture of ice. Cambridge University Press.",
    UNSEEN,
);
pub const SEGUR: Source = source(
    "Segur & Oberstar 1951",
    "Segur, J. B. and Oberstar, H. E. (1951): Viscosity of glycerol and its aqueous solutions. Industrial and \
     Engineering Chemistry 43 (9), 2117–2120.",
    UNSEEN,
);
pub const STOMAKHIN: Source = source(
    "Stomakhin et al. 2013",
    "Stomakhin, A., Schroeder, C., Chai, L., Teran, J. and Selle, A. (2013): A material point method for snow \
     simulation. ACM Transactions on Graphics 32 (4), 102, table of parameters and the figure that varies them.",
    "in programs that follow it and name the same values",
);
pub const TERZAGHI: Source = source(
    "Terzaghi et al. 1996",
    "Terzaghi, K., Peck, R. B. and Mesri, G. (1996): Soil mechanics in engineering practice. 3rd ed., Wiley: tables of \
     typical unit weights of soils and of the consistency of clay.",
    "25 to 50 kPa of soft and 100 to 200 kPa of stiff clay in public tables; the rest as it is commonly quoted",
);
pub const TRELOAR: Source = source(
    "Treloar 1975",
    "Treloar, L. R. G. (1975): The physics of rubber elasticity. 3rd ed., Oxford University Press: G = 0.39 MPa for \
     the vulcanised rubber of his measurements of 1944.",
    UNSEEN,
);
/// For values that no measurement gives.
pub const HERE: Source = source("numerical", "Chosen for this program: the text beside it says why.", "");
