// Energy of the laws (J/m³), with P or τ where the implicit step wants both. Twins:
// `material::energy_density`, src/core/material/derivatives.rs and the laws beside them.
//
// Energies are sums of small terms, never differences of large ones: a line search compares them.
//
// uses shared/state

/// What a forbidden state costs (J/m³): sums of it are infinite or beyond any energy of a body.
const FORBIDDEN = 3e38;

/// F = U Σ Vᵀ with stretches near 1 that are rounded once. Those of `svd3` are off by several
/// roundings, each of which is a stress of 1e-7 of the modulus. A column v of V has σ² - 1 =
/// v·(FᵀF - I) v/|v|², where an error of its angle does not matter.
fn fine_svd(F: mat3x3<f32>) -> Svd {
    var s = svd3(F);
    let Cv = (transpose(F) * F - diagonal(vec3<f32>(1.0))) * s.v;
    let squares = vec3<f32>(dot(s.v[0], Cv[0]), dot(s.v[1], Cv[1]), dot(s.v[2], Cv[2]))
        / vec3<f32>(dot(s.v[0], s.v[0]), dot(s.v[1], s.v[1]), dot(s.v[2], s.v[2]));
    let error = squares - (s.sigma - 1.0) * (s.sigma + 1.0);
    let is_near = abs(s.sigma - 1.0) < vec3<f32>(0.5);
    s.sigma += select(vec3<f32>(0.0), error / (2.0 * select(vec3<f32>(1.0), s.sigma, is_near)), is_near);
    return s;
}

/// e^x - 1 - x.
fn exp_excess(x: vec3<f32>) -> vec3<f32> {
    let tail = 1.0 / 120.0 + x * (1.0 / 720.0 + x * (1.0 / 5040.0 + x * (1.0 / 40320.0)));
    let series = x * x * (0.5 + x * (1.0 / 6.0 + x * (1.0 / 24.0 + x * tail)));
    return select(exp(x) - 1.0 - x, series, abs(x) < vec3<f32>(0.5));
}

/// x - ln(1 + x), as its series Σ (-x)^k/k from k = 2 through z = x/(2 + x): ln(1 + x) = 2 atanh z
/// and x - 2z = x z.
fn ln_excess(x: f32) -> f32 {
    let z = x / (2.0 + x);
    let z2 = z * z;
    let series = x * z - 2.0 * z * z2 * (1.0 / 3.0 + z2 * (1.0 / 5.0 + z2 * (1.0 / 7.0 + z2 * (1.0 / 9.0))));
    return select(x - log(1.0 + x), series, abs(x) < 0.3);
}

fn diagonal(d: vec3<f32>) -> mat3x3<f32> {
    return mat3x3<f32>(d.x, 0.0, 0.0, 0.0, d.y, 0.0, 0.0, 0.0, d.z);
}

fn is_fixed_corotated(model: u32) -> bool {
    return model == FIXED_COROTATED || model == VON_MISES_FIXED_COROTATED || model == SNOW;
}

/// (μ, λ), hardened.
fn elastic_moduli(m: Material, plastic: f32) -> vec2<f32> {
    return vec2<f32>(m.a, m.b) * select(1.0, snow_hardening(m, plastic), m.model == SNOW);
}

/// ψ = μ ‖F - R‖² + ½ λ (J - 1)², P = 2 μ (F - R) + λ (J - 1) cof F.
fn fixed_corotated_energy_pk1(F: mat3x3<f32>, moduli: vec2<f32>, P: ptr<function, mat3x3<f32>>) -> f32 {
    let cof = cofactor(F);
    let strain = F - polar_rotation(F);
    let dilation = dot(F[0], cof[0]) - 1.0;
    *P = (2.0 * moduli.x) * strain + (moduli.y * dilation) * cof;
    return moduli.x * norm2(strain) + 0.5 * moduli.y * dilation * dilation;
}

