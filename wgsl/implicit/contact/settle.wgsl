// The end of a step for particles near faces: none has gone through one, and all remember what they hold
// on to. Twin: src/engine/implicit/physics/contact/settling.rs.
// In: particles that g2p has moved. Out: the same; in `press`, what faces took (N s).
// One lane a particle and face; that of a particle's first face does all of it.
//
// uses implicit/contact/place, implicit/contact/links, implicit/put

/// Distance, in spacings, at which a slip face loses what it holds.
const LOST = 2.0;

@compute @workgroup_size(LANES)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let first = item(group, groups, lane);
    if (first >= params.links) {
        return;
    }
    let p = links[first].particle;
    if (first > 0u && links[first - 1u].particle == p) {
        return;
    }
    var end = first + 1u;
    while (end < params.links && links[end].particle == p) {
        end++;
    }
    let body = bodies[links[first].body];
    let begun = start_of(p);
    let start = memory_of(p);
    let v = vec3<f32>(state_in[p], state_in[params.room + p], state_in[2u * params.room + p]);
    let way = params.dt * v;
    for (var l = first; l < end; l++) {
        let c = links[l].collider;
        let place = place_at(c, begun, way, start, body);
        store_force(l, -params.dt * response(hold_of(c, start.holds), body.stiffness, place, links[l].limit).force);
    }
    let stop = stopped(first, end, begun.x, way, v, body);
    if (any(stop.way != way)) {
        if (!put(p, tag[p].x, offset_of(p) + stop.way / params.dx)) {
            return;
        }
        state_in[p] = stop.v.x;
        state_in[params.room + p] = stop.v.y;
        state_in[2u * params.room + p] = stop.v.z;
    }
    remember(p, remembered(first, end, begun, stop.way, start, body));
}

struct Stop { way: vec3<f32>, v: vec3<f32> }

/// Where a particle that would go a way (m) from `x` with `v` (m/s) does go, and how fast: not through
/// faces. Notes what they take.
fn stopped(first: u32, end: u32, x: vec3<f32>, way_in: vec3<f32>, v_in: vec3<f32>, body: Body) -> Stop {
    let least = STANDOFF * body.spacing;
    var out = Stop(way_in, v_in);
    var halted = false;
    for (var i = 0u; i < 2u * (end - first); i++) {
        // What slides along a face may slide through a sheet, which has no inside to come back from.
        let again = i >= end - first;
        let l = first + select(i, i - (end - first), again);
        let c = links[l].collider;
        let collider = colliders[c];
        if (again && !(halted && collider.touches == SHEET)) {
            continue;
        }
        let start = to_local(pose_at(c, 0u), x);
        let by = relative(c, x, out.way);
        let share = meets(collider, start, start + local_way(c, by), select(least, AGAIN * least, again));
        if (share > 1.0) {
            continue;
        }
        if (again) {
            out.way += (share - 1.0) * by;
            continue;
        }
        halted = true;
        let at = start + share * local_way(c, by);
        let there = normal_at(c, at, distance_to(collider, at));
        var kept = by - min((1.0 - share) * dot(by, there), 0.0) * there;
        if (distance_to(collider, start + local_way(c, kept)) < 0.25 * least) {
            kept = share * by;
        }
        out.way += kept - by;
        let final_ = start + local_way(c, kept);
        let n = normal_at(c, final_, distance_to(collider, final_));
        let inward = min(dot(out.v - surface_velocity(pose_at(c, 0u), x), n), 0.0) * n;
        out.v -= inward;
        store_force(l, force_of(l) + body.mass * inward);
    }
    return out;
}

/// What a particle that ends a way (m) from where it began remembers.
fn remembered(first: u32, end: u32, begun: Start, way: vec3<f32>, start: Memory, body: Body) -> Memory {
    var memory = start;
    if (start.holds != 0u) {
        memory = untouched(body);
        for (var l = first; l < end; l++) {
            let c = links[l].collider;
            if (start.holds == c + 1u) {
                memory = kept(place_at(c, begun, way, start, body), c, start, body);
            }
        }
    }
    let free = memory;
    var nearest = body.spacing;
    for (var l = first; l < end; l++) {
        let c = links[l].collider;
        if (memory.holds == 0u) {
            memory = taken_up(place_at(c, begun, way, free, body), c, free);
        }
        let there = to_local(pose_at(c, 0u), begun.x) + local_way(c, relative(c, begun.x, way));
        nearest = min(nearest, distance_to(colliders[c], there));
    }
    if (memory.holds == 0u) {
        // What was cut off of its radius grows again where it leaves.
        memory.radius = max(memory.radius, min(nearest, 0.5 * body.spacing));
    }
    return memory;
}

/// What becomes of a particle's hold on a face.
fn kept(place: Place, c: u32, start: Memory, body: Body) -> Memory {
    let hold = hold_of(c, start.holds);
    var memory = start;
    if (hold == RAIL) {
        if (place.gap > LOST * body.spacing) {
            memory = untouched(body);
        }
    } else if (hold == BOND) {
        memory.stretch = place.stretch;
    } else if (place.gap >= 0.0) {
        memory = Memory(start.radius, vec3<f32>(0.0), 0u);
    } else {
        memory.stretch = slid(place, c);
    }
    return memory;
}

/// What a particle that holds on to nothing remembers of a face.
fn taken_up(place: Place, c: u32, free: Memory) -> Memory {
    if (place.gap >= 0.0) {
        return free;
    }
    if (colliders[c].kind == STICKY) {
        return Memory(free.radius, along(place) + place.gap * place.normal, c + 1u);
    }
    return Memory(free.radius, slid(place, c), c + 1u);
}

/// The stretch along a face where it may slide: no longer than friction stretches its spring.
fn slid(place: Place, c: u32) -> vec3<f32> {
    let t = along(place);
    let size = length(t);
    let most = colliders[c].friction * max(-place.gap, 0.0);
    return select(t, t * (most / size), size > most);
}
