// What one particle does between gather and scatter: its volume follows the fill, x ← x + dt v,
// F ← (I + dt ∇v) F, with the guards of the step.
//
// uses explicit/gather_*, explicit/fill, explicit/move, explicit/flags

struct Advanced {
    ok: bool,
    shift: vec3<i32>,  // block to the new block: -1, 0 or 1 per axis
    y: vec3<f32>,      // offset in the old block, in [-1, 5): what the scatter tile is addressed by
    local: vec3<f32>,  // offset in the new block, in [0, 4)
    state: Deformation,
}

/// `to`: where it goes, as an offset in the old block.
fn advance(corner: vec3<f32>, to: vec3<f32>, g: Gathered, before: Deformation, body: Body, material: Material, id: u32,
    dt: f32, principal: ptr<function, Principal>, flags: ptr<function, Flags>) -> Advanced {
    var out: Advanced;
    let growth = g.gradient * (dt / params.dx);
    var state = before;
    if (FILLS != FILLS_NOTHING && body.full > 0.0) {
        state = relaxed(before, material.model, body, dt, growth, fill_of(g.fill));
    }
    let move_cells = g.v * (dt / params.dx);
    let farthest = max_entry(move_cells);
    out.state = deform(state, material, growth, principal);
    let size = select(norm2(out.state.F), abs(out.state.J), material.model == FLUID);
    // Written so that NaN fails the test: on Vulkan x != x is not reliable.
    if (!(farthest + size < 1e30)) {
        note(flags, ERROR_NAN, id);
        return out;
    }
    if (farthest >= 1.0) {
        note(flags, ERROR_CFL, id);
        return out;
    }
    (*flags).farthest = max((*flags).farthest, farthest);
    let entries = max(max_entry(growth[0]), max(max_entry(growth[1]), max_entry(growth[2])));
    (*flags).replan = (*flags).replan || farthest > params.soft_shift || entries > params.soft_growth;
    out.y = to;
    let x = corner + out.y;
    if (any((x < params.outer_low) | (x > params.outer_high))) {
        note(flags, ERROR_DOMAIN, id);
    }
    out.shift = vec3<i32>(floor(out.y * 0.25));
    // Just below a block's edge the offset can round up to 4.
    out.local = min(out.y - 4.0 * vec3<f32>(out.shift), vec3<f32>(3.9999998));
    out.ok = true;
    return out;
}
