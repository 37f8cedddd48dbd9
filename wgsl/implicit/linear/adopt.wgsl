// Takes E, the residual and z·∇E at the trial. One workgroup.
//
// uses implicit/linear/level, implicit/linear/state, implicit/linear/reduce

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> residuals: array<f32>;
@group(0) @binding(2) var<storage, read> energy: vec2<f32>;
@group(0) @binding(3) var<storage, read_write> state: State;
@group(0) @binding(4) var<storage, read> slopes: array<f32>;

@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) lane: u32) {
    var own = vec2<f32>();
    if (lane < level.groups) {
        own = vec2<f32>(residuals[lane], slopes[lane]);
    }
    let residual2 = summed(lane, own.x);
    let slope = summed(lane, own.y);
    if (lane == 0u) {
        state.energy = energy;
        state.residual2 = residual2;
        state.slope = slope;
        state.flags = select(BROKEN, 0u, abs(energy.x) < 3e38 && residual2 < 3e38);
    }
}
