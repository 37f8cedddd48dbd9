// Signed distance programs and contact with rigid surfaces. Twin: src/core/sim/collider/. Positions
// relative to domain.min (m).
//
// uses shared/structs

/// Half step of the normals' central differences, in dx.
const NORMAL_STEP = 0.03125;

/// Velocity relative to the surface after contact; n points out of the surface.
fn contact(v: vec3<f32>, n: vec3<f32>, kind: u32, friction: f32) -> vec3<f32> {
    if (kind == STICKY) {
        return vec3<f32>(0.0);
    }
    let normal = dot(v, n);
    let tangent = v - normal * n;
    if (kind == SLIP) {
        return tangent;
    }
    if (normal >= 0.0) {
        return v;
    }
    // Coulomb: the tangential impulse is at most friction times the normal one.
    let speed = length(tangent);
    let kept = max(0.0, speed + friction * normal);
    return select(vec3<f32>(0.0), tangent * (kept / max(speed, 1e-30)), speed > 0.0);
}

/// Distance to a cone in the half-plane (radius, height): a is radius below, radius above, half
/// height.
fn cone_distance(q: vec2<f32>, a: vec3<f32>) -> f32 {
    let cap = vec2<f32>(q.x - min(q.x, select(a.y, a.x, q.y < 0.0)), abs(q.y) - a.z);
    let down = vec2<f32>(a.x - a.y, -2.0 * a.z);
    let from_top = q - a.yz;
    let side = from_top - down * clamp(dot(from_top, down) / dot(down, down), 0.0, 1.0);
    let away = min(length(cap), length(side));
    return select(away, -away, side.x < 0.0 && cap.y < 0.0);
}

/// Sides of a cell that a sheet fills up, and half its thickness there (spacings).
const SOLID = 0x96u;
const FILLING = 0.8661;

/// The number with the other sign if the lowest bit is 1.
fn turned(x: f32, bit: u32) -> f32 {
    return bitcast<f32>(bitcast<u32>(x) ^ (bit << 31u));
}

/// Distance to a sampled field at a place in units of its samples; a sheet's samples have the sides of
/// their cell's corners in their lowest bits. Twin: DistanceField::distance in
/// src/core/sim/collider/field.rs.
fn grid_distance(at: vec3<f32>, spacing: f32, grid: vec4<u32>, sheet: bool) -> f32 {
    let n = grid.yzw;
    let held = clamp(at, vec3<f32>(0.0), vec3<f32>(n - 1u));
    let index = min(vec3<u32>(held), n - 2u);
    let s = held - vec3<f32>(index);
    let first = grid.x + index.x + n.x * (index.y + n.y * index.z);
    let sides = select(0u, (bitcast<u32>(sdf_samples[first]) & 0x7fu) << 1u, sheet);
    let filled = sides == SOLID;
    var row: array<f32, 4>;
    for (var i = 0u; i < 4u; i++) {
        let at_row = first + n.x * ((i & 1u) + n.y * (i >> 1u));
        let beyond = select(sides >> (2u * i), 0u, filled);
        row[i] = mix(turned(sdf_samples[at_row], beyond), turned(sdf_samples[at_row + 1u], beyond >> 1u), s.x);
    }
    let sum = mix(mix(row[0], row[1], s.y), mix(row[2], row[3], s.y), s.z);
    let value = select(sum, abs(sum) - select(0.0, FILLING * spacing, filled), sheet);
    let away = spacing * length(at - held);
    return select(value, length(vec2<f32>(value, away)), away > 0.0);
}

fn primitive_distance(op: SdfOp, world: vec3<f32>) -> f32 {
    let h = vec4<f32>(world, 1.0);
    let x = vec3<f32>(dot(op.r0, h), dot(op.r1, h), dot(op.r2, h));
    let a = op.size;
    switch (op.code) {
        case 0u: { // box, half extents a
            let q = abs(x) - a;
            return length(max(q, vec3<f32>(0.0))) + min(max(q.x, max(q.y, q.z)), 0.0);
        }
        case 1u: { return length(x) - a.x; } // sphere
        case 2u: { // cylinder, radius and half height
            let q = vec2<f32>(length(x.xy) - a.x, abs(x.z) - a.y);
            return length(max(q, vec2<f32>(0.0))) + min(max(q.x, q.y), 0.0);
        }
        case 3u: { // torus, radii
            return length(vec2<f32>(length(x.xy) - a.x, x.z)) - a.y;
        }
        case 4u: { return x.z; } // half-space
        case 5u: { return length(vec3<f32>(x.xy, x.z - clamp(x.z, -a.y, a.y))) - a.x; } // capsule, radius and half axis
        case 6u: { return cone_distance(vec2<f32>(length(x.xy), x.z), a); } // cone, radii below and above, half height
        default: { return grid_distance(x, a.x, op.grid, op.code == 8u); } // sampled field, distance between samples
    }
}

fn distance_to(collider: Collider, x: vec3<f32>) -> f32 {
    var stack: array<f32, 8>;
    var top = 0u;
    for (var i = collider.first; i < collider.first + collider.count; i++) {
        let op = sdf_ops[i];
        if (op.code < 16u) {
            stack[top] = primitive_distance(op, x);
            top += 1u;
        } else if (op.code == 19u) { // shell
            stack[top - 1u] = max(stack[top - 1u], -(stack[top - 1u] + op.size.x));
        } else {
            top -= 1u;
            let b = stack[top];
            let a = stack[top - 1u];
            // 16 union, 17 intersection, 18 difference
            stack[top - 1u] = select(max(a, select(b, -b, op.code == 18u)), min(a, b), op.code == 16u);
        }
    }
    return stack[0];
}

/// A place in the collider's own coordinates.
fn to_local(pose: Pose, x: vec3<f32>) -> vec3<f32> {
    let h = vec4<f32>(x - vec3<f32>(pose.r0.w, pose.r1.w, pose.r2.w), 0.0);
    return vec3<f32>(dot(pose.r0, h), dot(pose.r1, h), dot(pose.r2, h));
}

/// Outward unit normal at a place in the collider's coordinates, turned into the world; zero where
/// the distance has no slope. By central differences of half step `h` (m).
fn surface_normal(collider: Collider, pose: Pose, local: vec3<f32>, h: f32) -> vec3<f32> {
    // Central differences, in a loop so that the program is compiled once here.
    var gradient = vec3<f32>(0.0);
    for (var i = 0u; i < 6u; i++) {
        let sign = select(-1.0, 1.0, (i & 1u) == 1u);
        let axis = vec3<f32>(vec3<u32>(i >> 1u) == vec3<u32>(0u, 1u, 2u));
        gradient += sign * axis * distance_to(collider, local + (sign * h) * axis);
    }
    let size = length(gradient);
    let n = select(vec3<f32>(0.0), gradient / size, size > 0.0);
    // Columns of the pose's rotation are the rows that are stored.
    return n.x * pose.r0.xyz + n.y * pose.r1.xyz + n.z * pose.r2.xyz;
}

/// Over a step, the secant of the path.
fn surface_velocity(pose: Pose, x: vec3<f32>) -> vec3<f32> {
    let turning = cross(pose.angular.xyz, x - pose.center.xyz);
    return pose.linear.xyz + turning + pose.angular.w * cross(pose.angular.xyz, turning);
}
