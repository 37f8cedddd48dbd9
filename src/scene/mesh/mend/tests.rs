//! Planted faults of every kind are mended, and what is right is left as it is.

use super::*;
use crate::mesh::tests::{ball, cube, volume};

/// A mesh moved and scaled.
fn placed(mut mesh: TriangleMesh, factor: f64, by: [f64; 3]) -> TriangleMesh {
    mesh.vertices.iter_mut().for_each(|v| *v = std::array::from_fn(|a| factor * v[a] + by[a]));
    mesh
}

/// A mesh facing the other way.
fn inwards(mut mesh: TriangleMesh) -> TriangleMesh {
    mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    mesh
}

/// Several meshes as one, welded.
fn together(meshes: &[TriangleMesh]) -> TriangleMesh {
    let mut all = TriangleMesh::default();
    for mesh in meshes {
        let first = all.vertices.len() as u32;
        all.vertices.extend(&mesh.vertices);
        all.triangles.extend(mesh.triangles.iter().map(|t| t.map(|v| first + v)));
    }
    all.weld();
    all
}

fn small(factor: f64, by: f64) -> TriangleMesh {
    placed(cube(), factor, [by; 3])
}

#[test]
fn what_is_right_stays_as_it_is() {
    for mesh in [cube(), ball(8), together(&[cube(), placed(ball(6), 0.4, [3.0, 0.5, 0.5])])] {
        let mended = mend(mesh.clone()).unwrap();
        assert_eq!(mended.mesh, mesh);
        let Mended { duplicates, seams, faces, nesting, open, .. } = mended;
        assert_eq!((duplicates, seams, faces, nesting.turned, nesting.swallowed, open.0), (0, 0, 0, 0, 0, 0));
        assert!((nesting.volume / volume(&mesh) - 1.0).abs() < 1e-12);
    }
}

#[test]
fn any_flipped_faces_are_turned_back() {
    for (n, mesh) in [cube(), ball(7)].into_iter().enumerate() {
        for seed in 1..20u32 {
            let mut flipped = mesh.clone();
            let chosen = |k: usize| (k as u32 + 1).wrapping_mul(seed.wrapping_mul(2_654_435_761)).is_multiple_of(5);
            (0..flipped.triangles.len()).filter(|&k| chosen(k)).for_each(|k| flipped.triangles[k].swap(0, 1));
            let mended = mend(flipped).unwrap();
            assert!((volume(&mended.mesh) / volume(&mesh) - 1.0).abs() < 1e-12, "mesh {n}, seed {seed}");
            assert!(mended.faces + mended.nesting.turned > 0, "mesh {n}, seed {seed}");
        }
    }
}

#[test]
fn parts_apart_all_face_outwards() {
    let apart = [small(1.0, 0.0), inwards(small(0.5, 2.0)), inwards(placed(ball(6), 0.3, [-2.0, 0.0, 0.0]))];
    let expected: f64 = apart.iter().map(|mesh| volume(mesh).abs()).sum();
    let mended = mend(together(&apart)).unwrap();
    assert_eq!((mended.parts, mended.nesting.turned), (3, 2));
    assert!((mended.nesting.volume / expected - 1.0).abs() < 1e-12);
    assert!((volume(&mended.mesh) / expected - 1.0).abs() < 1e-12);
    // They touch along an edge, or in a corner.
    for by in [[1.0, 1.0, 0.0], [1.0, 1.0, 1.0]] {
        let mended = mend(together(&[cube(), inwards(placed(cube(), 1.0, by))])).unwrap();
        assert_eq!((mended.parts, mended.nesting.turned, mended.open.0), (2, 1, 0));
        assert!((volume(&mended.mesh) - 2.0).abs() < 1e-12);
    }
}

