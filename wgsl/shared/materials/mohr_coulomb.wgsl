// Mohr–Coulomb with cohesion and dilatancy. Twin: src/core/material/mohr_coulomb.rs. c = sin φ,
// d = sin ψ, e = c cos φ/μ. Stress: stvk_hencky.

/// f_ij over the surface.
fn mohr_coulomb_excess(most: f32, least: f32, trace: f32, m: Material) -> f32 {
    return (1.0 + m.c) * most - (1.0 - m.c) * least + m.b / m.a * m.c * trace - m.e;
}

/// To the tip, the plane, or the edge where two planes meet. The stretches fall, as `svd3` has
/// them.
fn mohr_coulomb_return(trial: Returned, m: Material) -> Returned {
    let ln_trial = ln_stretch(trial.sigma);
    let closed = close_opening(sum3(ln_trial), trial.q);
    let trace = closed.x;
    let strain = ln_trial + vec3<f32>((trace - sum3(ln_trial)) / 3.0);
    let dilatancy = select(m.d, 0.0, closed.y > 0.0);
    let more = 1.0 + dilatancy;
    let less = 1.0 - dilatancy;
    let extended = less * (strain.x - strain.y) > more * (strain.y - strain.z);

    let tip = opening_tip(m.e, 2.0 * m.c * (1.0 / 3.0 + 0.5 * m.b / m.a));
    let shear = select((strain.x - strain.z + strain.y - strain.z) / (3.0 - dilatancy),
        (strain.x - strain.y + strain.x - strain.z) / (3.0 + dilatancy), extended);
    let beyond = trace - tip - 2.0 * dilatancy * shear;
    if (beyond >= 0.0) {
        return Returned(vec3<f32>(exp(tip / 3.0)), closed.y + beyond, true);
    }

    let excess = mohr_coulomb_excess(strain.x, strain.z, trace, m);
    if (excess <= 0.0 && closed.y == trial.q) {
        return trial;
    }
    let volume = 2.0 * m.b / m.a * m.c * dilatancy;
    let plane = 2.0 * (1.0 + m.c * dilatancy) + volume;
    var after = strain + max(excess, 0.0) / plane * vec3<f32>(-more, 0.0, less);
    if (excess > 0.0 && (after.x < strain.y || after.z > strain.y)) {
        if (extended) {
            let both = excess + mohr_coulomb_excess(strain.x, strain.y, trace, m);
            let flow = both / (plane + (1.0 + m.c) * more + volume);
            let pair = 0.5 * (strain.y + strain.z + flow * less);
            after = vec3<f32>(strain.x - flow * more, pair, pair);
        } else {
            let both = excess + mohr_coulomb_excess(strain.y, strain.z, trace, m);
            let flow = both / (plane + (1.0 - m.c) * less + volume);
            let pair = 0.5 * (strain.x + strain.y - flow * more);
            after = vec3<f32>(pair, pair, strain.z + flow * less);
        }
    }
    return Returned(exp(after), closed.y, true);
}
