// Where the minimisation stands; the host reads it once an iteration.

struct State {
    // E at the iterate, an unevaluated sum.
    energy: vec2<f32>,
    // Σ |∇E_i|² / scale_i² at the iterate.
    residual2: f32,
    // φ'(0) = −zᵀ∇E of the search direction −z; zᵀ∇E where it is taken with the state.
    slope: f32,
    // Step of the line search, tried or accepted.
    alpha: f32,
    // Halvings in this line search.
    halvings: u32,
    // Bits: see below.
    flags: u32,
    spare: u32,
}

// The step at alpha is accepted.
const ACCEPTED = 1u;
// zᵀ∇E is not positive: the V-cycle was not.
const INDEFINITE = 2u;
// The new pair was dropped: yᵀs is not positive.
const DROPPED = 4u;
// E or ∇E at the start is not finite.
const BROKEN = 8u;
