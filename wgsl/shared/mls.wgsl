// Which of the transfers a program is for. In MLS a particle sees node i as g_i = w E⁻¹ (d_i - m),
// with m the mean of the node's grid and E = diag(p), or as published m = 0 and E = D.
//
// uses shared/kernel_*

/// MLS-MPM (forces and velocity gradient through moments) instead of APIC (through kernel
/// gradients).
override MLS: bool = true;
/// Moments about each grid's own mean, instead of about the particle.
override CENTRED: bool = true;

/// A E⁻¹.
fn times_inverse_arms(a: mat3x3<f32>, y: vec3<f32>) -> mat3x3<f32> {
    if (CENTRED) {
        return times_inverse_spread(a, y);
    }
    return times_inverse_moment(a, y);
}

/// m.
fn arms_mean(y: vec3<f32>, grid: u32) -> vec3<f32> {
    if (CENTRED) {
        return grid_mean(y, grid);
    }
    return vec3<f32>(0.0);
}

/// dx ∇v = share Σ w v_i (d - m)ᵀ E⁻¹, from B = share Σ w v_i dᵀ and `apart` = share (Σ⁺ - Σ⁻) w v_i.
fn mls_gradient(B: mat3x3<f32>, apart: vec3<f32>, y: vec3<f32>) -> mat3x3<f32> {
    let m = arms_mean(y, 0u);
    return times_inverse_arms(B - mat3x3<f32>(apart * m.x, apart * m.y, apart * m.z), y);
}
