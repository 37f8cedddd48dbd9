//! Results of a case: rows of expected value against result, and curves to plot.

use serde::Serialize;

/// How a value is compared with its expected value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rule {
    /// |got / expected − 1| ≤ tolerance.
    Relative,
    /// |got − expected| ≤ tolerance.
    Absolute,
    /// got ≤ expected.
    AtMost,
    /// got ≥ expected.
    AtLeast,
}

/// One checked value.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    pub case: &'static str,
    /// Engine and precision: `cpu f64` or `gpu f32`.
    pub engine: &'static str,
    /// Kernel, transfer, material: what differs between the rows of a case.
    pub variant: String,
    pub quantity: String,
    pub unit: &'static str,
    pub rule: Rule,
    pub expected: f64,
    /// Not a number (`null` in JSON) if the simulation did not get that far.
    pub got: f64,
    pub tolerance: f64,
    pub pass: bool,
    /// Why a simulation ended early.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

impl Row {
    /// True if `got` satisfies the rule; never for NaN.
    pub fn holds(rule: Rule, expected: f64, got: f64, tolerance: f64) -> bool {
        match rule {
            Rule::Relative => (got - expected).abs() <= tolerance * expected.abs(),
            Rule::Absolute => (got - expected).abs() <= tolerance,
            Rule::AtMost => got <= expected,
            Rule::AtLeast => got >= expected,
        }
    }

    /// The tolerance in readable form.
    pub fn tolerance_text(&self) -> String {
        match self.rule {
            Rule::Relative => format!("± {} %", number(100.0 * self.tolerance)),
            Rule::Absolute => format!("± {}", number(self.tolerance)),
            Rule::AtMost => "at most".into(),
            Rule::AtLeast => "at least".into(),
        }
    }
}

/// Five significant digits, without trailing zeros.
pub fn number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let magnitude = value.abs().log10().floor() as i32;
    if (-3..6).contains(&magnitude) {
        let text = format!("{:.*}", (4 - magnitude).max(0) as usize, value);
        return if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text };
    }
    format!("{value:.2e}")
}

/// A curve of a case: columns of numbers of equal length.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// File name without extension.
    pub name: String,
    pub columns: Vec<(String, Vec<f64>)>,
}

/// The curve as CSV, with a header line.
pub fn curve_csv(curve: &Curve) -> String {
    let names: Vec<&str> = curve.columns.iter().map(|(name, _)| name.as_str()).collect();
    let mut text = names.join(",") + "\n";
    for row in 0..curve.columns.first().map_or(0, |(_, values)| values.len()) {
        let cells: Vec<String> = curve.columns.iter().map(|(_, values)| format!("{:.6e}", values[row])).collect();
        text += &(cells.join(",") + "\n");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_do_what_they_say_and_refuse_what_is_no_number() {
        use Rule::*;
        assert!(Row::holds(Relative, -2.0, -2.01, 0.01) && !Row::holds(Relative, -2.0, -2.03, 0.01));
        assert!(Row::holds(Absolute, 0.0, 1e-13, 1e-12) && !Row::holds(Absolute, 0.0, -2e-12, 1e-12));
        assert!(Row::holds(AtMost, 1.0, 1.0, 0.0) && !Row::holds(AtMost, 1.0, 1.1, 0.0));
        assert!(Row::holds(AtLeast, 1.0, 1.0, 0.0) && !Row::holds(AtLeast, 1.0, 0.9, 0.0));
        for rule in [Relative, Absolute, AtMost, AtLeast] {
            assert!(!Row::holds(rule, 1.0, f64::NAN, 10.0));
        }
    }

    #[test]
    fn numbers_are_short() {
        let texts = [0.0, 1.0, 0.368, 1.0029, 0.05, 1e-12, 123456.0, 1.5e9, -0.59161, 100.0].map(number);
        assert_eq!(texts, ["0", "1", "0.368", "1.0029", "0.05", "1.00e-12", "123456", "1.50e9", "-0.59161", "100"]);
    }

    #[test]
    fn curves_are_csv() {
        let curve =
            Curve { name: "c".into(), columns: vec![("t".into(), vec![0.0, 1.0]), ("x".into(), vec![2.0, 3.5])] };
        assert_eq!(curve_csv(&curve), "t,x\n0.000000e0,2.000000e0\n1.000000e0,3.500000e0\n");
    }
}
