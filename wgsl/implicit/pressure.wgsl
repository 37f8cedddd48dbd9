// What separating surfaces push or, as constraints, pull.
//
// uses implicit/layout

/// The normal impulse (N s) of a separating surface; 0 of others.
fn pressure(touch: Touch) -> f32 {
    return select(0.0, dot(touch.impulse.xyz, touch.normal.xyz), touch.arm.w == SEPARATING);
}
