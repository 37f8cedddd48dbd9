// Tangent of laws that flow within an implicit step, symmetric. Twins: src/core/material/flowing.rs
// and `returned_tangent` of the laws beside it, which say what is left out.
//
// uses implicit/flowing

/// ε^½ and 8 ε: strains as near as this have no digits in their difference.
const NEAR_STRAIN = 3.4526698e-4;
const STRAIN_ROUNDING = 9.536743e-7;

/// bulk 1 1ᵀ + along n nᵀ + across (I - 1 1ᵀ/3 - n nᵀ), n the direction of a deviator.
fn radial(deviator: vec3<f32>, bulk: f32, along: f32, across: f32) -> mat3x3<f32> {
    let n = deviator / max(length(deviator), 1e-30);
    return diagonal(vec3<f32>(across)) + outer(vec3<f32>(bulk - across / 3.0), vec3<f32>(1.0))
        + outer((along - across) * n, n);
}

/// C - (C m)(C m)ᵀ/(m·C m): what is left of a stiffness where a body flows freely along m. C if m
/// is 0.
fn flowing_along(C: mat3x3<f32>, m: vec3<f32>) -> mat3x3<f32> {
    let stress = C * m;
    return C - outer(stress / max(dot(m, stress), 1e-30), stress);
}

/// Whether a change of volume only opens or closes what is between grains.
fn is_closing(strain: vec3<f32>, apart: f32) -> bool {
    return sum3(strain) < 0.0 && apart > 0.0;
}

fn bulk_modulus(m: Material) -> f32 {
    return m.b + m.a * (2.0 / 3.0);
}

fn drucker_prager_tangent(strain: vec3<f32>, q: f32, m: Material) -> mat3x3<f32> {
    let t = cone_trial(strain, q, m);
    if (t.opened >= 0.0) {
        return mat3x3<f32>();
    }
    let bulk = select(bulk_modulus(m), 0.0, is_closing(strain, t.apart));
    var flow = vec3<f32>(0.0);
    var kept = 1.0;
    if (t.flow > 0.0) {
        kept = 1.0 - t.flow / t.size;
        flow = t.deviator / t.size + t.dilation / 3.0;
    }
    return flowing_along(radial(t.deviator, bulk, 2.0 * m.a, 2.0 * m.a * kept), flow);
}

fn mohr_coulomb_tangent(strain: vec3<f32>, q: f32, m: Material) -> mat3x3<f32> {
    let t = plane_trial(strain, q, m);
    if (t.opened >= 0.0) {
        return mat3x3<f32>();
    }
    let bulk = select(bulk_modulus(m), 0.0, is_closing(strain, t.apart));
    let elastic = radial(t.strain, bulk, 2.0 * m.a, 2.0 * m.a);
    let more = 1.0 + t.dilatancy;
    let less = t.dilatancy - 1.0;
    let first = select(vec3<f32>(0.0), vec3<f32>(more, 0.0, less), t.excess > 0.0);
    let second = vec3<f32>(select(0.0, more, t.edge == 1), select(select(0.0, less, t.edge == 1), more, t.edge == -1),
        select(0.0, less, t.edge == -1));
    return flowing_along(flowing_along(elastic, first), second);
}

fn nacc_tangent(strain: vec3<f32>, q: f32, m: Material) -> mat3x3<f32> {
    let t = clay_trial(strain, m);
    let p0 = nacc_strength(q, m);
    if (t.p > p0 || t.p < -m.d * p0) {
        return mat3x3<f32>();
    }
    let elastic = strain_tangent(strain, m);
    let most = nacc_largest_q(t.p, p0, m);
    if (t.q <= most) {
        return elastic;
    }
    // Only the volume's part of the elastic tangent is outside the deviators.
    let volume = vec3<f32>(nacc_kappa(m) * exp(2.0 * sum3(strain)));
    return radial(t.deviator, 0.0, 0.0, most / t.q) * elastic + outer(volume, vec3<f32>(1.0));
}

/// d(2μ (σ - 1) σ)/d ln σ.
fn shear_tangent(sigma: vec3<f32>, mu: f32) -> vec3<f32> {
    return 2.0 * mu * (2.0 * sigma - 1.0) * sigma;
}

/// d(λ (J - 1) J)/d ln J.
fn volume_tangent(sigma: vec3<f32>, lambda: f32) -> f32 {
    let J = sigma.x * sigma.y * sigma.z;
    return lambda * (2.0 * J - 1.0) * J;
}

fn fixed_corotated_tangent(sigma: vec3<f32>, mu: f32, lambda: f32) -> mat3x3<f32> {
    return diagonal(shear_tangent(sigma, mu)) + outer(vec3<f32>(volume_tangent(sigma, lambda)), vec3<f32>(1.0));
}

