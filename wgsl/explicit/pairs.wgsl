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
const REACH = 2;
const WINDOW = 5u;

/// What the masses of a field say of its surface at a node: ∇ ln s (1/cell), how flat it is, and the node's
/// mass over the most along each axis.
struct Face { slope: vec3<f32>, flatness: f32, filled: vec3<f32> }

/// By offset, which node of a window stands for those that a wall cuts, by axis, and what its mass counts for.
struct StandIns { step: array<vec3<i32>, WINDOW>, scale: array<vec3<f32>, WINDOW> }

fn stand_ins(n: vec3<i32>, grid: u32) -> StandIns {
    var out: StandIns;
    let x = vec3<f32>(n) + vec3<f32>(node_offset(grid));
    let own = inside_walls(x);
    for (var k = 0u; k < WINDOW; k++) {
        for (var a = 0u; a < 3u; a++) {
            var step = i32(k) - REACH;
            var scale = 1.0;
            for (; step != 0; step -= sign(step)) {
                let share = inside_walls(x + f32(step))[a];
                if (share >= LEAST_ROOM) {
                    scale = own[a] / share;
                    break;
                }
            }
            out.step[k][a] = step;
            out.scale[k][a] = scale;
        }
    }
    return out;
}

fn share_at(field: u32, n: vec3<i32>, grid: u32, offset: vec3<i32>, cut: ptr<function, StandIns>) -> f32 {
    let k = offset + vec3<i32>(REACH);
    let step = vec3<i32>((*cut).step[k.x].x, (*cut).step[k.y].y, (*cut).step[k.z].z);
    let scale = (*cut).scale[k.x].x * (*cut).scale[k.y].y * (*cut).scale[k.z].z;
    let at = place_of(field * layer_size(), n + step, grid);
    if (at == NOWHERE) {
        return 0.0;
    }
    return f32(grid_in[at]) * scale / (params.mass_scale * params.contacts[field].z);
}

fn unit(a: u32) -> vec3<i32> {
    return vec3<i32>(vec3<u32>(0u, 1u, 2u) == vec3<u32>(a));
}

fn face(field: u32, n: vec3<i32>, grid: u32, cut: ptr<function, StandIns>) -> Face {
    var out: Face;
    let here = share_at(field, n, grid, vec3<i32>(0), cut);
    var sum = vec3<f32>(0.0);
    var total = 0.0;
    for (var k = 0u; k < 27u; k++) {
        let o = neighbour(k);
        var g: vec3<f32>;
        for (var a = 0u; a < 3u; a++) {
            let low = share_at(field, n, grid, o - unit(a), cut);
            let high = share_at(field, n, grid, o + unit(a), cut);
            g[a] = 0.5 * (high - low);
            if (k == 13u) {
                out.filled[a] = here / max(here, max(low, high));
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
    var along = select(0u, 1u, s.y > s.x);
    along = select(along, 2u, s.z > s[along]);
    let size = length(n);
    if (a.filled[along] + b.filled[along] < FULL || size == 0.0) {
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

fn meet(n: vec3<i32>, grid: u32) {
    var places: array<u32, MOST_FIELDS>;
    var faces: array<Face, MOST_FIELDS>;
    var held = 0u;
    var volume = 0;
    for (var f = 0u; f < params.fields; f++) {
        places[f] = place_of(f * layer_size(), n, grid);
        if (places[f] == NOWHERE) {
            continue;
        }
        if (params.fills == FILLS_VOLUME) {
            volume += grid_in[places[f] + FILLED];
        }
        if (grid_in[places[f]] > 0) {
            held += 1u;
        }
    }
    if (params.fills == FILLS_VOLUME) {
        for (var f = 0u; f < params.fields; f++) {
            if (places[f] != NOWHERE) {
                grid_in[places[f] + FILLED] = volume;
            }
        }
    }
    if (held < 2u) {
        return;
    }
    var cut = stand_ins(n, grid);
    for (var f = 0u; f < params.fields; f++) {
        if (places[f] != NOWHERE && grid_in[places[f]] <= 0) {
            places[f] = NOWHERE;
        }
        if (places[f] != NOWHERE) {
            faces[f] = face(f, n, grid, &cut);
        }
    }
    for (var a = 0u; a < params.fields; a++) {
        for (var b = a + 1u; b < params.fields; b++) {
            if (places[a] == NOWHERE || places[b] == NOWHERE) {
                continue;
            }
            let normal = pair_normal(faces[a], faces[b]);
            if (any(normal != vec3<f32>(0.0))) {
                exchange(places[a], places[b], between(a, b), normal);
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
    if (slot >= report.groups[GROUPS_BLOCKS_IN]) {
        return;
    }
    let block = blocks_in[slot + 1u];
    let field = layer(block) / layer_size();
    for (var f = 0u; f < field; f++) {
        if (table_in[block - (field - f) * layer_size()] != 0u) {
            return;
        }
    }
    let corner = 4 * block_coordinates(block) - params.pad;
    let n = corner + vec3<i32>(vec3<u32>(lane & 3u, (lane >> 2u) & 3u, lane >> 4u));
    for (var grid = 0u; grid < GRIDS; grid++) {
        meet(n, grid);
    }
}
