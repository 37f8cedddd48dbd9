// State of a level's Lanczos process, run as conjugate gradients with D⁻¹ on noise: their
// coefficients are those of the Lanczos matrix.

struct Lanczos {
    // Values of beta so far.
    count: u32,
    // r·z of the last of them.
    rz: f32,
    spare0: u32,
    spare1: u32,
    alpha: array<f32, 16>,
    beta: array<f32, 16>,
}
