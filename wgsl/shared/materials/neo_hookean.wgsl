// Neo-Hookean: ψ = ½ μ (tr FᵀF - 3) - μ ln J + ½ λ ln²J; τ = μ (F Fᵀ - I) + λ ln J I. Not defined
// for J ≤ 0: gives NaN, which is caught.

fn neo_hookean_kirchhoff(F: mat3x3<f32>, mu: f32, lambda: f32) -> mat3x3<f32> {
    let p = lambda * log(determinant(F)) - mu;
    return mu * (F * transpose(F)) + mat3x3<f32>(p, 0.0, 0.0, 0.0, p, 0.0, 0.0, 0.0, p);
}

fn neo_hookean_stiffness(F: mat3x3<f32>, mu: f32, lambda: f32) -> f32 {
    return mu * (largest_stretch_squared(F) + 1.0) + lambda * (1.0 - log(determinant(F)));
}
