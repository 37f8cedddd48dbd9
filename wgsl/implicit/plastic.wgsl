// Loads of what only laws need.
//
// uses implicit/layout, shared/state

fn plastic_of(p: u32, model: u32) -> f32 {
    if (has_plastic_state(model)) {
        return state[21u * params.room + p];
    }
    return 0.0;
}
