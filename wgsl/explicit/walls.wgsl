// Walls of the domain. Slip and separating ones hold the nodes on and behind their planes, one by
// one. Beside sticky ones, a node and its mirror image take opposite velocities
// (src/core/sim/contact.rs says why).
//
// The images of a node behind one, two or three walls, and theirs, are a group. Its innermost node
// owns it: the lane of that node reads all of them and writes all of them, wherever they are. The
// image of the compact kernel's grid s is on the grid -s, at the same index for a node on the
// plane; such groups belong to the node of grid +.
//
// uses explicit/reactions

/// Nodes whose index is less than this from a wall's may have an image that particles touch. Twin:
/// src/core/sim/contact.rs.
const NEAR_WALL = 4;
const MOST_IMAGES = 8u;

/// Whether the domain has walls of each kind.
override WALLS_STICKY: bool = true;
override WALLS_HELD: bool = true;

/// Room for all lanes' images, if there are any.
override IMAGES: u32 = select(1u, 64u * MOST_IMAGES, WALLS_STICKY);

/// Of each image of each lane's node: velocity, and mass as fixed-point momentum per velocity.
var<workgroup> images: array<vec4<f32>, IMAGES>;

/// The sticky wall of axis `a` that a node is near, 2a or 2a + 1; or NOWHERE.
fn sticky_wall(a: u32, n: i32) -> u32 {
    let cells = i32(params.cells[a]);
    var wall = NOWHERE;
    if (abs(n) < NEAR_WALL && 2 * n < cells) {
        wall = 2u * a;
    } else if (abs(cells - n) < NEAR_WALL) {
        wall = 2u * a + 1u;
    }
    if (params.periodic[a] != 0u || (wall != NOWHERE && u32(params.walls[wall].x) != STICKY)) {
        wall = NOWHERE;
    }
    return wall;
}

/// Whether a block at `corner` has nodes that may have images.
fn is_near_sticky(corner: vec3<i32>) -> bool {
    var near = false;
    for (var a = 0u; a < 3u; a++) {
        let cells = i32(params.cells[a]);
        let low = u32(params.walls[2u * a].x) == STICKY && corner[a] < NEAR_WALL;
        let high = u32(params.walls[2u * a + 1u].x) == STICKY && corner[a] + 3 > cells - NEAR_WALL;
        near = near || (params.periodic[a] == 0u && (low || high));
    }
    return near;
}

/// Index of a node's mirror image behind a wall.
fn mirrored(wall: u32, n: i32) -> i32 {
    return select(-n, 2 * i32(params.cells[wall / 2u]) - n, (wall & 1u) != 0u);
}

/// A node and its images. The bits of an image's number say behind which walls it is.
struct Group {
    n: vec3<i32>,
    grid: u32,
    walls: vec3<u32>, // of each axis, or NOWHERE
    bits: vec3<u32>,  // of each axis; 0 where the node is its own image
    all: u32,
    owned: bool,      // by this node
}

/// A node without images.
fn single(n: vec3<i32>, grid: u32) -> Group {
    return Group(n, grid, vec3<u32>(NOWHERE), vec3<u32>(0u), 0u, true);
}

fn group_of(n: vec3<i32>, grid: u32) -> Group {
    var group = single(n, grid);
    var on_plane = 0u;
    for (var a = 0u; a < 3u; a++) {
        let wall = sticky_wall(a, n[a]);
        group.walls[a] = wall;
        if (wall == NOWHERE) {
            continue;
        }
        if (n[a] < 0 || n[a] > i32(params.cells[a])) {
            group.owned = false;
        }
        if (mirrored(wall, n[a]) != n[a]) {
            group.bits[a] = 1u << a;
        } else if (GRIDS == 2u) {
            // Behind any such wall is the same node.
            if (on_plane == 0u) {
                on_plane = 1u << a;
            }
            group.bits[a] = on_plane;
        }
    }
    group.owned = group.owned && (on_plane == 0u || grid == 0u);
    group.all = group.bits.x | group.bits.y | group.bits.z;
    return group;
}

fn image_node(group: Group, k: u32) -> vec3<i32> {
    var n = group.n;
    for (var a = 0u; a < 3u; a++) {
        if ((k & group.bits[a]) != 0u) {
            n[a] = mirrored(group.walls[a], n[a]);
        }
    }
    return n;
}

fn image_grid(group: Group, k: u32) -> u32 {
    return (group.grid + countOneBits(k)) % GRIDS;
}

/// Contact of a node with the walls of axis `a` that are not sticky.
fn held(v: vec3<f32>, a: u32, n: i32, mass: f32, slot: u32) -> vec3<f32> {
    let upper = n >= i32(params.cells[a]);
    if (params.periodic[a] != 0u || (n > 0 && !upper)) {
        return v;
    }
    let side = select(0u, 1u, upper && n > 0);
    let wall = 2u * a + side;
    let kind = u32(params.walls[wall].x);
    if (kind == STICKY) {
        return v;
    }
    let normal = vec3<f32>(vec3<u32>(0u, 1u, 2u) == vec3<u32>(a)) * select(1.0, -1.0, side == 1u);
    let after = contact(v, normal, kind, params.walls[wall].y);
    take(slot, wall, mass * (v - after), vec3<f32>(0.0));
    return after;
}
