// β = r·z over that of the step before (the first: 0). One workgroup.
//
// uses implicit/linear/level, implicit/linear/lanczos, implicit/linear/reduce

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> partials: array<f32>;
@group(0) @binding(2) var<storage, read_write> lanczos: Lanczos;

@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) lane: u32) {
    var own = 0.0;
    if (lane < level.groups) {
        own = partials[lane];
    }
    let rz = summed(lane, own);
    if (lane == 0u) {
        let k = lanczos.count;
        lanczos.beta[k] = select(0.0, rz / lanczos.rz, k > 0u && lanczos.rz > 0.0);
        lanczos.rz = rz;
        lanczos.count = k + 1u;
    }
}
