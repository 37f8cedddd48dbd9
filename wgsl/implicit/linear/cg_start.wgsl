// Start of conjugate gradients from s = 0: b = ∇E, the residual, lies where the V-cycle takes its
// right-hand side. Grid-stride over rows.
//
// uses implicit/linear/level, implicit/linear/cg

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> gradient: array<f32>;
@group(0) @binding(2) var<storage, read_write> b: array<f32>;
@group(0) @binding(3) var<storage, read_write> step: array<f32>;
@group(0) @binding(4) var<storage, read_write> p_in: array<f32>;
@group(0) @binding(5) var<storage, read_write> ap: array<f32>;
@group(0) @binding(6) var<storage, read_write> cg: Cg;

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = level.stride;
    for (var row = group.x * 256u + lane; row < level.rows; row += 256u * level.groups) {
        for (var k = row; k < 3u * n; k += n) {
            b[k] = gradient[k];
            step[k] = 0.0;
            p_in[k] = 0.0;
            ap[k] = 0.0;
        }
    }
    if (group.x == 0u && lane == 0u) {
        cg = Cg();
    }
}
