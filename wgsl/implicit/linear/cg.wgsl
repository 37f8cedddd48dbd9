// Conjugate gradients for A s = ∇E around the V-cycle z ≈ A⁻¹ r, r = ∇E − A s, with Polak and
// Ribière's β; twin of src/engine/implicit/solver/krylov.rs. The host reads this after every
// iteration.

struct Cg {
    // z·r.
    zr: f32,
    beta: f32,
    alpha: f32,
    // Directions so far.
    count: u32,
    // Σ m |Δv − s|² (kg m²/s²): of Δv where s would take it.
    size2: f32,
    // Σ m (kg).
    mass: f32,
    // Σ m |v|² of the velocities at the step's start (kg m²/s²).
    motion2: f32,
    // p·Ap of the last direction.
    pap: f32,
}
