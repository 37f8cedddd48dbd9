// At the trial: partial sums of z·∇E and of Σ |∇E_i|² / scale_i². Grid-stride over rows; nothing to
// do once the search has ended.
//
// uses implicit/linear/level, implicit/linear/reduce

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> control: array<u32, 4>;
@group(0) @binding(2) var<storage, read> z: array<f32>;
@group(0) @binding(3) var<storage, read> gradient: array<f32>;
@group(0) @binding(4) var<storage, read> scales: array<f32>;
@group(0) @binding(5) var<storage, read_write> slopes: array<f32>;
@group(0) @binding(6) var<storage, read_write> residuals: array<f32>;

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = level.stride;
    let rows = select(level.rows, 0u, control[0] != 0u);
    var slope = 0.0;
    var residual = 0.0;
    for (var row = group.x * 256u + lane; row < rows; row += 256u * level.groups) {
        let g = vec3<f32>(gradient[row], gradient[n + row], gradient[2u * n + row]);
        let r = g / scales[row];
        slope += dot(vec3<f32>(z[row], z[n + row], z[2u * n + row]), g);
        residual += dot(r, r);
    }
    let slope_sum = summed(lane, slope);
    let residual_sum = summed(lane, residual);
    if (lane == 0u) {
        slopes[group.x] = slope_sum;
        residuals[group.x] = residual_sum;
    }
}
