//! The scalar type that numerics are generic in: `f32` or `f64`.
//!
//! It has only what the formulas need, and nothing that would keep a loop over particles from
//! vectorising. Every method is a plain hardware operation, except the last few: of these, `single` has
//! what laws need most in `f32`, and the others call the mathematics library.

use std::fmt::{Debug, Display};
use std::iter::Sum;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// A floating-point scalar.
pub trait Real:
    Copy
    + Default
    + Debug
    + Display
    + PartialOrd
    + Send
    + Sync
    + 'static
    + Neg<Output = Self>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
    + Sum
{
    const ZERO: Self;
    const HALF: Self;
    const ONE: Self;
    const TWO: Self;
    /// Distance from 1 to the next larger number.
    const EPSILON: Self;
    /// Smallest positive normal number.
    const TINY: Self;

    fn from_f64(x: f64) -> Self;
    fn to_f64(self) -> f64;
    fn from_i32(i: i32) -> Self;
    /// Largest whole number not above `self`, for |self| < 2²¹.
    fn floor(self) -> Self;
    /// A whole number below 2²¹ as an integer.
    fn to_i32(self) -> i32;
    fn sqrt(self) -> Self;
    fn abs(self) -> Self;
    fn max(self, other: Self) -> Self;
    fn min(self, other: Self) -> Self;
    fn copysign(self, sign: Self) -> Self;
    fn is_finite(self) -> bool;
    fn ln(self) -> Self;
    fn ln_1p(self) -> Self;
    fn exp(self) -> Self;
    fn exp_m1(self) -> Self;
    fn powf(self, exponent: Self) -> Self;
}

macro_rules! real {
    ($t:ident, $shift:expr, $($functions:ident)::+) => {
        impl Real for $t {
            const ZERO: Self = 0.0;
            const HALF: Self = 0.5;
            const ONE: Self = 1.0;
            const TWO: Self = 2.0;
            const EPSILON: Self = $t::EPSILON;
            const TINY: Self = $t::MIN_POSITIVE;

            #[inline(always)]
            fn from_f64(x: f64) -> Self {
                x as $t
            }
            #[inline(always)]
            fn to_f64(self) -> f64 {
                self as f64
            }
            #[inline(always)]
            fn from_i32(i: i32) -> Self {
                i as $t
            }
            #[inline(always)]
            fn floor(self) -> Self {
                // Adding 1.5 · 2^mantissa rounds to the nearest whole number. Unlike the standard
                // library's `floor` and `as i32`, this vectorises on every processor.
                let nearest = (self + $shift) - $shift;
                if nearest > self { nearest - 1.0 } else { nearest }
            }
            #[inline(always)]
            fn to_i32(self) -> i32 {
                ((self + $shift).to_bits() as i32).wrapping_sub($shift.to_bits() as i32)
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                $t::sqrt(self)
            }
            #[inline(always)]
            fn abs(self) -> Self {
                $t::abs(self)
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                if self > other { self } else { other }
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                if self < other { self } else { other }
            }
            #[inline(always)]
            fn copysign(self, sign: Self) -> Self {
                $t::copysign(self, sign)
            }
            #[inline(always)]
            fn is_finite(self) -> bool {
                $t::is_finite(self)
            }
            #[inline(always)]
            fn ln(self) -> Self {
                $($functions)::+::ln(self)
            }
            #[inline(always)]
            fn ln_1p(self) -> Self {
                $t::ln_1p(self)
            }
            #[inline(always)]
            fn exp(self) -> Self {
                $($functions)::+::exp(self)
            }
            #[inline(always)]
            fn exp_m1(self) -> Self {
                $($functions)::+::exp_m1(self)
            }
            #[inline(always)]
            fn powf(self, exponent: Self) -> Self {
                $t::powf(self, exponent)
            }
        }
    };
}

real!(f32, 12_582_912.0f32, super::single);
real!(f64, 6_755_399_441_055_744.0f64, f64);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floor_rounds_down_on_both_sides_of_zero() {
        let cases = [(0.0, 0), (0.9, 0), (1.0, 1), (1.5, 1), (2.5, 2), (-0.1, -1), (-1.0, -1), (-1.5, -2), (7.999, 7)];
        for (x, i) in cases.into_iter().chain([(2e6 + 0.75, 2_000_000), (-2e6 - 0.75, -2_000_001)]) {
            assert_eq!(Real::floor(x), i as f64);
            assert_eq!(Real::floor(x).to_i32(), i);
            assert_eq!(Real::floor(x as f32), i as f32);
            assert_eq!(Real::floor(x as f32).to_i32(), i);
        }
    }
}
