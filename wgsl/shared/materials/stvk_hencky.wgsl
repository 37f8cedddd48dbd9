// StVK in Hencky strain ε = ln σ (Klár 2016): τ_i = 2 μ ε_i + λ Σ ε. Twin:
// src/core/material/stvk_hencky.rs.

/// ln s to f32 precision around 1, where Vulkan grants its own log 2⁻²¹ of absolute error only: 2
/// atanh((s - 1)/(s + 1)).
fn ln_stretch(s: vec3<f32>) -> vec3<f32> {
    let z = (s - 1.0) / (s + 1.0);
    let z2 = z * z;
    let series = 2.0 * z * (1.0 + z2 * (1.0 / 3.0 + z2 * (1.0 / 5.0 + z2 * (1.0 / 7.0 + z2 * (1.0 / 9.0)))));
    return select(log(s), series, abs(z) < vec3<f32>(0.15));
}

fn sum3(v: vec3<f32>) -> f32 {
    return v.x + v.y + v.z;
}

fn hencky_stress(strain: vec3<f32>, mu: f32, lambda: f32) -> vec3<f32> {
    return 2.0 * mu * strain + vec3<f32>(lambda * sum3(strain));
}

fn hencky_kirchhoff(sigma: vec3<f32>, mu: f32, lambda: f32) -> vec3<f32> {
    return hencky_stress(ln_stretch(sigma), mu, lambda);
}

/// Along the axes λ + 2μ - τ_i, across them at most μ (1 + 2 Δε).
fn hencky_stiffness(sigma: vec3<f32>, mu: f32, lambda: f32) -> f32 {
    let tau = hencky_kirchhoff(sigma, mu, lambda);
    let least = min(tau.x, min(tau.y, tau.z));
    let high = max(sigma.x, max(sigma.y, sigma.z));
    let low = min(sigma.x, min(sigma.y, sigma.z));
    return max(lambda + 2.0 * mu - least, mu * (1.0 + 2.0 * log(high / low)));
}
