// What surfaces give the nodes that they constrain, at Δv: ∇E before projection and without
// friction, m (Δv - dt g) + dt Σ V0 P Fⁿᵀ g_i - dt Σ w f, shared out as in Boundary::reactions of
// src/engine/implicit/physics/boundary.rs; and the strength µ J of their friction
// (Boundary::drags).
// In: `push` and `press` at Δv. Out: `touches.impulse`, and sums for `weigh`. One workgroup a block and grid,
// one lane a node, which gathers in the order of the particles.
//
// uses implicit/cells, implicit/particle, implicit/shape, implicit/pressure, implicit/contact/pressed

@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let k = group_index(group, groups);
    let there = k < report.blocks * GRIDS;
    let at = k * 64u + lane;
    var press = vec3<f32>(0.0);
    if (there) {
        let kept = u32(begin[at].w);
        if (kept > 0u) {
            press = share_out(at, kept, given_to(k, at, lane));
        }
    }
    lane_presses[lane] = press;
    for (var half = LANES / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if (lane < half) {
            lane_presses[lane] += lane_presses[lane + half];
        }
    }
    if (there && lane == 0u) {
        presses[k] = vec4<f32>(lane_presses[0], 0.0);
    }
}

var<workgroup> lane_presses: array<vec3<f32>, LANES>;

/// ∇E of a node before projection and without friction.
fn given_to(k: u32, at: u32, lane: u32) -> vec3<f32> {
    let grid = k % GRIDS;
    let n = node_of(block_list[k / GRIDS], lane);
    var force = vec3<f32>(0.0);
    for (var r = 0u; r < RUNS; r++) {
        let from_ = run(n, grid, r);
        for (var p = from_.first; p < from_.end; p++) {
            force += push_of(p) * shape(offset_of(p), n - from_.corner, grid).g;
        }
    }
    if (params.links > 0u) {
        force -= params.dt * pressed(n, grid);
    }
    let row = row_of[at];
    var change = moving[at].xyz - node[at].xyz;
    if (row != NO_NODE) {
        change = vec3<f32>(dv[row], dv[params.stride + row], dv[2u * params.stride + row]);
    }
    return force + node[at].w * (change - params.dt * params.gravity);
}

/// Among the surfaces of a node; returns push and pull of a separating one that is alone, and the
/// strength of friction.
fn share_out(at: u32, kept: u32, given: vec3<f32>) -> vec3<f32> {
    var rest = given;
    var press = vec3<f32>(0.0);
    var rubbing = 3u;
    for (var t = 0u; t < kept; t++) {
        let touch = touches[3u * at + t];
        let normal = dot(rest, touch.normal.xyz);
        let part = select(normal * touch.normal.xyz, rest, touch.arm.w == HOLDING);
        rest -= part;
        let strength = select(0.0, max(touch.normal.w * normal, 0.0), row_of[at] != NO_NODE);
        touches[3u * at + t].impulse = vec4<f32>(part, strength);
        press.z += strength;
        if (touch.normal.w > 0.0) {
            rubbing = min(rubbing, t);
        }
    }
    if (kept == 1u) {
        let normal = pressure(touches[3u * at]);
        press.x = max(normal, 0.0);
        press.y = max(-normal, 0.0);
    }
    // What is left lies along the surfaces: friction's part.
    if (rubbing < 3u) {
        let taken = touches[3u * at + rubbing].impulse;
        touches[3u * at + rubbing].impulse = vec4<f32>(taken.xyz + rest, taken.w);
    }
    return press;
}
