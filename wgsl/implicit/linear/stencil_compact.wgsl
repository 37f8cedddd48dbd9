// Neighbours of a node under the compact kernel, x slowest: offsets −1..1 on its own grid, then 4³
// on the other one, −1..2 seen from grid 0 (at +¼ dx) and −2..1 from grid 1.

const SLOTS = 91u;
const CENTRE = 13u;

struct Neighbour {
    offset: vec3<i32>,
    // On the other grid of the pair.
    other: bool,
}

// Lowest and highest offset along an axis.
fn reach(grid: i32, other: bool) -> vec2<i32> {
    if (!other) {
        return vec2<i32>(-1, 1);
    }
    return vec2<i32>(-1, 2) - grid;
}

fn neighbour(slot: u32, grid: i32) -> Neighbour {
    if (slot < 27u) {
        return Neighbour(vec3<i32>(vec3<u32>(slot / 9u, slot / 3u % 3u, slot % 3u)) - 1, false);
    }
    let s = slot - 27u;
    return Neighbour(vec3<i32>(vec3<u32>(s / 16u, s / 4u % 4u, s % 4u)) + reach(grid, true).x, true);
}

fn slot_of(offset: vec3<i32>, grid: i32, other: bool) -> u32 {
    let o = vec3<u32>(offset - reach(grid, other).x);
    return select((o.x * 3u + o.y) * 3u + o.z, 27u + (o.x * 4u + o.y) * 4u + o.z, other);
}
