//! Settings of the discretisation that a scene may choose. Scenes spell these types as they are
//! serialised here.

mod implicit;

pub use implicit::{CoarseSolve, Implicit, Method, Norm, Plasticity, Smoother};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How steps are taken in time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Integrator {
    /// Explicit or implicit, whichever is predicted to be faster; the estimate says why.
    Auto,
    /// Short steps that cost little; the speed of sound bounds them.
    Explicit,
    /// Long steps, each a minimisation; motion alone bounds them.
    Implicit,
}

impl Integrator {
    /// The name that scenes use.
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Explicit => "explicit",
            Self::Implicit => "implicit",
        }
    }
}

/// How far particles and nodes reach each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Kernel {
    /// Two grids, on each of which a particle meets the nodes of its cell: sharp contacts, narrow gaps.
    Compact,
    /// B-splines of 3 nodes an axis: smoother fields.
    Quadratic,
    /// B-splines of 4 nodes an axis: smooth stresses; on the CPU only.
    Cubic,
    /// The 2 nodes of the cell an axis, noisy where particles cross cells; for comparison, on the CPU only.
    Linear,
}

/// How velocities go from particles to the grid and back.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Transfer {
    /// Particles keep no affine velocity; forces by kernel gradients.
    Pic,
    /// Affine velocities; forces by kernel gradients.
    Apic,
    /// Affine velocities; forces by moments (moving least squares). On the compact kernel's two
    /// grids, about the mean of each grid.
    Mls,
    /// As `mls`, but with the compact kernel's moments about the particle, as CK-MPM publishes
    /// them. They make divergence of a kink in the velocity, so that layers beside sticky surfaces
    /// may lock; for comparison with the paper. The other kernels have one grid and know no
    /// difference.
    MlsPublished,
}

impl Transfer {
    /// Whether particles keep an affine velocity.
    pub fn is_affine(self) -> bool {
        self != Self::Pic
    }

    /// Whether forces and ∇v come from moments, and not from kernel gradients.
    pub fn is_mls(self) -> bool {
        matches!(self, Self::Mls | Self::MlsPublished)
    }

    /// Whether these moments are about each grid's own mean.
    pub fn is_centred(self) -> bool {
        self == Self::Mls
    }
}

/// Where colliders act. Grips and the domain's walls act on nodes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ContactAt {
    /// Springs between particles and faces: faces lie where they are, whatever the cells, and nothing
    /// passes through.
    #[default]
    Particles,
    /// Nodes inside a collider take its velocity, as CK-MPM and HOT have it: the cell decides where
    /// the face is, and plates thinner than two cells leak.
    Nodes,
}

/// Of what precision numbers are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Precision {
    /// Single: enough for most scenes.
    F32,
    /// Double, on the CPU: for checks of accuracy.
    F64,
}

/// A field that is recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "Field")]
pub enum OutputField {
    #[serde(rename = "velocity")]
    Velocity,
    /// Volume ratio det F.
    #[serde(rename = "J")]
    J,
    /// von Mises equivalent of the Cauchy stress (Pa).
    #[serde(rename = "von_mises")]
    VonMises,
    /// Pressure, -tr(Cauchy)/3 (Pa).
    #[serde(rename = "pressure")]
    Pressure,
    /// Cauchy stress without viscosity (Pa): `stress_xx`, `stress_yy`, `stress_zz`, `stress_xy`, `stress_yz`,
    /// `stress_xz`.
    #[serde(rename = "stress")]
    Stress,
    /// Logarithmic (Hencky) strain, half the logarithm of F Fᵀ, in the axes of space: `strain_xx` to `strain_xz`. F is
    /// the elastic part in materials that flow, and has the volume alone in fluids.
    #[serde(rename = "strain")]
    Strain,
    /// Plastic strain as far as the law keeps it, as the logarithm of a volume ratio: what loose grains have gained
    /// apart from one another (Drucker-Prager, Mohr-Coulomb), the plastic volume since the start (NACC, snow). 0 in
    /// materials that do not flow, not a number for von Mises, which keeps none.
    #[serde(rename = "plastic_strain")]
    PlasticStrain,
    /// Number of the body or source: bodies from 0 in their order, sources after them. The recording has the names.
    #[serde(rename = "body")]
    Body,
    /// Number of the particle, the same in all frames.
    #[serde(rename = "id")]
    Id,
}

impl OutputField {
    /// Whether it is a function of the deformation.
    pub fn of_deformation(self) -> bool {
        !matches!(self, Self::Velocity | Self::Body | Self::Id)
    }
}
