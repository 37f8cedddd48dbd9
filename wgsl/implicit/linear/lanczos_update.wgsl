// α = r·z / p·Ap, r ← r − α Ap, z = D⁻¹ r; partial sums of r·z. Grid-stride over rows.
//
// uses implicit/linear/level, implicit/linear/lanczos, implicit/linear/vectors
// uses implicit/linear/reduce

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> inverse: array<f32>;
@group(0) @binding(2) var<storage, read> products: array<f32>;
@group(0) @binding(3) var<storage, read> ap: array<f32>;
@group(0) @binding(4) var<storage, read_write> r: array<f32>;
@group(0) @binding(5) var<storage, read_write> z: array<f32>;
@group(0) @binding(6) var<storage, read_write> partials: array<f32>;
@group(0) @binding(7) var<storage, read_write> lanczos: Lanczos;

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = level.stride;
    // One of every workgroup of lanczos_product, 32 rows each.
    var own = 0.0;
    for (var k = lane; 32u * k < level.rows; k += 256u) {
        own += products[k];
    }
    let pap = summed(lane, own);
    let alpha = select(0.0, lanczos.rz / pap, pap > 0.0);
    var sum = 0.0;
    for (var row = group.x * 256u + lane; row < level.rows; row += 256u * level.groups) {
        var residual: vec3<f32>;
        for (var a = 0u; a < 3u; a++) {
            residual[a] = r[a * n + row] - alpha * ap[a * n + row];
            r[a * n + row] = residual[a];
        }
        let preconditioned = inverse_times(row, residual);
        for (var a = 0u; a < 3u; a++) {
            z[a * n + row] = preconditioned[a];
        }
        sum += dot(residual, preconditioned);
    }
    let total = summed(lane, sum);
    if (lane == 0u) {
        partials[group.x] = total;
        if (group.x == 0u) {
            lanczos.alpha[lanczos.count - 1u] = alpha;
        }
    }
}
