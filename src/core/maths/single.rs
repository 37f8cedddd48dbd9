//! eˣ, eˣ − 1 and ln x of `f32` without branches and calls, so that loops over particles vectorise; within 2 units in
//! the last place. Reductions and polynomials are those of Moshier's Cephes library (expf.c, logf.c).

/// ln 2 = HIGH + LOW; small whole numbers times HIGH are exact.
const HIGH: f32 = 355.0 / 512.0;
const LOW: f32 = -2.121_944_4e-4;
/// Adding 1.5 · 2²³ rounds to the nearest whole number.
const SHIFT: f32 = 12_582_912.0;
/// Beyond these, eˣ is no normal number or infinite.
const LEAST: f32 = -87.336_54;
const MOST: f32 = 88.722_84;

/// n and eʳ − 1 with x = n ln 2 + r, |r| ≤ ½ ln 2, for x between the bounds.
#[inline(always)]
fn reduced(x: f32) -> (f32, f32) {
    let n = (x * std::f32::consts::LOG2_E + SHIFT) - SHIFT;
    let r = (x - n * HIGH) - n * LOW;
    let mut p = 1.987_569_1e-4;
    for c in [1.398_2e-3, 8.333_452e-3, 4.166_579_6e-2, 1.666_666_5e-1, 0.5] {
        p = p * r + c;
    }
    (n, r + r * r * p)
}

/// 2ⁿ for whole n from −126 to 127.
#[inline(always)]
fn power_of_two(n: f32) -> f32 {
    let bits = (n + SHIFT).to_bits().wrapping_sub(SHIFT.to_bits());
    f32::from_bits(bits.wrapping_add(127) << 23)
}

#[inline(always)]
pub fn exp(x: f32) -> f32 {
    let within = if x < LEAST { LEAST } else { x };
    let within = if within > MOST { MOST } else { within };
    let (n, less) = reduced(within);
    // 2ⁿ in two factors: n may be 128.
    let half = ((n * 0.5) + SHIFT) - SHIFT;
    let power = (less + 1.0) * power_of_two(half) * power_of_two(n - half);
    let power = if x < LEAST { 0.0 } else { power };
    if x > MOST { f32::INFINITY } else { power }
}

#[inline(always)]
pub fn exp_m1(x: f32) -> f32 {
    let within = if x < -20.0 { -20.0 } else { x };
    let within = if within > MOST { MOST } else { within };
    let (n, less) = reduced(within);
    let half = ((n * 0.5) + SHIFT) - SHIFT;
    let (first, second) = (power_of_two(half), power_of_two(n - half));
    let power = (less * first + (first - 1.0 / second)) * second;
    if x > MOST { f32::INFINITY } else { power }
}

#[inline(always)]
pub fn ln(x: f32) -> f32 {
    // Numbers below the normal ones are scaled up first.
    let small = x < f32::MIN_POSITIVE;
    let scaled = if small { x * 8_388_608.0 } else { x };
    // m in [√½, √2), x = m 2ᵉ.
    let bits = scaled.to_bits().wrapping_sub(std::f32::consts::FRAC_1_SQRT_2.to_bits());
    let m = f32::from_bits((bits & 0x007f_ffff).wrapping_add(std::f32::consts::FRAC_1_SQRT_2.to_bits()));
    let e = ((bits as i32) >> 23) as f32 - if small { 23.0 } else { 0.0 };
    let f = m - 1.0;
    let mut p = 7.037_683_6e-2;
    for c in [
        -1.151_461e-1,
        1.167_699_9e-1,
        -1.242_014_1e-1,
        1.424_932_3e-1,
        -1.666_805_8e-1,
        2.000_071_5e-1,
        -2.499_999_4e-1,
        3.333_333e-1,
    ] {
        p = p * f + c;
    }
    let square = f * f;
    let result = (f + (p * f * square + e * LOW - 0.5 * square)) + e * HIGH;
    let result = if x == 0.0 { f32::NEG_INFINITY } else { result };
    let result = if x < 0.0 { f32::NAN } else { result };
    // Infinity and NaN stay what they are.
    if x < f32::INFINITY { result } else { x }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Distance from the rounded value, in units of its last place.
    fn off(value: f32, exact: f64) -> f64 {
        let near = exact as f32;
        let unit = f64::from(f32::from_bits(near.abs().to_bits() + 1)) - f64::from(near.abs());
        (f64::from(value) - exact).abs() / unit
    }

    #[test]
    fn functions_are_right_to_two_units_in_the_last_place() {
        let mut worst = [0.0f64; 3];
        for k in 0..2_000_000 {
            let x = -87.0 + 175.0 * (k as f32 / 2e6);
            let near = (x / 88.0).powi(5);
            for x in [x, near] {
                worst[0] = worst[0].max(off(exp(x), f64::from(x).exp()));
                worst[1] = worst[1].max(if x == 0.0 { 0.0 } else { off(exp_m1(x), f64::from(x).exp_m1()) });
            }
            for x in [f32::from_bits(0x0000_0001 + 1060 * k as u32), 1.0 + near] {
                worst[2] = worst[2].max(if x == 1.0 || x <= 0.0 { 0.0 } else { off(ln(x), f64::from(x).ln()) });
            }
        }
        assert!(worst.iter().all(|&w| w < 2.0), "{worst:?}");
    }

    #[test]
    fn bounds_are_those_of_the_library() {
        for x in [0.0, -0.0, 1.0, f32::INFINITY, f32::NEG_INFINITY, 89.0, 200.0, -200.0, f32::NAN] {
            for (own, library) in [(exp(x), x.exp()), (exp_m1(x), x.exp_m1())] {
                assert!((own - library).abs() <= 2.0 * f32::EPSILON || own == library || x.is_nan(), "{x}: {own}");
                assert_eq!(own.is_nan(), library.is_nan(), "{x}: {own}");
            }
        }
        for x in [0.0, -0.0, -1.0, 1.0, f32::INFINITY, f32::NEG_INFINITY, f32::NAN] {
            assert!(ln(x) == x.ln() || ln(x).is_nan() && x.ln().is_nan(), "{x}: {}", ln(x));
        }
    }
}
