// What surfaces leave of each node's freedom in this step. Twin:
// src/engine/implicit/physics/boundary.rs, which says why.
// In: nodes' masses and velocities. Out: `freedom`, `moving` (what Δv is added to), `begin` (where
// the solve starts; w: how many surfaces constrain the node), those surfaces in `touches`, and
// `row_of` = 1 for nodes that are solved for.
// One lane a dense node.
//
// uses implicit/nodes, shared/distance

const PARALLEL = 1e-6; // normals nearer to each other than this (sine) are one

struct Rule { velocity: vec3<f32>, kept: u32, held: bool, n: array<vec3<f32>, 3> }

fn keep(
    rule: ptr<function, Rule>,
    at: u32,
    surface: u32,
    contact: vec2<f32>,
    normal: vec3<f32>,
    velocity: vec3<f32>,
    arm: vec3<f32>,
    falling: vec3<f32>,
) {
    let of_surface = vec4<f32>(velocity, bitcast<f32>(surface));
    let kind = u32(contact.x);
    if (kind == STICKY) {
        // The last sticky surface has the last word.
        (*rule).velocity = velocity;
        (*rule).held = true;
        (*rule).kept = 1u;
        touches[3u * at] = Touch(vec4<f32>(normal, contact.y), of_surface, vec4<f32>(arm, HOLDING), vec4<f32>(0.0));
        return;
    }
    if ((*rule).held || (*rule).kept == 3u || (kind != SLIP && dot(falling - velocity, normal) >= 0.0)) {
        return;
    }
    var n = normal;
    for (var k = 0u; k < (*rule).kept; k++) {
        n -= dot(n, (*rule).n[k]) * (*rule).n[k];
    }
    let size = length(n);
    if (size < PARALLEL) {
        return;
    }
    n /= size;
    // v·n of the surface must hold for its own normal; what it asks along the new direction follows
    // from what is fixed already.
    (*rule).velocity += (dot(velocity - (*rule).velocity, normal) / size) * n;
    let holds = vec4<f32>(arm, select(SEPARATING, SLIPPERY, kind == SLIP));
    touches[3u * at + (*rule).kept] = Touch(vec4<f32>(n, contact.y), of_surface, holds, vec4<f32>(0.0));
    if (kind != SLIP) {
        atomicStore(&report.separating, 1u);
    }
    (*rule).n[(*rule).kept] = n;
    (*rule).kept += 1u;
}

fn meet_walls(rule: ptr<function, Rule>, at: u32, n: vec3<i32>, falling: vec3<f32>) {
    for (var a = 0u; a < 3u; a++) {
        // Of the compact kernel's pairs both nodes belong to the wall or neither
        // (src/core/sim/contact.rs says why).
        let upper = n[a] >= i32(params.cells[a]) && n[a] > 0;
        if (params.periodic[a] == 0u && (n[a] <= 0 || upper)) {
            let wall = 2u * a + select(0u, 1u, upper);
            let normal = vec3<f32>(vec3<u32>(0u, 1u, 2u) == vec3<u32>(a)) * select(1.0, -1.0, upper);
            keep(rule, at, wall, params.walls[wall].xy, normal, vec3<f32>(0.0), vec3<f32>(0.0), falling);
        }
    }
}

fn meet_colliders(rule: ptr<function, Rule>, at: u32, x: vec3<f32>, falling: vec3<f32>) {
    for (var c = 0u; c < params.colliders; c++) {
        let collider = colliders[c];
        let pose = poses[c];
        // What acts on particles leaves nodes alone.
        if (pose.linear.w == 0.0 || collider.touches != 0u) {
            continue;
        }
        let local = to_local(pose, x);
        if (distance_to(collider, local) > 0.0) {
            continue;
        }
        let arm = x - pose.center.xyz;
        let h = vec4<f32>(arm, 1.0);
        let velocity = vec3<f32>(dot(sweeps[c].r0, h), dot(sweeps[c].r1, h), dot(sweeps[c].r2, h));
        let contact = vec2<f32>(f32(collider.kind), collider.friction);
        let normal = surface_normal(collider, pose, local, NORMAL_STEP * params.dx);
        keep(rule, at, 6u + c, contact, normal, velocity, arm, falling);
    }
}

@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let at = item(group, groups, lane);
    if (at >= params.capacity * GRIDS * 64u) {
        return;
    }
    if (at >= report.blocks * GRIDS * 64u) {
        row_of[at] = 0u;
        return;
    }
    let mass = node[at].w;
    let falling = node[at].xyz + params.dt * params.gravity;
    var rule: Rule;
    rule.velocity = falling;
    var kind = vec4<f32>(0.0, 0.0, 0.0, NOWHERE);
    if (mass >= params.mass_floor) {
        let grid = (at / 64u) % GRIDS;
        let n = node_of(block_list[at / (64u * GRIDS)], at % 64u) - params.pad;
        meet_walls(&rule, at, n, falling);
        meet_colliders(&rule, at, params.dx * (vec3<f32>(n) + node_offset(grid)), falling);
        if (rule.held || rule.kept == 3u) {
            kind.w = PRESCRIBED;
        } else if (rule.kept == 2u) {
            kind = vec4<f32>(cross(rule.n[0], rule.n[1]), LINE);
        } else if (rule.kept == 1u) {
            kind = vec4<f32>(rule.n[0], PLANE);
        } else {
            kind.w = FREE;
        }
    }
    let solved = kind.w < PRESCRIBED;
    freedom[at] = kind;
    begin[at] = vec4<f32>(rule.velocity, f32(rule.kept));
    moving[at] = vec4<f32>(select(rule.velocity, node[at].xyz, solved), 0.0);
    row_of[at] = select(0u, 1u, solved);
}
