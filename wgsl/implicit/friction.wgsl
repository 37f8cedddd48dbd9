// Coulomb friction of a surface at a node as a dissipative part of the potential, µ J f(|u|) for
// sliding at u, smoothed below the speed ε.
// Twin: src/engine/implicit/physics/friction.rs, which says why.
//
// uses implicit/layout

/// Sliding below this way a step (dx) counts as sticking.
const STICKING = 1e-4;

fn slow_speed() -> f32 {
    return STICKING * params.dx / params.dt;
}

fn sliding(touch: Touch, v: vec3<f32>) -> vec3<f32> {
    let u = v - touch.velocity.xyz;
    return u - dot(u, touch.normal.xyz) * touch.normal.xyz;
}

fn drag_energy(touch: Touch, v: vec3<f32>) -> f32 {
    let y = length(sliding(touch, v));
    let s = slow_speed();
    return touch.impulse.w * select(y * (y / s) * (1.0 - y / (3.0 * s)) + s / 3.0, y, y >= s);
}

/// f′/y and f″.
fn drag_rates(y: f32) -> vec2<f32> {
    let s = slow_speed();
    if (y >= s) {
        return vec2<f32>(1.0 / y, 0.0);
    }
    return vec2<f32>((2.0 - y / s) / s, (2.0 - 2.0 * y / s) / s);
}

fn drag_gradient(touch: Touch, v: vec3<f32>) -> vec3<f32> {
    let u = sliding(touch, v);
    return (touch.impulse.w * drag_rates(length(u)).x) * u;
}

fn drag_hessian(touch: Touch, v: vec3<f32>) -> mat3x3<f32> {
    let n = touch.normal.xyz;
    let u = sliding(touch, v);
    let y = length(u);
    let rates = drag_rates(y);
    let f = select(vec3<f32>(0.0), u / y, y > 0.0);
    let across = mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0) - mat3x3<f32>(n * n.x, n * n.y, n * n.z);
    return touch.impulse.w * (rates.x * across + (rates.y - rates.x) * mat3x3<f32>(f * f.x, f * f.y, f * f.z));
}
