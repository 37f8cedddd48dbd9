// The Hessian's rows: A_ij[a][c] = m_i δ + Σ_p K_p[3a + e][3c + f] g_i[e] g_j[f] (HOT §4.2),
// gathered.
// One workgroup a row. Its lanes first contract K with g_i for a chunk of particles, one particle a
// lane; then each lane, which owns one neighbour, adds up Σ_p (K g_i) g_j over the chunk. Then S_i
// A S_j, and trace/3 · (I - S) and friction on the diagonal.
// The sum of a row is not added up from blocks of stiffness, which cancel. All g_j of a particle add
// up to 0, so Σ_j A_ij over all nodes is what is no stiffness. Without the nodes that are not in the
// system, and with S, it is S_i ((m + friction) S_i - Σ_outside A_ij S_i + Σ_j≠i A_ij (S_j - S_i)).
//
// uses implicit/cells, implicit/particle, implicit/freedom, implicit/friction, implicit/neighbour
// uses implicit/upper, shared/mls

const WIDE = 128u;
const CHUNK = 32u;

var<workgroup> contracted: array<array<f32, 27>, CHUNK>;
var<workgroup> stencils: array<Stencil, CHUNK>;
var<workgroup> corners: array<vec3<i32>, CHUNK>; // of the particle's block, relative to the row's node
var<workgroup> run_first: array<u32, RUNS>;
var<workgroup> run_sum: array<u32, RUNS>;        // particles of the runs up to this one
var<workgroup> run_corner: array<vec3<i32>, RUNS>;
var<workgroup> row_parts: array<mat3x3<f32>, WIDE>;

fn g_of(t: u32, grid: u32, k: vec3<u32>) -> vec3<f32> {
    let w = vec3<f32>(stencils[t].w[grid][k.x].x, stencils[t].w[grid][k.y].y, stencils[t].w[grid][k.z].z);
    if (MLS) {
        return (w.x * w.y * w.z) * (stencils[t].d[grid] + vec3<f32>(k));
    }
    return vec3<f32>(stencils[t].dw[grid][k.x].x, stencils[t].dw[grid][k.y].y, stencils[t].dw[grid][k.z].z)
        * vec3<f32>(w.y * w.z, w.x * w.z, w.x * w.y);
}

fn contract(t: u32, p: u32, g: vec3<f32>) {
    for (var a = 0u; a < 3u; a++) {
        for (var j = 0u; j < 9u; j++) {
            var sum = 0.0;
            for (var e = 0u; e < 3u; e++) {
                sum += tensor[upper(3u * a + e, j) * params.room + p] * g[e];
            }
            contracted[t][9u * a + j] = sum;
        }
    }
}

@compute @workgroup_size(WIDE)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let row = min(group_index(group, groups), params.rows - 1u);
    let id = ids[row];
    let grid = u32(id.w);
    let n = id.xyz + params.pad;
    if (lane < RUNS) {
        let r = run(n, grid, lane);
        run_first[lane] = r.first;
        run_sum[lane] = r.end - r.first;
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
            let p = run_first[r] + k - before;
            let y = offset_of(p);
            stencils[lane] = stencil(y);
            if (MLS) {
                // Distances from each grid's mean: all that g needs of them.
                for (var s = 0u; s < GRIDS; s++) {
                    stencils[lane].d[s] -= arms_mean(y, s);
                }
            }
            corners[lane] = run_corner[r];
            contract(lane, p, g_of(lane, grid, vec3<u32>(-run_corner[r] - stencils[lane].base[grid])));
        }
        workgroupBarrier();
        if (lane < SLOTS) {
            for (var t = 0u; t < min(CHUNK, total - first); t++) {
                let k = other.xyz - corners[t] - stencils[t].base[other_grid];
                if (any(k < vec3<i32>(0)) || any(k >= vec3<i32>(i32(NODES)))) {
                    continue;
                }
                let g = g_of(t, other_grid, vec3<u32>(k));
                for (var a = 0u; a < 3u; a++) {
                    for (var c = 0u; c < 3u; c++) {
                        let m = 9u * a + 3u * c;
                        block[c][a] +=
                            contracted[t][m] * g.x + contracted[t][m + 1u] * g.y + contracted[t][m + 2u] * g.z;
                    }
                }
            }
        }
        workgroupBarrier();
    }
    let S = projection(freedoms[row]);
    var part: mat3x3<f32>;
    var missing: mat3x3<f32>; // what the row's own block is completed by
    if (lane < SLOTS) {
        let column = columns[lane * params.stride + row];
        if (column == NO_NODE) {
            part = -1.0 * (S * block * S);
            block = mat3x3<f32>();
        } else if (column == row) {
            let identity = mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
            let m = masses[row];
            block += m * identity;
            let mean = (block[0].x + block[1].y + block[2].z) / 3.0;
            missing = mean * (identity - S);
            var drag: mat3x3<f32>;
            let at = dense_node(n, grid);
            let v = node[at].xyz + vec3<f32>(trial[row], trial[params.stride + row], trial[2u * params.stride + row]);
            let kept = u32(begin[at].w);
            for (var t = 0u; t < kept; t++) {
                let touch = touches[3u * at + t];
                if (touch.impulse.w > 0.0) {
                    drag += S * drag_hessian(touch, v) * S;
                }
            }
            block = S * block * S + missing + drag;
            part = m * S + drag;
        } else {
            let other_S = projection(freedoms[column]);
            part = S * block * (other_S - S);
            block = S * block * other_S;
        }
        for (var a = 0u; a < 3u; a++) {
            for (var c = 0u; c < 3u; c++) {
                values[(lane * 9u + 3u * a + c) * params.stride + row] = block[c][a];
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
    workgroupBarrier();
    if (lane < SLOTS && columns[lane * params.stride + row] == row) {
        let anchor = row_parts[0] + missing;
        for (var a = 0u; a < 3u; a++) {
            for (var c = 0u; c < 3u; c++) {
                anchors[(3u * a + c) * params.stride + row] = anchor[c][a];
            }
        }
    }
}
