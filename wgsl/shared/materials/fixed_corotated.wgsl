// Fixed corotated (Stomakhin 2012): ψ = μ Σ(σ_i - 1)² + ½ λ (J - 1)²; τ = 2 μ (F - R) Fᵀ + λ (J -
// 1) J I.

fn fixed_corotated_kirchhoff(F: mat3x3<f32>, mu: f32, lambda: f32) -> mat3x3<f32> {
    let J = determinant(F);
    let R = polar_rotation(F);
    let p = lambda * (J - 1.0) * J;
    let tau = (2.0 * mu) * ((F - R) * transpose(F));
    return tau + mat3x3<f32>(p, 0.0, 0.0, 0.0, p, 0.0, 0.0, 0.0, p);
}

fn fixed_corotated_stiffness(F: mat3x3<f32>, mu: f32, lambda: f32) -> f32 {
    let J = determinant(F);
    return 2.0 * mu * largest_stretch_squared(F) + lambda * J * J;
}
