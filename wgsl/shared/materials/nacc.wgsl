// Non-associative Cam Clay (Wolper 2019). Twin: src/core/material/nacc.rs. a = μ, b = λ, c = M, d =
// β, e = ξ; q: α. Pressures in units of κ.

const NACC_RESIDUAL = 1e-5;
const NACC_MAX_HARDENING = 4.0;
/// √(3/2): q / κ over μ / κ ‖dev b‖.
const NACC_Q = 1.2247449;

fn ln_near_one(s: f32) -> f32 {
    return ln_stretch(vec3<f32>(s)).x;
}

fn nacc_kappa(m: Material) -> f32 {
    return m.b + m.a * (2.0 / 3.0);
}

/// J^(-2/3) b_i.
fn nacc_isochoric(sigma: vec3<f32>, J: f32) -> vec3<f32> {
    return exp((-2.0 / 3.0) * ln_near_one(J)) * sigma * sigma;
}

/// p0 / κ = NACC_RESIDUAL + sinh x; its series has the digits that e^x - e^-x loses.
fn nacc_strength(q: f32, m: Material) -> f32 {
    let x = min(m.e * max(-q, 0.0), NACC_MAX_HARDENING);
    let x2 = x * x;
    let series = x * (1.0 + x2 / 6.0 * (1.0 + x2 / 20.0 * (1.0 + x2 / 42.0)));
    let e = exp(x);
    return NACC_RESIDUAL + select(0.5 * (e - 1.0 / e), series, x < 0.5);
}

/// The q of the ellipse at p.
fn nacc_largest_q(p: f32, p0: f32, m: Material) -> f32 {
    return m.c * sqrt(max(-(p + m.d * p0) * (p - p0), 0.0) / (1.0 + 2.0 * m.d));
}

fn nacc_kirchhoff(sigma: vec3<f32>, m: Material) -> vec3<f32> {
    let J = sigma.x * sigma.y * sigma.z;
    let b = nacc_isochoric(sigma, J);
    // (J - 1)(J + 1) keeps the digits that J² - 1 loses near rest.
    return m.a * (b - sum3(b) / 3.0) + vec3<f32>(0.5 * nacc_kappa(m) * (J - 1.0) * (J + 1.0));
}

fn nacc_stiffness(sigma: vec3<f32>, m: Material) -> f32 {
    let J = sigma.x * sigma.y * sigma.z;
    let b = nacc_isochoric(sigma, J);
    let along = m.a * 0.5 * ((2.0 - 8.0 / 3.0) * b + vec3<f32>((4.0 / 9.0 + 2.0 / 3.0) * sum3(b)))
        + vec3<f32>(0.5 * nacc_kappa(m) * (J * J + 1.0));
    let worst = max(along, m.a * b);
    return max(worst.x, max(worst.y, worst.z));
}

fn nacc_to_tip(trial: Returned, J: f32, p: f32) -> Returned {
    let J_tip = sqrt(max(1.0 - 2.0 * p, 0.0));
    var out = trial;
    out.sigma = vec3<f32>(exp(ln_near_one(J_tip) / 3.0));
    out.q = trial.q + ln_near_one(J / J_tip);
    out.moved = true;
    return out;
}

fn nacc_return(trial: Returned, m: Material) -> Returned {
    let J = trial.sigma.x * trial.sigma.y * trial.sigma.z;
    let b = nacc_isochoric(trial.sigma, J);
    let tr3 = sum3(b) / 3.0;
    var deviator = b - tr3;
    let p = -0.5 * (J - 1.0) * (J + 1.0);
    let q = NACC_Q * m.a / nacc_kappa(m) * length(deviator);
    let p0 = nacc_strength(trial.q, m);
    if (p > p0) {
        return nacc_to_tip(trial, J, p0);
    }
    if (p < -m.d * p0) {
        return nacc_to_tip(trial, J, -m.d * p0);
    }
    let most = nacc_largest_q(p, p0, m);
    if (q <= most) {
        return trial;
    }
    deviator *= most / q;
    // Π (d_i + t) = 1 at equal volume, Newton from above.
    var t = tr3;
    for (var i = 0u; i < 8u; i++) {
        let x = deviator + t;
        t -= (x.x * x.y * x.z - 1.0) / (x.y * x.z + x.x * x.z + x.x * x.y);
    }
    // Hardening as if towards the ellipse's centre.
    let centre = 0.5 * (1.0 - m.d) * p0;
    let half_axis = 0.5 * (1.0 + m.d) * p0;
    let m2 = m.c * m.c;
    let square = m2 * (p - centre) * (p - centre) + (1.0 + 2.0 * m.d) * q * q;
    let reach = sqrt(m2 * half_axis * half_axis / max(square, 1e-30));
    let p_surface = centre + (p - centre) * min(reach, 1.0);
    let J_surface = sqrt(max(1.0 - 2.0 * p_surface, 1e-30));
    var out = trial;
    out.sigma = exp(ln_near_one(J) / 3.0) * sqrt(max(deviator + t, vec3<f32>(1e-30)));
    out.q = trial.q + ln_near_one(J / J_surface);
    out.moved = true;
    return out;
}
