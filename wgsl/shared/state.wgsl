// A particle's deformation state, its return map and its stress. Adding a law: its file in
// materials/, a constant here and a case in `flow`, `principal_kirchhoff` and
// `principal_stiffness`. Twin: src/core/material/mod.rs.
//
// uses shared/structs, shared/polar, shared/materials/fixed_corotated
// uses shared/materials/neo_hookean, shared/materials/weakly_compressible_fluid
// uses shared/materials/stvk_hencky, shared/materials/von_mises, shared/materials/opening
// uses shared/materials/drucker_prager, shared/materials/mohr_coulomb, shared/materials/nacc
// uses shared/materials/snow

/// Laws that the scene has, a bit each. Programs are compiled without the code of all others.
override LAWS: u32 = 1023u;

/// F, or J alone (a fluid); q: plastic state of the laws that have one.
struct Deformation { F: mat3x3<f32>, J: f32, q: f32 }

const FIXED_COROTATED = 0u;
const NEO_HOOKEAN = 1u;
const FLUID = 2u;
// From here on laws in principal space: F = U Σ Vᵀ.
const STVK_HENCKY = 3u;
const VON_MISES_HENCKY = 4u;
const VON_MISES_FIXED_COROTATED = 5u;
// From here on with a plastic state.
const DRUCKER_PRAGER = 6u;
const NACC = 7u;
const SNOW = 8u;
const MOHR_COULOMB = 9u;

const MIN_STRETCH = 1e-4;
const MAX_STRETCH = 1e4;

fn has_law(law: u32) -> bool {
    return (LAWS & (1u << law)) != 0u;
}

fn is_law(m: Material, law: u32) -> bool {
    return has_law(law) && m.model == law;
}

/// A material whose law is no question, if there is only one.
fn material_of(body: Body) -> Material {
    var m = materials[body.material];
    if (countOneBits(LAWS) == 1u) {
        m.model = firstTrailingBit(LAWS);
    }
    return m;
}

fn is_principal(law: u32) -> bool {
    return (LAWS >> STVK_HENCKY) != 0u && law >= STVK_HENCKY;
}

/// Whether the return map can change F.
fn is_plastic(law: u32) -> bool {
    return (LAWS >> VON_MISES_HENCKY) != 0u && law >= VON_MISES_HENCKY;
}

fn has_plastic_state(law: u32) -> bool {
    return (LAWS >> DRUCKER_PRAGER) != 0u && law >= DRUCKER_PRAGER;
}

/// Values of a particle's state.
fn state_channels() -> u32 {
    if (LAWS == (1u << FLUID)) {
        return 1u;
    }
    return select(9u, 10u, (LAWS >> DRUCKER_PRAGER) != 0u);
}

/// Singular values and plastic state in a return map.
struct Returned { sigma: vec3<f32>, q: f32, moved: bool }

/// The same with strains ε = ln σ.
struct ReturnedStrain { strain: vec3<f32>, q: f32, moved: bool }

fn stretches_of(after: ReturnedStrain, trial: Returned) -> Returned {
    if (!after.moved) {
        return trial;
    }
    return Returned(exp(after.strain), after.q, true);
}

/// What stress in principal space needs of F: filled by `deform` or `decompose` for laws in
/// principal space.
struct Principal { u: mat3x3<f32>, sigma: vec3<f32> }

struct Stress { tau: mat3x3<f32>, stiffening: f32 } // stiffening: ρ0 c² over that at rest

fn diagonal_times(u: mat3x3<f32>, d: vec3<f32>, v: mat3x3<f32>) -> mat3x3<f32> {
    return mat3x3<f32>(u[0] * d.x, u[1] * d.y, u[2] * d.z) * transpose(v);
}

fn flow(trial: Returned, m: Material) -> Returned {
    if (is_law(m, VON_MISES_HENCKY) || is_law(m, VON_MISES_FIXED_COROTATED)) {
        return von_mises_return(trial, m);
    }
    if (is_law(m, DRUCKER_PRAGER)) {
        return drucker_prager_return(trial, m);
    }
    if (is_law(m, MOHR_COULOMB)) {
        return mohr_coulomb_return(trial, m);
    }
    if (is_law(m, NACC)) {
        return nacc_return(trial, m);
    }
    if (is_law(m, SNOW)) {
        return snow_return(trial, m);
    }
    return trial;
}

