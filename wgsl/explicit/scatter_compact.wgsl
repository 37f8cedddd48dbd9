// Scatter to the 8 nodes of each grid of the compact kernel.
//
// uses explicit/sums, shared/mls, shared/polar

/// What a particle gives to one grid, in fixed-point units.
struct Share {
    corner: vec4<f32>,    // momentum of a unit weight at the first node, and mass
    along: mat3x3<f32>,   // how the momentum grows from node to node, by axis
    push: mat3x3<f32>,    // APIC: force times the slope of the upper node's weight, by axis
    volume: f32,
    lower: vec3<f32>,     // weights
    upper: vec3<f32>,
}

/// Adds to the two nodes of a row from place `at` on. `momentum`: at its first node; `weight`, `push`: of the row.
fn scatter_row(at: u32, share: Share, momentum: vec3<f32>, weight: f32, push: vec3<f32>, carry: ptr<function, Carry>) {
    let mass = share.corner.w;
    let along = share.push[0] * weight;
    add_to_node(at, vec4<f32>(momentum, mass), share.lower.x * weight, along - push * share.lower.x, share.volume,
        carry);
    add_to_node(at + 1u, vec4<f32>(momentum + share.along[0], mass), share.upper.x * weight,
        vec3<f32>(0.0) - along - push * share.upper.x, share.volume, carry);
}

/// Adds to the nodes from place `at` of a tile with `side` nodes to an edge.
fn scatter_grid(at: u32, side: u32, share: Share, carry: ptr<function, Carry>) {
    let l = share.lower;
    let u = share.upper;
    let y = share.push[1];
    let z = share.push[2];
    let corner = share.corner.xyz;
    let above = corner + share.along[2];
    scatter_row(at, share, corner, l.y * l.z, (y * l.z + z * l.y) * -1.0, carry);
    scatter_row(at + side, share, corner + share.along[1], u.y * l.z, y * l.z - z * u.y, carry);
    scatter_row(at + side * side, share, above, l.y * u.z, z * l.y - y * u.z, carry);
    scatter_row(at + side * side + side, share, above + share.along[1], u.y * u.z, y * u.z + z * u.y, carry);
}

/// Scatters mass and momentum: w (m v + m C d), with the force -V0 τ ∇w or, for MLS,
/// -V0 τ E⁻¹ (d - m) w, times dt.
/// `tau_impulse` = dt V0 τ / dx; `cells`: cells that the particle fills. False, and nothing done, if that is no number.
fn scatter(id: u32, y: vec3<f32>, mass: f32, cells: f32, v: vec3<f32>, B: mat3x3<f32>,
    tau_impulse: mat3x3<f32>) -> bool {
    if (!(norm2(tau_impulse) < 1e30)) {
        return false;
    }
    let s = spot(y);
    let moments = Moments(0.5 * (s.lower_plus * s.upper_plus + s.lower_minus * s.upper_minus), s.skew);
    let scale = params.momentum_scale;
    var affine = B * mass;
    if (MLS && !CENTRED) {
        affine -= tau_impulse;
    }
    var A = times_inverse(affine, moments) * scale;
    var push = vec3<f32>(0.0);
    if (MLS && CENTRED) {
        let inverse = scale / moments.p;
        let force = mat3x3<f32>(tau_impulse[0] * inverse.x, tau_impulse[1] * inverse.y, tau_impulse[2] * inverse.z);
        A -= force;
        push = force * s.skew;
    }
    let total = vec4<f32>((mass * scale) * v, mass * params.mass_scale);
    let value = total.xyz - A * s.f;
    let plus = value + push;
    let minus = value + A * (s.step - 0.5) - push;
    var push_plus = mat3x3<f32>();
    var push_minus = mat3x3<f32>();
    if (!MLS) {
        let t = tau_impulse * scale;
        push_plus = mat3x3<f32>(t[0] * s.slope_plus.x, t[1] * s.slope_plus.y, t[2] * s.slope_plus.z);
        push_minus = mat3x3<f32>(t[0] * s.slope_minus.x, t[1] * s.slope_minus.y, t[2] * s.slope_minus.z);
    }
    let volume = cells * params.cell_scale;
    let first = first_sum(0u, s.base);
    var carry: Carry;
    var at = first;
    var side = SUM_PLUS;
    var share = Share(vec4<f32>(plus, total.w), A, push_plus, volume, s.lower_plus, s.upper_plus);
    // Not unrolled: code and registers of one grid serve both.
    for (var grid = 0u; grid < GRIDS; grid++) {
        scatter_grid(at, side, share, &carry);
        at = first_sum(1u, s.base + s.step);
        side = SUM_MINUS;
        share = Share(vec4<f32>(minus, total.w), A, push_minus, volume, s.lower_minus, s.upper_minus);
    }
    let nearest = select(vec3<u32>(0u), vec3<u32>(1u, SUM_PLUS, SUM_PLUS * SUM_PLUS), s.f > vec3<f32>(0.5));
    settle(first + nearest.x + nearest.y + nearest.z, id, 2.0 * total, 2.0 * volume, carry);
    return true;
}
