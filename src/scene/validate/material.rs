//! Meaning of material parameters: signs and ranges.

use gridfall_core::material::parameters::Elastic;
use gridfall_core::sim::timestep::moduli;

use crate::fault::join;
use crate::schema::Material;
use crate::validate::check::Check;
use crate::validate::plausible::{DAMPING, DENSITY, EXPONENT, WAVE};

/// Judges the parameters of a material.
pub fn check_material(check: &mut Check, at: &str, material: &Material) {
    if let Some(elastic) = material.elastic() {
        check_elastic(check, at, &elastic);
    }
    let field = |name: &str| join(at, name);
    match material {
        Material::FixedCorotated(_) | Material::NeoHookean(_) | Material::StvkHencky(_) => {}
        Material::WeaklyCompressibleFluid(fluid) => {
            check.positive(&field("density"), fluid.density, "the density");
            check.positive(&field("bulk_modulus"), fluid.bulk_modulus, "the bulk modulus");
            check.not_negative(&field("viscosity"), fluid.viscosity, "the viscosity");
            if check.finite(&field("gamma"), fluid.gamma) && fluid.gamma <= 1.0 {
                let reason = format!("the exponent is {}", fluid.gamma);
                check.fault(&field("gamma"), "out_of_range", reason, "write a number above 1; 7.15 is water's");
            }
            check.plausible(&field("gamma"), fluid.gamma, &EXPONENT);
        }
        Material::DruckerPrager(sand) => {
            let angles = (sand.friction_angle_degrees, sand.dilatancy_angle_degrees);
            check_granular(check, at, angles, sand.cohesion);
        }
        Material::MohrCoulomb(soil) => {
            let angles = (soil.friction_angle_degrees, soil.dilatancy_angle_degrees);
            check_granular(check, at, angles, soil.cohesion);
        }
        Material::Nacc(clay) => {
            check.positive(&field("M"), clay.m, "the slope of the critical state line");
            check.not_negative(&field("beta"), clay.beta, "the cohesion");
            check.not_negative(&field("xi"), clay.xi, "the hardening factor");
            check.finite(&field("alpha0"), clay.alpha0);
        }
        Material::VonMises(metal) => check.positive(&field("yield_stress"), metal.yield_stress, "the yield stress"),
        Material::Snow(snow) => {
            let (at, compression) = (field("critical_compression"), snow.critical_compression);
            if check.finite(&at, compression) && !(0.0..1.0).contains(&compression) {
                let reason = format!("the critical compression is {compression}");
                check.fault(&at, "out_of_range", reason, "write a number from 0 to below 1; snow has about 0.025");
            }
            check.not_negative(&field("critical_stretch"), snow.critical_stretch, "the critical stretch");
            check.not_negative(&field("hardening"), snow.hardening, "the hardening");
        }
    }
    check.plausible(&field("density"), material.density(), &DENSITY);
    if check.faults.clean(at) {
        let (lambda, mu, _) = moduli(material);
        let stiffness = if material.is_fluid() { "bulk_modulus" } else { "youngs_modulus" };
        check.plausible(&field(stiffness), ((lambda + 2.0 * mu) / material.density()).sqrt(), &WAVE);
    }
}

fn check_granular(check: &mut Check, at: &str, (friction, dilatancy): (f64, f64), cohesion: f64) {
    check.not_negative(&join(at, "cohesion"), cohesion, "the cohesion");
    let (friction_at, dilatancy_at) = (join(at, "friction_angle_degrees"), join(at, "dilatancy_angle_degrees"));
    if check.finite(&friction_at, friction) && !(0.0..90.0).contains(&friction) {
        let reason = format!("the friction angle is {friction} degrees");
        let remedy = "write degrees from 0 to below 90; dry sand has 30 to 40";
        return check.fault(&friction_at, "out_of_range", reason, remedy);
    }
    if check.finite(&dilatancy_at, dilatancy) && !(0.0..=friction).contains(&dilatancy) {
        let reason = format!("the dilatancy angle is {dilatancy} degrees, the friction angle {friction}");
        let remedy =
            "write degrees from 0 to the friction angle; dense sand dilates by about 30 less than its friction angle";
        check.fault(&dilatancy_at, "out_of_range", reason, remedy);
    }
}

fn check_elastic(check: &mut Check, at: &str, elastic: &Elastic) {
    check.positive(&join(at, "density"), elastic.density, "the density");
    check.positive(&join(at, "youngs_modulus"), elastic.youngs_modulus, "Young's modulus");
    let damping_at = join(at, "damping");
    check.not_negative(&damping_at, elastic.damping, "the damping time");
    check.plausible(&damping_at, elastic.damping, &DAMPING);
    let (at, nu) = (join(at, "poissons_ratio"), elastic.poissons_ratio);
    if check.finite(&at, nu) && !(nu > -1.0 && nu < 0.5) {
        let reason = format!("Poisson's ratio is {nu}");
        let remedy = "write a number above -1 and below 0.5; 0.49 is nearly incompressible";
        check.fault(&at, "out_of_range", reason, remedy);
    }
}
