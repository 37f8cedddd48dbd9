// Drucker–Prager sand with volume correction (Klár 2016; Tampubolon 2017). Twin:
// src/core/material/drucker_prager.rs. q: v_c, the volume (as a logarithm) that the grains must
// lose before they touch again. Stress: stvk_hencky.

fn drucker_prager_return(trial: Returned, m: Material) -> Returned {
    var out = trial;
    let strain = ln_stretch(trial.sigma);
    let mean = (sum3(strain) + trial.q) / 3.0;
    if (mean >= 0.0) {
        out.sigma = vec3<f32>(1.0);
        out.q = 3.0 * mean;
        out.moved = true;
        return out;
    }
    let deviator = strain - sum3(strain) / 3.0;
    let size = length(deviator);
    let allowed = -m.c * (3.0 * m.b + 2.0 * m.a) / (2.0 * m.a) * 3.0 * mean;
    if (size > allowed || trial.q != 0.0) {
        let kept = select(1.0, allowed / size, size > allowed);
        out.sigma = exp(vec3<f32>(mean) + kept * deviator);
        out.q = 0.0;
        out.moved = true;
    }
    return out;
}