#[test]
fn hollows_stay_hollow() {
    let (outer, hole, core) = (cube(), inwards(small(0.5, 0.25)), small(0.25, 0.375));
    let shell = 1.0 - 0.125;
    for (meshes, expected, turned) in [
        (vec![outer.clone(), hole.clone()], shell, 0),
        // The whole file inside out.
        (vec![inwards(outer.clone()), inwards(hole.clone())], shell, 2),
        // A core in the hollow, right or inside out.
        (vec![outer.clone(), hole.clone(), core.clone()], shell + 1.0 / 64.0, 0),
        (vec![outer.clone(), hole.clone(), inwards(core.clone())], shell + 1.0 / 64.0, 1),
        // A hollow body beside one that is inside out.
        (vec![outer.clone(), hole.clone(), inwards(small(1.0, 3.0)), small(0.5, 3.25)], 2.0 * shell, 2),
    ] {
        let mended = mend(together(&meshes)).unwrap();
        assert_eq!((mended.nesting.turned, mended.nesting.swallowed), (turned, 0), "{expected}");
        assert!((mended.nesting.volume / expected - 1.0).abs() < 1e-12, "{} not {expected}", mended.nesting.volume);
        assert!((volume(&mended.mesh) / expected - 1.0).abs() < 1e-12);
    }
    // Facing the same way as the part around, a part is as solid as that.
    let mended = mend(together(&[outer, inwards(hole)])).unwrap();
    assert_eq!((mended.nesting.turned, mended.nesting.swallowed), (0, 1));
    assert!((mended.nesting.volume - 1.0).abs() < 1e-12);
}

#[test]
fn parts_that_cross_are_both_solid() {
    let mended = mend(together(&[cube(), inwards(placed(cube(), 1.0, [0.7, 0.6, 0.5]))])).unwrap();
    assert_eq!((mended.parts, mended.nesting.turned), (2, 1));
    assert!((volume(&mended.mesh) - 2.0).abs() < 1e-12);
    // Bars that cross without a vertex of one inside the other.
    let bar = |long: usize| {
        let mut bar = cube();
        bar.vertices.iter_mut().for_each(|v| v[long] = 6.0 * v[long] - 2.5);
        bar
    };
    let mended = mend(together(&[bar(0), inwards(placed(bar(1), 0.9, [0.05; 3]))])).unwrap();
    assert_eq!((mended.parts, mended.nesting.turned), (2, 1));
}

#[test]
fn duplicate_faces_go() {
    let mut twice = cube();
    let [a, b, c] = twice.triangles[3];
    twice.triangles.extend([[a, b, c], [c, a, b], [b, a, c]]);
    let mended = mend(twice).unwrap();
    assert_eq!((mended.duplicates, mended.open), (3, (0, 18)));
    assert!((volume(&mended.mesh) - 1.0).abs() < 1e-12);
    // Every face from both sides.
    let mended = mend(together(&[cube(), inwards(cube())])).unwrap();
    assert_eq!((mended.duplicates, mended.open), (12, (0, 18)));
    assert!((volume(&mended.mesh) - 1.0).abs() < 1e-12);
    // A wall between two parts, whichever way they face.
    let mirrored = || {
        let mut mirrored = cube();
        mirrored.vertices.iter_mut().for_each(|v| v[0] = 2.0 - v[0]);
        mirrored
    };
    for other in [mirrored(), inwards(mirrored())] {
        let mended = mend(together(&[cube(), other])).unwrap();
        assert_eq!((mended.duplicates, mended.open.0, mended.parts), (4, 0, 1));
        assert!((volume(&mended.mesh) - 2.0).abs() < 1e-12);
    }
    // A fin without thickness.
    let mut fin = cube();
    let [a, b, _] = fin.triangles[0];
    fin.vertices.push([0.5, 0.5, 9.0]);
    fin.triangles.extend([[a, b, 8], [b, a, 8]]);
    let mended = mend(fin).unwrap();
    assert_eq!((mended.duplicates, mended.open.0), (2, 0));
}

