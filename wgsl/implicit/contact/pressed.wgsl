// What the faces that press on particles bring to nodes.
//
// uses implicit/cells, implicit/particle, implicit/shape, implicit/contact/links

/// Whether faces are near any particle of a block or of those below it, whose nodes particles share.
/// For lanes 0 to 7, one a block.
fn is_touched(slot: u32, lane: u32) -> bool {
    let offset = vec3<i32>(vec3<u32>(lane & 1u, (lane >> 1u) & 1u, lane >> 2u));
    let other = slot_of(block_coordinates(block_list[slot]) - offset);
    if (other == NO_NODE) {
        return false;
    }
    return link_starts[starts[other * IN_BLOCK]] < link_starts[starts[(other + 1u) * IN_BLOCK]];
}

/// Σ w f (N) over the particles of a node with coordinates `n` in the table.
fn pressed(n: vec3<i32>, grid: u32) -> vec3<f32> {
    var force = vec3<f32>(0.0);
    for (var r = 0u; r < RUNS; r++) {
        let from_ = run(n, grid, r);
        for (var l = link_starts[from_.first]; l < link_starts[from_.end]; l++) {
            force += shape(offset_of(links[l].particle), n - from_.corner, grid).w * force_of(l);
        }
    }
    return force;
}
