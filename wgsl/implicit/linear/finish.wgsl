// ρ of the new pair. One workgroup.

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> sums: array<f32>;
@group(0) @binding(2) var<storage, read_write> pair: Pair;
@group(0) @binding(3) var<storage, read_write> state: State;

@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) lane: u32) {
    var own = 0.0;
    if (lane < level.groups) {
        own = sums[lane];
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
