//! Bounds within which a scene's numbers can be physical quantities in SI units. What is beyond them
//! is a slip of units or of a key, and nothing good comes of running it.

use crate::validate::check::Check;
use crate::vectors::length;

/// A quantity and its bounds.
pub struct Range {
    pub what: &'static str,
    pub unit: &'static str,
    pub least: f64,
    pub most: f64,
}

impl Range {
    const fn up_to(what: &'static str, most: f64, unit: &'static str) -> Self {
        Self { what, unit, least: 0.0, most }
    }
}

/// Largest number of any kind.
pub const LARGEST: f64 = 1e15;
/// Smallest number where one above 0 belongs.
pub const SMALLEST: f64 = 1e-15;

/// A hundredth of the speed of light: beyond it, Newton's mechanics no longer hold.
pub const SPEED: Range = Range::up_to("the speed", 3e6, "m/s");
/// sqrt((λ + 2μ) / ρ).
pub const WAVE: Range = Range::up_to("the speed of sound in the material", 3e6, "m/s");
/// From the thinnest gas to a white dwarf.
pub const DENSITY: Range = Range { what: "the density", unit: "kg/m³", least: 1e-6, most: 1e9 };
pub const GRAVITY: Range = Range::up_to("the acceleration", 1e9, "m/s²");
pub const PLACE: Range = Range::up_to("the distance from the origin", 1e9, "m");
pub const SPACING: Range = Range { what: "the grid spacing", unit: "m", least: 1e-9, most: 1e6 };
pub const END: Range = Range::up_to("the end", 1e9, "s");
pub const VOLUME_RATIO: Range = Range { what: "the volume ratio", unit: "", least: 1e-3, most: 1e3 };
/// Beyond it, no explicit step is long enough for anything to move.
pub const DAMPING: Range = Range::up_to("the damping time", 1e3, "s");
pub const EXPONENT: Range = Range::up_to("the exponent", 100.0, "");

impl Check<'_> {
    /// Checks that a value at `at`, which is not at fault so far, is within a range.
    pub fn plausible(&mut self, at: &str, value: f64, range: &Range) {
        let Range { what, unit, least, most } = range;
        if !self.faults.clean(at) || (*least..=*most).contains(&value) {
            return;
        }
        let (side, bound) = if value > *most { ("more", most) } else { ("less", least) };
        let reason = format!("{what} is {value:.3e} {unit}, {side} than the {bound:e} {unit} that are plausible");
        let bounds = if *least > 0.0 { format!("from {least:e} to {most:e}") } else { format!("up to {most:e}") };
        let remedy = format!("write a number {bounds}; scenes are in SI units (m, kg, s)");
        self.fault(at, "implausible", tidy(&reason), remedy);
    }

    /// Checks the length of a vector.
    pub fn plausible_length(&mut self, at: &str, v: &[f64], range: &Range) {
        self.plausible(at, length(v), range);
    }

    /// Checks the speed of what turns or shears at `rate` (1/s), up to `reach` (m) beyond the domain.
    pub fn plausible_rate(&mut self, at: &str, rate: f64, reach: f64) {
        if self.has_grid() {
            let domain = &self.scene.domain;
            let sides: Vec<f64> = domain.min.iter().zip(&domain.max).map(|(min, max)| max - min).collect();
            self.plausible(at, rate * (length(&sides) + reach), &SPEED);
        }
    }
}

/// Without the blanks that a missing unit leaves.
fn tidy(text: &str) -> String {
    text.replace(" ,", ",").replace("  ", " ")
}
