// Fixed corotated (Stomakhin 2012): ψ = μ Σ(σ_i - 1)² + ½ λ (J - 1)²; τ = 2 μ (F - R) Fᵀ + λ (J -
// 1) J I.

/// Symmetric to the bit, whatever rounding does to R: else the stress would turn bodies.
fn fixed_corotated_kirchhoff(F: mat3x3<f32>, mu: f32, lambda: f32) -> mat3x3<f32> {
    let J = determinant(F);
    let R = polar_rotation(F);
    let p = lambda * (J - 1.0) * J;
    let rows = transpose(F);
    let apart = transpose(F - R);
    let diagonal = (2.0 * mu) * vec3<f32>(dot(apart[0], rows[0]), dot(apart[1], rows[1]), dot(apart[2], rows[2])) + p;
    let shear = (2.0 * mu) * vec3<f32>(dot(apart[1], rows[2]), dot(apart[0], rows[2]), dot(apart[0], rows[1]));
    return mat3x3<f32>(diagonal.x, shear.z, shear.y, shear.z, diagonal.y, shear.x, shear.y, shear.x, diagonal.z);
}

fn fixed_corotated_stiffness(F: mat3x3<f32>, mu: f32, lambda: f32) -> f32 {
    let J = determinant(F);
    return 2.0 * mu * largest_stretch_squared(F) + lambda * J * J;
}
