// How full the room around a particle is: Σ w V_i of what is there over Σ w V_i of what may be
// there, and how the volume of fluids and loose grains follows it. Twins:
// src/engine/explicit/cpu/fill.rs, src/core/sim/volume.rs.
//
// uses explicit/tile, explicit/share, explicit/room, shared/state

/// What the particle's ∇v adds to its body's rate, as a share of itself.
const STIRRED: f32 = 0.3;
/// Fill, over that which counts as full, up to which it is noise and no crowd.
const NOISE: f32 = 1.1;
/// Fill, over that which counts as full, beyond which crowds dissolve no faster.
const DENSEST: f32 = 2.0;
/// Fill, over that which counts as full, beyond which more does not count.
const FULLEST: f32 = 1.25;
/// Excess over full at which grains are corrected in full; below, in proportion.
const GRADUAL: f32 = 0.02;

/// The fill of a particle in the block whose corner is at `corner` (cells).
fn fill_around(corner: vec3<f32>, y: vec3<f32>) -> f32 {
    let s = stencil(y);
    let x = corner + y + SHIFT;
    // Beyond, nodes of the particle have all their room.
    let close = (x < vec3<f32>(ROOM_REACH)) | (x > params.cells - ROOM_REACH);
    let near = any(close & (params.periodic == vec3<u32>(0u)));
    var filled = 0.0;
    var room = 0.0;
    for (var grid = 0u; grid < GRIDS; grid++) {
        var free = s.w[grid];
        if (near) {
            for (var i = 0u; i < NODES; i++) {
                let node = corner + vec3<f32>(s.base[grid] + vec3<i32>(i32(i))) + node_offset(grid);
                free[i] *= inside_walls(node);
            }
        }
        for (var k = 0u; k < NODES; k++) {
            for (var j = 0u; j < NODES; j++) {
                for (var i = 0u; i < NODES; i++) {
                    let n = s.base[grid] + vec3<i32>(vec3<u32>(i, j, k));
                    let node = unpacked(fill_tile[read_place(grid, n)]);
                    filled += s.w[grid][i].x * s.w[grid][j].y * s.w[grid][k].z * node.filled;
                    room += free[i].x * free[j].y * free[k].z * node.room;
                }
            }
        }
    }
    // A particle behind a surface counts as one on it: half of its room on every axis.
    return GRID_SHARE * filled / max(GRID_SHARE * room, 0.125);
}

/// The state a little towards that of which the fill tells: J of a fluid, the volumetric strain of
/// grains with what they have gained apart. `growth`: dt ∇v.
fn relaxed(state: Deformation, model: u32, body: Body, dt: f32, growth: mat3x3<f32>, fill: f32) -> Deformation {
    var next = state;
    let over = max(fill / body.full, 1.0);
    let crowd = 5.0 * max(min(over, DENSEST) - NOISE, 0.0);
    let rate = body.rate + body.crowded * crowd * crowd;
    let share = min(rate * dt + STIRRED * sqrt(norm2(growth)), 1.0);
    let goal = 1.0 / min(over, FULLEST);
    if (model == FLUID) {
        next.J += share * (goal - state.J);
    } else if (over > 1.0) {
        let volume = determinant(state.F) * exp(state.q);
        if (volume > goal) {
            let weight = min((over - 1.0) / GRADUAL, 1.0);
            next.F = state.F * pow(1.0 + weight * share * (goal / volume - 1.0), 1.0 / 3.0);
        }
    }
    return next;
}

/// Cells that a particle fills in the sums of rest volumes, if there are any. What a solid has lost of its volume is
/// room for others.
fn filled_cells(state: Deformation, model: u32, body: Body) -> f32 {
    if (params.fills != FILLS_VOLUME) {
        return 0.0;
    }
    var kept = 1.0;
    if (model != FLUID && body.full == 0.0) {
        kept = clamp(determinant(state.F), 0.0, 1.0);
    }
    return kept * body.volume / (params.dx * params.dx * params.dx);
}
