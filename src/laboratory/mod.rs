//! Materials in the laboratory: curves of element tests as files and pictures, and materials whose
//! curves are like measured ones.

pub mod curve;
pub mod fit;
pub mod plot;

use gridfall_core::material::element::Test;

/// The columns that a test is about, in the order in which they are drawn.
pub fn shown(test: Test) -> &'static [&'static str] {
    match test {
        Test::Uniaxial => &["axial_stress", "volumetric_strain"],
        Test::Triaxial => &["q", "volumetric_strain"],
        Test::Shear => &["shear_stress", "volumetric_strain"],
        Test::Oedometer => &["axial_stress", "lateral_stress"],
    }
}
