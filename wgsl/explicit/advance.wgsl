// What one particle does between gather and scatter: its volume follows the fill, x ← x + dt v,
// F ← (I + dt ∇v) F, with the guards of the step.
//
// uses explicit/transfer, explicit/fill, explicit/move

struct Advanced {
    ok: bool,
    shift: vec3<i32>,  // block to the new block: -1, 0 or 1 per axis
    y: vec3<f32>,      // offset in the old block, in [-1, 5): what the scatter tile is addressed by
    local: vec3<f32>,  // offset in the new block, in [0, 4)
    state: Deformation,
}

/// `to`: where it goes, as an offset in the old block.
fn advance(corner: vec3<f32>, y: vec3<f32>, to: vec3<f32>, g: Gathered, before: Deformation, body: Body, id: u32,
    dt: f32, principal: ptr<function, Principal>) -> Advanced {
    var out: Advanced;
    let material = materials[body.material];
    let growth = g.gradient * (dt / params.dx);
    var state = before;
    if (body.full > 0.0) {
        state = relaxed(before, material.model, body, dt, growth, fill_around(corner, y));
    }
    let move_cells = g.v * (dt / params.dx);
    let farthest = max(max(abs(move_cells.x), abs(move_cells.y)), abs(move_cells.z));
    out.state = deform(state, material, growth, principal);
    let size = select(norm2(out.state.F), abs(out.state.J), material.model == FLUID);
    // Written so that NaN fails the test: on Vulkan x != x is not reliable.
    if (!(farthest + size < 1e30)) {
        fail(ERROR_NAN, id);
        return out;
    }
    if (farthest >= 1.0) {
        fail(ERROR_CFL, id);
        return out;
    }
    atomicMax(&report.max_shift, bitcast<u32>(farthest));
    let entries = max(abs(growth[0]), max(abs(growth[1]), abs(growth[2])));
    if (farthest > params.soft_shift || max(entries.x, max(entries.y, entries.z)) > params.soft_growth) {
        atomicOr(&report.halt, HALT_REPLAN);
    }
    out.y = to;
    let x = corner + out.y + SHIFT;
    let outside = (x < vec3<f32>(-1.0)) | (x > params.cells + 1.0);
    if (any(outside & (params.periodic == vec3<u32>(0u)))) {
        fail(ERROR_DOMAIN, id);
    }
    out.shift = vec3<i32>(floor(out.y * 0.25));
    // Just below a block's edge the offset can round up to 4.
    out.local = min(out.y - 4.0 * vec3<f32>(out.shift), vec3<f32>(3.9999998));
    out.ok = true;
    return out;
}
