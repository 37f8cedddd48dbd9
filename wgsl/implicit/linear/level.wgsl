// Levels of the hierarchy: a lattice of nodes, and the dense table that numbers them. Nodes of a
// level are in the order of its table: blocks of 4³ indices, both grids of the compact kernel's
// pair in a block. Coarse node j sits on fine node 2j of the same grid (HOT §5.3).

struct Level {
    // Lowest index of the table.
    low: vec3<i32>,
    // Nodes, and the room for them.
    rows: u32,
    // The table's blocks.
    blocks: vec3<u32>,
    stride: u32,
    // Cells along periodic axes, otherwise 0.
    period: vec3<i32>,
    grids: u32,
    // Workgroups of a reduction.
    groups: u32,
    // The Chebyshev polynomial of the smoother or coarse solve: degree, and λ over the interval's
    // lower end.
    degree: u32,
    range: f32,
    // Whether nodes may have a restricted freedom: on the finest level.
    sliding: u32,
    // Indices of the finer level over this one's: 2, or 1 along a periodic axis that cannot be
    // halved.
    factor: vec3<i32>,
    spare: u32,
}

const NONE = 0xffffffffu;

// Where a node is in its level's table.
fn entry_of(level: Level, id: vec4<i32>) -> u32 {
    let at = vec3<u32>(id.xyz - level.low);
    let block = at / 4u;
    if (any(block >= level.blocks)) {
        return NONE;
    }
    let within = (at.x % 4u * 4u + at.y % 4u) * 4u + at.z % 4u;
    return (((block.x * level.blocks.y + block.y) * level.blocks.z + block.z) * level.grids + u32(id.w)) * 64u + within;
}

fn id_of(level: Level, entry: u32) -> vec4<i32> {
    let within = entry % 64u;
    let block = entry / 64u / level.grids;
    let n = level.blocks;
    let corner = 4u * vec3<u32>(block / n.z / n.y, block / n.z % n.y, block % n.z);
    let at = corner + vec3<u32>(within / 16u, within / 4u % 4u, within % 4u);
    return vec4<i32>(vec3<i32>(at) + level.low, i32(entry / 64u % level.grids));
}

fn entries(level: Level) -> u32 {
    return level.blocks.x * level.blocks.y * level.blocks.z * level.grids * 64u;
}

// An index within its period.
fn wrapped(level: Level, index: vec3<i32>) -> vec3<i32> {
    var i = index;
    for (var a = 0u; a < 3u; a++) {
        let n = level.period[a];
        if (n > 0) {
            i[a] = ((i[a] % n) + n) % n;
        }
    }
    return i;
}
