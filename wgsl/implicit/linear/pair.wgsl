// A pair (s, y) of L-BFGS: ρ = 1 / yᵀs, and α of the first loop.

struct Pair {
    rho: f32,
    alpha: f32,
}
