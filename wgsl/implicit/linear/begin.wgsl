// Start of the two-loop recursion: q = ∇E, and partial sums of s·q with the newest pair's s.
// Grid-stride over rows.
//
// uses implicit/linear/level, implicit/linear/reduce

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> g: array<f32>;
@group(0) @binding(2) var<storage, read> s: array<f32>;
@group(0) @binding(3) var<storage, read_write> q: array<f32>;
@group(0) @binding(4) var<storage, read_write> partials: array<f32>;

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = level.stride;
    var sum = 0.0;
    for (var row = group.x * 256u + lane; row < level.rows; row += 256u * level.groups) {
        for (var k = row; k < 3u * n; k += n) {
            q[k] = g[k];
            sum += s[k] * g[k];
        }
    }
    let total = summed(lane, sum);
    if (lane == 0u) {
        partials[group.x] = total;
    }
}
