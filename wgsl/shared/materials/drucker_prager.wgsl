// Drucker–Prager sand with cohesion and dilatancy (Klár 2016). Twin:
// src/core/material/drucker_prager.rs. c = α, d = α_ψ, e = β/(2μ). Stress: stvk_hencky.

fn drucker_prager_return(trial: Returned, m: Material) -> Returned {
    let strain = ln_stretch(trial.sigma);
    let deviator = strain - sum3(strain) / 3.0;
    let closed = close_opening(sum3(strain), trial.q);
    let trace = closed.x;
    let growth = m.c * (3.0 * m.b + 2.0 * m.a) / (2.0 * m.a);
    let dilation = select(3.0 * m.d, 0.0, closed.y > 0.0);
    let size = length(deviator);
    let tip = opening_tip(m.e, growth);
    let beyond = trace - tip - dilation * size;
    if (beyond >= 0.0) {
        return Returned(vec3<f32>(exp(tip / 3.0)), closed.y + beyond, true);
    }
    let excess = size + growth * trace - m.e;
    if (excess <= 0.0 && closed.y == trial.q) {
        return trial;
    }
    let flow = max(excess, 0.0) / (1.0 + growth * dilation);
    let kept = select(1.0, 1.0 - flow / size, excess > 0.0);
    return Returned(exp(vec3<f32>((trace - flow * dilation) / 3.0) + kept * deviator), closed.y, true);
}
