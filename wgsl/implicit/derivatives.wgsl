// Energy, P and the projected ∂P/∂F of the laws for the implicit step. Twins:
// src/core/material/derivatives.rs, src/core/material/stiffness.rs and the laws beside them. Needs
// Material (shared/layout.wgsl), shared/state.wgsl, shared/polar.wgsl and shared/materials/*.
//
// F = U Σ Vᵀ; with dF' = Uᵀ dF V the derivative is A on the diagonal, and for each pair of axes
// [[x, y], [y, x]] on (dF'_ij, dF'_ji).
//
// uses shared/energy

/// In principal space (Pa): P_i, ∂P_i/∂σ_j, and (P_i - P_j)/(σ_i - σ_j) of the pair of axes other
/// than k.
struct Slopes { gradient: vec3<f32>, hessian: mat3x3<f32>, shear: vec3<f32> }

/// A; x = `same` and y = `cross` of the pair of axes other than k.
struct Projected { U: mat3x3<f32>, V: mat3x3<f32>, A: mat3x3<f32>, same: vec3<f32>, cross: vec3<f32> }

/// Below it logarithmic strain is its tangent.
const EXTENSION = 0.1;
/// Relative difference of stretches below which a quotient of differences has fewer digits than a
/// derivative: ε^(1/3).
const NEAR = 5e-3;
const LEAST_SUM = 1e-6;

/// Column b, row a: a_i b_j.
fn outer(a: vec3<f32>, b: vec3<f32>) -> mat3x3<f32> {
    return mat3x3<f32>(a * b.x, a * b.y, a * b.z);
}

/// Logarithmic strain, along its tangent below EXTENSION; `slope`: its derivative.
fn extended_strain(sigma: vec3<f32>, slope: ptr<function, vec3<f32>>) -> vec3<f32> {
    let kept = max(sigma, vec3<f32>(EXTENSION));
    *slope = 1.0 / kept;
    return ln_stretch(kept) + (sigma - kept) / EXTENSION;
}

/// ∂τ_i/∂ε_j.
fn strain_tangent(strain: vec3<f32>, m: Material) -> mat3x3<f32> {
    let one = vec3<f32>(1.0);
    if (m.model != NACC) {
        return diagonal(vec3<f32>(2.0 * m.a)) + outer(vec3<f32>(m.b), one);
    }
    let trace = sum3(strain);
    let b = exp(2.0 * (strain - trace / 3.0));
    let across = vec3<f32>(nacc_kappa(m) * exp(2.0 * trace) + (2.0 / 9.0) * m.a * sum3(b)) - (2.0 / 3.0) * m.a * b;
    return diagonal(2.0 * m.a * b) + outer(across, one) - outer((2.0 / 3.0) * m.a * one, b);
}

/// ψ(F) (J/m³) and P(F) (Pa) of the elastic law. Neo-Hookean at J ≤ 0: FORBIDDEN.
fn elastic_energy_pk1(material: Material, F: mat3x3<f32>, plastic: f32, P: ptr<function, mat3x3<f32>>) -> f32 {
    if (is_fixed_corotated(material.model)) {
        return fixed_corotated_energy_pk1(F, elastic_moduli(material, plastic), P);
    }
    if (material.model == NEO_HOOKEAN) {
        return neo_hookean_energy_pk1(F, vec2<f32>(material.a, material.b), P);
    }
    let s = fine_svd(F);
    var slope: vec3<f32>;
    var tau: vec3<f32>;
    let energy = strain_energy(extended_strain(s.sigma, &slope), material, &tau);
    *P = diagonal_times(s.u, tau * slope, s.v);
    return energy;
}

