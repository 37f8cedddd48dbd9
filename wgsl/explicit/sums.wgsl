// A particle's share in the sums of nodes: integers whose total is right to the unit.
//
// Shares are rounded to 22 bits of the particle's largest, or to units where those are coarser: added to a large
// enough number, a value has its integer in the last bits of the mantissa. What then lacks from the total goes to
// the nearest node. The total of the momentum is rounded up or down at random (`dither`): with plain rounding, a
// lattice of particles that all round alike would drift by a share of a unit in every step.
//
// uses explicit/tile

/// What turns numbers of at most 2²² steps into units: a step is 2^k units.
struct Rounding {
    high: f32,    // 1.5 · 2^(23 + k): a number added to it is one of whole steps
    step: i32,    // units
    origin: i32,  // minus the bits of `high`, in units
}

/// Of numbers up to `most` (units) in magnitude.
fn rounding(most: f32) -> Rounding {
    // 2^22 ≤ most / 2^k; the bits of 2^22 are 149 << 23.
    let power = max((bitcast<i32>(most) >> 23u) - 148, 0);
    let bits = (150 + power) * 8388608 + 4194304;
    let step = i32(1u << u32(power));
    return Rounding(bitcast<f32>(bits), step, -bits * step);
}

/// Whole units; `wide`: the number after `high` was added.
fn units_of(wide: f32, r: Rounding) -> i32 {
    return bitcast<i32>(wide) * r.step + r.origin;
}

struct Roundings { momentum: Rounding, mass: Rounding, volume: Rounding }

/// What has been given so far (units).
struct Given { momentum: vec3<i32>, mass: i32, volume: i32 }

fn add_units(at: u32, units: Given) {
    atomicAdd(&sum_tile[at], units.mass);
    atomicAdd(&sum_tile[at + SUM_NODES], units.momentum.x);
    atomicAdd(&sum_tile[at + 2u * SUM_NODES], units.momentum.y);
    atomicAdd(&sum_tile[at + 3u * SUM_NODES], units.momentum.z);
    if (FILLS == FILLS_VOLUME) {
        atomicAdd(&volume_tile[at], units.volume);
    }
}

/// Adds to a node's sums: momentum and mass of a unit weight, the weight, what else the momentum gets, and the
/// volume of a unit weight, all in units.
fn add_to_node(at: u32, value: vec4<f32>, weight: f32, more: vec3<f32>, volume: f32, r: Roundings,
    given: ptr<function, Given>) {
    var units: Given;
    var wide = value.xyz * weight + r.momentum.high;
    if (!MLS) {
        wide = (value.xyz * weight + more) + r.momentum.high;
    }
    units.momentum = vec3<i32>(units_of(wide.x, r.momentum), units_of(wide.y, r.momentum), units_of(wide.z, r.momentum));
    units.mass = units_of(value.w * weight + r.mass.high, r.mass);
    (*given).momentum += units.momentum;
    (*given).mass += units.mass;
    if (FILLS == FILLS_VOLUME) {
        units.volume = units_of(volume * weight + r.volume.high, r.volume);
        (*given).volume += units.volume;
    }
    add_units(at, units);
}

/// Three values in [-½, ½) from a particle's id and the step (PCG hash, Jarzynski & Olano 2020).
fn dither(id: u32) -> vec3<f32> {
    let state = (id ^ (report.index * 0x9e3779b9u)) * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    let h = (word >> 22u) ^ word;
    return vec3<f32>((vec3<u32>(h) >> vec3<u32>(0u, 8u, 16u)) & vec3<u32>(255u)) * (1.0 / 256.0) - 0.498046875;
}

/// What lacks from a particle's total, of momentum and mass and of the volume, goes to its nearest node.
fn settle(at: u32, id: u32, total: vec4<f32>, volume: f32, given: Given) {
    let due = vec4<i32>(round(total + vec4<f32>(dither(id), 0.0)));
    var missing = Given(due.xyz - given.momentum, due.w - given.mass, 0);
    if (FILLS == FILLS_VOLUME) {
        missing.volume = i32(round(volume)) - given.volume;
    }
    add_units(at, missing);
}
