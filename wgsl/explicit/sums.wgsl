// A particle's share in the sums of nodes: integers whose total is right to half a unit.
//
// The rounding error of a node's share is carried over to the particle's next node; what lacks from the total at the
// end, because Σ w = 1 holds only to rounding, goes to the nearest one. The total of the momentum is rounded up or
// down at random (`dither`): with plain rounding, a lattice of particles that all round alike would drift by a share
// of a unit in every step. Without the carry, what far nodes get, often less than half a unit, would be lost to the
// angular momentum.
//
// uses explicit/tile

/// Rounding errors that the next node gets, of momentum and mass, and of the volume; and what nodes got (units).
struct Carry { value: vec4<f32>, volume: f32, given: vec4<i32>, given_volume: i32 }

/// Three values in [-½, ½) from a hash of particle and step (PCG, Jarzynski & Olano 2020).
fn dither(id: u32) -> vec3<f32> {
    let state = (id ^ ((params.steps + report.step) * 0x9e3779b9u)) * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    let h = (word >> 22u) ^ word;
    return vec3<f32>((vec3<u32>(h) >> vec3<u32>(0u, 8u, 16u)) & vec3<u32>(255u)) * (1.0 / 256.0) - 0.498046875;
}

fn add_units(at: u32, units: vec4<i32>, volume: i32) {
    atomicAdd(&sum_tile[at], units.w);
    atomicAdd(&sum_tile[at + SUM_NODES], units.x);
    atomicAdd(&sum_tile[at + 2u * SUM_NODES], units.y);
    atomicAdd(&sum_tile[at + 3u * SUM_NODES], units.z);
    if (FILLS == FILLS_VOLUME) {
        atomicAdd(&volume_tile[at], volume);
    }
}

/// Adds to a node's sums: momentum and mass of a unit weight, the weight, what else the momentum gets, and the
/// volume of a unit weight, all in units.
fn add_to_node(at: u32, value: vec4<f32>, weight: f32, more: vec3<f32>, volume: f32, carry: ptr<function, Carry>) {
    var wanted = value * weight + (*carry).value;
    if (!MLS) {
        wanted += vec4<f32>(more, 0.0);
    }
    let rounded = round(wanted);
    (*carry).value = wanted - rounded;
    let units = vec4<i32>(rounded);
    (*carry).given += units;
    var whole = 0;
    if (FILLS == FILLS_VOLUME) {
        let wanted_volume = volume * weight + (*carry).volume;
        let rounded_volume = round(wanted_volume);
        (*carry).volume = wanted_volume - rounded_volume;
        whole = i32(rounded_volume);
        (*carry).given_volume += whole;
    }
    add_units(at, units, whole);
}

/// Gives a node what lacks from a particle's total, of momentum and mass and of the volume.
fn settle(at: u32, id: u32, total: vec4<f32>, volume: f32, carry: Carry) {
    let due = vec4<i32>(round(total + vec4<f32>(dither(id), 0.0)));
    var lacking = 0;
    if (FILLS == FILLS_VOLUME) {
        lacking = i32(round(volume)) - carry.given_volume;
    }
    add_units(at, due - carry.given, lacking);
}
