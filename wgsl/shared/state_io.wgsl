// Where a particle's deformation state lies: channel-major arrays, J in channel 0 of a fluid.

fn load_deformation(at: u32, model: u32) -> Deformation {
    var s: Deformation;
    if (model == FLUID) {
        s.J = deformation_in[at];
    } else {
        for (var c = 0u; c < 3u; c++) {
            for (var r = 0u; r < 3u; r++) {
                s.F[c][r] = deformation_in[(3u * c + r) * params.particles + at];
            }
        }
    }
    return s;
}

fn load_frame_deformation(id: u32, model: u32) -> Deformation {
    var s: Deformation;
    if (model == FLUID) {
        s.J = frame_deformation[id];
    } else {
        for (var c = 0u; c < 3u; c++) {
            for (var r = 0u; r < 3u; r++) {
                s.F[c][r] = frame_deformation[(3u * c + r) * params.particles + id];
            }
        }
    }
    return s;
}

fn store_deformation(at: u32, model: u32, s: Deformation) {
    if (model == FLUID) {
        deformation_out[at] = s.J;
    } else {
        for (var c = 0u; c < 3u; c++) {
            for (var r = 0u; r < 3u; r++) {
                deformation_out[(3u * c + r) * params.particles + at] = s.F[c][r];
            }
        }
    }
}

fn store_frame_deformation(id: u32, model: u32, s: Deformation) {
    if (model == FLUID) {
        frame_deformation[id] = s.J;
    } else {
        for (var c = 0u; c < 3u; c++) {
            for (var r = 0u; r < 3u; r++) {
                frame_deformation[(3u * c + r) * params.particles + id] = s.F[c][r];
            }
        }
    }
}
