// λ = 1.1 × the largest Ritz value of D⁻¹A, and the coefficients of the Chebyshev polynomial over
// [λ / range, λ] (Saad, "Iterative methods for sparse linear systems", alg. 12.1). The Lanczos
// matrix has 1/α_k + β_k/α_{k−1} on its diagonal and √β_{k+1} / α_k beside it; its largest
// eigenvalue is bisected with Sturm's sequence. One thread.
//
// uses implicit/linear/level, implicit/linear/lanczos

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> lanczos: Lanczos;
// A slot of 16 for the coefficients (c₁, c₂, λ, 0) of every step.
@group(0) @binding(2) var<storage, read_write> coefficients: array<vec4<f32>>;
// 1, or more after a V-cycle that was not positive.
@group(0) @binding(3) var<storage, read> stretch: f32;

const MARGIN = 1.1;

@compute @workgroup_size(1)
fn main() {
    var diagonal: array<f32, 16>;
    var beside: array<f32, 16>;
    var size = 0u;
    var high = 0.0;
    for (var k = 0u; k < lanczos.count; k++) {
        let alpha = lanczos.alpha[k];
        // A Krylov space that is exhausted ends early.
        if (!(alpha > 0.0)) {
            break;
        }
        diagonal[k] = 1.0 / alpha;
        if (k > 0u) {
            diagonal[k] += lanczos.beta[k] / lanczos.alpha[k - 1u];
            beside[k] = sqrt(lanczos.beta[k]) / lanczos.alpha[k - 1u];
            high = max(high, diagonal[k - 1u] + beside[k - 1u] + beside[k]);
        }
        size = k + 1u;
    }
    // Gershgorin for the last row.
    high = max(high, diagonal[max(size, 1u) - 1u] + beside[max(size, 1u) - 1u]);
    var low = 0.0;
    for (var i = 0u; i < 40u; i++) {
        let middle = 0.5 * (low + high);
        // Eigenvalues above: signs of the pivots of T − middle I.
        var above = false;
        var pivot = 1.0;
        for (var k = 0u; k < size; k++) {
            pivot = diagonal[k] - middle - beside[k] * beside[k] / pivot;
            above |= pivot > 0.0;
            pivot = select(pivot, -1e-20, pivot == 0.0);
        }
        if (above) {
            low = middle;
        } else {
            high = middle;
        }
    }
    let last = select(1.0, MARGIN * high, high > 0.0) * stretch;
    let first = last / level.range;
    let theta = 0.5 * (last + first);
    let delta = 0.5 * (last - first);
    var rho = delta / theta;
    // Without a polynomial the first step stays at zero.
    coefficients[0] = vec4<f32>(0.0, select(1.0 / theta, 0.0, level.degree == 0u), last, 0.0);
    for (var k = 1u; k < level.degree; k++) {
        let next = 1.0 / (2.0 * theta / delta - rho);
        coefficients[16u * k] = vec4<f32>(next * rho, 2.0 * next / delta, last, 0.0);
        rho = next;
    }
}
