// Where a particle's state lies. A fluid has J, all others F by columns and then the plastic state.
//
// Inside a frame, 32 particles have their values together, channel by channel, so that a particle's are a fixed
// distance apart. By id, as the host knows them, channels are one after the other: those of the deformation, and v
// and B/dx by columns.
//
// A buffer has five channels at most, and the next one those that follow: devices bind 2 GiB, which is then enough for
// 10^8 particles.
//
// uses explicit/layout, shared/state

const PART_CHANNELS = 5u;

/// Of a buffer with so many channels.
fn place_of_state(at: u32, channels: u32) -> u32 {
    return (at & ~31u) * channels + (at & 31u);
}

fn place_of_first(at: u32) -> u32 {
    return place_of_state(at, min(state_channels(), PART_CHANNELS));
}

fn place_of_rest(at: u32) -> u32 {
    return place_of_state(at, state_channels() - PART_CHANNELS);
}

fn load_deformation(particle: u32, model: u32) -> Deformation {
    var s: Deformation;
    let at = place_of_first(particle);
    if (model == FLUID) {
        s.J = deformation_in[at];
        return s;
    }
    let rest = place_of_rest(particle);
    s.F = mat3x3<f32>(
        deformation_in[at], deformation_in[at + 32u], deformation_in[at + 64u],
        deformation_in[at + 96u], deformation_in[at + 128u], rest_in[rest],
        rest_in[rest + 32u], rest_in[rest + 64u], rest_in[rest + 96u],
    );
    if (has_plastic_state(model)) {
        s.q = rest_in[rest + 128u];
    }
    return s;
}

fn store_deformation(particle: u32, model: u32, s: Deformation) {
    let at = place_of_first(particle);
    if (model == FLUID) {
        deformation_out[at] = s.J;
        return;
    }
    let rest = place_of_rest(particle);
    deformation_out[at] = s.F[0].x;
    deformation_out[at + 32u] = s.F[0].y;
    deformation_out[at + 64u] = s.F[0].z;
    deformation_out[at + 96u] = s.F[1].x;
    deformation_out[at + 128u] = s.F[1].y;
    rest_out[rest] = s.F[1].z;
    rest_out[rest + 32u] = s.F[2].x;
    rest_out[rest + 64u] = s.F[2].y;
    rest_out[rest + 96u] = s.F[2].z;
    if (has_plastic_state(model)) {
        rest_out[rest + 128u] = s.q;
    }
}

/// Channel k of the deformation by id.
fn frame_state(k: u32, id: u32) -> f32 {
    if (k < PART_CHANNELS) {
        return frame_deformation[k * params.particles + id];
    }
    return frame_rest[(k - PART_CHANNELS) * params.particles + id];
}

fn set_frame_state(k: u32, id: u32, value: f32) {
    if (k < PART_CHANNELS) {
        frame_deformation[k * params.particles + id] = value;
    } else {
        frame_rest[(k - PART_CHANNELS) * params.particles + id] = value;
    }
}

fn load_frame_deformation(id: u32, model: u32) -> Deformation {
    var s: Deformation;
    if (model == FLUID) {
        s.J = frame_state(0u, id);
        return s;
    }
    for (var c = 0u; c < 3u; c++) {
        for (var r = 0u; r < 3u; r++) {
            s.F[c][r] = frame_state(3u * c + r, id);
        }
    }
    if (has_plastic_state(model)) {
        s.q = frame_state(9u, id);
    }
    return s;
}

fn store_frame_deformation(id: u32, model: u32, s: Deformation) {
    if (model == FLUID) {
        set_frame_state(0u, id, s.J);
        return;
    }
    for (var c = 0u; c < 3u; c++) {
        for (var r = 0u; r < 3u; r++) {
            set_frame_state(3u * c + r, id, s.F[c][r]);
        }
    }
    if (has_plastic_state(model)) {
        set_frame_state(9u, id, s.q);
    }
}

/// Channel k of v (m/s) and then B/dx by columns (m/s), by id.
fn frame_motion(k: u32, id: u32) -> f32 {
    if (k < PART_CHANNELS) {
        return frame_velocity[k * params.particles + id];
    }
    if (k < 2u * PART_CHANNELS) {
        return frame_velocity_1[(k - PART_CHANNELS) * params.particles + id];
    }
    return frame_velocity_2[(k - 2u * PART_CHANNELS) * params.particles + id];
}

fn set_frame_motion(k: u32, id: u32, value: f32) {
    if (k < PART_CHANNELS) {
        frame_velocity[k * params.particles + id] = value;
    } else if (k < 2u * PART_CHANNELS) {
        frame_velocity_1[(k - PART_CHANNELS) * params.particles + id] = value;
    } else {
        frame_velocity_2[(k - 2u * PART_CHANNELS) * params.particles + id] = value;
    }
}

fn load_velocity(id: u32) -> vec3<f32> {
    return vec3<f32>(frame_motion(0u, id), frame_motion(1u, id), frame_motion(2u, id));
}

/// B/dx.
fn load_affine(id: u32) -> mat3x3<f32> {
    return mat3x3<f32>(
        frame_motion(3u, id), frame_motion(4u, id), frame_motion(5u, id),
        frame_motion(6u, id), frame_motion(7u, id), frame_motion(8u, id),
        frame_motion(9u, id), frame_motion(10u, id), frame_motion(11u, id),
    );
}

fn store_motion(id: u32, v: vec3<f32>, B: mat3x3<f32>) {
    for (var k = 0u; k < 3u; k++) {
        set_frame_motion(k, id, v[k]);
        set_frame_motion(3u + k, id, B[0][k]);
        set_frame_motion(6u + k, id, B[1][k]);
        set_frame_motion(9u + k, id, B[2][k]);
    }
}
