// Weakly compressible fluid: p = B (J^-γ - 1), B = K/γ; Cauchy σ = -p I + μ (∇v + ∇vᵀ); τ = J σ.
// The state is J alone.
// Twin: src/core/material/weakly_compressible_fluid.rs.

fn weakly_compressible_fluid_pressure(J: f32, B: f32, gamma: f32) -> f32 {
    // J^-γ - 1 near J = 1 loses digits through pow: series of expm1(-γ ln J) there.
    let e = -gamma * log(J);
    let series = e * (1.0 + e * (0.5 + e * (1.0 / 6.0 + e * (1.0 / 24.0))));
    return B * select(exp(e) - 1.0, series, abs(e) < 0.05);
}

fn weakly_compressible_fluid_kirchhoff(J: f32, pressure: f32, viscosity: f32, grad_v: mat3x3<f32>) -> mat3x3<f32> {
    let p = -J * pressure;
    return (J * viscosity) * (grad_v + transpose(grad_v)) + mat3x3<f32>(p, 0.0, 0.0, 0.0, p, 0.0, 0.0, 0.0, p);
}

/// Of the bulk, J² ψ'' / K, or of a lone particle (Sun, Shinar & Schroeder 2020).
fn weakly_compressible_fluid_stiffening(J: f32, pressure: f32, B: f32, gamma: f32) -> f32 {
    let strain = J - 1.0;
    let secant = select(1.0, -pressure / (strain * B * gamma), abs(strain) > 1e-3);
    let lone = select((2.0 - J) * (2.0 - J), 2.0 * J * J * J / (J + 1.0), strain > 0.0);
    return max(J * (pressure / B + 1.0), lone * secant);
}
