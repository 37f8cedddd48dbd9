// Accepts the trial or halves the step: accepted when ΔE ≤ 0, or when ΔE ≤ 4u|E| and |φ'(α)| ≤ 0.8
// |φ'(0)|, u = 2⁻²⁴. One workgroup.
//
// uses implicit/linear/level, implicit/linear/state, implicit/linear/reduce

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> slopes: array<f32>;
@group(0) @binding(2) var<storage, read> residuals: array<f32>;
@group(0) @binding(3) var<storage, read> energy: vec2<f32>;
@group(0) @binding(4) var<storage, read_write> state: State;
@group(0) @binding(5) var<storage, read_write> control: array<u32, 4>;

const UNIT = 5.9604645e-8;

@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) lane: u32) {
    var slope = 0.0;
    var residual = 0.0;
    if (lane < level.groups) {
        slope = slopes[lane];
        residual = residuals[lane];
    }
    let zg = summed(lane, slope);
    let residual2 = summed(lane, residual);
    if (lane != 0u || control[0] != 0u) {
        return;
    }
    let change = (energy.x - state.energy.x) + (energy.y - state.energy.y);
    let noise = 4.0 * UNIT * abs(state.energy.x);
    // Comparisons with NaN are false: a state that has none is not accepted.
    let falls = change <= 0.0;
    let levels_off = change <= noise && abs(zg) <= 0.8 * abs(state.slope);
    if ((falls || levels_off) && residual2 < 3e38) {
        state.flags |= ACCEPTED;
        state.energy = energy;
        state.residual2 = residual2;
        control[0] = 1u;
    } else {
        state.alpha *= 0.5;
        state.halvings += 1u;
    }
}
