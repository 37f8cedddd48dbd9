// Bodies that meet at nodes: where two fields have mass, each pair exchanges an impulse, before gravity and
// surfaces act. Formulas and reasons: src/engine/explicit/cpu/pairs.rs, src/core/sim/pair.rs.
// In: fixed-point mass, momentum and rest volume. Out: momenta after contact; rest volumes of all fields
// together. What one body takes the other gives, to the unit.
// One workgroup an active block, that of the lowest field where several are: a lane reads and writes the
// nodes of all fields at its place. Of other places it reads masses, which nobody writes.
//
// uses explicit/node, explicit/room, shared/distance

const FULL = 0.9;
const EDGE = 1e-4;
const LEAST_ROOM = 0.25;

/// What the masses of a field say of its surface at a node: ∇ ln s (1/cell), how flat it is, and the node's
/// mass over the most along each axis.
struct Face { slope: vec3<f32>, flatness: f32, filled: vec3<f32> }

/// The mass of a field's node at an offset from `n`, as a share of the full node. For a node that a wall cuts off, the
/// next one towards `n` stands, with what of it is inside. `own`: shares of the room of `n` inside walls.
fn share_at(field: u32, n: vec3<i32>, grid: u32, offset: vec3<i32>, own: vec3<f32>) -> f32 {
    let x = vec3<f32>(n) + vec3<f32>(node_offset(grid));
    var step = offset;
    var scale = 1.0;
    for (var a = 0u; a < 3u; a++) {
        let along = unit(a);
        for (var tries = 0u; tries < 2u; tries++) {
            let s = dot(step, along);
            let share = dot(inside_walls(x + f32(s)), vec3<f32>(along));
            if (s != 0 && share < LEAST_ROOM) {
                step -= select(1, -1, s < 0) * along;
            }
        }
        let s = dot(step, along);
        if (s != 0) {
            scale *= dot(own, vec3<f32>(along)) / dot(inside_walls(x + f32(s)), vec3<f32>(along));
        }
    }
    let at = place_of(field * layer_size(), n + step, grid);
    if (at == NOWHERE) {
        return 0.0;
    }
    return f32(grid_in[at]) * scale / (params.mass_scale * params.contacts[field].z);
}

fn unit(a: u32) -> vec3<i32> {
    return vec3<i32>(vec3<u32>(0u, 1u, 2u) == vec3<u32>(a));
}

fn face(field: u32, n: vec3<i32>, grid: u32) -> Face {
    var out: Face;
    let own = inside_walls(vec3<f32>(n) + vec3<f32>(node_offset(grid)));
    let here = share_at(field, n, grid, vec3<i32>(0), own);
    var sum = vec3<f32>(0.0);
    var total = 0.0;
    for (var k = 0u; k < 27u; k++) {
        let o = neighbour(k);
        var g = vec3<f32>(0.0);
        for (var a = 0u; a < 3u; a++) {
            let along = unit(a);
            let low = share_at(field, n, grid, o - along, own);
            let high = share_at(field, n, grid, o + along, own);
            g += 0.5 * (high - low) * vec3<f32>(along);
            if (k == 13u) {
                out.filled += here / max(here, max(low, high)) * vec3<f32>(along);
            }
        }
        sum += g;
        total += length(g);
        if (k == 13u) {
            out.slope = g / here;
        }
    }
    if (total > 0.0) {
        out.flatness = length(sum) / total;
    }
    return out;
}

fn weight(face: Face) -> f32 {
    var f = face.flatness;
    for (var k = 0u; k < 7u; k++) {
        f *= f;
    }
    return f + EDGE;
}

/// The normal towards the first of two faces; zero if they do not touch.
fn pair_normal(a: Face, b: Face) -> vec3<f32> {
    let n = weight(a) * a.slope - weight(b) * b.slope;
    let s = abs(n);
    let filled = a.filled + b.filled;
    let across = select(filled.x, filled.y, s.y > s.x);
    let size = length(n);
    if (select(across, filled.z, s.z > max(s.x, s.y)) < FULL || size == 0.0) {
        return vec3<f32>(0.0);
    }
    return n / size;
}

/// Contact of field `a` with field `b` > `a`: where both have one, that which holds less.
fn between(a: u32, b: u32) -> vec2<f32> {
    let mine = params.contacts[b].xy;
    if (a == 0u) {
        return mine;
    }
    let other = params.contacts[a].xy;
    return vec2<f32>(select(mine.x, other.x, u32(mine.x) == SLIP), min(mine.y, other.y));
}

fn momentum(at: u32) -> vec3<i32> {
    return vec3<i32>(grid_in[at + CHANNEL], grid_in[at + 2u * CHANNEL], grid_in[at + 3u * CHANNEL]);
}

fn put_momentum(at: u32, p: vec3<i32>) {
    grid_in[at + CHANNEL] = p.x;
    grid_in[at + 2u * CHANNEL] = p.y;
    grid_in[at + 3u * CHANNEL] = p.z;
}

/// The impulse that the node at `a` takes from that at `b`, in units of momentum.
fn exchange(a: u32, b: u32, how: vec2<f32>, n: vec3<f32>) {
    let m = f32(grid_in[a]);
    let w = f32(grid_in[b]);
    let relative = vec3<f32>(momentum(a)) / m - vec3<f32>(momentum(b)) / w;
    let after = contact(relative, n, u32(how.x), how.y);
    let impulse = vec3<i32>(round((m * w / (m + w)) * (after - relative)));
    put_momentum(a, momentum(a) + impulse);
    put_momentum(b, momentum(b) - impulse);
}

/// Where a field's node is, if it has mass, or NOWHERE.
fn held_at(field: u32, n: vec3<i32>, grid: u32) -> u32 {
    let at = place_of(field * layer_size(), n, grid);
    return select(NOWHERE, at, at != NOWHERE && grid_in[min(at, arrayLength(&grid_in) - 1u)] > 0);
}

fn meet(n: vec3<i32>, grid: u32) {
    if (FILLS == FILLS_VOLUME) {
        var volume = 0;
        for (var f = 0u; f < params.fields; f++) {
            let at = place_of(f * layer_size(), n, grid);
            if (at != NOWHERE) {
                volume += grid_in[at + FILLED];
            }
        }
        for (var f = 0u; f < params.fields; f++) {
            let at = place_of(f * layer_size(), n, grid);
            if (at != NOWHERE) {
                grid_in[at + FILLED] = volume;
            }
        }
    }
    for (var a = 0u; a < params.fields; a++) {
        let here = held_at(a, n, grid);
        if (here == NOWHERE) {
            continue;
        }
        var mine: Face;
        var known = false;
        for (var b = a + 1u; b < params.fields; b++) {
            let there = held_at(b, n, grid);
            if (there == NOWHERE) {
                continue;
            }
            if (!known) {
                mine = face(a, n, grid);
                known = true;
            }
            let normal = pair_normal(mine, face(b, n, grid));
            if (any(normal != vec3<f32>(0.0))) {
                exchange(here, there, between(a, b), normal);
            }
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
    let field = layer(block) / layer_size();
    for (var f = 0u; f < field; f++) {
        if (slot_in(block - (field - f) * layer_size()) != 0u) {
            return;
        }
    }
    let corner = 4 * block_coordinates(block) - params.pad;
    let n = corner + vec3<i32>(vec3<u32>(lane & 3u, (lane >> 2u) & 3u, lane >> 4u));
    for (var grid = 0u; grid < GRIDS; grid++) {
        meet(n, grid);
    }
}