/// J² - 1 without tr 2E, for 2E = FᵀF - I.
fn dilation_beyond_trace(e: mat3x3<f32>) -> f32 {
    let trace = e[0].x + e[1].y + e[2].z;
    return 0.5 * (trace * trace - norm2(e)) + determinant(e);
}

/// ψ = ½ μ (tr 2E - ln J²) + ⅛ λ ln² J², P = F⁻ᵀ (2 μ E + λ ln J I).
fn neo_hookean_energy_pk1(F: mat3x3<f32>, moduli: vec2<f32>, P: ptr<function, mat3x3<f32>>) -> f32 {
    let cof = cofactor(F);
    let J = dot(F[0], cof[0]);
    if (!(J > 1e-12)) {
        *P = mat3x3<f32>();
        return FORBIDDEN;
    }
    let e = transpose(F) * F - diagonal(vec3<f32>(1.0));
    let trace = e[0].x + e[1].y + e[2].z;
    let rest = dilation_beyond_trace(e);
    let x = trace + rest;
    var excess = ln_excess(x) - rest;
    var ln_J2 = x - ln_excess(x);
    if (abs(x) >= 0.3) {
        ln_J2 = 2.0 * log(J);
        excess = trace - ln_J2;
    }
    *P = (1.0 / J) * (cof * (moduli.x * e + diagonal(vec3<f32>(0.5 * moduli.y * ln_J2))));
    return 0.5 * moduli.x * excess + 0.125 * moduli.y * ln_J2 * ln_J2;
}

/// In logarithmic strain: ψ; principal Kirchhoff stress τ, ∂ψ/∂ε.
fn strain_energy(strain: vec3<f32>, m: Material, tau: ptr<function, vec3<f32>>) -> f32 {
    let trace = sum3(strain);
    if (m.model != NACC) {
        *tau = 2.0 * m.a * strain + vec3<f32>(m.b * trace);
        return m.a * dot(strain, strain) + 0.5 * m.b * trace * trace;
    }
    // J^(-2/3) b_i = e^2e, e the deviator.
    let e = 2.0 * (strain - trace / 3.0);
    let b = exp_excess(e);
    let volume = exp_excess(vec3<f32>(2.0 * trace)).x;
    let kappa = nacc_kappa(m);
    *tau = m.a * (e + b - sum3(b) / 3.0) + vec3<f32>(0.5 * kappa * (2.0 * trace + volume));
    return 0.5 * m.a * sum3(b) + 0.25 * kappa * volume;
}

/// ψ = B (J - 1 - ln J + (J^(1-γ) - 1 - ln J^(1-γ))/(γ - 1)), each of whose terms is small at rest.
fn weakly_compressible_fluid_energy(J: f32, B: f32, gamma: f32) -> f32 {
    let x = J - 1.0;
    let expansion = ln_excess(x);
    let e = (1.0 - gamma) * (x - expansion);
    let compression = exp_excess(vec3<f32>(e)).x / (gamma - 1.0);
    return B * (expansion + select(compression, 0.0, gamma == 1.0));
}

/// ψ(F), or ψ(J) of a fluid, as the stress of explicit steps has it: strains are not extended.
fn energy_density(state: Deformation, m: Material) -> f32 {
    if (is_law(m, FLUID)) {
        return weakly_compressible_fluid_energy(state.J, m.a, m.b);
    }
    var unused: mat3x3<f32>;
    if (is_law(m, NEO_HOOKEAN)) {
        return neo_hookean_energy_pk1(state.F, vec2<f32>(m.a, m.b), &unused);
    }
    if (is_law(m, FIXED_COROTATED) || is_law(m, VON_MISES_FIXED_COROTATED) || is_law(m, SNOW)) {
        return fixed_corotated_energy_pk1(state.F, elastic_moduli(m, state.q), &unused);
    }
    let sigma = clamp(fine_svd(state.F).sigma, vec3<f32>(MIN_STRETCH), vec3<f32>(MAX_STRETCH));
    var tau: vec3<f32>;
    return strain_energy(ln_stretch(sigma), m, &tau);
}
