// Sides of plates, and what lies beyond them. Formulas and reasons: src/core/sim/side.rs. Positions relative
// to domain.min (m).
//
// uses explicit/layout, shared/distance

const LAYERS = 7u;
/// In dx.
const SIDE_REACH = 4.0;
const SIDE_WAY = 1.0;
const SIDE_FREE = 7.0;
const TOUCHING: f32 = 0.0625;
const TIE: f32 = 0.03125;
/// Most steps of TOUCHING through SIDE_FREE.
const MOST_SIDE_STEPS = 60u;

/// A collider and how far it is; `c` is `params.colliders` if there is none.
struct Nearest { distance: f32, c: u32 }

fn plate_pose(c: u32) -> Pose {
    return poses[(report.step - params.first_step) * params.colliders + c];
}

fn nearest_plate(x: vec3<f32>) -> Nearest {
    var best = Nearest(1e30, params.colliders);
    for (var c = 0u; c < params.colliders; c++) {
        let collider = colliders[c];
        let pose = plate_pose(c);
        if (collider.touches != 0u && pose.linear.w != 0.0) {
            let distance = distance_to(collider, to_local(pose, x));
            if (distance < best.distance) {
                best = Nearest(distance, c);
            }
        }
    }
    return best;
}

/// From a plate to a side.
fn side_direction(layer: u32) -> vec3<f32> {
    let axis = vec3<f32>(vec3<u32>((layer - 1u) / 2u) == vec3<u32>(0u, 1u, 2u));
    return select(-axis, axis, layer % 2u == 1u);
}

/// How far (dx) along a unit vector the way leads out of a plate again that it goes through within `most` dx; -1 if
/// there is none.
fn way_through(x: vec3<f32>, way: vec3<f32>, most: f32) -> f32 {
    var gone = 0.0;
    var entered = false;
    for (var i = 0u; i < MOST_SIDE_STEPS && gone <= most; i++) {
        let distance = nearest_plate(x + (gone * params.dx) * way).distance / params.dx;
        if (distance > TOUCHING && entered) {
            return gone;
        }
        entered = entered || distance <= TOUCHING;
        gone += max(abs(distance), 2.0 * TOUCHING);
    }
    return -1.0;
}
