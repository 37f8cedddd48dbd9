// What surfaces take from the material: sums of impulses and their moments. Twin:
// src/core/sim/reaction.rs.
//
// 64-bit integers in two words, so that the order of additions does not matter. A workgroup adds up
// the first surfaces in its own memory and flushes once; which replica it flushes to spreads the
// traffic, and the host adds the replicas up.
//
// uses explicit/layout

/// Units of a sum per fixed-point unit of momentum; arms are in cells.
const REACTION_UNITS = 64.0;
const REPLICAS = 16u;
const WALLS = 6u;
/// Surfaces that are summed in workgroup memory.
const SHARED_SURFACES = 16u;

var<workgroup> taken: array<atomic<u32>, 192>;

struct Wide { low: u32, high: u32 }

/// A rounded value as two's complement. Exact: a f32 has 24 bits.
fn wide(x: f32) -> Wide {
    let a = abs(round(x));
    let high = floor(a * (1.0 / 4294967296.0));
    let w = Wide(u32(a - high * 4294967296.0), u32(high));
    if (x >= 0.0) {
        return w;
    }
    let low = ~w.low + 1u;
    return Wide(low, ~w.high + select(0u, 1u, low == 0u));
}

/// What has to be added to the high word after the low word was.
fn carried(w: Wide, old_low: u32) -> u32 {
    return w.high + select(0u, 1u, old_low + w.low < old_low);
}

fn add_globally(at: u32, w: Wide) {
    let high = carried(w, atomicAdd(&reactions[2u * at], w.low));
    if (high != 0u) {
        atomicAdd(&reactions[2u * at + 1u], high);
    }
}

/// First sum of a replica.
fn replica(slot: u32) -> u32 {
    return (slot % REPLICAS) * 6u * (WALLS + params.colliders);
}

fn add_sum(slot: u32, sum: u32, x: f32) {
    let w = wide(x);
    if ((w.low | w.high) == 0u) {
        return;
    }
    if (sum >= 6u * SHARED_SURFACES) {
        add_globally(replica(slot) + sum, w);
        return;
    }
    let high = carried(w, atomicAdd(&taken[2u * sum], w.low));
    if (high != 0u) {
        atomicAdd(&taken[2u * sum + 1u], high);
    }
}

/// Books the impulse (fixed-point momentum) that a surface takes at an arm (cells).
fn take(slot: u32, surface: u32, impulse: vec3<f32>, arm: vec3<f32>) {
    let j = impulse * REACTION_UNITS;
    let moment = cross(arm, j);
    for (var k = 0u; k < 3u; k++) {
        add_sum(slot, 6u * surface + k, j[k]);
        add_sum(slot, 6u * surface + 3u + k, moment[k]);
    }
}

/// Zeroes the workgroup's sums. A barrier must follow.
fn open_reactions(lane: u32) {
    for (var i = lane; i < 12u * SHARED_SURFACES; i += 64u) {
        atomicStore(&taken[i], 0u);
    }
}

/// Adds the workgroup's sums to a replica. A barrier must come before.
fn flush_reactions(slot: u32, lane: u32) {
    for (var i = lane; i < 6u * min(SHARED_SURFACES, WALLS + params.colliders); i += 64u) {
        let w = Wide(atomicLoad(&taken[2u * i]), atomicLoad(&taken[2u * i + 1u]));
        if ((w.low | w.high) != 0u) {
            add_globally(replica(slot) + i, w);
        }
    }
}
