// Von Mises, ‖dev τ‖ ≤ √(2/3) σ_Y. Twin: src/core/material/von_mises.rs. Hencky: the deviator of ε
// shrinks at equal volume.
// Fixed corotated: 2 μ (σ - 1) σ takes the place of 2 μ ε, and is solved for its larger root.

/// What of the principal stress has a deviator (Pa), 2 μ ε or 2 μ (σ - 1) σ, and the share of the
/// deviator that the yield surface allows.
struct RadialTrial { mean: f32, deviator: vec3<f32>, kept: f32 }

fn radial_trial(shear: vec3<f32>, m: Material) -> RadialTrial {
    let mean = sum3(shear) / 3.0;
    let deviator = shear - mean;
    let size = length(deviator);
    return RadialTrial(mean, deviator, select(1.0, m.c / size, size > m.c));
}

/// The larger root σ of 2 μ (σ - 1) σ = x.
fn stretch_of_shear(x: vec3<f32>, mu: f32) -> vec3<f32> {
    return 0.5 * (1.0 + sqrt(max(1.0 + 2.0 * x / mu, vec3<f32>(0.0))));
}

fn von_mises_return(trial: Returned, m: Material) -> Returned {
    var out = trial;
    let hencky = m.model == VON_MISES_HENCKY;
    let t = radial_trial(2.0 * m.a * select((trial.sigma - 1.0) * trial.sigma, ln_stretch(trial.sigma), hencky), m);
    if (t.kept < 1.0) {
        let kept = vec3<f32>(t.mean) + t.kept * t.deviator;
        out.sigma = select(stretch_of_shear(kept, m.a), exp(kept / (2.0 * m.a)), hencky);
        out.moved = true;
    }
    return out;
}

fn fixed_corotated_principal(sigma: vec3<f32>, mu: f32, lambda: f32) -> vec3<f32> {
    let J = sigma.x * sigma.y * sigma.z;
    return 2.0 * mu * (sigma - 1.0) * sigma + vec3<f32>(lambda * (J - 1.0) * J);
}

fn fixed_corotated_principal_stiffness(sigma: vec3<f32>, mu: f32, lambda: f32) -> f32 {
    let J = sigma.x * sigma.y * sigma.z;
    let most = max(sigma.x, max(sigma.y, sigma.z));
    return 2.0 * mu * most * most + lambda * J * J;
}
