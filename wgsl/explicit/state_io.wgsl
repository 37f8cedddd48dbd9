// Where a particle's deformation state lies: channel-major arrays, F by columns and then the
// plastic state; J in channel 0 of a fluid.
//
// uses explicit/layout, shared/state

fn load_deformation(at: u32, model: u32) -> Deformation {
    var s: Deformation;
    if (model == FLUID) {
        s.J = deformation_in[at];
        return s;
    }
    for (var c = 0u; c < 3u; c++) {
        for (var r = 0u; r < 3u; r++) {
            s.F[c][r] = deformation_in[(3u * c + r) * params.particles + at];
        }
    }
    if (has_plastic_state(model)) {
        s.q = deformation_in[9u * params.particles + at];
    }
    return s;
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

fn store_deformation(at: u32, model: u32, s: Deformation) {
    if (model == FLUID) {
        deformation_out[at] = s.J;
        return;
    }
    for (var c = 0u; c < 3u; c++) {
        for (var r = 0u; r < 3u; r++) {
            deformation_out[(3u * c + r) * params.particles + at] = s.F[c][r];
        }
    }
    if (has_plastic_state(model)) {
        deformation_out[9u * params.particles + at] = s.q;
    }
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
