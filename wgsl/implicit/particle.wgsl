// Loads of a sorted particle's state.
//
// uses implicit/layout

fn velocity_of(p: u32) -> vec3<f32> {
    return vec3<f32>(state[p], state[params.room + p], state[2u * params.room + p]);
}

fn affine_of(p: u32) -> mat3x3<f32> {
    var m: mat3x3<f32>;
    for (var c = 0u; c < 3u; c++) {
        for (var r = 0u; r < 3u; r++) {
            m[c][r] = state[(3u + 3u * c + r) * params.room + p];
        }
    }
    return m;
}

fn deformation_of(p: u32) -> mat3x3<f32> {
    var m: mat3x3<f32>;
    for (var c = 0u; c < 3u; c++) {
        for (var r = 0u; r < 3u; r++) {
            m[c][r] = state[(12u + 3u * c + r) * params.room + p];
        }
    }
    return m;
}

fn offset_of(p: u32) -> vec3<f32> {
    return bitcast<vec3<f32>>(position[p].xyz);
}

fn push_of(p: u32) -> mat3x3<f32> {
    var m: mat3x3<f32>;
    for (var c = 0u; c < 3u; c++) {
        for (var r = 0u; r < 3u; r++) {
            m[c][r] = push[(3u * c + r) * params.room + p];
        }
    }
    return m;
}

fn store_push(p: u32, m: mat3x3<f32>) {
    for (var c = 0u; c < 3u; c++) {
        for (var r = 0u; r < 3u; r++) {
            push[(3u * c + r) * params.room + p] = m[c][r];
        }
    }
}
