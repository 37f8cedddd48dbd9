// What a particle remembers of contact. Twin: Touch in src/core/sim/touch.rs.
//
// uses implicit/layout

/// Radius (m), how far it was carried along the surface that it holds on to (m), and that collider,
/// counted from 1.
struct Memory { radius: f32, stretch: vec3<f32>, holds: u32 }

/// In the channel of `holds`: it has met no faces yet.
const UNMET: f32 = -1.0;

fn untouched(body: Body) -> Memory {
    return Memory(0.5 * body.spacing, vec3<f32>(0.0), 0u);
}

/// At the step's start.
fn memory_of(p: u32) -> Memory {
    let at = params.touch * params.room + p;
    let stretch = vec3<f32>(
        state[at + 2u * params.room], state[at + 3u * params.room], state[at + 4u * params.room]);
    return Memory(state[at + params.room], stretch, u32(max(state[at], 0.0)));
}

/// At its end.
fn remember(p: u32, memory: Memory) {
    let at = params.touch * params.room + p;
    state_in[at] = f32(memory.holds);
    state_in[at + params.room] = memory.radius;
    state_in[at + 2u * params.room] = memory.stretch.x;
    state_in[at + 3u * params.room] = memory.stretch.y;
    state_in[at + 4u * params.room] = memory.stretch.z;
}
