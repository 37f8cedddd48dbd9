// A particle's deformation state: F (9 channels), or J (1 channel, and channel 0 of a fluid among solids).

struct Deformation { F: mat3x3<f32>, J: f32 }

const FLUID = 2u;

/// Advances F ← (I + dt ∇v) F or J ← (1 + dt tr ∇v) J; `growth` = dt ∇v.
fn deform(state: Deformation, model: u32, growth: mat3x3<f32>) -> Deformation {
    var next = state;
    if (model == FLUID) {
        next.J = state.J + state.J * (growth[0].x + growth[1].y + growth[2].z);
    } else {
        next.F = state.F + growth * state.F;
    }
    return next;
}

fn kirchhoff(state: Deformation, m: Material, grad_v: mat3x3<f32>) -> mat3x3<f32> {
    if (m.model == FLUID) {
        return weakly_compressible_fluid_kirchhoff(state.J, m.a, m.b, m.c, grad_v);
    }
    if (m.model == 1u) {
        return neo_hookean_kirchhoff(state.F, m.a, m.b);
    }
    return fixed_corotated_kirchhoff(state.F, m.a, m.b);
}
