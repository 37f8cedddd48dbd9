//! Constitutive models and their parameters, as a scene writes them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A constitutive model with its parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "model", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Material {
    FixedCorotated(Elastic),
    NeoHookean(Elastic),
    StvkHencky(Elastic),
    WeaklyCompressibleFluid(Fluid),
    DruckerPrager(DruckerPrager),
    MohrCoulomb(MohrCoulomb),
    Nacc(Nacc),
    VonMises(VonMises),
    Snow(Snow),
}

impl Material {
    /// Mass density at rest (kg/m³).
    pub fn density(&self) -> f64 {
        match self {
            Self::WeaklyCompressibleFluid(fluid) => fluid.density,
            _ => self.elastic().map_or(0.0, |elastic| elastic.density),
        }
    }

    pub fn is_fluid(&self) -> bool {
        matches!(self, Self::WeaklyCompressibleFluid(_))
    }

    /// Whether deformation is all stored, none of it plastic.
    pub fn is_elastic(&self) -> bool {
        matches!(self, Self::FixedCorotated(_) | Self::NeoHookean(_) | Self::StvkHencky(_))
    }

    /// Whether particles carry a scalar of plastic state beside F.
    pub fn has_plastic_state(&self) -> bool {
        matches!(self, Self::DruckerPrager(_) | Self::MohrCoulomb(_) | Self::Nacc(_) | Self::Snow(_))
    }

    /// Damping time (s); 0 without damping, and for the materials that have none.
    pub fn damping(&self) -> f64 {
        self.elastic().map_or(0.0, |elastic| elastic.damping)
    }

    /// Density, elastic moduli and damping of a solid; none for a fluid.
    pub fn elastic(&self) -> Option<Elastic> {
        let elastic =
            |density, youngs_modulus, poissons_ratio| Elastic { density, youngs_modulus, poissons_ratio, damping: 0.0 };
        Some(match self {
            Self::FixedCorotated(e) | Self::NeoHookean(e) | Self::StvkHencky(e) => e.clone(),
            Self::DruckerPrager(m) => elastic(m.density, m.youngs_modulus, m.poissons_ratio),
            Self::MohrCoulomb(m) => elastic(m.density, m.youngs_modulus, m.poissons_ratio),
            Self::Nacc(m) => elastic(m.density, m.youngs_modulus, m.poissons_ratio),
            Self::VonMises(m) => {
                Elastic { damping: m.damping, ..elastic(m.density, m.youngs_modulus, m.poissons_ratio) }
            }
            Self::Snow(m) => elastic(m.density, m.youngs_modulus, m.poissons_ratio),
            Self::WeaklyCompressibleFluid(_) => return None,
        })
    }
}

/// Isotropic elasticity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Elastic {
    /// Mass density at rest (kg/m³).
    pub density: f64,
    /// Young's modulus (Pa).
    pub youngs_modulus: f64,
    /// Poisson's ratio, in (-1, 0.5).
    pub poissons_ratio: f64,
    /// Damping time (s): a swing of f Hz has π f times as much of the critical damping. Explicit integration only.
    #[serde(default)]
    pub damping: f64,
}

/// p = (bulk_modulus / gamma) (J^-gamma - 1).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fluid {
    /// Mass density at rest (kg/m³).
    pub density: f64,
    /// Bulk modulus at rest (Pa).
    pub bulk_modulus: f64,
    /// Exponent of the equation of state; 7.15 by default.
    #[serde(default = "default_gamma")]
    pub gamma: f64,
    /// Dynamic viscosity (Pa·s).
    #[serde(default)]
    pub viscosity: f64,
}

fn default_gamma() -> f64 {
    7.15
}

/// Sand: Hencky elasticity inside a Drucker–Prager cone. The friction angle holds in the stress state of `cone`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DruckerPrager {
    /// Mass density at rest (kg/m³).
    pub density: f64,
    /// Young's modulus (Pa).
    pub youngs_modulus: f64,
    /// Poisson's ratio, in (-1, 0.5).
    pub poissons_ratio: f64,
    /// Angle of internal friction (degrees), in [0, 90).
    pub friction_angle_degrees: f64,
    /// Shear strength without pressure (Pa).
    #[serde(default)]
    pub cohesion: f64,
    /// Angle by which flow dilates (degrees), from 0 to the friction angle; 0 keeps the volume.
    #[serde(default)]
    pub dilatancy_angle_degrees: f64,
    /// The stress state in which the angles hold.
    #[serde(default)]
    pub cone: Cone,
}

