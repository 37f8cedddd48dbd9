// Neighbours of a node under the quadratic kernel: offsets −2..2 on every axis, x slowest.

const SLOTS = 125u;
const CENTRE = 62u;

struct Neighbour {
    offset: vec3<i32>,
    // On the other grid of the pair.
    other: bool,
}

fn neighbour(slot: u32, grid: i32) -> Neighbour {
    return Neighbour(vec3<i32>(vec3<u32>(slot / 25u, slot / 5u % 5u, slot % 5u)) - 2, false);
}

// Lowest and highest offset along an axis.
fn reach(grid: i32, other: bool) -> vec2<i32> {
    return vec2<i32>(-2, 2);
}

fn slot_of(offset: vec3<i32>, grid: i32, other: bool) -> u32 {
    let o = vec3<u32>(offset + 2);
    return (o.x * 5u + o.y) * 5u + o.z;
}
