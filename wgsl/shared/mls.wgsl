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

/// m of grid +; that of grid - is -m.
fn arms_mean(y: vec3<f32>) -> vec3<f32> {
    if (CENTRED) {
        return grid_mean(y);
    }
    return vec3<f32>(0.0);
}
