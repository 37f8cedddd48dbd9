// β = z·(r − r_old) / z_old·r_old, with r − r_old = −α Ap; 0 for the first direction. One workgroup.
//
// uses implicit/linear/level, implicit/linear/cg, implicit/linear/reduce

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> products: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> weights: array<f32>;
@group(0) @binding(3) var<storage, read_write> cg: Cg;

@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) lane: u32) {
    var own = vec4<f32>();
    var weight = 0.0;
    if (lane < level.groups) {
        own = products[lane];
        weight = weights[lane];
    }
    let total = vec4<f32>(summed(lane, own.x), summed(lane, own.y), summed(lane, own.z), summed(lane, own.w));
    let mass = summed(lane, weight);
    if (lane == 0u) {
        cg.beta = select(0.0, -cg.alpha * total.y / cg.zr, cg.count > 0u && cg.zr > 0.0);
        cg.zr = total.x;
        cg.size2 = total.z;
        cg.motion2 = total.w;
        cg.mass = mass;
    }
}
