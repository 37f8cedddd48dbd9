// Structs of the scene that explicit and implicit stages share. Rust twins:
// src/engine/explicit/gpu/layout.rs.

// rate, crowded, full: how the volume follows what fills the room (src/core/sim/volume.rs); full 0: it does
// not.
struct Body {
    mass: f32,
    volume: f32,
    material: u32,
    demand: f32, // of the material at rest (1/s²)
    rate: f32,   // at rest (1/s)
    full: f32,   // fill that counts as full
    crowded: f32, // what a crowd adds to the rate (1/s)
    stiffness: f32, // of contact at the particle (N/m), damping (N s/m) and distance between particles (m):
    damping: f32,   // src/core/sim/touch.rs
    spacing: f32,
    spare0: u32,
    spare1: u32,
}

// A fluid: a = K/γ, b = γ, c = viscosity. All others: a = μ, b = λ, and von Mises: c = √(2/3) σ_Y;
// Drucker–Prager: c = α, d = α_ψ, e = β/(2μ); Mohr–Coulomb: c = sin φ, d = sin ψ,
// e = c cos φ/μ; NACC: c = M, d = β, e = ξ; snow: c = 1 - θc, d = 1 + θs, e = ξ.
// damping: of solids, t_d (s).
struct Material { model: u32, a: f32, b: f32, c: f32, d: f32, e: f32, damping: f32, spare: u32 }

// One instruction of a signed distance program (src/core/sim/collider/): its rows place it:
// rotation and translation.
// grid: first of `sdf_samples`, samples along each axis.
struct SdfOp { r0: vec4<f32>, r1: vec4<f32>, r2: vec4<f32>, size: vec3<f32>, code: u32, grid: vec4<u32> }

// slack: by how much distances may differ beyond the distance between their points (m). touches: 1 if it acts
// on particles, 0 on nodes.
struct Collider {
    first: u32,
    count: u32,
    kind: u32,
    friction: f32,
    slack: f32,
    touches: u32,
    spare0: u32,
    spare1: u32,
}

// Kinds of contact; all others are separating.
const STICKY = 0u;
const SLIP = 1u;

// Pose of a collider at a step's start: x_start = rotationᵀ (x - translation); velocity over the
// step = linear + angular × r + angular.w angular × (angular × r), r = x - center.
struct Pose {
    r0: vec4<f32>, r1: vec4<f32>, r2: vec4<f32>, // rows of rotationᵀ; w = translation
    linear: vec4<f32>,                           // w = 1 while the collider is there, else 0
    angular: vec4<f32>,
    center: vec4<f32>,                           // w = 1 while it takes room (no grip does), else 0
}
