// What faces add to the Hessian's rows, H_ij += dt² share Σ w_i w_j K, and to their sums
// (implicit/assemble has the rest).
// One workgroup a row; each lane owns one neighbour and adds up over chunks of particles and faces,
// whose stencils one lane each has put in workgroup memory.
//
// uses implicit/cells, implicit/particle, implicit/freedom, implicit/neighbour, implicit/contact/links

const WIDE = 128u;
const CHUNK = 32u;

var<workgroup> stencils: array<Stencil, CHUNK>;
var<workgroup> weights: array<f32, CHUNK>;       // of the row's node
var<workgroup> chunk: array<u32, CHUNK>;         // links
var<workgroup> corners: array<vec3<i32>, CHUNK>; // of the particle's block, relative to the row's node
var<workgroup> run_first: array<u32, RUNS>;
var<workgroup> run_sum: array<u32, RUNS>;        // links of the runs up to this one
var<workgroup> run_corner: array<vec3<i32>, RUNS>;
var<workgroup> row_parts: array<mat3x3<f32>, WIDE>;

/// Weight of the node at `k` from the first of a grid; zero if the particle does not touch it.
fn weight(t: u32, grid: u32, k: vec3<i32>) -> f32 {
    if (any(k < vec3<i32>(0)) || any(k >= vec3<i32>(i32(NODES)))) {
        return 0.0;
    }
    return stencils[t].w[grid][k.x].x * stencils[t].w[grid][k.y].y * stencils[t].w[grid][k.z].z;
}

@compute @workgroup_size(WIDE)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let row = group_index(group, groups);
    if (row >= params.rows) {
        return;
    }
    let id = ids[row];
    let grid = u32(id.w);
    let n = id.xyz + params.pad;
    if (lane < RUNS) {
        let r = run(n, grid, lane);
        run_first[lane] = link_starts[r.first];
        run_sum[lane] = link_starts[r.end] - link_starts[r.first];
        run_corner[lane] = r.corner - n;
    }
    workgroupBarrier();
    if (lane == 0u) {
        for (var r = 1u; r < RUNS; r++) {
            run_sum[r] += run_sum[r - 1u];
        }
    }
    // A load that every lane is known to agree on: `total` bounds a loop with barriers.
    let total = workgroupUniformLoad(&run_sum[RUNS - 1u]);
    if (total == 0u) {
        return;
    }
    let other = neighbour(grid, lane);
    let other_grid = u32(other.w);
    var block: mat3x3<f32>; // block[c][a]
    for (var first = 0u; first < total; first += CHUNK) {
        if (lane < CHUNK && first + lane < total) {
            let k = first + lane;
            var r = 0u;
            while (run_sum[r] <= k) {
                r++;
            }
            var before = 0u;
            if (r > 0u) {
                before = run_sum[r - 1u];
            }
            chunk[lane] = run_first[r] + k - before;
            stencils[lane] = stencil(offset_of(links[chunk[lane]].particle));
            corners[lane] = run_corner[r];
            weights[lane] = weight(lane, grid, -run_corner[r] - stencils[lane].base[grid]);
        }
        workgroupBarrier();
        if (lane < SLOTS) {
            for (var t = 0u; t < min(CHUNK, total - first); t++) {
                let w = weights[t] * weight(t, other_grid, other.xyz - corners[t] - stencils[t].base[other_grid]);
                if (w != 0.0) {
                    block += w * stiffness_of(chunk[t]);
                }
            }
        }
        workgroupBarrier();
    }
    var column = NO_NODE;
    if (lane < SLOTS) {
        column = columns[lane * params.stride + row];
    }
    var part: mat3x3<f32>;
    if (column != NO_NODE) {
        block *= GRID_SHARE * params.dt * params.dt;
        let S = projection(freedoms[row]);
        part = S * block * projection(freedoms[column]);
        if (column == row) {
            let mean = (block[0].x + block[1].y + block[2].z) / 3.0;
            part += mean * (mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0) - S);
        }
        for (var a = 0u; a < 3u; a++) {
            for (var c = 0u; c < 3u; c++) {
                values[(lane * 9u + 3u * a + c) * params.stride + row] += part[c][a];
            }
        }
    }
    row_parts[lane] = part;
    for (var half = WIDE / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if (lane < half) {
            row_parts[lane] += row_parts[lane + half];
        }
    }
    if (lane == 0u) {
        for (var a = 0u; a < 3u; a++) {
            for (var c = 0u; c < 3u; c++) {
                anchors[(3u * a + c) * params.stride + row] += row_parts[0][c][a];
            }
        }
    }
}
