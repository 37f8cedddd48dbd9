// After a V-cycle: z ← S z; partial sums of z·r, z·Ap, and of the masses with Δv − s and with the
// velocities at the step's start. Grid-stride over rows.
//
// uses implicit/linear/level, implicit/linear/freedom, implicit/linear/reduce

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> freedoms: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> masses: array<f32>;
@group(0) @binding(3) var<storage, read> speeds: array<f32>;
@group(0) @binding(4) var<storage, read> dv: array<f32>;
@group(0) @binding(5) var<storage, read> step: array<f32>;
@group(0) @binding(6) var<storage, read> b: array<f32>;
@group(0) @binding(7) var<storage, read> ap: array<f32>;
@group(0) @binding(8) var<storage, read_write> z: array<f32>;
@group(0) @binding(9) var<storage, read_write> products: array<vec4<f32>>;
@group(0) @binding(10) var<storage, read_write> weights: array<f32>;

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = level.stride;
    var sums = vec4<f32>();
    var weight = 0.0;
    for (var row = group.x * 256u + lane; row < level.rows; row += 256u * level.groups) {
        let value = projected(freedoms[row], vec3<f32>(z[row], z[n + row], z[2u * n + row]));
        var change2 = 0.0;
        for (var a = 0u; a < 3u; a++) {
            let k = a * n + row;
            z[k] = value[a];
            sums.x += value[a] * b[k];
            sums.y += value[a] * ap[k];
            let change = dv[k] - step[k];
            change2 += change * change;
        }
        let m = masses[row];
        sums.z += m * change2;
        sums.w += m * speeds[row] * speeds[row];
        weight += m;
    }
    let total = vec4<f32>(summed(lane, sums.x), summed(lane, sums.y), summed(lane, sums.z), summed(lane, sums.w));
    let mass = summed(lane, weight);
    if (lane == 0u) {
        products[group.x] = total;
        weights[group.x] = mass;
    }
}
