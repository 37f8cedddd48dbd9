//! Contact between bodies: which nodes a body moves with, and what two bodies do to each other where
//! both have nodes.
//!
//! Bodies without contact of their own share their nodes: field 0. They have one velocity there, and
//! stick. A body with contact has nodes to itself, a field of its own.

use super::contact::{Contact, ContactKind, respond};
use super::setup::{Body, Setup};
use crate::maths::linalg::Vector;
use crate::maths::real::Real;

/// Most bodies with contact of their own. Twin: `MOST_FIELDS` in wgsl/explicit/layout.wgsl, one more.
pub const MOST: usize = 8;

/// How much of a node two bodies must fill together before they are in contact there. They have nodes in
/// common while they are up to two or three cells apart; with those alone to tell, they would hover.
/// Twin: as the next ones, in wgsl/explicit/pairs.wgsl.
pub const FULL: f64 = 0.9;

/// What an edge counts for beside a face, 1, in the normal of a pair.
pub const EDGE: f64 = 1e-4;

/// Share of a node's room inside walls below which its mass tells nothing.
pub const LEAST_ROOM: f64 = 0.25;

/// The contact of a body that has one. Sticky contact is what bodies have that have none.
pub fn own(body: &Body) -> Option<Contact> {
    body.contact.filter(|contact| contact.kind != ContactKind::Sticky)
}

/// The field of each body.
pub fn fields(setup: &Setup) -> Vec<usize> {
    let mut last = 0;
    let field = |body| {
        own(body).map_or(0, |_| {
            last += 1;
            last
        })
    };
    setup.bodies.iter().map(field).collect()
}

/// Whether some body has a field of its own.
pub fn is_parted(setup: &Setup) -> bool {
    setup.bodies.iter().any(|body| own(body).is_some())
}

/// The contact of each field; that of field 0 is never looked at.
pub fn contacts(setup: &Setup) -> Vec<Contact> {
    let none = Contact { kind: ContactKind::Sticky, friction: 0.0 };
    std::iter::once(none).chain(setup.bodies.iter().filter_map(own)).collect()
}

/// Mass of a node that the densest body of a field fills (kg), by field.
pub fn full_nodes(setup: &Setup) -> Vec<f64> {
    let mut full = vec![0.0f64; contacts(setup).len()];
    for (body, field) in setup.bodies.iter().zip(fields(setup)) {
        full[field] = full[field].max(body.mass / body.volume0 * setup.dx.powi(setup.dimension as i32));
    }
    full
}

/// Contact of field `a` with field `b` > `a`: where both have one, that which holds less.
pub fn between(contacts: &[Contact], a: usize, b: usize) -> Contact {
    let (mine, other) = (contacts[b], contacts[a]);
    if a == 0 {
        return mine;
    }
    let kind = if mine.kind == ContactKind::Slip { other.kind } else { mine.kind };
    Contact { kind, friction: mine.friction.min(other.friction) }
}

/// The impulse that the first of two bodies takes from the second at a node, and the second takes
/// oppositely from the first. `n`, a unit vector, points from the second to the first.
///
/// They meet as a body and a surface do ([`respond`]), with the mass that moves against the other:
/// where they approach, they then move together along n, and friction takes at most μ times that
/// impulse from their motion along each other. So relative motion loses energy or none.
#[inline]
pub fn impulse<T: Real, const D: usize>(
    contact: &Contact,
    mass: [T; 2],
    v: [&Vector<T, D>; 2],
    n: &Vector<T, D>,
) -> Vector<T, D> {
    let relative: Vector<T, D> = std::array::from_fn(|a| v[0][a] - v[1][a]);
    let after = respond(contact, &relative, n, &[T::ZERO; D]);
    let reduced = mass[0] * mass[1] / (mass[0] + mass[1]);
    std::array::from_fn(|a| reduced * (after[a] - relative[a]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const MASS: [f64; 2] = [3.0, 0.5];
    const N: [f64; 3] = [0.0, 0.6, 0.8];

    fn separate(friction: f64) -> Contact {
        Contact { kind: ContactKind::Separate, friction }
    }

    fn after(contact: &Contact, v: [[f64; 3]; 2]) -> [[f64; 3]; 2] {
        let j = impulse(contact, MASS, [&v[0], &v[1]], &N);
        [0, 1].map(|k| [0, 1, 2].map(|a| v[k][a] + if k == 0 { j[a] } else { -j[a] } / MASS[k]))
    }

    fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
        (0..3).map(|k| a[k] * b[k]).sum()
    }

    #[test]
    fn bodies_that_approach_move_on_together_and_keep_their_momentum() {
        let v = [[1.0, -2.0, -0.5], [-0.5, 1.0, 0.25]];
        let momentum = |v: [[f64; 3]; 2]| [0, 1, 2].map(|a| MASS[0] * v[0][a] + MASS[1] * v[1][a]);
        let energy = |v: [[f64; 3]; 2]| (0..2).map(|k| MASS[k] * dot(v[k], v[k])).sum::<f64>();
        for friction in [0.0, 0.3, 9.0] {
            let w = after(&separate(friction), v);
            let relative = [0, 1, 2].map(|a| w[0][a] - w[1][a]);
            assert!(dot(relative, N).abs() < 1e-14);
            assert!((0..3).all(|a| (momentum(w)[a] - momentum(v)[a]).abs() < 1e-14));
            assert!(energy(w) < energy(v));
        }
    }

    #[test]
    fn friction_is_at_most_its_share_of_the_pressure() {
        let v = [[2.0, -1.0, -1.0], [0.0; 3]];
        let parts = |friction: f64| {
            let j = impulse(&separate(friction), MASS, [&v[0], &v[1]], &N);
            let pressure = dot(j, N);
            (pressure, [0, 1, 2].map(|a| j[a] - pressure * N[a]))
        };
        let (pressure, along) = parts(0.25);
        let size = dot(along, along).sqrt();
        assert!(pressure > 0.0 && (size - 0.25 * pressure).abs() < 1e-14, "{pressure} {along:?}");
        // Against the motion, and enough of it stops that.
        assert!(along[0] < 0.0);
        let w = after(&separate(9.0), v);
        assert!((0..3).all(|a| (w[0][a] - w[1][a]).abs() < 1e-14));
        assert!(dot(parts(0.0).1, [1.0; 3]).abs() < 1e-15);
    }

    #[test]
    fn nothing_holds_bodies_that_part_but_slip() {
        let apart = [[1.0, 2.0, 0.5], [0.0, -1.0, 0.25]];
        assert_eq!(impulse(&separate(0.5), MASS, [&apart[0], &apart[1]], &N), [0.0; 3]);
        let slip = Contact { kind: ContactKind::Slip, friction: 0.0 };
        let w = after(&slip, apart);
        assert!(dot([0, 1, 2].map(|a| w[0][a] - w[1][a]), N).abs() < 1e-14);
    }

    #[test]
    fn of_two_contacts_the_one_that_holds_less_counts() {
        let slip = Contact { kind: ContactKind::Slip, friction: 0.0 };
        let contacts = [separate(9.0), separate(0.3), separate(0.2), slip, slip];
        assert_eq!(between(&contacts, 0, 1), separate(0.3));
        assert_eq!(between(&contacts, 1, 2), separate(0.2));
        assert_eq!(between(&contacts, 1, 3), separate(0.0));
        assert_eq!(between(&contacts, 3, 4), slip);
    }
}
