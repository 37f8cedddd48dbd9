// Drucker–Prager sand with cohesion and dilatancy (Klár 2016). Twin:
// src/core/material/drucker_prager.rs. c = α, d = α_ψ, e = β/(2μ). Stress: stvk_hencky.

/// A trial strain beside the cone, once compression has closed what it can of the opening.
struct ConeTrial {
    deviator: vec3<f32>,
    size: f32,     // ‖dev ε‖
    trace: f32,    // tr ε after closing
    apart: f32,    // v_c after closing
    dilation: f32, // 3 α_ψ, 0 while the grains are apart
    tip: f32,      // tr ε at the tip
    opened: f32,   // what the state opens beyond it; negative where it does not
    flow: f32,     // by how much ‖dev ε‖ flows if it does not open; not positive inside the cone
}

fn cone_trial(strain: vec3<f32>, opening: f32, m: Material) -> ConeTrial {
    var t: ConeTrial;
    t.deviator = strain - sum3(strain) / 3.0;
    let closed = close_opening(sum3(strain), opening);
    t.trace = closed.x;
    t.apart = closed.y;
    let growth = m.c * (3.0 * m.b + 2.0 * m.a) / (2.0 * m.a);
    t.dilation = select(3.0 * m.d, 0.0, t.apart > 0.0);
    t.size = length(t.deviator);
    t.tip = opening_tip(m.e, growth);
    t.opened = t.trace - t.tip - t.dilation * t.size;
    t.flow = (t.size + growth * t.trace - m.e) / (1.0 + growth * t.dilation);
    return t;
}

fn drucker_prager_strain(strain: vec3<f32>, opening: f32, m: Material) -> ReturnedStrain {
    let t = cone_trial(strain, opening, m);
    if (t.opened >= 0.0) {
        return ReturnedStrain(vec3<f32>(t.tip / 3.0), t.apart + t.opened, true);
    }
    let flow = max(t.flow, 0.0);
    let kept = select(1.0, 1.0 - flow / t.size, flow > 0.0);
    let after = vec3<f32>((t.trace - flow * t.dilation) / 3.0) + kept * t.deviator;
    return ReturnedStrain(after, t.apart, flow > 0.0 || t.apart != opening);
}

fn drucker_prager_return(trial: Returned, m: Material) -> Returned {
    return stretches_of(drucker_prager_strain(ln_stretch(trial.sigma), trial.q, m), trial);
}
