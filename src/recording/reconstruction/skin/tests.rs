//! Surfaces of bodies whose shape is known.

use super::*;

/// A lattice of points inside of a shape.
fn lattice(spacing: f32, reach: i32, inside: impl Fn(&Vector3<f32>) -> bool) -> Points {
    let range = || -reach..reach;
    let at = |i: i32| (i as f32 + 0.5) * spacing;
    let all = range().flat_map(|i| range().flat_map(move |j| range().map(move |k| Vector3::new(at(i), at(j), at(k)))));
    let positions: Vec<Vector3<f32>> = all.filter(inside).collect();
    // A turn about z, and a drift.
    let velocities = positions.iter().map(|x| Vector3::new(-x.y, x.x, 3.0)).collect();
    Points { positions, velocities }
}

/// By the divergence theorem; positive only if triangles face outwards.
fn volume(skin: &Skin) -> f64 {
    let x = |corner: u32| Vector3::from(skin.positions[corner as usize]).cast::<f64>();
    skin.triangles.iter().map(|[a, b, c]| x(*a).dot(&x(*b).cross(&x(*c))) / 6.0).sum()
}

/// Each edge is run along once in each direction.
fn closed(skin: &Skin) -> bool {
    let mut edges = std::collections::HashMap::new();
    for [a, b, c] in &skin.triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            *edges.entry((*from, *to)).or_insert(0) += 1;
        }
    }
    edges.iter().all(|((from, to), n)| *n == 1 && edges.get(&(*to, *from)) == Some(&1))
}

#[test]
fn balls_and_boxes_keep_their_volume() {
    let spacing = 0.05;
    let ball = lattice(spacing, 12, |x| x.norm() < 0.5);
    let cuboid = lattice(spacing, 12, |x| x.x.abs() < 0.5 && x.y.abs() < 0.3 && x.z.abs() < 0.2);
    // Edges are rounded off, which a box of eight particles across has many of.
    for (name, points, tolerance) in [("ball", ball, 0.02), ("box", cuboid, 0.05)] {
        let skin = skin(&points, spacing).unwrap();
        assert!(closed(&skin), "{name}");
        let expected = points.positions.len() as f64 * f64::from(spacing).powi(3);
        let ratio = volume(&skin) / expected;
        assert!((ratio - 1.0).abs() < tolerance, "{name}: {ratio}");
    }
}

#[test]
fn normals_and_velocities_are_those_of_the_field() {
    let points = lattice(0.05, 12, |x| x.norm() < 0.5);
    let skin = skin(&points, 0.05).unwrap();
    for ((x, normal), v) in skin.positions.iter().zip(&skin.normals).zip(&skin.velocities) {
        let x = Vector3::from(*x);
        assert!((x.norm() - 0.5).abs() < 0.03, "{x}");
        assert!(Vector3::from(*normal).dot(&x.normalize()) > 0.97, "{x} {normal:?}");
        // Sums over particles on one side alone: as far off as the middle of those is from the surface.
        let expected = Vector3::new(-x.y, x.x, 3.0);
        assert!((Vector3::from(*v) - expected).norm() < 0.05, "{v:?} {expected}");
    }
}

#[test]
fn a_surface_is_the_same_each_time() {
    // More than one subdomain of the reconstruction.
    let points = lattice(0.02, 24, |x| x.norm() < 0.45);
    let [first, second] = [0, 1].map(|_| skin(&points, 0.02).unwrap());
    assert!(first.positions == second.positions && first.triangles == second.triangles);
    assert!(first.velocities == second.velocities && first.normals == second.normals);
}

#[test]
fn a_single_particle_is_a_drop() {
    let points = Points { positions: vec![Vector3::zeros()], velocities: vec![] };
    let skin = skin(&points, 0.1).unwrap();
    assert!(closed(&skin) && volume(&skin) > 0.0 && skin.velocities.is_empty());
    for (x, normal) in skin.positions.iter().zip(&skin.normals) {
        assert!(Vector3::from(*normal).dot(&Vector3::from(*x).normalize()) > 0.9, "{x:?} {normal:?}");
    }
}
