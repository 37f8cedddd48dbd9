// Stress of laws that flow within an implicit step: that of the state which the return map takes
// the trial to, P_i = τ_i/σ_i with σ_i of the trial. Twin: src/core/material/flowing.rs.
//
// From strain to strain: the return maps' stretches would round small strains once more.
//
// uses implicit/derivatives

/// ln 1e-9, of the least stretch that flows. It belongs to σ = -1.7.
const LEAST_STRAIN = -20.723266;

/// A trial state and where it returns to.
struct Flow {
    strain: vec3<f32>, // ε of the trial, extended
    slope: vec3<f32>,  // ε'
    tau: vec3<f32>,    // after the return (Pa)
    q: f32,            // plastic state after the return
}

/// NACC's deviator of J^(-2/3) b, and p and q over κ.
struct ClayTrial { deviator: vec3<f32>, p: f32, q: f32 }

fn clay_trial(strain: vec3<f32>, m: Material) -> ClayTrial {
    let trace = sum3(strain);
    // b - 1 and J² - 1 without their ones.
    let e = 2.0 * (strain - trace / 3.0);
    let excess = exp_excess(e);
    let deviator = e + excess - sum3(excess) / 3.0;
    let p = -0.5 * (2.0 * trace + exp_excess(vec3<f32>(2.0 * trace)).x);
    return ClayTrial(deviator, p, NACC_Q * m.a / nacc_kappa(m) * length(deviator));
}

/// τ after the return. α does not matter then, and the volume stays, except at the tips.
fn nacc_flow(strain: vec3<f32>, q: f32, m: Material) -> vec3<f32> {
    let t = clay_trial(strain, m);
    let p0 = nacc_strength(q, m);
    let most = nacc_largest_q(t.p, p0, m);
    let is_tip = t.p > p0 || t.p < -m.d * p0;
    let kept = select(select(1.0, most / t.q, t.q > most), 0.0, is_tip);
    return m.a * kept * t.deviator - vec3<f32>(nacc_kappa(m) * clamp(t.p, -m.d * p0, p0));
}

/// e^ε of the extended strain.
fn extended_stretch(sigma: vec3<f32>) -> vec3<f32> {
    let beyond = min((sigma - EXTENSION) / EXTENSION, vec3<f32>(0.0));
    return max(select(sigma, EXTENSION * exp(beyond), beyond < vec3<f32>(0.0)), vec3<f32>(exp(LEAST_STRAIN)));
}

fn flow_of(material: Material, sigma: vec3<f32>, q: f32) -> Flow {
    var out: Flow;
    var slope: vec3<f32>;
    out.strain = max(extended_strain(sigma, &slope), vec3<f32>(LEAST_STRAIN));
    out.slope = slope;
    out.q = q;
    switch (material.model) {
        case VON_MISES_FIXED_COROTATED: {
            let stretch = extended_stretch(sigma);
            let t = radial_trial(2.0 * material.a * (stretch - 1.0) * stretch, material);
            if (t.kept < 1.0) {
                let after = stretch_of_shear(vec3<f32>(t.mean) + t.kept * t.deviator, material.a);
                out.tau = fixed_corotated_principal(after, material.a, material.b);
            } else {
                out.tau = fixed_corotated_principal(stretch, material.a, material.b);
            }
        }
        case DRUCKER_PRAGER: {
            let after = drucker_prager_strain(out.strain, q, material);
            out.tau = hencky_stress(after.strain, material.a, material.b);
            out.q = after.q;
        }
        case MOHR_COULOMB: {
            let after = mohr_coulomb_strain(out.strain, q, material);
            out.tau = hencky_stress(after.strain, material.a, material.b);
            out.q = after.q;
        }
        case NACC: {
            out.tau = nacc_flow(out.strain, q, material);
        }
        case SNOW: {
            let after = snow_return(Returned(extended_stretch(sigma), q, false), material);
            out.tau = principal_kirchhoff(after.sigma, after.q, material);
            out.q = after.q;
        }
        default: {
            let t = radial_trial(2.0 * material.a * out.strain, material);
            out.tau = t.kept * t.deviator + vec3<f32>(t.mean + material.b * sum3(out.strain));
        }
    }
    return out;
}

/// By how much a state of a fixed corotated law flows: from 0 where it is flat to 1 where no stretch
/// is extended. The rest is elastic, which restores inverted states. 1 of other laws.
fn flowing_share(model: u32, sigma: vec3<f32>) -> f32 {
    let least = min(sigma.x, min(sigma.y, sigma.z));
    return select(1.0, clamp(least / EXTENSION, 0.0, 1.0), is_fixed_corotated(model));
}

/// ψ(F) (J/m³); P(F) (Pa) within a step, in which plastic laws flow if `flowing`. What flows has
/// no energy that solvers may compare: 0, or FORBIDDEN where numbers overflow.
fn energy_pk1(material: Material, F: mat3x3<f32>, plastic: f32, flowing: bool, P: ptr<function, mat3x3<f32>>) -> f32 {
    if (!(flowing && is_plastic(material.model))) {
        return elastic_energy_pk1(material, F, plastic, P);
    }
    let s = fine_svd(F);
    let flow = flow_of(material, s.sigma, plastic);
    var gradient = flow.tau * flow.slope;
    let share = flowing_share(material.model, s.sigma);
    if (share < 1.0) {
        gradient = mix(elastic_slopes(material, s.sigma, flow.q).gradient, gradient, share);
    }
    *P = diagonal_times(s.u, gradient, s.v);
    // Written so that NaN fails the test: on Vulkan x != x is not reliable.
    if (!(max(max_entry((*P)[0]), max(max_entry((*P)[1]), max_entry((*P)[2]))) < FORBIDDEN)) {
        *P = mat3x3<f32>();
        return FORBIDDEN;
    }
    return 0.0;
}