/// Advances F ← (I + dt ∇v) F or J ← (1 + dt tr ∇v) J, `growth` = dt ∇v, and back to the yield
/// surface.
fn deform(state: Deformation, m: Material, growth: mat3x3<f32>, principal: ptr<function, Principal>) -> Deformation {
    var next = state;
    if (is_law(m, FLUID)) {
        next.J = state.J + state.J * (growth[0].x + growth[1].y + growth[2].z);
        return next;
    }
    next.F = state.F + growth * state.F;
    if (is_principal(m.model)) {
        let s = svd3(next.F);
        let trial = clamp(s.sigma, vec3<f32>(MIN_STRETCH), vec3<f32>(MAX_STRETCH));
        let projected = flow(Returned(trial, state.q, any(trial != s.sigma) && m.model != STVK_HENCKY), m);
        if (projected.moved) {
            next.F = diagonal_times(s.u, projected.sigma, s.v);
            next.q = projected.q;
        }
        *principal = Principal(s.u, projected.sigma);
    }
    return next;
}

fn decompose(state: Deformation, model: u32) -> Principal {
    var principal: Principal;
    if (is_principal(model)) {
        let s = svd3(state.F);
        principal = Principal(s.u, clamp(s.sigma, vec3<f32>(MIN_STRETCH), vec3<f32>(MAX_STRETCH)));
    }
    return principal;
}

fn principal_kirchhoff(sigma: vec3<f32>, q: f32, m: Material) -> vec3<f32> {
    if (is_law(m, VON_MISES_FIXED_COROTATED)) {
        return fixed_corotated_principal(sigma, m.a, m.b);
    }
    if (is_law(m, NACC)) {
        return nacc_kirchhoff(sigma, m);
    }
    if (is_law(m, SNOW)) {
        return snow_hardening(m, q) * fixed_corotated_principal(sigma, m.a, m.b);
    }
    return hencky_kirchhoff(sigma, m.a, m.b);
}

fn principal_stiffness(sigma: vec3<f32>, q: f32, m: Material) -> f32 {
    if (is_law(m, VON_MISES_FIXED_COROTATED)) {
        return fixed_corotated_principal_stiffness(sigma, m.a, m.b);
    }
    if (is_law(m, NACC)) {
        return nacc_stiffness(sigma, m);
    }
    if (is_law(m, SNOW)) {
        return snow_hardening(m, q) * fixed_corotated_principal_stiffness(sigma, m.a, m.b);
    }
    return hencky_stiffness(sigma, m.a, m.b);
}

/// Stress without the damping of solids.
fn undamped_kirchhoff(state: Deformation, principal: Principal, m: Material, grad_v: mat3x3<f32>) -> Stress {
    if (is_law(m, FLUID)) {
        let pressure = weakly_compressible_fluid_pressure(state.J, m.a, m.b);
        return Stress(weakly_compressible_fluid_kirchhoff(state.J, pressure, m.c, grad_v),
            weakly_compressible_fluid_stiffening(state.J, pressure, m.a, m.b));
    }
    let at_rest = m.b + 2.0 * m.a;
    if (is_principal(m.model)) {
        let tau = principal_kirchhoff(principal.sigma, state.q, m);
        let stiffness = principal_stiffness(principal.sigma, state.q, m);
        return Stress(diagonal_times(principal.u, tau, principal.u), stiffness / at_rest);
    }
    if (is_law(m, NEO_HOOKEAN)) {
        return Stress(neo_hookean_kirchhoff(state.F, m.a, m.b), neo_hookean_stiffness(state.F, m.a, m.b) / at_rest);
    }
    return Stress(fixed_corotated_kirchhoff(state.F, m.a, m.b), fixed_corotated_stiffness(state.F, m.a, m.b) / at_rest);
}

/// A solid's damping: τ_v = t_d (2μ D + λ tr D I), D = sym ∇v, with the moduli at rest. Twin:
/// src/core/material/damping.rs.
fn damping_kirchhoff(m: Material, grad_v: mat3x3<f32>) -> mat3x3<f32> {
    let pressure = m.damping * m.b * (grad_v[0].x + grad_v[1].y + grad_v[2].z);
    return m.damping * m.a * (grad_v + transpose(grad_v))
        + mat3x3<f32>(pressure, 0.0, 0.0, 0.0, pressure, 0.0, 0.0, 0.0, pressure);
}

fn kirchhoff(state: Deformation, principal: Principal, m: Material, grad_v: mat3x3<f32>) -> Stress {
    var stress = undamped_kirchhoff(state, principal, m, grad_v);
    if (m.damping != 0.0) {
        stress.tau += damping_kirchhoff(m, grad_v);
    }
    return stress;
}

/// Bound on the largest σ² from above (Wolkowicz & Styan 1980). Twin: src/core/material/stretch.rs.
fn largest_stretch_squared(F: mat3x3<f32>) -> f32 {
    let mean = norm2(F) / 3.0;
    let deviator = F * transpose(F) - mat3x3<f32>(mean, 0.0, 0.0, 0.0, mean, 0.0, 0.0, 0.0, mean);
    return mean + sqrt((2.0 / 3.0) * norm2(deviator));
}
