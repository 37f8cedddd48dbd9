// ρ of the new pair. One workgroup.
//
// uses implicit/linear/level, implicit/linear/state, implicit/linear/pair, implicit/linear/reduce

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> partials: array<f32>;
@group(0) @binding(2) var<storage, read_write> pair: Pair;
@group(0) @binding(3) var<storage, read_write> state: State;

@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) lane: u32) {
    var own = 0.0;
    if (lane < level.groups) {
        own = partials[lane];
    }
    let ys = summed(lane, own);
    if (lane == 0u && (state.flags & ACCEPTED) != 0u) {
        if (ys > 0.0) {
            pair.rho = 1.0 / ys;
        } else {
            state.flags |= DROPPED;
        }
    }
}
