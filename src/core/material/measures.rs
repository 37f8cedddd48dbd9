//! Measures of a state for those who look at results. No engine uses them.

use super::parameters::Material;
use crate::maths::linalg::{Matrix, from_row_major, mul_transpose, to_row_major};
use crate::maths::svd::{Svd, svd};

/// Logarithmic (Hencky) strain ln V = ½ ln(F Fᵀ), row-major, of the deformation gradient `f` (row-major 3 × 3), in the
/// axes of space. Of a law that flows, F is the elastic part.
pub fn hencky_strain(f: &[f64; 9]) -> [f64; 9] {
    let Svd { u, sigma, .. } = svd(&from_row_major::<f64, 3>(f));
    // The last of them is negative where F turns a body inside out, and V is not.
    let logarithms = sigma.map(|sigma| sigma.abs().ln());
    let scaled: Matrix<f64, 3> = std::array::from_fn(|i| std::array::from_fn(|j| u[i][j] * logarithms[j]));
    to_row_major(&mul_transpose(&scaled, &u), 0.0)
}

/// Plastic strain since the start, as far as a law keeps it: the logarithm of a volume ratio, positive for growth.
/// 0 for laws that do not flow, NaN for those that flow and do not say how far.
pub fn plastic_strain(material: &Material, plastic: f64) -> f64 {
    match material {
        Material::DruckerPrager(_) | Material::MohrCoulomb(_) => plastic,
        Material::Nacc(clay) => plastic - clay.alpha0,
        Material::Snow(_) => plastic.ln(),
        Material::VonMises(_) => f64::NAN,
        Material::FixedCorotated(_)
        | Material::NeoHookean(_)
        | Material::StvkHencky(_)
        | Material::WeaklyCompressibleFluid(_) => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::{initial_plastic_state, samples};
    use crate::maths::linalg::{determinant, mul};

    #[test]
    fn strain_is_logarithmic_and_turns_with_the_body() {
        let stretches = [1.3f64, 0.9, 1.0];
        let f: Matrix<f64, 3> =
            std::array::from_fn(|i| std::array::from_fn(|j| if i == j { stretches[i] } else { 0.0 }));
        let (s, c) = 0.6f64.sin_cos();
        let turn = [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]];
        let strain = hencky_strain(&to_row_major(&mul(&turn, &f), 0.0));
        let [a, b, _] = stretches.map(f64::ln);
        let expected =
            [[c * c * a + s * s * b, s * c * (a - b), 0.0], [s * c * (a - b), s * s * a + c * c * b, 0.0], [0.0; 3]];
        for (value, expected) in strain.iter().zip(expected.as_flattened()) {
            assert!((value - expected).abs() < 1e-14, "{strain:?}");
        }
        // Its trace is the logarithm of the volume ratio, under shear and inside out, too.
        for f in [[1.0, 0.4, 0.0, 0.0, 1.1, -0.2, 0.3, 0.0, 0.8], [-1.2, 0.0, 0.0, 0.0, 1.0, 0.1, 0.0, 0.0, 1.0]] {
            let strain = hencky_strain(&f);
            assert!((strain[0] + strain[4] + strain[8] - determinant(&f).abs().ln()).abs() < 1e-14);
            assert!((strain[1] - strain[3]).abs() < 1e-15 && (strain[5] - strain[7]).abs() < 1e-15);
        }
    }

    #[test]
    fn nothing_has_flown_at_rest() {
        for material in samples() {
            let strain = plastic_strain(&material, initial_plastic_state(&material));
            assert!(strain == 0.0 || matches!(material, Material::VonMises(_)) && strain.is_nan(), "{material:?}");
        }
    }
}
