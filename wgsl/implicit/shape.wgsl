// How a particle sees one node: its weight w, the distance d to it (cells), and g with ∇v = share Σ
// v_i g_iᵀ: ∂w/∂x, or for MLS w (d - m), whose E⁻¹ is applied elsewhere. Same numbers as `stencil` of the
// kernel files.
//
// uses shared/kernel_*, shared/mls

struct Shape { w: f32, d: vec3<f32>, g: vec3<f32> }

fn pick(s: array<vec3<f32>, NODES>, k: vec3<u32>) -> vec3<f32> {
    var table = s;
    return vec3<f32>(table[k.x].x, table[k.y].y, table[k.z].z);
}

/// `n`: the node relative to the particle's block; zero if the particle does not touch it.
fn shape(y: vec3<f32>, n: vec3<i32>, grid: u32) -> Shape {
    var s = stencil(y);
    let k = n - s.base[grid];
    var out: Shape;
    if (any(k < vec3<i32>(0)) || any(k >= vec3<i32>(i32(NODES)))) {
        return out;
    }
    let w = pick(s.w[grid], vec3<u32>(k));
    out.w = w.x * w.y * w.z;
    out.d = s.d[grid] + vec3<f32>(k);
    if (MLS) {
        out.g = out.w * (out.d - arms_mean(y, grid));
    } else {
        out.g = pick(s.dw[grid], vec3<u32>(k)) * vec3<f32>(w.y * w.z, w.x * w.z, w.x * w.y);
    }
    return out;
}
