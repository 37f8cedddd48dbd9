// Nodes that both sides of a plate have: layers for which a node is at home move together, and those for which
// it lies beyond a plate. Twin: src/engine/explicit/cpu/sides.rs.
// In: fixed-point mass, momentum and rest volume. Out: momenta, each layer's with its own mass, to the unit what
// they were together; rest volumes of the layers that move together, negative at nodes beyond a plate.
// One workgroup an active block, that of the lowest layer where several are: a lane reads and writes the nodes of
// all layers at its place.
//
// uses explicit/node, explicit/beyond

/// Whether a node lies beyond a plate for particles of a layer. `distance`: of the node (dx).
fn is_beyond(x: vec3<f32>, distance: f32, layer: u32) -> bool {
    if (layer == 0u || distance > SIDE_REACH) {
        return false;
    }
    let toward = side_direction(layer);
    let ahead = way_through(x, toward, SIDE_REACH);
    if (ahead < 0.0 || distance > TOUCHING) {
        return ahead >= 0.0;
    }
    // Inside: its own face is the nearer one.
    let behind = way_through(x, -toward, SIDE_REACH);
    return behind >= 0.0 && ahead > behind + select(-TIE, TIE, layer % 2u == 1u);
}

/// Gives the nodes of the layers in `members`, a bit each, one velocity, and the sum of what fills them.
fn together(members: u32, n: vec3<i32>, grid: u32, beyond: bool) {
    var mass = 0;
    var volume = 0;
    var momentum = vec3<i32>(0);
    var heaviest = 0u;
    var most = -1;
    for (var k = 0u; k < LAYERS; k++) {
        if ((members & (1u << k)) == 0u) {
            continue;
        }
        let at = place_of(k * layer_size(), n, grid);
        let own = grid_in[at];
        mass += own;
        volume += grid_in[at + FILLED];
        momentum += vec3<i32>(grid_in[at + CHANNEL], grid_in[at + 2u * CHANNEL], grid_in[at + 3u * CHANNEL]);
        if (own > most) {
            most = own;
            heaviest = k;
        }
    }
    // What rounding leaves goes to the heaviest, whose velocity it changes least.
    var rest = momentum;
    for (var i = 0u; i < LAYERS; i++) {
        let k = (heaviest + 1u + i) % LAYERS;
        if ((members & (1u << k)) == 0u) {
            continue;
        }
        let at = place_of(k * layer_size(), n, grid);
        let share = vec3<i32>(round(f32(grid_in[at]) / f32(max(mass, 1)) * vec3<f32>(momentum)));
        let own = select(share, rest, k == heaviest);
        rest -= own;
        grid_in[at + CHANNEL] = own.x;
        grid_in[at + 2u * CHANNEL] = own.y;
        grid_in[at + 3u * CHANNEL] = own.z;
        if (FILLS != FILLS_NOTHING) {
            grid_in[at + FILLED] = select(volume, -1 - volume, beyond);
        }
    }
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let slot = group_index(id, count);
    if (!running() || slot >= report.blocks) {
        return;
    }
    let block = blocks_in[slot];
    let first = block - layer(block);
    var here = 0u;
    for (var k = 0u; k < LAYERS; k++) {
        here |= select(0u, 1u << k, slot_in(first + k * layer_size()) != 0u);
    }
    let own = layer(block) / layer_size();
    if (here == 1u || firstTrailingBit(here) != own) {
        return;
    }
    let n = 4 * block_coordinates(block) - params.pad + vec3<i32>(vec3<u32>(lane & 3u, (lane >> 2u) & 3u, lane >> 4u));
    for (var grid = 0u; grid < GRIDS; grid++) {
        let x = (vec3<f32>(n) + vec3<f32>(node_offset(grid))) * params.dx;
        let distance = nearest_plate(x).distance / params.dx;
        var beyond = 0u;
        for (var k = 0u; k < LAYERS; k++) {
            if ((here & (1u << k)) != 0u && is_beyond(x, distance, k)) {
                beyond |= 1u << k;
            }
        }
        together(here & ~beyond, n, grid, false);
        together(here & beyond, n, grid, true);
    }
}