/// Derivatives of the elastic law's ψ(σ).
fn elastic_slopes(material: Material, sigma: vec3<f32>, plastic: f32) -> Slopes {
    var out: Slopes;
    let moduli = elastic_moduli(material, plastic);
    let others = sigma.yzx * sigma.zxy;
    let J = sigma.x * others.x;
    if (is_fixed_corotated(material.model)) {
        let dilation = J - 1.0;
        out.gradient = 2.0 * moduli.x * (sigma - 1.0) + moduli.y * dilation * others;
        let c = moduli.y * dilation * sigma;
        out.hessian = diagonal(vec3<f32>(2.0 * moduli.x)) + moduli.y * outer(others, others)
            + mat3x3<f32>(0.0, c.z, c.y, c.z, 0.0, c.x, c.y, c.x, 0.0);
    } else if (material.model == NEO_HOOKEAN) {
        var P: mat3x3<f32>;
        neo_hookean_energy_pk1(diagonal(sigma), moduli, &P);
        out.gradient = vec3<f32>(P[0].x, P[1].y, P[2].z);
        let inverse = 1.0 / sigma;
        out.hessian = diagonal(vec3<f32>(moduli.x) + (moduli.x - moduli.y * log(J)) * inverse * inverse)
            + moduli.y * outer(inverse, inverse);
    } else {
        var slope: vec3<f32>;
        var tau: vec3<f32>;
        let strain = extended_strain(sigma, &slope);
        strain_energy(strain, material, &tau);
        out.gradient = tau * slope;
        out.hessian = stretch_hessian(sigma, slope, tau, strain_tangent(strain, material));
    }
    let difference = out.gradient.yzx - out.gradient.zxy;
    out.shear = quotient(sigma.yzx, sigma.zxy, difference, near_shear(out.hessian));
    return out;
}

/// ∂P_i/∂σ_j of P_i = τ_i ε'_i, ε'_i = `slope`, from ∂τ_i/∂ε_j.
fn stretch_hessian(sigma: vec3<f32>, slope: vec3<f32>, tau: vec3<f32>, tangent: mat3x3<f32>) -> mat3x3<f32> {
    return diagonal(slope) * tangent * diagonal(slope) + diagonal(tau * curvature(sigma, slope));
}

/// ε'' of the extended logarithmic strain.
fn curvature(sigma: vec3<f32>, slope: vec3<f32>) -> vec3<f32> {
    return select(-slope * slope, vec3<f32>(0.0), sigma < vec3<f32>(EXTENSION));
}

/// ½ (h_ii + h_jj) - h_ij of the pair of axes other than k: its shear at nearly equal stretches.
fn near_shear(h: mat3x3<f32>) -> vec3<f32> {
    return vec3<f32>(
        0.5 * (h[1].y + h[2].z) - h[1].z,
        0.5 * (h[2].z + h[0].x) - h[2].x,
        0.5 * (h[0].x + h[1].y) - h[0].y,
    );
}

/// `difference`/(a - b), or `near` at nearly equal stretches.
fn quotient(a: vec3<f32>, b: vec3<f32>, difference: vec3<f32>, near: vec3<f32>) -> vec3<f32> {
    let is_near = abs(a - b) <= NEAR * max(abs(a) + abs(b), vec3<f32>(EXTENSION));
    return select(difference / select(a - b, vec3<f32>(1.0), is_near), near, is_near);
}

/// The nearest positive semidefinite matrix to a symmetric one (Higham 1988): itself, or ½ (A +
/// (A²)^½).
fn semidefinite(a: mat3x3<f32>) -> mat3x3<f32> {
    let minor = a[0].x * a[1].y - a[0].y * a[0].y;
    if (a[0].x > 0.0 && minor > 0.0 && determinant(a) > 0.0) {
        return a;
    }
    let s = svd3(a);
    return 0.5 * (a + diagonal_times(s.v, abs(s.sigma), s.v));
}

/// ∂P/∂F at F = U Σ Vᵀ with its negative eigenvalues set to 0.
fn projected(s: Svd, slopes: Slopes) -> Projected {
    var out: Projected;
    out.U = s.u;
    out.V = s.v;
    out.A = semidefinite(slopes.hessian);
    let sums = max(s.sigma.yzx + s.sigma.zxy, vec3<f32>(LEAST_SUM));
    let turn = max((slopes.gradient.yzx + slopes.gradient.zxy) / sums, vec3<f32>(0.0));
    let shear = max(slopes.shear, vec3<f32>(0.0));
    out.same = 0.5 * (shear + turn);
    out.cross = 0.5 * (shear - turn);
    return out;
}

/// dP = ∂P/∂F : dF.
fn projected_times(p: Projected, dF: mat3x3<f32>) -> mat3x3<f32> {
    let d = transpose(p.U) * dF * p.V;
    let axial = p.A * vec3<f32>(d[0].x, d[1].y, d[2].z);
    // Entries (1, 2), (2, 0), (0, 1), and those across the diagonal.
    let upper = vec3<f32>(d[2].y, d[0].z, d[1].x);
    let lower = vec3<f32>(d[1].z, d[2].x, d[0].y);
    let up = p.same * upper + p.cross * lower;
    let low = p.same * lower + p.cross * upper;
    return p.U * mat3x3<f32>(axial.x, low.z, up.y, up.z, axial.y, low.x, low.y, up.x, axial.z) * transpose(p.V);
}
