// S: the directions in which a node may move. Twin: `Freedom` in
// src/engine/implicit/solver/objective.rs.
//
// uses implicit/layout

fn projection(f: vec4<f32>) -> mat3x3<f32> {
    let identity = mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    if (f.w == FREE) {
        return identity;
    }
    let outer = mat3x3<f32>(f.xyz * f.x, f.xyz * f.y, f.xyz * f.z);
    if (f.w == LINE) {
        return outer;
    }
    return identity - outer;
}
