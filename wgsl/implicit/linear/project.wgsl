// After the V-cycle: z ← S z, and partial sums of y·z with the oldest pair's y, or of ∇E·z without
// pairs. Grid-stride over rows.
//
// uses implicit/linear/level, implicit/linear/freedom, implicit/linear/reduce

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> freedoms: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> y: array<f32>;
@group(0) @binding(3) var<storage, read_write> z: array<f32>;
@group(0) @binding(4) var<storage, read_write> partials: array<f32>;

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = level.stride;
    var sum = 0.0;
    for (var row = group.x * 256u + lane; row < level.rows; row += 256u * level.groups) {
        let value = projected(freedoms[row], vec3<f32>(z[row], z[n + row], z[2u * n + row]));
        for (var a = 0u; a < 3u; a++) {
            z[a * n + row] = value[a];
            sum += y[a * n + row] * value[a];
        }
    }
    let total = summed(lane, sum);
    if (lane == 0u) {
        partials[group.x] = total;
    }
}
