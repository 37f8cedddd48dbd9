// How full the room around a particle is: Σ w V_i of what is there over Σ w V_i of what may be
// there, and how the volume of fluids and loose grains follows it. Twins:
// src/engine/explicit/cpu/fill.rs, src/core/sim/volume.rs.
//
// uses explicit/layout, shared/state

/// What the particle's ∇v adds to its body's rate, as a share of itself.
const STIRRED: f32 = 0.3;
/// Fill, over that which counts as full, up to which it is noise and no crowd.
const NOISE: f32 = 1.1;
/// Fill, over that which counts as full, beyond which crowds dissolve no faster.
const DENSEST: f32 = 2.0;
/// Fill, over that which counts as full, beyond which more does not count.
const FULLEST: f32 = 1.25;
/// Excess over full at which grains are corrected in full; below, in proportion.
const GRADUAL: f32 = 0.02;

/// The fill of a particle from what it gathered. One behind a surface counts as one on it: half of its room on every
/// axis.
fn fill_of(gathered: vec2<f32>) -> f32 {
    return gathered.x / max(gathered.y, 0.125);
}

/// The state a little towards that of which the fill tells: J of a fluid, the volumetric strain of
/// grains with what they have gained apart. `growth`: dt ∇v.
fn relaxed(state: Deformation, model: u32, body: Body, dt: f32, growth: mat3x3<f32>, fill: f32) -> Deformation {
    var next = state;
    let over = max(fill / body.full, 1.0);
    let crowd = 5.0 * max(min(over, DENSEST) - NOISE, 0.0);
    let rate = body.rate + body.crowded * crowd * crowd;
    let share = min(rate * dt + STIRRED * sqrt(norm2(growth)), 1.0);
    let goal = 1.0 / min(over, FULLEST);
    if (model == FLUID) {
        next.J += share * (goal - state.J);
    } else if (over > 1.0) {
        let volume = determinant(state.F) * exp(state.q);
        if (volume > goal) {
            let weight = min((over - 1.0) / GRADUAL, 1.0);
            next.F = state.F * pow(1.0 + weight * share * (goal / volume - 1.0), 1.0 / 3.0);
        }
    }
    return next;
}

/// Cells that a particle fills in the sums of rest volumes, if there are any. What a solid has lost of its volume is
/// room for others.
fn filled_cells(state: Deformation, model: u32, body: Body) -> f32 {
    if (FILLS != FILLS_VOLUME) {
        return 0.0;
    }
    var kept = 1.0;
    if (model != FLUID && body.full == 0.0) {
        kept = clamp(determinant(state.F), 0.0, 1.0);
    }
    return kept * body.volume / (params.dx * params.dx * params.dx);
}
