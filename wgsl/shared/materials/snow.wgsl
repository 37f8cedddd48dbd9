// Snow (Stomakhin 2013): stretches clamped to [c, d] = [1 - θc, 1 + θs], moduli times e^(ξ (1 -
// Jp)). Twin: src/core/material/snow.rs. q: Jp.
// Stress: fixed corotated with the hardened moduli.

const MAX_PLASTIC_VOLUME = 1e4;

fn snow_hardening(m: Material, Jp: f32) -> f32 {
    return exp(m.e * (1.0 - Jp));
}

fn snow_return(trial: Returned, m: Material) -> Returned {
    var out = trial;
    let clamped = clamp(trial.sigma, vec3<f32>(m.c), vec3<f32>(m.d));
    if (any(clamped != trial.sigma)) {
        let s = trial.sigma / clamped;
        out.q = min(trial.q * s.x * s.y * s.z, MAX_PLASTIC_VOLUME);
        out.sigma = clamped;
        out.moved = true;
    }
    return out;
}
