//! Which test, and how far.

use crate::material::parameters::Material;
use crate::material::{Law, lame};

/// A test of a laboratory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Test {
    Uniaxial,
    Triaxial,
    Shear,
    Oedometer,
}

impl Test {
    pub const ALL: [Self; 4] = [Self::Uniaxial, Self::Triaxial, Self::Shear, Self::Oedometer];

    pub fn name(self) -> &'static str {
        match self {
            Self::Uniaxial => "uniaxial",
            Self::Triaxial => "triaxial",
            Self::Shear => "shear",
            Self::Oedometer => "oedometer",
        }
    }

    /// −1 where compression counts as positive.
    pub(super) fn sign(self) -> f64 {
        match self {
            Self::Uniaxial | Self::Shear => 1.0,
            Self::Triaxial | Self::Oedometer => -1.0,
        }
    }

    /// Length by the length at the start, at a strain as the test counts it.
    pub fn stretch(self, strain: f64) -> f64 {
        1.0 + self.sign() * strain
    }

    /// Whether sides may be held at a pressure.
    pub fn takes_pressure(self) -> bool {
        matches!(self, Self::Triaxial | Self::Shear)
    }
}

/// How a test is done.
#[derive(Clone, Debug, PartialEq)]
pub struct Programme {
    pub test: Test,
    /// Strain at the end, as the test counts it.
    pub strain: f64,
    /// Pressure (Pa) before the test, which is then held; 0 for none.
    pub confining_pressure: f64,
    pub steps: usize,
    /// Strain per second; 0 for so slowly that viscosity does not count.
    pub rate: f64,
}

/// How a test shall be done where it differs from the usual one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wishes {
    pub strain: Option<f64>,
    pub confining_pressure: Option<f64>,
    pub steps: Option<usize>,
    pub rate: Option<f64>,
}

/// A wish that no test can fulfil.
#[derive(Clone, Debug, PartialEq)]
pub struct Refused {
    /// Name of the field of [`Wishes`].
    pub field: &'static str,
    /// What is wrong with it, after the field's name.
    pub reason: String,
    pub remedy: &'static str,
}

/// Strains (absolute) that a test may go to.
const MAX_STRAIN: f64 = 100.0;
/// Length by the length at the start that has to be left.
const LEAST_STRETCH: f64 = 0.01;

/// Points of a curve unless said otherwise.
const STEPS: usize = 200;
/// The usual confining pressure (Pa): that of the atmosphere.
const USUAL_PRESSURE: f64 = 1e5;

impl Programme {
    /// A test as it suits a material: with a pressure where grains need one, far enough for it to yield.
    pub fn usual(material: &Material, test: Test) -> Self {
        let grains = friction(material).is_some_and(|(sin, _)| sin > 0.0);
        let pressed = match test {
            Test::Triaxial => true,
            Test::Shear => grains,
            Test::Uniaxial | Test::Oedometer => false,
        };
        let pressure = USUAL_PRESSURE.min(modulus(material) / 100.0);
        let mut programme = Self {
            test,
            strain: 0.0,
            confining_pressure: if pressed { pressure } else { 0.0 },
            steps: STEPS,
            rate: 0.0,
        };
        programme.strain = programme.usual_strain(material);
        programme
    }

    /// A test as it suits a material, but for some wishes.
    ///
    /// # Errors
    /// The first wish that cannot be fulfilled.
    pub fn wished(material: &Material, test: Test, wishes: &Wishes) -> Result<Self, Refused> {
        let refused = |field, reason, remedy| Err(Refused { field, reason, remedy });
        let mut programme = Self::usual(material, test);
        if let Some(pressure) = wishes.confining_pressure {
            if !test.takes_pressure() {
                let reason = format!("is given, and a {} test holds no pressure", test.name());
                return refused("confining_pressure", reason, "take it out");
            }
            if !(pressure >= 0.0 && pressure.is_finite()) {
                return refused("confining_pressure", format!("is {pressure}"), "write 0 or a number above 0");
            }
            programme.confining_pressure = pressure;
            programme.strain = programme.usual_strain(material);
        }
        if let Some(rate) = wishes.rate {
            if !(rate > 0.0 && rate.is_finite()) {
                return refused("rate", format!("is {rate}"), "write a number above 0");
            }
            programme.rate = rate;
        }
        if let Some(steps) = wishes.steps {
            if steps == 0 {
                return refused("steps", "is 0".into(), "write a number above 0");
            }
            programme.steps = steps;
        }
        if let Some(strain) = wishes.strain {
            let short = test != Test::Shear && test.stretch(strain) < LEAST_STRETCH;
            if !strain.is_finite() || strain == 0.0 || short || strain.abs() > MAX_STRAIN {
                let remedy = "write one that is not 0 and leaves a hundredth of the length";
                return refused("strain", format!("is {strain}"), remedy);
            }
            programme.strain = strain;
        }
        Ok(programme)
    }

    /// Some times the strain at which the material yields; of elastic ones, one that shows their shape.
    pub fn usual_strain(&self, material: &Material) -> f64 {
        let compressed = self.test == Test::Uniaxial && material.has_plastic_state();
        let strain: f64 = match (material, self.test) {
            (Material::WeaklyCompressibleFluid(_), Test::Oedometer) => 0.01,
            (Material::Nacc(_) | Material::Snow(_), _) => 0.1,
            (_, Test::Oedometer) if !matches!(material, Material::VonMises(_)) => 0.05,
            (Material::VonMises(metal), _) => 8.0 * metal.yield_stress / metal.youngs_modulus,
            _ => match friction(material) {
                Some((sin, cohesion)) => {
                    let confined = 2.0 * sin / (1.0 - sin) * self.confining_pressure;
                    let strength = confined + 2.0 * cohesion * ((1.0 + sin) / (1.0 - sin)).sqrt();
                    (6.0 * strength / modulus(material)).clamp(1e-3, 0.15)
                }
                None if self.test == Test::Triaxial => 0.1,
                None => 0.5,
            },
        };
        if compressed { -strain } else { strain }
    }
}

/// sin φ and the cohesion (Pa) of grains.
fn friction(material: &Material) -> Option<(f64, f64)> {
    match material {
        Material::DruckerPrager(m) => Some((m.friction_angle_degrees.to_radians().sin(), m.cohesion)),
        Material::MohrCoulomb(m) => Some((m.friction_angle_degrees.to_radians().sin(), m.cohesion)),
        _ => None,
    }
}

/// Young's modulus (Pa); of a fluid its bulk modulus.
fn modulus(material: &Material) -> f64 {
    match material.elastic() {
        Some(elastic) => {
            let (mu, lambda) = lame(&elastic);
            mu * (3.0 * lambda + 2.0 * mu) / (lambda + mu)
        }
        None => Law::<f64>::new(material).stiffness_at_rest(),
    }
}
