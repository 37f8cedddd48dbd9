// The particles at the step's end (CK-MPM eqs. 20–25): v = share Σ w v_i, B = share Σ w v_i dᵀ, F ←
// (I + dt ∇v) F and back to the yield surface (HOT §4.1:
// plasticity is lagged), x ← x + dt v. Out: the unsorted buffers, so that the sorted ones still
// hold the step's start.
// One workgroup a block, one lane a particle at a time.
//
// uses implicit/cells, implicit/particle, implicit/plastic, implicit/tile, implicit/put
// uses implicit/contact/memory

@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let slot = group_index(group, groups);
    let there = slot < report.blocks;
    if (there) {
        for (var t = lane; t < TILE * GRIDS; t += LANES) {
            let at = dense_node(tile_node(block_list[slot], t % TILE), t / TILE);
            var v = vec3<f32>(0.0);
            if (at != NO_NODE) {
                v = moving[at].xyz;
            }
            tile[t] = array<f32, 3>(v.x, v.y, v.z);
        }
    }
    workgroupBarrier();
    if (!there) {
        return;
    }
    for (var p = starts[slot * IN_BLOCK] + lane; p < starts[(slot + 1u) * IN_BLOCK]; p += LANES) {
        advance(slot, p);
    }
}

fn advance(slot: u32, p: u32) {
    let y = offset_of(p);
    let id = tag[p].x;
    let model = materials[bodies[tag[p].y].material].model;
    var s = stencil(y);
    let first = tile_at(s.base[0], 0u);
    // Sums of differences: Σ w = 1 holds only to rounding, which would otherwise be a steady gain
    // or loss of momentum.
    var v = vec3<f32>(0.0);
    var B: mat3x3<f32>;
    var apart = vec3<f32>(0.0);
    for (var grid = 0u; grid < GRIDS; grid++) {
        var sum = vec3<f32>(0.0);
        for (var k = 0u; k < NODES; k++) {
            for (var j = 0u; j < NODES; j++) {
                for (var i = 0u; i < NODES; i++) {
                    let n = vec3<u32>(i, j, k);
                    let w = GRID_SHARE * s.w[grid][i].x * s.w[grid][j].y * s.w[grid][k].z;
                    let d = s.d[grid] + vec3<f32>(n);
                    let wv = w * (tile_at(s.base[grid] + vec3<i32>(n), grid) - first);
                    sum += wv;
                    B += mat3x3<f32>(wv * d.x, wv * d.y, wv * d.z);
                }
            }
        }
        v += sum;
        apart += select(sum, -sum, grid == 1u);
    }
    v += first;
    let rate = params.dt / params.dx;
    var deformation: Deformation;
    deformation.F = deformation_of(p);
    deformation.q = plastic_of(p, model);
    var principal: Principal;
    var gradient: mat3x3<f32>;
    if (MLS) {
        gradient = mls_gradient(B, apart, y);
    } else {
        gradient = tile_gradient(y);
    }
    let next = deform(deformation, materials[bodies[tag[p].y].material], rate * gradient, &principal);
    let shift = rate * v;
    let farthest = length(shift);
    // Written so that NaN fails the test: on Vulkan x != x is not reliable.
    if (!(farthest + norm2(next.F) < 1e30)) {
        fail(ERROR_NAN, id);
        return;
    }
    atomicMax(&report.max_shift, bitcast<u32>(farthest));
    atomicMax(&report.max_speed, bitcast<u32>(length(v)));
    if (!put(p, id, y + shift)) {
        return;
    }
    tag_in[p] = tag[p];
    for (var r = 0u; r < 3u; r++) {
        state_in[r * params.room + p] = v[r];
        for (var c = 0u; c < 3u; c++) {
            state_in[(3u + 3u * c + r) * params.room + p] = B[c][r];
            state_in[(12u + 3u * c + r) * params.room + p] = next.F[c][r];
        }
    }
    if (has_plastic_state(model)) {
        state_in[21u * params.room + p] = next.q;
    }
    // Those near faces are settled afterwards.
    if (params.touch != 0u) {
        remember(p, untouched(bodies[tag[p].y]));
    }
}