/// The stress state in which a Drucker–Prager cone has its friction angle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Cone {
    /// Two equal pressures and a larger one, as published. In plane strain 30 degrees act like 28 (2D) and 44 (3D).
    #[default]
    TriaxialCompression,
    /// No strain along one axis: long walls, slopes and footings, and all scenes in 2D.
    PlaneStrain,
}

/// Soil and sand: Hencky elasticity inside the Mohr–Coulomb surface. The friction angle holds in every stress state.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MohrCoulomb {
    /// Mass density at rest (kg/m³).
    pub density: f64,
    /// Young's modulus (Pa).
    pub youngs_modulus: f64,
    /// Poisson's ratio, in (-1, 0.5).
    pub poissons_ratio: f64,
    /// Angle of internal friction (degrees), in [0, 90).
    pub friction_angle_degrees: f64,
    /// Shear strength without pressure (Pa).
    #[serde(default)]
    pub cohesion: f64,
    /// Angle by which flow dilates (degrees), from 0 to the friction angle; 0 keeps the volume.
    #[serde(default)]
    pub dilatancy_angle_degrees: f64,
}

/// Non-associative Cam Clay: brittle to ductile fracture, hardening under compression and softening under extension.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Nacc {
    /// Mass density at rest (kg/m³).
    pub density: f64,
    /// Young's modulus (Pa).
    pub youngs_modulus: f64,
    /// Poisson's ratio, in (-1, 0.5).
    pub poissons_ratio: f64,
    /// Slope of the critical state line, which sets the yield surface's height.
    #[serde(rename = "M")]
    pub m: f64,
    /// Cohesion: the tension at the surface's tip as a share of the compression at the other.
    pub beta: f64,
    /// Hardening factor.
    pub xi: f64,
    /// Initial logarithm of the plastic volume ratio; the more negative, the stronger.
    pub alpha0: f64,
}

/// Perfect plasticity of metals: the deviatoric Kirchhoff stress is bounded.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VonMises {
    /// Mass density at rest (kg/m³).
    pub density: f64,
    /// Young's modulus (Pa).
    pub youngs_modulus: f64,
    /// Poisson's ratio, in (-1, 0.5).
    pub poissons_ratio: f64,
    /// Yield stress in uniaxial tension (Pa).
    pub yield_stress: f64,
    /// The elastic law below the yield stress.
    #[serde(default)]
    pub elasticity: Elasticity,
    /// Damping time (s): a swing of f Hz has π f times as much of the critical damping. Explicit integration only.
    #[serde(default)]
    pub damping: f64,
}

/// The elastic law of a plastic material.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Elasticity {
    /// Quadratic in the logarithm of the stretches.
    #[default]
    Hencky,
    /// As the material `fixed-corotated`.
    FixedCorotated,
}

/// Snow: fixed corotated elasticity, singular values clamped, hardening with compaction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Snow {
    /// Mass density at rest (kg/m³).
    pub density: f64,
    /// Young's modulus (Pa).
    pub youngs_modulus: f64,
    /// Poisson's ratio, in (-1, 0.5).
    pub poissons_ratio: f64,
    /// Largest elastic compression θc: stretches stay above 1 - θc; in [0, 1).
    #[serde(default = "default_critical_compression")]
    pub critical_compression: f64,
    /// Largest elastic extension θs: stretches stay below 1 + θs.
    #[serde(default = "default_critical_stretch")]
    pub critical_stretch: f64,
    /// Hardening ξ: moduli grow by e^(ξ (1 - Jp)), Jp the plastic volume ratio; 0 for none.
    #[serde(default = "default_hardening")]
    pub hardening: f64,
}

fn default_critical_compression() -> f64 {
    0.025
}
fn default_critical_stretch() -> f64 {
    0.0075
}
fn default_hardening() -> f64 {
    10.0
}
