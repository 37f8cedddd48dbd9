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

/// A column of F V, and of V.
struct Column { b: vec3<f32>, v: vec3<f32> }

/// The longer one first; a swap negates one of the two, so that det V stays 1.
fn order(a: ptr<function, Column>, b: ptr<function, Column>) {
    if (dot((*a).b, (*a).b) < dot((*b).b, (*b).b)) {
        let longer = *b;
        *b = Column(vec3<f32>(0.0) - (*a).b, vec3<f32>(0.0) - (*a).v);
        *a = longer;
    }
}

/// F = U Σ Vᵀ, det U = det V = 1, |σ| falling, the sign of det F on the last.
fn svd3(f: mat3x3<f32>) -> Svd {
    // Squares of the entries must neither vanish nor overflow.
    let largest = max(max_entry(f[0]), max(max_entry(f[1]), max_entry(f[2])));
    if (!(largest > 0.0 && largest < 1e38)) {
        let identity = mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
        return Svd(identity, vec3<f32>(largest), identity);
    }
    let scaled = f * (1.0 / largest);
    var first = Column(scaled[0], vec3<f32>(1.0, 0.0, 0.0));
    var second = Column(scaled[1], vec3<f32>(0.0, 1.0, 0.0));
    var third = Column(scaled[2], vec3<f32>(0.0, 0.0, 1.0));
    // Each pair in turn, until all three were at right angles, to rounding.
    var right = 0u;
    for (var i = 0u; i < 18u && right < 3u; i++) {
        let alpha = dot(first.b, first.b);
        let beta = dot(second.b, second.b);
        let gamma = dot(first.b, second.b);
        right++;
        if (abs(gamma) > 6e-8 * sqrt(alpha * beta)) {
            right = 0u;
            let zeta = (beta - alpha) / (2.0 * gamma);
            let t = select(-1.0, 1.0, zeta >= 0.0) / (abs(zeta) + sqrt(1.0 + zeta * zeta));
            let c = inverseSqrt(1.0 + t * t);
            let s = c * t;
            let turned = Column(c * first.b - s * second.b, c * first.v - s * second.v);
            second = Column(s * first.b + c * second.b, s * first.v + c * second.v);
            first = turned;
        }
        let last = first;
        first = second;
        second = third;
        third = last;
    }
    order(&first, &second);
    order(&second, &third);
    order(&first, &second);
    var out: Svd;
    out.v = mat3x3<f32>(first.v, second.v, third.v);
    let s0 = length(first.b);
    out.u[0] = select(vec3<f32>(1.0, 0.0, 0.0), first.b / s0, s0 > 1e-30);
    // Directions of vanishing columns are free: take any that make U a rotation.
    let r1 = second.b - out.u[0] * dot(out.u[0], second.b);
    let s1 = length(r1);
    let axis = select(vec3<f32>(0.0, 1.0, 0.0), vec3<f32>(0.0, 0.0, 1.0), abs(out.u[0].y) > 0.7);
    let free = normalize(axis - out.u[0] * dot(out.u[0], axis));
    out.u[1] = select(free, r1 / s1, s1 > 1e-12 * s0 && s1 > 1e-30);
    out.u[2] = cross(out.u[0], out.u[1]);
    out.sigma = largest * vec3<f32>(s0, dot(out.u[1], second.b), dot(out.u[2], third.b));
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