#[test]
fn parts_that_share_a_wall_cut_in_two_ways_fit() {
    let beside = |a: usize| {
        let mut by = [0.0; 3];
        by[a] = 1.0;
        placed(cube(), 1.0, by)
    };
    for a in 0..3 {
        for meshes in [[cube(), beside(a)], [cube(), inwards(beside(a))], [inwards(cube()), inwards(beside(a))]] {
            let mended = mend(together(&meshes)).unwrap();
            assert_eq!(mended.open.0, 0, "axis {a}");
            assert!((volume(&mended.mesh) - 2.0).abs() < 1e-12, "axis {a}: {}", volume(&mended.mesh));
        }
    }
}

#[test]
fn vertices_on_edges_become_corners() {
    // One vertex, and several on two edges of a triangle, slightly off.
    for (shares, off) in [(vec![0.5], 0.0), (vec![0.2, 0.3, 0.7], 3e-6)] {
        for edges in [1, 2] {
            let mut mesh = cube();
            let [a, b, c] = mesh.triangles[0];
            for (from, to) in [(a, b), (b, c)].into_iter().take(edges) {
                let at = mesh.triangles.iter().position(|t| (0..3).any(|k| (t[k], t[(k + 1) % 3]) == (to, from)));
                let t = mesh.triangles.swap_remove(at.unwrap());
                let apex = *t.iter().find(|v| **v != from && **v != to).unwrap();
                let mut last = to;
                for share in &shares {
                    let [p, q] = [to, from].map(|v| mesh.vertices[v as usize]);
                    let at = std::array::from_fn(|k| p[k] + share * (q[k] - p[k]) + off);
                    mesh.vertices.push(at);
                    let next = mesh.vertices.len() as u32 - 1;
                    mesh.triangles.push([last, next, apex]);
                    last = next;
                }
                mesh.triangles.push([last, from, apex]);
            }
            let mended = mend(mesh).unwrap();
            assert_eq!((mended.seams, mended.open.0), (edges * shares.len(), 0), "{shares:?}, {edges} edges");
            assert!((volume(&mended.mesh) - 1.0).abs() < 1e-4);
        }
    }
}

#[test]
fn a_moebius_strip_is_refused() {
    let n = 12;
    let mut strip = TriangleMesh::default();
    for k in 0..n {
        let turn = std::f64::consts::TAU * f64::from(k) / f64::from(n);
        for side in [-0.3, 0.3] {
            let r = 1.0 + side * (0.5 * turn).cos();
            strip.vertices.push([r * turn.cos(), r * turn.sin(), side * (0.5 * turn).sin()]);
        }
    }
    let vertex = |k: u32, side: u32| if k < n { 2 * k + side } else { 1 - side };
    for k in 0..n {
        let [a, b, c, d] = [vertex(k, 0), vertex(k, 1), vertex(k + 1, 0), vertex(k + 1, 1)];
        strip.triangles.extend([[a, c, b], [b, c, d]]);
    }
    assert_eq!(mend(strip).unwrap_err(), NotOrientable);
}

#[test]
fn a_part_with_a_hole_still_has_an_inside() {
    let open = |mesh: TriangleMesh| {
        let mut mesh = mesh;
        mesh.triangles.truncate(11);
        mesh
    };
    let mended = mend(together(&[open(cube()), inwards(open(small(1.0, 2.0)))])).unwrap();
    assert_eq!((mended.nesting.turned, mended.open.0), (1, 6));
    assert!((mended.nesting.volume - 2.0).abs() < 1e-12, "{}", mended.nesting.volume);
    // Sheets that bound a body only together keep their sides.
    let mut sheets = TriangleMesh::default();
    let cube = cube();
    for t in &cube.triangles {
        let first = sheets.vertices.len() as u32;
        sheets.vertices.extend(t.map(|v| cube.vertices[v as usize].map(|x| 0.999 * x + 1e-3 * f64::from(first))));
        sheets.triangles.push([first, first + 1, first + 2]);
    }
    assert_eq!(mend(sheets.clone()).unwrap().mesh, sheets);
}
