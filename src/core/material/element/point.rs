//! What is read off an element.

use super::{Element, Test, det, double_dot, mul_transpose, trace};
use crate::maths::linalg::Matrix;

/// A row of a curve. Stresses are true stresses (Pa) unless they say otherwise.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point {
    /// Change of length by length; in shear, the shift by the height.
    pub strain: f64,
    /// Force along the axis by the area at the start of the test; in shear, along the plane.
    pub nominal_stress: f64,
    pub axial_stress: f64,
    pub lateral_stress: f64,
    pub shear_stress: f64,
    pub p: f64,
    pub q: f64,
    /// Change of the volume by the volume at the start of the test.
    pub volumetric_strain: f64,
    /// Volume by that of the body at rest.
    pub volume_ratio: f64,
    /// Σ √(2/3) ‖dev Δε_p‖, ε_p the logarithmic strain that flowed.
    pub plastic_strain: f64,
    /// Its volumetric part, positive for growth.
    pub plastic_volume: f64,
    /// The law's own state: ln of a volume (sand, clay), a volume ratio (snow).
    pub plastic_state: f64,
}

impl Point {
    pub const COLUMNS: [&str; 12] = [
        "strain",
        "nominal_stress",
        "axial_stress",
        "lateral_stress",
        "shear_stress",
        "p",
        "q",
        "volumetric_strain",
        "volume_ratio",
        "plastic_strain",
        "plastic_volume",
        "plastic_state",
    ];

    /// In the order of [`Self::COLUMNS`].
    pub fn values(&self) -> [f64; 12] {
        [
            self.strain,
            self.nominal_stress,
            self.axial_stress,
            self.lateral_stress,
            self.shear_stress,
            self.p,
            self.q,
            self.volumetric_strain,
            self.volume_ratio,
            self.plastic_strain,
            self.plastic_volume,
            self.plastic_state,
        ]
    }

    /// The value of a column; none if there is no such column.
    pub fn value(&self, column: &str) -> Option<f64> {
        Self::COLUMNS.iter().position(|name| *name == column).map(|at| self.values()[at])
    }
}

impl Element {
    pub(super) fn point(&self, test: Test, strain: f64, start: &Matrix<f64, 3>) -> Point {
        let sign = test.sign();
        let s = &self.stress;
        let mean = trace(s) / 3.0;
        let mut deviator = *s;
        (0..3).for_each(|i| deviator[i][i] -= mean);
        let ratio = det(&self.whole);
        // The force on a plane of the start: J σ F⁻ᵀ with F from there, whose cofactor has these.
        let from_start = mul_transpose(&self.whole, &super::inverse(&super::mul_transpose(start, &super::identity())));
        let width = from_start[0][0] * from_start[2][2];
        let nominal = if test == Test::Shear { s[0][1] * width } else { s[1][1] * width };
        Point {
            strain,
            nominal_stress: sign * nominal,
            axial_stress: sign * s[1][1],
            lateral_stress: sign * s[0][0],
            shear_stress: s[0][1],
            p: -mean,
            q: (1.5 * double_dot(&deviator, &deviator)).sqrt(),
            volumetric_strain: sign * (ratio / det(start) - 1.0),
            volume_ratio: ratio,
            plastic_strain: self.flown[0],
            plastic_volume: self.flown[1],
            plastic_state: self.plastic,
        }
    }
}
