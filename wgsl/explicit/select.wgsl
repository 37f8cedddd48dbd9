// States of chosen particles at a frame boundary, as the host reads them back: a record each.
// One thread a chosen particle; each record is written by one.
//
// uses explicit/state_io

@group(0) @binding(29) var<storage, read> chosen: array<u32>; // how many, values of deformation wanted, then ids
@group(0) @binding(30) var<storage, read_write> records: array<u32>; // offset (f32 bits), block, v, body, deformation

/// Values of a record before those of the deformation.
const PLAIN = 8u;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let at = group_index(group, count) * WORKGROUP + lane;
    if (at >= chosen[0]) {
        return;
    }
    let id = chosen[2u + at];
    if (id >= params.live) {
        return;
    }
    let channels = chosen[1];
    let first = at * (PLAIN + channels);
    let place = frame_position[id];
    for (var k = 0u; k < 4u; k++) {
        records[first + k] = place[k];
    }
    for (var k = 0u; k < 3u; k++) {
        records[first + 4u + k] = bitcast<u32>(frame_motion(k, id));
    }
    records[first + 7u] = body_of[id];
    for (var k = 0u; k < channels; k++) {
        records[first + PLAIN + k] = bitcast<u32>(frame_state(k, id));
    }
}
