//! The stretch at which a stress is as wanted.

/// Most evaluations of a search.
const MOST: usize = 200;

/// A root of `excess`, a stress less the one that is wanted, which grows with the stretch. The first
/// guess may be far off: the search goes outwards until the sign changes, then between by regula
/// falsi (Illinois), by halves where that is slow.
pub(super) fn root(guess: f64, tolerance: f64, excess: impl Fn(f64) -> f64) -> Option<f64> {
    let at_guess = excess(guess);
    if at_guess.abs() <= tolerance {
        return Some(guess);
    }
    let outwards = if at_guess > 0.0 { -1.0 } else { 1.0 };
    let (mut near, mut at_near, mut reach) = (guess, at_guess, 1e-6f64);
    let (mut far, mut at_far);
    loop {
        far = guess * (outwards * reach).exp();
        at_far = excess(far);
        if at_far.abs() <= tolerance {
            return Some(far);
        }
        if at_far.is_nan() || reach > 8.0 {
            return None;
        }
        if at_far * at_near < 0.0 {
            break;
        }
        (near, at_near) = (far, at_far);
        reach *= 2.0;
    }
    for n in 0..MOST {
        let falsi = far - at_far * (far - near) / (at_far - at_near);
        let middle = if n % 4 == 3 { 0.5 * (near + far) } else { falsi };
        let value = excess(middle);
        // Between neighbours in f64 there is nothing better.
        if value.abs() <= tolerance || (far - near).abs() <= 4.0 * f64::EPSILON * far.abs() {
            return Some(middle);
        }
        if value * at_far < 0.0 {
            (near, at_near) = (far, at_far);
        } else {
            at_near *= 0.5;
        }
        (far, at_far) = (middle, value);
    }
    None
}
