// Scatter to the 27 nodes of the quadratic kernel.
//
// uses explicit/sums, shared/mls, shared/polar

fn of_three(i: u32, first: f32, middle: f32, last: f32) -> f32 {
    return select(select(middle, first, i == 0u), last, i == 2u);
}

/// Scatters mass and momentum: w (m v + m C d), with the force -V0 τ ∇w or, for MLS, -V0 τ E⁻¹ d w, times dt.
/// `tau_impulse` = dt V0 τ / dx; `cells`: cells that the particle fills. False, and nothing done, if that is no number.
fn scatter(id: u32, y: vec3<f32>, mass: f32, cells: f32, v: vec3<f32>, B: mat3x3<f32>,
    tau_impulse: mat3x3<f32>) -> bool {
    if (!(norm2(tau_impulse) < 1e30)) {
        return false;
    }
    let base = floor(y);
    let f = y - base;
    let g = 1.0 - f;
    let first = 0.5 * g * g;
    let middle = 0.75 - (f - 0.5) * (f - 0.5);
    let last = 0.5 * f * f;
    let scale = params.momentum_scale;
    let push = tau_impulse * scale;
    var A = B * (mass * scale);
    if (MLS) {
        A -= push;
    }
    A *= 4.0;
    let total = vec4<f32>((mass * scale) * v, mass * params.mass_scale);
    let corner = total.xyz - A * (f + 0.5);
    let volume = cells * params.cell_scale;
    let at = first_sum(0u, base);
    var carry: Carry;
    // Rows one after the other: fewer registers than all at once.
    for (var row = 0u; row < 9u; row++) {
        let j = row % 3u;
        let k = row / 3u;
        let wy = of_three(j, first.y, middle.y, last.y);
        let wz = of_three(k, first.z, middle.z, last.z);
        let weight = wy * wz;
        let start = corner + A[1] * f32(j) + A[2] * f32(k);
        let place = at + 8u * j + 64u * k;
        var along = vec3<f32>(0.0); // APIC: force times slopes, of the row's first axis
        var across = vec3<f32>(0.0);
        if (!MLS) {
            along = push[0] * weight;
            across = push[1] * (of_three(j, f.y - 1.0, 1.0 - 2.0 * f.y, f.y) * wz)
                + push[2] * (of_three(k, f.z - 1.0, 1.0 - 2.0 * f.z, f.z) * wy);
        }
        add_to_node(place, vec4<f32>(start, total.w), first.x * weight,
            along * (1.0 - f.x) - across * first.x, volume, &carry);
        add_to_node(place + 1u, vec4<f32>(start + A[0], total.w), middle.x * weight,
            along * (2.0 * f.x - 1.0) - across * middle.x, volume, &carry);
        add_to_node(place + 2u, vec4<f32>(start + 2.0 * A[0], total.w), last.x * weight,
            along * (0.0 - f.x) - across * last.x, volume, &carry);
    }
    settle(at + 73u, id, total, volume, carry);
    return true;
}
