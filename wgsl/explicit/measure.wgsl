// A frame's sums for the diagnostics, and its extremes, from full states by id. Lengths are in cells and positions
// from the domain's corner, so that a domain far from the origin loses nothing. Twin: src/core/sim/diagnostics.rs.
// One workgroup a run of PART particles, one lane a particle at a time. Sums are pairs, added up in a fixed order;
// the host adds up those of the runs.
//
// uses explicit/state_io, shared/energy, shared/pairs, shared/kernel_*

@group(0) @binding(28) var<storage, read_write> parts: array<vec2<f32>>; // RECORD a run

const LANES = 64u;
/// Particles of a run.
const PART = 2048u;
/// Momentum, angular momentum over dx, kinetic, affine and strain energy, work of gravity over dx.
const SUMS = 10u;
/// The sums, then the largest v² and the least J.
const RECORD = 11u;

var<workgroup> lane_sums: array<array<vec2<f32>, SUMS>, LANES>;
var<workgroup> lane_extremes: array<vec2<f32>, LANES>;

/// Position from the domain's corner (cells).
fn cells_from_corner(place: vec4<u32>) -> vec3<f32> {
    let corner = vec3<f32>(4 * block_coordinates(place.w) - params.pad);
    let x = corner + bitcast<vec3<f32>>(place.xyz) + SHIFT;
    let period = vec3<f32>(4u * params.blocks);
    return select(x, x - period, (params.periodic == vec3<u32>(1u)) & (x >= period));
}

@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let part = group_index(group, groups);
    let end = min((part + 1u) * PART, params.live);
    var sums: array<vec2<f32>, SUMS>;
    var extremes = vec2<f32>(0.0, 3e38);
    for (var id = part * PART + lane; id < end; id += LANES) {
        let body = bodies[body_of[id]];
        let material = material_of(body);
        let place = frame_position[id];
        let x = cells_from_corner(place);
        let v = load_velocity(id);
        let B = load_affine(id);
        let C = times_inverse_moment(B, bitcast<vec3<f32>>(place.xyz));
        let state = load_frame_deformation(id, material.model);
        let turning = vec3<f32>(B[1].z - B[2].y, B[2].x - B[0].z, B[0].y - B[1].x);
        let momentum = body.mass * v;
        let spin = body.mass * (cross(x, v) + turning);
        let affine = dot(B[0], C[0]) + dot(B[1], C[1]) + dot(B[2], C[2]);
        var terms = array<f32, SUMS>(
            momentum.x, momentum.y, momentum.z, spin.x, spin.y, spin.z,
            0.5 * dot(momentum, v), 0.5 * body.mass * affine, body.volume * energy_density(state, material),
            body.mass * dot(params.gravity, x),
        );
        for (var k = 0u; k < SUMS; k++) {
            sums[k] = add_pairs(sums[k], vec2<f32>(terms[k], 0.0));
        }
        var J = state.J;
        if (!is_law(material, FLUID)) {
            J = determinant(state.F);
        }
        extremes = vec2<f32>(max(extremes.x, dot(v, v)), min(extremes.y, J));
    }
    lane_sums[lane] = sums;
    lane_extremes[lane] = extremes;
    for (var half = LANES / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if (lane < half) {
            for (var k = 0u; k < SUMS; k++) {
                lane_sums[lane][k] = add_pairs(lane_sums[lane][k], lane_sums[lane + half][k]);
            }
            let a = lane_extremes[lane];
            let b = lane_extremes[lane + half];
            lane_extremes[lane] = vec2<f32>(max(a.x, b.x), min(a.y, b.y));
        }
    }
    if (lane == 0u) {
        for (var k = 0u; k < SUMS; k++) {
            parts[part * RECORD + k] = lane_sums[0][k];
        }
        parts[part * RECORD + SUMS] = lane_extremes[0];
    }
}
