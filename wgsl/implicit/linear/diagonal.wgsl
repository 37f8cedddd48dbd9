// Inverses of the diagonal blocks, D⁻¹ = Σ v vᵀ / λ from the eigenvectors. A coarse node that is
// reached through sliding nodes only has a singular block: its missing directions get the block's
// largest eigenvalue, in the matrix too, which leaves them alone.
// The row of a node that few particles see is taken relative to the neighbour it is coupled to most:
// its own block is smaller than those beside it, and would drown in their rounding.
// Out: inverse[k * stride + row], k = xx, xy, xz, yy, yz, zz. A thread a row.
//
// uses implicit/linear/level, implicit/linear/stencil_*

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read_write> values: array<f32>;
@group(0) @binding(2) var<storage, read_write> inverse: array<f32>;
@group(0) @binding(3) var<storage, read_write> anchors: array<f32>;
@group(0) @binding(4) var<storage, read> columns: array<u32>;

// Relative to the largest eigenvalue: above the roundings of a product with S, below every ratio
// that f32 can make use of.
const SINGULAR = 2e-6;

fn size2(at: u32) -> f32 {
    var sum = 0.0;
    for (var k = 0u; k < 9u; k++) {
        sum += values[at + k * level.stride] * values[at + k * level.stride];
    }
    return sum;
}

// Jacobi rotation of a symmetric matrix in the plane (p, q), gathered into v.
fn rotate(m: ptr<function, array<vec3<f32>, 3>>, v: ptr<function, array<vec3<f32>, 3>>, p: u32, q: u32) {
    let apq = (*m)[p][q];
    if (apq == 0.0) {
        return;
    }
    let theta = ((*m)[q][q] - (*m)[p][p]) / (2.0 * apq);
    // Past 1e9 the rotation is nothing in f32, and θ² would overflow further on.
    let size = min(abs(theta), 1e9);
    let t = select(-1.0, 1.0, theta >= 0.0) / (size + sqrt(size * size + 1.0));
    let c = 1.0 / sqrt(t * t + 1.0);
    let s = t * c;
    for (var k = 0u; k < 3u; k++) {
        let x = (*m)[k][p];
        let y = (*m)[k][q];
        (*m)[k][p] = c * x - s * y;
        (*m)[k][q] = s * x + c * y;
    }
    let rp = (*m)[p];
    let rq = (*m)[q];
    (*m)[p] = c * rp - s * rq;
    (*m)[q] = s * rp + c * rq;
    let vp = (*v)[p];
    let vq = (*v)[q];
    (*v)[p] = c * vp - s * vq;
    (*v)[q] = s * vp + c * vq;
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) thread: vec3<u32>) {
    let row = thread.x;
    if (row >= level.rows) {
        return;
    }
    let at = 9u * CENTRE * level.stride + row;
    var m: array<vec3<f32>, 3>;
    for (var r = 0u; r < 3u; r++) {
        for (var c = 0u; c < 3u; c++) {
            m[r][c] = 0.5 * (values[at + (3u * r + c) * level.stride] + values[at + (3u * c + r) * level.stride]);
        }
    }
    var v = array<vec3<f32>, 3>(vec3<f32>(1.0, 0.0, 0.0), vec3<f32>(0.0, 1.0, 0.0), vec3<f32>(0.0, 0.0, 1.0));
    for (var sweep = 0u; sweep < 5u; sweep++) {
        rotate(&m, &v, 0u, 1u);
        rotate(&m, &v, 0u, 2u);
        rotate(&m, &v, 1u, 2u);
    }
    let largest = max(m[0][0], max(m[1][1], m[2][2]));
    var d: array<f32, 6>;
    for (var k = 0u; k < 3u; k++) {
        var eigenvalue = m[k][k];
        if (eigenvalue < SINGULAR * largest) {
            for (var r = 0u; r < 3u; r++) {
                for (var c = 0u; c < 3u; c++) {
                    let missing = (largest - eigenvalue) * v[k][r] * v[k][c];
                    values[at + (3u * r + c) * level.stride] += missing;
                    anchors[row + (3u * r + c) * level.stride] += missing;
                }
            }
            eigenvalue = largest;
        }
        let w = v[k] / eigenvalue;
        d[0] += w.x * v[k].x;
        d[1] += w.x * v[k].y;
        d[2] += w.x * v[k].z;
        d[3] += w.y * v[k].y;
        d[4] += w.y * v[k].z;
        d[5] += w.z * v[k].z;
    }
    for (var k = 0u; k < 6u; k++) {
        inverse[k * level.stride + row] = d[k];
    }
    var widest = size2(at);
    var follows = row;
    for (var slot = 0u; slot < SLOTS; slot++) {
        let size = size2(9u * slot * level.stride + row);
        if (size > widest) {
            widest = size;
            follows = columns[slot * level.stride + row];
        }
    }
    anchors[9u * level.stride + row] = f32(follows);
}
