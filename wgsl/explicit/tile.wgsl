// Workgroup memory of the transfers: node velocities (and what fills the nodes, if somebody asks)
// that a block's particles read, and fixed-point sums that they scatter.
//
// Read tile: nodes 0..5 of the block per axis (a particle's base is 0..3, compact grid -: 0..4).
// Scatter tile: nodes -1..6, because a particle moves less than a cell before it scatters.
// Sums are integers: their order does not matter, so that runs repeat bit for bit.
//
// uses explicit/neighbours

const READ = 6u;
const READ_NODES = 216u;
const TILE = 8u;
const TILE_NODES = 512u;

var<workgroup> velocity_tile: array<f32, 3u * READ_NODES * GRIDS>;
var<workgroup> fill_tile: array<u32, READ_NODES * GRIDS>; // as `grid_update` packs it
var<workgroup> sum_tile: array<atomic<i32>, 4u * TILE_NODES * GRIDS>;
var<workgroup> volume_tile: array<atomic<i32>, TILE_NODES * GRIDS>;
var<workgroup> slots_out: array<u32, 27>;  // slot + 1 of each neighbour on the `_out` side
var<workgroup> bin_counts: array<atomic<u32>, 27>;
var<workgroup> bin_bases: array<u32, 27>;

/// Looks up the neighbours on the `_out` side and zeroes the sums. A barrier must follow.
fn open_scatter(block: u32, lane: u32) {
    for (var i = lane; i < 27u; i += WORKGROUP) {
        let b = block_beside(block, neighbour(i));
        var slot = 0u;
        if (b >= 0) {
            slot = atomicLoad(&table_out[b]);
        }
        slots_out[i] = slot;
        atomicStore(&bin_counts[i], 0u);
    }
    for (var i = lane; i < 4u * TILE_NODES * GRIDS; i += WORKGROUP) {
        atomicStore(&sum_tile[i], 0);
    }
    if (params.fills == FILLS_VOLUME) {
        for (var i = lane; i < TILE_NODES * GRIDS; i += WORKGROUP) {
            atomicStore(&volume_tile[i], 0);
        }
    }
}

/// Loads what `grid_update` left; nodes of inactive blocks are at rest. A barrier must come before and
/// after.
fn load_nodes(lane: u32) {
    for (var i = lane; i < READ_NODES * GRIDS; i += WORKGROUP) {
        let grid = i / READ_NODES;
        let r = i % READ_NODES;
        let n = vec3<u32>(r % READ, (r / READ) % READ, r / (READ * READ));
        let high = n >> vec3<u32>(2u);
        let low = n & vec3<u32>(3u);
        let slot = slots_in[high.x + 2u * high.y + 4u * high.z];
        var v = vec3<f32>(0.0);
        var fill = 0u;
        if (slot != 0u) {
            let at = place_in(slot - 1u, grid, low);
            v = bitcast<vec3<f32>>(vec3<i32>(
                grid_in[at + CHANNEL], grid_in[at + 2u * CHANNEL], grid_in[at + 3u * CHANNEL]));
            if (params.fills != FILLS_NOTHING) {
                fill = bitcast<u32>(grid_in[at + FILLED]);
            }
        }
        velocity_tile[i] = v.x;
        velocity_tile[i + READ_NODES * GRIDS] = v.y;
        velocity_tile[i + 2u * READ_NODES * GRIDS] = v.z;
        if (params.fills != FILLS_NOTHING) {
            fill_tile[i] = fill;
        }
    }
}

/// Place of a node in the read tile.
fn read_place(grid: u32, n: vec3<i32>) -> u32 {
    let u = vec3<u32>(n);
    return grid * READ_NODES + u.x + READ * u.y + READ * READ * u.z;
}

fn node_velocity(grid: u32, n: vec3<i32>) -> vec3<f32> {
    let at = read_place(grid, n);
    let stride = READ_NODES * GRIDS;
    return vec3<f32>(velocity_tile[at], velocity_tile[at + stride], velocity_tile[at + 2u * stride]);
}

