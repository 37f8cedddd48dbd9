// First loop of the two-loop recursion, a pair (Nocedal & Wright, alg. 7.4): α = ρ s·q, q ← q − α
// y; then partial sums of s'·q with the next older pair's s'. Grid-stride over rows; the partial
// sums of s·q come in from the dispatch before.
//
// uses implicit/linear/level, implicit/linear/pair, implicit/linear/reduce

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> partials_in: array<f32>;
@group(0) @binding(2) var<storage, read_write> pair: Pair;
@group(0) @binding(3) var<storage, read> y: array<f32>;
@group(0) @binding(4) var<storage, read> s: array<f32>;
@group(0) @binding(5) var<storage, read_write> q: array<f32>;
@group(0) @binding(6) var<storage, read_write> partials_out: array<f32>;

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = level.stride;
    var own = 0.0;
    if (lane < level.groups) {
        own = partials_in[lane];
    }
    let alpha = pair.rho * summed(lane, own);
    var sum = 0.0;
    for (var row = group.x * 256u + lane; row < level.rows; row += 256u * level.groups) {
        for (var k = row; k < 3u * n; k += n) {
            let value = q[k] - alpha * y[k];
            q[k] = value;
            sum += s[k] * value;
        }
    }
    let total = summed(lane, sum);
    if (lane == 0u) {
        partials_out[group.x] = total;
        if (group.x == 0u) {
            pair.alpha = alpha;
        }
    }
}
