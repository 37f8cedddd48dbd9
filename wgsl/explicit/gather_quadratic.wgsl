// Gather of the quadratic kernel: weighted means over its 27 nodes, and moments along each axis.
//
// On three nodes Σ w v = v_1 + w_0 (v_0 - v_1) + w_2 (v_2 - v_1): exact where all velocities are the same, so that
// no error of Σ w = 1 is a steady gain or loss of momentum. Likewise Σ w d v, since Σ w d = 0, and Σ w' v.
//
// uses explicit/gathered

/// Of the first and the last node of the three, by axis: weights, those times the distance from the particle, and
/// slopes.
struct Ends {
    w_first: vec3<f32>,
    w_last: vec3<f32>,
    arm_first: vec3<f32>,
    arm_last: vec3<f32>,
    slope_first: vec3<f32>,
    slope_last: vec3<f32>,
}

/// Means of velocities, their moments, those with slopes, and what fills the nodes.
struct Means { v: vec3<f32>, B: mat3x3<f32>, gradient: mat3x3<f32>, fill: vec2<f32> }

fn velocity_at(at: u32) -> vec3<f32> {
    return bitcast<vec3<f32>>(read_tile[at].xyz);
}

fn row_mean(at: u32, e: Ends) -> Means {
    let middle = velocity_at(at + 1u);
    let first = velocity_at(at) - middle;
    let last = velocity_at(at + 2u) - middle;
    var m: Means;
    m.v = middle + first * e.w_first.x + last * e.w_last.x;
    m.B[0] = first * e.arm_first.x + last * e.arm_last.x;
    m.gradient[0] = first * e.slope_first.x + last * e.slope_last.x;
    if (FILLS != FILLS_NOTHING) {
        let own = fill_units(read_tile[at + 1u].w);
        let before = fill_units(read_tile[at].w);
        let after = fill_units(read_tile[at + 2u].w);
        m.fill = own + (before - own) * e.w_first.x + (after - own) * e.w_last.x;
    }
    return m;
}

fn layer_mean(at: u32, e: Ends) -> Means {
    let a = row_mean(at, e);
    let b = row_mean(at + 6u, e);
    let c = row_mean(at + 12u, e);
    let first = a.v - b.v;
    let last = c.v - b.v;
    let w = vec2<f32>(e.w_first.y, e.w_last.y);
    var m: Means;
    m.v = b.v + first * w.x + last * w.y;
    m.B[0] = b.B[0] + (a.B[0] - b.B[0]) * w.x + (c.B[0] - b.B[0]) * w.y;
    m.B[1] = first * e.arm_first.y + last * e.arm_last.y;
    m.gradient[0] = b.gradient[0] + (a.gradient[0] - b.gradient[0]) * w.x + (c.gradient[0] - b.gradient[0]) * w.y;
    m.gradient[1] = first * e.slope_first.y + last * e.slope_last.y;
    m.fill = b.fill + (a.fill - b.fill) * w.x + (c.fill - b.fill) * w.y;
    return m;
}

fn gather(y: vec3<f32>) -> Gathered {
    let base = floor(y);
    let f = y - base;
    let g = 1.0 - f;
    var e: Ends;
    e.w_first = 0.5 * g * g;
    e.w_last = 0.5 * f * f;
    e.arm_first = e.w_first * (-0.5 - f);
    e.arm_last = e.w_last * (1.5 - f);
    e.slope_first = f - 1.0;
    e.slope_last = f;
    let at = first_read(0u, base);
    let a = layer_mean(at, e);
    let b = layer_mean(at + 36u, e);
    let c = layer_mean(at + 72u, e);
    let first = a.v - b.v;
    let last = c.v - b.v;
    let w = vec2<f32>(e.w_first.z, e.w_last.z);
    var out: Gathered;
    out.v = b.v + first * w.x + last * w.y;
    out.B = b.B + (a.B - b.B) * w.x + (c.B - b.B) * w.y;
    out.B[2] = first * e.arm_first.z + last * e.arm_last.z;
    if (MLS) {
        out.gradient = out.B * 4.0;
    } else {
        out.gradient = b.gradient + (a.gradient - b.gradient) * w.x + (c.gradient - b.gradient) * w.y;
        out.gradient[2] = first * e.slope_first.z + last * e.slope_last.z;
    }
    out.fill = FILL_UNIT * (b.fill + (a.fill - b.fill) * w.x + (c.fill - b.fill) * w.y);
    return out;
}
