// Particle ↔ grid transfers, APIC and MLS, on either kernel (CK-MPM §4.3–4.5; NUMERICS in docs).
// Velocities in m/s; distances d, D and B in cells, so that C d = (B D⁻¹) d needs no dx.
//
// uses explicit/tile, shared/mls, shared/polar

struct Gathered { v: vec3<f32>, B: mat3x3<f32>, gradient: mat3x3<f32> } // gradient: dx ∇v (m/s)

/// Sums are of differences to the first node's velocity: Σ w = 1 holds only to rounding, and that
/// error would otherwise be a steady gain or loss of momentum.
/// v = ½ Σ w v_i, B = ½ Σ w v_i dᵀ, and dx ∇v = ½ Σ v_i ∇wᵀ (APIC) or ½ Σ w v_i (d - m)ᵀ E⁻¹ (MLS)
/// at the old position.
fn gather(y: vec3<f32>) -> Gathered {
    let s = stencil(y);
    let first = node_velocity(0u, s.base[0]);
    var out: Gathered;
    var apart = vec3<f32>(0.0); // ½ (Σ⁺ - Σ⁻) w v_i
    for (var grid = 0u; grid < GRIDS; grid++) {
        var sum = vec3<f32>(0.0);
        for (var k = 0u; k < NODES; k++) {
            for (var j = 0u; j < NODES; j++) {
                for (var i = 0u; i < NODES; i++) {
                    let w = vec3<f32>(s.w[grid][i].x, s.w[grid][j].y, s.w[grid][k].z);
                    let n = vec3<u32>(i, j, k);
                    let d = s.d[grid] + vec3<f32>(n);
                    let v = node_velocity(grid, s.base[grid] + vec3<i32>(n)) - first;
                    let wv = (GRID_SHARE * w.x * w.y * w.z) * v;
                    sum += wv;
                    out.B += mat3x3<f32>(wv * d.x, wv * d.y, wv * d.z);
                    if (!MLS) {
                        let dw = GRID_SHARE * vec3<f32>(s.dw[grid][i].x, s.dw[grid][j].y, s.dw[grid][k].z)
                            * vec3<f32>(w.y * w.z, w.x * w.z, w.x * w.y);
                        out.gradient += mat3x3<f32>(v * dw.x, v * dw.y, v * dw.z);
                    }
                }
            }
        }
        out.v += sum;
        apart += select(sum, -sum, grid == 1u);
    }
    out.v += first;
    if (MLS) {
        out.gradient = mls_gradient(out.B, apart, y);
    }
    return out;
}

/// Scatters mass and momentum: w (m v + m C d), with the force -V0 τ ∇w or, for MLS,
/// -V0 τ E⁻¹ (d - m) w, times dt.
/// `tau_impulse` = dt V0 τ / dx; `cells`: cells that the particle fills. False, and nothing done, if it is not finite.
fn scatter(id: u32, y: vec3<f32>, mass: f32, cells: f32, v: vec3<f32>, B: mat3x3<f32>,
    tau_impulse: mat3x3<f32>) -> bool {
    if (!(norm2(tau_impulse) < 1e30)) {
        return false;
    }
    let s = stencil(y);
    var affine = B * mass;
    var push = vec3<f32>(0.0);
    if (MLS && !CENTRED) {
        affine -= tau_impulse;
    }
    var A = times_inverse_moment(affine, y);
    if (MLS && CENTRED) {
        let force = times_inverse_spread(tau_impulse, y);
        A -= force;
        push = force * grid_mean(y, 0u);
    }
    var carry = dither(id);
    var volume_carry = carry.x;
    for (var grid = 0u; grid < GRIDS; grid++) {
        let value = mass * v + select(push, -push, grid == 1u);
        for (var k = 0u; k < NODES; k++) {
            for (var j = 0u; j < NODES; j++) {
                for (var i = 0u; i < NODES; i++) {
                    let w = vec3<f32>(s.w[grid][i].x, s.w[grid][j].y, s.w[grid][k].z);
                    let n = vec3<u32>(i, j, k);
                    let d = s.d[grid] + vec3<f32>(n);
                    let weight = w.x * w.y * w.z;
                    var p = weight * (value + A * d);
                    if (!MLS) {
                        let dw = vec3<f32>(s.dw[grid][i].x, s.dw[grid][j].y, s.dw[grid][k].z)
                            * vec3<f32>(w.y * w.z, w.x * w.z, w.x * w.y);
                        p -= tau_impulse * dw;
                    }
                    add_to_node(grid, s.base[grid] + vec3<i32>(n), weight * mass, p, &carry);
                    if (params.fills == FILLS_VOLUME) {
                        add_volume(grid, s.base[grid] + vec3<i32>(n), weight * cells, &volume_carry);
                    }
                }
            }
        }
    }
    return true;
}
