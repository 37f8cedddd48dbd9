// What contact leaves for the transfer of the same particles, where that will write afterwards.
//
// uses explicit/layout

fn leave(to: u32, y: vec3<f32>, kick: vec3<f32>) {
    position_out[to] = bitcast<vec4<u32>>(vec4<f32>(y, kick.x));
    destinations[to] = bitcast<vec2<u32>>(kick.yz);
}

/// Offset in the old block (cells).
fn touched_offset(to: u32) -> vec3<f32> {
    return bitcast<vec3<f32>>(position_out[to].xyz);
}

/// What faces add to its velocity (m/s).
fn touched_kick(to: u32) -> vec3<f32> {
    return bitcast<vec3<f32>>(vec3<u32>(position_out[to].w, destinations[to]));
}