fn von_mises_corotated_tangent(stretch: vec3<f32>, m: Material) -> mat3x3<f32> {
    let t = radial_trial(2.0 * m.a * (stretch - 1.0) * stretch, m);
    if (t.kept >= 1.0) {
        return fixed_corotated_tangent(stretch, m.a, m.b);
    }
    // The stress after the return, x' + λ (J' - 1) J', depends on the trial's x by x'(x).
    let after = stretch_of_shear(vec3<f32>(t.mean) + t.kept * t.deviator, m.a);
    let share = radial(t.deviator, 1.0 / 3.0, 0.0, t.kept);
    let slopes = 1.0 / max(shear_tangent(after, m.a), vec3<f32>(NEAR_STRAIN * 2.0 * m.a));
    let volume = outer(vec3<f32>(volume_tangent(after, m.b)), share * slopes);
    return (share + volume) * diagonal(shear_tangent(stretch, m.a));
}

fn snow_tangent(stretch: vec3<f32>, flow: Flow, m: Material) -> mat3x3<f32> {
    let clamped = clamp(stretch, vec3<f32>(m.c), vec3<f32>(m.d));
    let factor = snow_hardening(m, flow.q);
    let free = select(vec3<f32>(1.0), vec3<f32>(0.0), clamped != stretch);
    let tangent = fixed_corotated_tangent(clamped, factor * m.a, factor * m.b);
    let hardening = (1.0 - free) * sqrt(max(-m.e * flow.q * flow.tau, vec3<f32>(0.0)));
    return diagonal(free) * tangent * diagonal(free) + outer(hardening, hardening);
}

/// ∂τ_i/∂ε_j, τ after the return and ε before it.
fn returned_tangent(material: Material, sigma: vec3<f32>, plastic: f32, flow: Flow) -> mat3x3<f32> {
    switch (material.model) {
        case VON_MISES_FIXED_COROTATED: { return von_mises_corotated_tangent(extended_stretch(sigma), material); }
        case DRUCKER_PRAGER: { return drucker_prager_tangent(flow.strain, plastic, material); }
        case MOHR_COULOMB: { return mohr_coulomb_tangent(flow.strain, plastic, material); }
        case NACC: { return nacc_tangent(flow.strain, plastic, material); }
        case SNOW: { return snow_tangent(extended_stretch(sigma), flow, material); }
        default: {
            let t = radial_trial(2.0 * material.a * flow.strain, material);
            let along = select(0.0, 2.0 * material.a, t.kept >= 1.0);
            return radial(t.deviator, bulk_modulus(material), along, 2.0 * material.a * t.kept);
        }
    }
}

/// Derivatives of P(σ) within a step, in which plastic laws flow if `flowing`.
fn slopes_within(material: Material, sigma: vec3<f32>, plastic: f32, flowing: bool) -> Slopes {
    if (!(flowing && is_plastic(material.model))) {
        return elastic_slopes(material, sigma, plastic);
    }
    let flow = flow_of(material, sigma, plastic);
    let one_way = returned_tangent(material, sigma, plastic, flow);
    let tangent = 0.5 * (one_way + transpose(one_way));
    var out: Slopes;
    out.gradient = flow.tau * flow.slope;
    out.hessian = stretch_hessian(sigma, flow.slope, flow.tau, tangent);
    // (P_i - P_j)/(σ_i - σ_j) of P_i = τ_i ε'_i. Strains that flow are often so small that σ_i - σ_j is
    // only rounding, while τ has a kink within it: so the quotient of τ is by strains.
    let a = sigma.yzx;
    let b = sigma.zxy;
    let difference = flow.strain.yzx - flow.strain.zxy;
    let is_near = abs(difference) <= NEAR_STRAIN * (abs(flow.strain.yzx) + abs(flow.strain.zxy)) + STRAIN_ROUNDING;
    let modulus = select((flow.tau.yzx - flow.tau.zxy) / select(difference, vec3<f32>(1.0), is_near),
        near_shear(tangent), is_near);
    let slope = 0.5 * (flow.slope.yzx + flow.slope.zxy);
    let bending = curvature(sigma, flow.slope);
    let bend = quotient(a, b, flow.slope.yzx - flow.slope.zxy, 0.5 * (bending.yzx + bending.zxy));
    out.shear = modulus * quotient(a, b, difference, slope) * slope + 0.5 * (flow.tau.yzx + flow.tau.zxy) * bend;
    let share = flowing_share(material.model, sigma);
    if (share < 1.0) {
        let elastic = elastic_slopes(material, sigma, flow.q);
        out.gradient = mix(elastic.gradient, out.gradient, share);
        out.hessian = share * out.hessian + (1.0 - share) * elastic.hessian;
        out.shear = mix(elastic.shear, out.shear, share);
    }
    return out;
}
