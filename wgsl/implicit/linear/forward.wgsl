// Second loop of the two-loop recursion, a pair: β = ρ y·z, z ← z + (α − β) s; then partial sums of
// y'·z with the next newer pair's y', of ∇E·z after the newest. Grid-stride over rows; the partial
// sums of y·z come in from the dispatch before.
//
// uses implicit/linear/level, implicit/linear/pair, implicit/linear/reduce

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> partials_in: array<f32>;
@group(0) @binding(2) var<storage, read> pair: Pair;
@group(0) @binding(3) var<storage, read> s: array<f32>;
@group(0) @binding(4) var<storage, read> y: array<f32>;
@group(0) @binding(5) var<storage, read_write> z: array<f32>;
@group(0) @binding(6) var<storage, read_write> partials_out: array<f32>;

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = level.stride;
    var own = 0.0;
    if (lane < level.groups) {
        own = partials_in[lane];
    }
    let factor = pair.alpha - pair.rho * summed(lane, own);
    var sum = 0.0;
    for (var row = group.x * 256u + lane; row < level.rows; row += 256u * level.groups) {
        for (var k = row; k < 3u * n; k += n) {
            let value = z[k] + factor * s[k];
            z[k] = value;
            sum += y[k] * value;
        }
    }
    let total = summed(lane, sum);
    if (lane == 0u) {
        partials_out[group.x] = total;
    }
}
