// What a particle gets from the grid.
//
// uses explicit/tile, shared/mls, shared/polar

// v (m/s); B (m/s, in cells); gradient: dx ∇v (m/s); fill: cells filled and room around it, as shares of a full node.
struct Gathered { v: vec3<f32>, B: mat3x3<f32>, gradient: mat3x3<f32>, fill: vec2<f32> }
