// Start of a line search along −z: φ'(0) = −zᵀ∇E, α = 1; nothing is tried when it does not fall.
// One workgroup.
//
// uses implicit/linear/level, implicit/linear/state, implicit/linear/reduce

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> partials_in: array<f32>;
@group(0) @binding(2) var<storage, read_write> state: State;
@group(0) @binding(3) var<storage, read_write> control: array<u32, 4>;

@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) lane: u32) {
    var own = 0.0;
    if (lane < level.groups) {
        own = partials_in[lane];
    }
    let zg = summed(lane, own);
    if (lane == 0u) {
        let falls = zg > 0.0;
        state.slope = -zg;
        state.alpha = 1.0;
        state.halvings = 0u;
        state.flags = select(INDEFINITE, 0u, falls);
        control[0] = select(1u, 0u, falls);
    }
}
