// Grains that are apart: q is v_c, the volume (as a logarithm) that the grains must lose before
// they touch again. Twin: src/core/material/opening.rs.

const LEAST_GROWTH = 1e-20;

/// The trace of ε and v_c once compression has closed what it can of the opening.
fn close_opening(trace: f32, opening: f32) -> vec2<f32> {
    let closed = min(max(-trace, 0.0), opening);
    return vec2<f32>(trace + closed, opening - closed);
}

/// A strength over what makes it grow. Without strength 0, without growth out of reach.
fn opening_tip(strength: f32, growth: f32) -> f32 {
    return strength / max(growth, LEAST_GROWTH);
}
