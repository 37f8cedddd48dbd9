//! What a picture shall be like, as users write it.

use std::str::FromStr;

use crate::picture::Aim;

/// What a picture shall be like.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Look {
    pub size: Size,
    pub aim: Aim,
    /// A field of the points, or `body`; without it points have the colours that were recorded.
    pub color_by: Option<String>,
    /// Values of the field with the first and the last colour; those of almost all points without it.
    pub bounds: Option<Bounds>,
    /// Names of bodies and sources whose points are drawn; all without any.
    pub bodies: Vec<String>,
}

/// Width and height of a picture: `960x540`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size([usize; 2]);

/// Least width and height.
const LEAST: usize = 64;
const MOST: usize = 7680;
/// Most pixels: 3840 × 2160.
const MOST_PIXELS: usize = 3840 * 2160;

impl Default for Size {
    fn default() -> Self {
        Self([960, 540])
    }
}

impl Size {
    /// Width and height.
    pub fn pixels(self) -> [usize; 2] {
        self.0
    }
}

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let sides =
            text.split_once(['x', '×']).and_then(|(w, h)| Some([w.trim().parse().ok()?, h.trim().parse().ok()?]));
        let [width, height]: [usize; 2] = sides.ok_or_else(|| format!("\"{text}\" is no size, as 960x540 is"))?;
        if [width, height].iter().any(|side| !(LEAST..=MOST).contains(side)) {
            return Err(format!("width and height are {LEAST} to {MOST} pixels"));
        }
        if width * height > MOST_PIXELS {
            return Err(format!("{width}x{height} has more pixels than 3840x2160"));
        }
        Ok(Self([width, height]))
    }
}

/// Two values, the lower one first: `0,2.5`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    pub low: f64,
    pub high: f64,
}

impl Bounds {
    /// Both of these, and what is between them.
    pub fn and(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// From or to zero, if that is nearly so.
    pub(super) fn reaching_zero(self) -> Self {
        let near = |end: f64, other: f64| end * other > 0.0 && end.abs() < 0.15 * other.abs();
        Self {
            low: if near(self.low, self.high) { 0.0 } else { self.low },
            high: if near(self.high, self.low) { 0.0 } else { self.high },
        }
    }

    /// Not narrower than what numbers can tell apart.
    pub(super) fn widened(self) -> Self {
        let least = 1e-6 * self.low.abs().max(self.high.abs()).max(1e-12);
        if self.high - self.low >= least {
            return self;
        }
        let middle = 0.5 * (self.low + self.high);
        Self { low: middle - least, high: middle + least }
    }
}

impl FromStr for Bounds {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |text: &str| text.trim().parse().ok().filter(|number: &f64| number.is_finite());
        let both = text.split_once(',').and_then(|(low, high)| Some((number(low)?, number(high)?)));
        let (low, high) = both.ok_or_else(|| format!("\"{text}\" is no range, as 0,2.5 is"))?;
        if low >= high {
            return Err(format!("the first value of the range {text} must be below the second"));
        }
        Ok(Self { low, high })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_ranges() {
        assert_eq!("1280x720".parse::<Size>().unwrap().pixels(), [1280, 720]);
        for wrong in ["", "12", "axb", "10x10", "9000x100", "7680x4320"] {
            assert!(wrong.parse::<Size>().is_err(), "{wrong}");
        }
        assert_eq!("-1,2e3".parse::<Bounds>().unwrap(), Bounds { low: -1.0, high: 2000.0 });
        for wrong in ["", "1", "2,1", "1,1", "a,b", "0,inf"] {
            assert!(wrong.parse::<Bounds>().is_err(), "{wrong}");
        }
    }
}
