//! Materials of every law, for tests that compare the laws, so that none is forgotten.

use super::parameters::{Cone, DruckerPrager, Elastic, Elasticity, Fluid, Material, MohrCoulomb, Nacc, Snow, VonMises};

/// At least one material of every law. The compiler keeps the match complete.
pub fn samples() -> Vec<Material> {
    let (density, youngs_modulus, poissons_ratio) = (1000.0, 1e5, 0.3);
    let elastic = Elastic { density, youngs_modulus, poissons_ratio, damping: 0.0 };
    let von_mises = |elasticity| {
        Material::VonMises(VonMises {
            density,
            youngs_modulus,
            poissons_ratio,
            yield_stress: 2e3,
            elasticity,
            damping: 0.0,
        })
    };
    let sand = |cohesion, dilatancy_angle_degrees, cone| {
        Material::DruckerPrager(DruckerPrager {
            density,
            youngs_modulus,
            poissons_ratio,
            friction_angle_degrees: 30.0,
            cohesion,
            dilatancy_angle_degrees,
            cone,
        })
    };
    let soil = |friction_angle_degrees, cohesion, dilatancy_angle_degrees| {
        Material::MohrCoulomb(MohrCoulomb {
            density,
            youngs_modulus,
            poissons_ratio,
            friction_angle_degrees,
            cohesion,
            dilatancy_angle_degrees,
        })
    };
    let all = vec![
        Material::FixedCorotated(elastic.clone()),
        Material::NeoHookean(elastic.clone()),
        Material::StvkHencky(elastic),
        Material::WeaklyCompressibleFluid(Fluid { density, bulk_modulus: 1e5, gamma: 7.15, viscosity: 0.5 }),
        sand(0.0, 0.0, Cone::TriaxialCompression),
        sand(2e3, 0.0, Cone::PlaneStrain),
        sand(2e3, 12.0, Cone::PlaneStrain),
        soil(30.0, 0.0, 0.0),
        soil(35.0, 0.0, 15.0),
        soil(25.0, 2e3, 0.0),
        soil(28.0, 2e3, 28.0),
        soil(0.0, 2e3, 0.0),
        Material::Nacc(Nacc { density, youngs_modulus, poissons_ratio, m: 2.36, beta: 0.5, xi: 3.0, alpha0: -0.01 }),
        von_mises(Elasticity::Hencky),
        von_mises(Elasticity::FixedCorotated),
        Material::Snow(Snow {
            density,
            youngs_modulus,
            poissons_ratio,
            critical_compression: 0.025,
            critical_stretch: 0.0075,
            hardening: 10.0,
        }),
    ];
    for material in &all {
        match material {
            Material::FixedCorotated(_) | Material::NeoHookean(_) | Material::StvkHencky(_) => {}
            Material::WeaklyCompressibleFluid(_) | Material::DruckerPrager(_) | Material::MohrCoulomb(_) => {}
            Material::Nacc(_) | Material::VonMises(_) | Material::Snow(_) => {}
        }
    }
    all
}
