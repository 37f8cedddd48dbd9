//! What a surface does to the velocity of a grid node that it touches.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::maths::linalg::{Vector, dot};
use crate::maths::real::Real;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ContactKind {
    /// The material takes the surface's velocity.
    Sticky,
    /// Free along the surface, held to it along the normal.
    Slip,
    /// Free to leave along the normal; Coulomb friction while pressed.
    Separate,
}

/// What a surface does to the material that meets it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    pub kind: ContactKind,
    /// Coulomb friction coefficient; 0 unless `kind` is `Separate`.
    pub friction: f64,
}

/// The velocity after contact with a surface of unit normal `n` (into the material) that moves at
/// velocity `surface`.
///
/// Sticky: the surface's velocity. Slip: the relative velocity loses its normal part. Separate:
/// only an inward normal part is removed, and Coulomb friction removes up to μ times as much of the
/// tangential part.
#[inline]
pub fn respond<T: Real, const D: usize>(
    contact: &Contact,
    v: &Vector<T, D>,
    n: &Vector<T, D>,
    surface: &Vector<T, D>,
) -> Vector<T, D> {
    let mut relative = *v;
    for a in 0..D {
        relative[a] -= surface[a];
    }
    let normal = dot(&relative, n);
    match contact.kind {
        ContactKind::Sticky => return *surface,
        ContactKind::Separate if normal >= T::ZERO => return *v,
        ContactKind::Slip | ContactKind::Separate => {}
    }
    for a in 0..D {
        relative[a] -= normal * n[a];
    }
    if contact.friction > 0.0 {
        let speed = dot(&relative, &relative).sqrt();
        let loss = T::from_f64(contact.friction) * -normal;
        let kept = if loss < speed { T::ONE - loss / speed } else { T::ZERO };
        relative = relative.map(|r| r * kept);
    }
    for a in 0..D {
        relative[a] += surface[a];
    }
    relative
}

/// The velocity of a node beside a sticky wall. `v` and `mass` are of the node and of its mirror
/// image on the other side of the wall's plane.
///
/// Beside such a wall a smooth velocity field is odd about the plane. So the two nodes take opposite
/// velocities, those that are nearest in kinetic energy: what they make of the velocity at the
/// plane, v + v', is taken from both by the same impulse. Linear fields stay as they are. Nodes that
/// are held one by one make a kink of them, and lose momentum to it in every step ("Walls" in
/// docs/NUMERICS.md).
#[inline]
pub fn stick_mirrored<T: Real, const D: usize>(v: [&Vector<T, D>; 2], mass: [T; 2]) -> Vector<T, D> {
    let total = mass[0] + mass[1];
    let mut out = *v[0];
    for a in 0..D {
        out[a] = (mass[0] * v[0][a] - mass[1] * v[1][a]) / total;
    }
    out
}

/// Nodes whose index is less than this from a wall's may have a mirror image that particles touch.
/// Twin: `NEAR_WALL` in wgsl/explicit/walls.wgsl.
const NEAR_WALL: i32 = 4;

/// The wall of an axis that a node is near, 0 the lower, 1 the upper, and the index of the node's
/// mirror image; the walls' planes are at 0 and `cells`. A node of grid s = ±1 of the compact
/// kernel, at i + s/4, has its image on the other grid.
#[inline]
pub fn mirrored(node: i32, cells: i32) -> Option<(usize, i32)> {
    if node.abs() < NEAR_WALL && 2 * node < cells {
        Some((0, -node))
    } else if (cells - node).abs() < NEAR_WALL {
        Some((1, 2 * cells - node))
    } else {
        None
    }
}

/// Which wall of an axis holds a node, one by one: 0 the lower, 1 the upper. The walls' planes are at
/// node indices 0 and `cells`.
///
/// On a single grid, the wall nodes are those on or beyond the plane. The compact kernel's node i
/// is a pair at i ± ¼ dx, and both belong to the wall if i does. If the nearer node of the pair
/// were left free, a body's outermost particles would be held by only one of the two grids. They
/// would slip through the wall slowly and lose their energy to it. (A jelly cube landing on a
/// sticky floor kept 6 % of its energy after 60 ms instead of 77 %; with the quadratic kernel it
/// keeps 73 %.)
#[inline]
pub fn wall_side(node: i32, cells: i32) -> Option<usize> {
    if node <= 0 {
        Some(0)
    } else if node >= cells {
        Some(1)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(kind: ContactKind, friction: f64, v: [f64; 3], surface: [f64; 3]) -> [f64; 3] {
        respond(&Contact { kind, friction }, &v, &[0.0, 0.0, 1.0], &surface)
    }

    #[test]
    fn each_contact_does_what_it_says() {
        use ContactKind::*;
        let (down, up, moving) = ([3.0, 4.0, -2.0], [3.0, 4.0, 2.0], [1.0, 0.0, 0.5]);
        assert_eq!(after(Sticky, 0.0, down, moving), moving);
        assert_eq!(after(Slip, 0.0, down, [0.0; 3]), [3.0, 4.0, 0.0]);
        assert_eq!(after(Slip, 0.0, up, moving), [3.0, 4.0, 0.5]);
        assert_eq!(after(Separate, 0.3, up, [0.0; 3]), up);
        assert_eq!(after(Separate, 0.0, down, [0.0; 3]), [3.0, 4.0, 0.0]);
        // The normal part of 2 is removed; friction 0.5 takes 1 of the tangential speed of 5.
        let slowed = after(Separate, 0.5, down, [0.0; 3]);
        assert!((slowed[0] - 2.4).abs() < 1e-15 && (slowed[1] - 3.2).abs() < 1e-15 && slowed[2] == 0.0);
        // Enough friction to stick.
        assert_eq!(after(Separate, 3.0, down, [0.0; 3]), [0.0; 3]);
        assert_eq!(after(Separate, 9.0, down, moving), moving);
    }

    #[test]
    fn wall_nodes_have_their_index_on_or_beyond_the_plane() {
        assert_eq!([-1, 0, 1, 7, 8, 9].map(|i| wall_side(i, 8)), [Some(0), Some(0), None, None, Some(1), Some(1)]);
    }

    #[test]
    fn images_lie_as_far_behind_the_plane() {
        let images = [-4, -3, 0, 1, 3, 4, 7, 10, 11, 12].map(|i| mirrored(i, 10));
        let lower = |image| Some((0, image));
        let upper = |image| Some((1, image));
        let expected = [None, lower(3), lower(0), lower(-1), lower(-3), None, upper(13), upper(10), upper(9), upper(8)];
        assert_eq!(images, expected);
    }

    #[test]
    fn images_take_opposite_velocities_and_lose_the_least_energy() {
        let (v, u, m, n) = ([1.0, -2.0, 0.5], [0.3, 1.0, 4.0], 3.0, 0.5);
        let after = stick_mirrored([&v, &u], [m, n]);
        assert_eq!(stick_mirrored([&u, &v], [n, m]), after.map(|c| -c));
        // Both get the same impulse.
        for a in 0..3 {
            assert!((m * (after[a] - v[a]) - n * (-after[a] - u[a])).abs() < 1e-14);
        }
        // An odd field stays.
        assert_eq!(stick_mirrored([&v, &v.map(|c| -c)], [m, n]), v);
    }
}
