// α = z·r / p·Ap; 0 where p·Ap is not positive. One workgroup.
//
// uses implicit/linear/level, implicit/linear/cg, implicit/linear/reduce

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> curvatures: array<f32>;
@group(0) @binding(2) var<storage, read_write> cg: Cg;

@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) lane: u32) {
    // One of every workgroup of cg_product, 32 rows each.
    var own = 0.0;
    for (var k = lane; 32u * k < level.rows; k += 256u) {
        own += curvatures[k];
    }
    let pap = summed(lane, own);
    if (lane == 0u) {
        cg.pap = pap;
        cg.alpha = select(0.0, cg.zr / pap, pap > 0.0);
        cg.count += 1u;
    }
}
