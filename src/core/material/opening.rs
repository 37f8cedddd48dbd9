//! Grains that are apart: v_c ≥ 0 is the logarithm of the volume that a granular body gained while
//! it opened (Tampubolon et al. 2017, "Multi-species simulation of porous sand and water mixtures",
//! §4.3.4). Its plastic state is v_c.
//!
//! * A body opens where the return map ends at the tip of the yield surface. The trace of ε beyond
//!   the tip's goes into v_c, without that by which the flow dilates: dilation stays.
//! * It resists compression only after it has lost that volume again: a negative trace takes from
//!   v_c first.
//! * Grains that are apart have no reason to dilate: while v_c > 0, flow keeps the volume.

use crate::maths::real::Real;

/// The trace of ε and v_c once compression has closed what it can of the opening.
#[inline(always)]
pub fn close<T: Real>(trace: T, opening: T) -> (T, T) {
    let closed = (-trace).max(T::ZERO).min(opening);
    (trace + closed, opening - closed)
}

/// A strength over what makes it grow, for the pressure of a tip. Without strength the tip is at
/// rest, even where nothing grows; with it and without growth, it is out of reach.
#[inline(always)]
pub fn tip<T: Real>(strength: T, growth: T) -> T {
    strength / growth.max(T::from_f64(LEAST_GROWTH))
}

/// Keeps tips out of reach finite in f32.
const LEAST_GROWTH: f64 = 1e-20;
