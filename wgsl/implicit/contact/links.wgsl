// What faces do to the particles, by particle and face.
//
// uses implicit/layout

fn store_force(l: u32, force: vec3<f32>) {
    press[l] = force.x;
    press[params.link_room + l] = force.y;
    press[2u * params.link_room + l] = force.z;
}

/// On the particle (N).
fn force_of(l: u32) -> vec3<f32> {
    return vec3<f32>(press[l], press[params.link_room + l], press[2u * params.link_room + l]);
}

/// Channel of an entry of the stiffness.
fn symmetric(r: u32, c: u32) -> u32 {
    let low = min(r, c);
    return 3u + low * 3u - (low * (low + 1u)) / 2u + max(r, c);
}

/// Minus the force's derivative (N/m).
fn stiffness_of(l: u32) -> mat3x3<f32> {
    var out: mat3x3<f32>;
    for (var r = 0u; r < 3u; r++) {
        for (var c = 0u; c < 3u; c++) {
            out[c][r] = press[symmetric(r, c) * params.link_room + l];
        }
    }
    return out;
}
