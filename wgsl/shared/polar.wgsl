// Rotation of the polar decomposition F = R S with det R = +1 (the smallest singular value carries
// the sign of det F).
// Twin: src/core/maths. Well-conditioned F: scaled Newton iteration R ← ½ (γ R + R⁻ᵀ/γ) (Higham
// 1986); else a one-sided Jacobi SVD.

fn cofactor(m: mat3x3<f32>) -> mat3x3<f32> {
    return mat3x3<f32>(cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1]));
}

fn norm2(m: mat3x3<f32>) -> f32 {
    return dot(m[0], m[0]) + dot(m[1], m[1]) + dot(m[2], m[2]);
}

fn max_entry(v: vec3<f32>) -> f32 {
    let a = abs(v);
    return max(a.x, max(a.y, a.z));
}

struct Svd { u: mat3x3<f32>, sigma: vec3<f32>, v: mat3x3<f32> }

/// F = U Σ Vᵀ, det U = det V = 1, |σ| falling, the sign of det F on the last.
fn svd3(f: mat3x3<f32>) -> Svd {
    // Squares of the entries must neither vanish nor overflow.
    let largest = max(max_entry(f[0]), max(max_entry(f[1]), max_entry(f[2])));
    if (!(largest > 0.0 && largest < 1e38)) {
        let identity = mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
        return Svd(identity, vec3<f32>(largest), identity);
    }
    var b = f * (1.0 / largest);
    var v = mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    for (var sweep = 0u; sweep < 6u; sweep++) {
        for (var k = 0u; k < 3u; k++) {
            let p = select(0u, 1u, k == 2u);
            let q = select(2u, 1u, k == 0u);
            let alpha = dot(b[p], b[p]);
            let beta = dot(b[q], b[q]);
            let gamma = dot(b[p], b[q]);
            if (abs(gamma) <= 1e-8 * sqrt(alpha * beta)) {
                continue;
            }
            let zeta = (beta - alpha) / (2.0 * gamma);
            let t = select(-1.0, 1.0, zeta >= 0.0) / (abs(zeta) + sqrt(1.0 + zeta * zeta));
            let c = inverseSqrt(1.0 + t * t);
            let s = c * t;
            let bp = b[p];
            let bq = b[q];
            b[p] = c * bp - s * bq;
            b[q] = s * bp + c * bq;
            let vp = v[p];
            let vq = v[q];
            v[p] = c * vp - s * vq;
            v[q] = s * vp + c * vq;
        }
    }
    // Sort the columns by length; each swap negates one of the pair, so that det V stays 1.
    for (var k = 0u; k < 3u; k++) {
        let p = select(0u, 1u, k == 1u);
        let q = p + 1u;
        if (dot(b[p], b[p]) < dot(b[q], b[q])) {
            let bp = b[p];
            b[p] = b[q];
            b[q] = -bp;
            let vp = v[p];
            v[p] = v[q];
            v[q] = -vp;
        }
    }
    var out: Svd;
    out.v = v;
    let s0 = length(b[0]);
    out.u[0] = select(vec3<f32>(1.0, 0.0, 0.0), b[0] / s0, s0 > 1e-30);
    // Directions of vanishing columns are free: take any that make U a rotation.
    let r1 = b[1] - out.u[0] * dot(out.u[0], b[1]);
    let s1 = length(r1);
    let axis = select(vec3<f32>(0.0, 1.0, 0.0), vec3<f32>(0.0, 0.0, 1.0), abs(out.u[0].y) > 0.7);
    let free = normalize(axis - out.u[0] * dot(out.u[0], axis));
    out.u[1] = select(free, r1 / s1, s1 > 1e-12 * s0 && s1 > 1e-30);
    out.u[2] = cross(out.u[0], out.u[1]);
    out.sigma = largest * vec3<f32>(s0, dot(out.u[1], b[1]), dot(out.u[2], b[2]));
    return out;
}

fn polar_rotation(f: mat3x3<f32>) -> mat3x3<f32> {
    let size2 = norm2(f);
    let det = dot(f[0], cross(f[1], f[2]));
    // det ≥ 1e-3 (‖F‖/√3)³ bounds the condition number; Newton then converges in a handful of
    // iterations.
    if (!(det > 1e-3 * size2 * sqrt(size2) * 0.19245)) {
        let s = svd3(f);
        return s.u * transpose(s.v);
    }
    var r = f;
    for (var i = 0u; i < 12u; i++) {
        let c = cofactor(r);
        let inv_det = 1.0 / dot(r[0], c[0]);
        let inverse_transpose = c * inv_det;
        let gamma = sqrt(sqrt(norm2(inverse_transpose) / norm2(r)));
        let next = r * (0.5 * gamma) + inverse_transpose * (0.5 / gamma);
        let change = norm2(next - r);
        r = next;
        if (change < 1e-12) {
            break;
        }
    }
    return r;
}
