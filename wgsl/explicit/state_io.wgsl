// Where a particle's deformation state lies. A fluid has J, all others F by columns and then the plastic state.
//
// Inside a frame, 32 particles have their values together, channel by channel, so that a particle's are a fixed
// distance apart. By id, as the host knows them, channels are one after the other.
//
// uses explicit/layout, shared/state

fn place_of_state(at: u32) -> u32 {
    return (at & ~31u) * state_channels() + (at & 31u);
}

fn load_deformation(particle: u32, model: u32) -> Deformation {
    var s: Deformation;
    let at = place_of_state(particle);
    if (model == FLUID) {
        s.J = deformation_in[at];
        return s;
    }
    s.F = mat3x3<f32>(
        deformation_in[at], deformation_in[at + 32u], deformation_in[at + 64u],
        deformation_in[at + 96u], deformation_in[at + 128u], deformation_in[at + 160u],
        deformation_in[at + 192u], deformation_in[at + 224u], deformation_in[at + 256u],
    );
    if (has_plastic_state(model)) {
        s.q = deformation_in[at + 288u];
    }
    return s;
}

fn store_deformation(particle: u32, model: u32, s: Deformation) {
    let at = place_of_state(particle);
    if (model == FLUID) {
        deformation_out[at] = s.J;
        return;
    }
    for (var c = 0u; c < 3u; c++) {
        deformation_out[at + 96u * c] = s.F[c].x;
        deformation_out[at + 96u * c + 32u] = s.F[c].y;
        deformation_out[at + 96u * c + 64u] = s.F[c].z;
    }
    if (has_plastic_state(model)) {
        deformation_out[at + 288u] = s.q;
    }
}

fn load_frame_deformation(id: u32, model: u32) -> Deformation {
    var s: Deformation;
    if (model == FLUID) {
        s.J = frame_deformation[id];
        return s;
    }
    for (var c = 0u; c < 3u; c++) {
        for (var r = 0u; r < 3u; r++) {
            s.F[c][r] = frame_deformation[(3u * c + r) * params.particles + id];
        }
    }
    if (has_plastic_state(model)) {
        s.q = frame_deformation[9u * params.particles + id];
    }
    return s;
}

fn store_frame_deformation(id: u32, model: u32, s: Deformation) {
    if (model == FLUID) {
        frame_deformation[id] = s.J;
        return;
    }
    for (var c = 0u; c < 3u; c++) {
        for (var r = 0u; r < 3u; r++) {
            frame_deformation[(3u * c + r) * params.particles + id] = s.F[c][r];
        }
    }
    if (has_plastic_state(model)) {
        frame_deformation[9u * params.particles + id] = s.q;
    }
}
