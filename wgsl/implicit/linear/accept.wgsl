// Goes to the accepted trial: s = trial − Δv and y = ∇E' − ∇E become the new pair, with partial
// sums of yᵀs; Δv and ∇E follow. Grid-stride over rows.
//
// uses implicit/linear/level, implicit/linear/state, implicit/linear/reduce

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> state: State;
@group(0) @binding(2) var<storage, read> trial: array<f32>;
@group(0) @binding(3) var<storage, read> gradient: array<f32>;
@group(0) @binding(4) var<storage, read_write> dv: array<f32>;
@group(0) @binding(5) var<storage, read_write> g: array<f32>;
@group(0) @binding(6) var<storage, read_write> s: array<f32>;
@group(0) @binding(7) var<storage, read_write> y: array<f32>;
@group(0) @binding(8) var<storage, read_write> partials: array<f32>;

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = level.stride;
    let rows = select(0u, level.rows, (state.flags & ACCEPTED) != 0u);
    var sum = 0.0;
    for (var row = group.x * 256u + lane; row < rows; row += 256u * level.groups) {
        for (var k = row; k < 3u * n; k += n) {
            let step = trial[k] - dv[k];
            let change = gradient[k] - g[k];
            s[k] = step;
            y[k] = change;
            dv[k] = trial[k];
            g[k] = gradient[k];
            sum += step * change;
        }
    }
    let total = summed(lane, sum);
    if (lane == 0u) {
        partials[group.x] = total;
    }
}
