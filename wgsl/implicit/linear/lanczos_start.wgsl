// Start of a level's Lanczos process: r noise by the node's index, scaled as D^½ so that soft and
// stiff nodes count alike, z = D⁻¹ r, p = 0; partial sums of r·z. Grid-stride over rows.
//
// uses implicit/linear/level, implicit/linear/lanczos, implicit/linear/vectors
// uses implicit/linear/reduce

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> ids: array<vec4<i32>>;
@group(0) @binding(2) var<storage, read> inverse: array<f32>;
@group(0) @binding(3) var<storage, read_write> r: array<f32>;
@group(0) @binding(4) var<storage, read_write> z: array<f32>;
@group(0) @binding(5) var<storage, read_write> p: array<f32>;
@group(0) @binding(6) var<storage, read_write> partials: array<f32>;
@group(0) @binding(7) var<storage, read_write> lanczos: Lanczos;

fn hash(x: u32) -> u32 {
    let h = x * 747796405u + 2891336453u;
    let g = ((h >> ((h >> 28u) + 4u)) ^ h) * 277803737u;
    return (g >> 22u) ^ g;
}

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = level.stride;
    var sum = 0.0;
    for (var row = group.x * 256u + lane; row < level.rows; row += 256u * level.groups) {
        let id = vec4<u32>(ids[row]);
        var noise: vec3<f32>;
        for (var a = 0u; a < 3u; a++) {
            noise[a] = f32(hash(id.x + hash(id.y + hash(id.z + hash(4u * id.w + a)))) >> 8u) / 8388608.0 - 1.0;
        }
        noise *= inverseSqrt((inverse[row] + inverse[3u * n + row] + inverse[5u * n + row]) / 3.0);
        let preconditioned = inverse_times(row, noise);
        for (var a = 0u; a < 3u; a++) {
            r[a * n + row] = noise[a];
            z[a * n + row] = preconditioned[a];
            p[a * n + row] = 0.0;
        }
        sum += dot(noise, preconditioned);
    }
    let total = summed(lane, sum);
    if (lane == 0u) {
        partials[group.x] = total;
        if (group.x == 0u) {
            lanczos.count = 0u;
        }
    }
}