/// Mass of a node of the read tile (kg), from the grid.
fn node_mass(grid: u32, n: vec3<i32>) -> f32 {
    let high = vec3<u32>(n) >> vec3<u32>(2u);
    let low = vec3<u32>(n) & vec3<u32>(3u);
    let slot = slots_in[high.x + 2u * high.y + 4u * high.z];
    if (slot == 0u) {
        return 0.0;
    }
    return f32(grid_in[place_in(slot - 1u, grid, low)]) / params.mass_scale;
}

/// Adds to a node's sums and carries the rounding error over to the particle's next node, so that a
/// particle's total is exact to half a unit. The carry starts at random (`dither`): with plain
/// rounding, a lattice of particles that all round alike would drift by a share of a unit in every
/// step.
fn add_to_node(grid: u32, n: vec3<i32>, mass: f32, momentum: vec3<f32>, carry: ptr<function, vec4<f32>>) {
    let u = vec3<u32>(n + vec3<i32>(1));
    let at = grid * TILE_NODES + u.x + TILE * u.y + TILE * TILE * u.z;
    let wanted = vec4<f32>(mass * params.mass_scale, momentum * params.momentum_scale) + *carry;
    let rounded = round(wanted);
    *carry = wanted - rounded;
    let units = vec4<i32>(rounded);
    atomicAdd(&sum_tile[at], units.x);
    atomicAdd(&sum_tile[at + TILE_NODES * GRIDS], units.y);
    atomicAdd(&sum_tile[at + 2u * TILE_NODES * GRIDS], units.z);
    atomicAdd(&sum_tile[at + 3u * TILE_NODES * GRIDS], units.w);
}

/// Adds to the cells that are filled at a node; `carry` as above.
fn add_volume(grid: u32, n: vec3<i32>, cells: f32, carry: ptr<function, f32>) {
    let u = vec3<u32>(n + vec3<i32>(1));
    let wanted = cells * params.cell_scale + *carry;
    let rounded = round(wanted);
    *carry = wanted - rounded;
    atomicAdd(&volume_tile[grid * TILE_NODES + u.x + TILE * u.y + TILE * TILE * u.z], i32(rounded));
}

/// Four values in [-½, ½) from a particle's id and the step (PCG hash, Jarzynski & Olano 2020).
fn dither(id: u32) -> vec4<f32> {
    let state = (id ^ (report.index * 0x9e3779b9u)) * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    let h = (word >> 22u) ^ word;
    return vec4<f32>((vec4<u32>(h) >> vec4<u32>(0u, 8u, 16u, 24u)) & vec4<u32>(255u)) * (1.0 / 256.0) - 0.498046875;
}

/// Adds the tile to the grid. A barrier must come before.
fn flush_tile(lane: u32) {
    for (var i = lane; i < TILE_NODES * GRIDS; i += WORKGROUP) {
        let mass = atomicLoad(&sum_tile[i]);
        let p = vec3<i32>(
            atomicLoad(&sum_tile[i + TILE_NODES * GRIDS]),
            atomicLoad(&sum_tile[i + 2u * TILE_NODES * GRIDS]),
            atomicLoad(&sum_tile[i + 3u * TILE_NODES * GRIDS]),
        );
        var volume = 0;
        if (params.fills == FILLS_VOLUME) {
            volume = atomicLoad(&volume_tile[i]);
        }
        if (mass == 0 && volume == 0 && all(p == vec3<i32>(0))) {
            continue;
        }
        let grid = i / TILE_NODES;
        let r = i % TILE_NODES;
        // +3: node -1 becomes 3 of the lower neighbour.
        let n = vec3<u32>(r % TILE, (r / TILE) % TILE, r / (TILE * TILE)) + vec3<u32>(3u);
        let high = n >> vec3<u32>(2u);
        let low = n & vec3<u32>(3u);
        let slot = slots_out[high.x + 3u * high.y + 9u * high.z];
        if (slot != 0u) {
            let at = place_in(slot - 1u, grid, low);
            atomicAdd(&grid_out[at], mass);
            atomicAdd(&grid_out[at + CHANNEL], p.x);
            atomicAdd(&grid_out[at + 2u * CHANNEL], p.y);
            atomicAdd(&grid_out[at + 3u * CHANNEL], p.z);
            if (volume != 0) {
                atomicAdd(&grid_out[at + FILLED], volume);
            }
        }
    }
}
