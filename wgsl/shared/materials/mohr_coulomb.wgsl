// Mohr–Coulomb with cohesion and dilatancy. Twin: src/core/material/mohr_coulomb.rs. c = sin φ,
// d = sin ψ, e = c cos φ/μ. Stress: stvk_hencky.

/// f_ij over the surface.
fn mohr_coulomb_excess(most: f32, least: f32, trace: f32, m: Material) -> f32 {
    return (1.0 + m.c) * most - (1.0 - m.c) * least + m.b / m.a * m.c * trace - m.e;
}

/// A trial strain beside the planes, once compression has closed what it can of the opening.
struct PlaneTrial {
    strain: vec3<f32>, // after closing
    apart: f32,        // v_c after closing
    dilatancy: f32,    // sin ψ, 0 while the grains are apart
    tip: f32,          // tr ε at the tip
    opened: f32,       // what the state opens beyond it; negative where it does not
    excess: f32,       // f_13
    edge: i32,         // where it flows to: 0 the plane, 1 the edge ε_2 = ε_3, -1 that of ε_1 = ε_2
    after: vec3<f32>,  // strain there
}

/// The strains fall, as `svd3` has the stretches.
fn plane_trial(trial: vec3<f32>, opening: f32, m: Material) -> PlaneTrial {
    var t: PlaneTrial;
    let closed = close_opening(sum3(trial), opening);
    let trace = closed.x;
    let strain = trial + vec3<f32>((trace - sum3(trial)) / 3.0);
    t.strain = strain;
    t.apart = closed.y;
    t.dilatancy = select(m.d, 0.0, t.apart > 0.0);
    let more = 1.0 + t.dilatancy;
    let less = 1.0 - t.dilatancy;
    let extended = less * (strain.x - strain.y) > more * (strain.y - strain.z);

    t.tip = opening_tip(m.e, 2.0 * m.c * (1.0 / 3.0 + 0.5 * m.b / m.a));
    let shear = select((strain.x - strain.z + strain.y - strain.z) / (3.0 - t.dilatancy),
        (strain.x - strain.y + strain.x - strain.z) / (3.0 + t.dilatancy), extended);
    t.opened = trace - t.tip - 2.0 * t.dilatancy * shear;

    t.excess = mohr_coulomb_excess(strain.x, strain.z, trace, m);
    let volume = 2.0 * m.b / m.a * m.c * t.dilatancy;
    let plane = 2.0 * (1.0 + m.c * t.dilatancy) + volume;
    t.after = strain + max(t.excess, 0.0) / plane * vec3<f32>(-more, 0.0, less);
    if (t.excess > 0.0 && (t.after.x < strain.y || t.after.z > strain.y)) {
        if (extended) {
            let both = t.excess + mohr_coulomb_excess(strain.x, strain.y, trace, m);
            let flow = both / (plane + (1.0 + m.c) * more + volume);
            let pair = 0.5 * (strain.y + strain.z + flow * less);
            t.after = vec3<f32>(strain.x - flow * more, pair, pair);
            t.edge = 1;
        } else {
            let both = t.excess + mohr_coulomb_excess(strain.y, strain.z, trace, m);
            let flow = both / (plane + (1.0 - m.c) * less + volume);
            let pair = 0.5 * (strain.x + strain.y - flow * more);
            t.after = vec3<f32>(pair, pair, strain.z + flow * less);
            t.edge = -1;
        }
    }
    return t;
}

/// To the tip, the plane, or the edge where two planes meet.
fn mohr_coulomb_strain(strain: vec3<f32>, opening: f32, m: Material) -> ReturnedStrain {
    let t = plane_trial(strain, opening, m);
    if (t.opened >= 0.0) {
        return ReturnedStrain(vec3<f32>(t.tip / 3.0), t.apart + t.opened, true);
    }
    return ReturnedStrain(t.after, t.apart, t.excess > 0.0 || t.apart != opening);
}

fn mohr_coulomb_return(trial: Returned, m: Material) -> Returned {
    return stretches_of(mohr_coulomb_strain(ln_stretch(trial.sigma), trial.q, m), trial);
}
