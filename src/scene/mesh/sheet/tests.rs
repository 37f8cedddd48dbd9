//! Distances of sheets: exact on flat pieces, and nothing gets through wherever they end, fold and meet.

use std::sync::Arc;

use gridfall_core::sim::collider::{
    ALWAYS, Collider, DistanceField, Motion, Primitive, Sdf, SdfOp, axis_angle, rotate,
};
use gridfall_core::sim::particles::IDENTITY;
use gridfall_core::sim::setup::{Contact, ContactKind};
use gridfall_core::sim::source::Effort;

use crate::mesh::triangles::{TriangleMesh, cross, dot, sub};
use crate::mesh::{Plan, bvh::Bvh};
use crate::schema::Fill;

const SPACING: f64 = 0.1;

/// Quadrilaterals, turned so that no axis is special, and welded.
fn sheet(quads: &[[[f64; 3]; 4]]) -> TriangleMesh {
    let turn = turn();
    let mut mesh = TriangleMesh::default();
    for quad in quads {
        let n = mesh.vertices.len() as u32;
        mesh.vertices.extend(quad.map(|x| rotate(&turn, x)));
        mesh.triangles.extend([[n, n + 1, n + 2], [n, n + 2, n + 3]]);
    }
    mesh.weld();
    mesh
}

fn turn() -> [f64; 9] {
    let axis = [1.0, 2.0, -0.5].map(|a: f64| a / 5.25f64.sqrt());
    axis_angle(axis, 0.7)
}

/// A rectangle in the plane spanned by two vectors, about a point.
fn rectangle(center: [f64; 3], u: [f64; 3], v: [f64; 3]) -> [[f64; 3]; 4] {
    [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
        .map(|[s, t]| std::array::from_fn(|a| center[a] + s * u[a] + t * v[a]))
}

/// The half-plane from the z axis in a direction of the x-y plane (degrees), cut off.
fn wing(degrees: f64) -> [[f64; 3]; 4] {
    let (s, c) = degrees.to_radians().sin_cos();
    rectangle([0.5 * c, 0.5 * s, 0.0], [0.5 * c, 0.5 * s, 0.0], [0.0, 0.0, 0.6])
}

fn field(mesh: &TriangleMesh) -> Arc<DistanceField> {
    Arc::new(Plan::new(mesh, SPACING, 3).sample(mesh, Fill::Sheet, &Effort::unlimited()).unwrap())
}

fn collider(field: &Arc<DistanceField>) -> Collider {
    let primitive = Primitive::Grid(field.clone(), 1.0);
    let op = SdfOp::Primitive { primitive, rotation: IDENTITY, translation: [0.0; 3] };
    Collider {
        name: "sheet".into(),
        sdf: Sdf { ops: vec![op] },
        contact: Contact { kind: ContactKind::Separate, friction: 0.0 },
        motion: Motion::default(),
        present_s: ALWAYS,
        grip: false,
    }
}

/// Numbers from -1 to 1 that fill a cube evenly (Roberts 2018).
fn even(k: usize) -> [f64; 3] {
    [0.8191725134, 0.6710436067, 0.5497004779].map(|a: f64| 2.0 * (0.5 + a * k as f64).fract() - 1.0)
}

#[test]
fn a_flat_sheet_is_where_it_is_on_both_sides() {
    let turn = turn();
    let mesh = sheet(&[rectangle([0.0; 3], [0.8, 0.0, 0.0], [0.0, 0.6, 0.0])]);
    let (field, bvh) = (field(&mesh), Bvh::new(&mesh));
    let placed = collider(&field);
    let placed = placed.at(0.0);
    // Of the distance over the sheet, the same within a cell of its rim, and beyond it; of the normal.
    let mut worst = [0.0f64; 4];
    for k in 0..200_000 {
        let u = even(k);
        let local = [1.2 * u[0], 1.0 * u[1], 0.3 * u[2]];
        let x = rotate(&turn, local);
        let exact = bvh.nearest(x, 0, &mut 0).0;
        let off = (field.distance(x) - exact).abs() / SPACING;
        let to_rim = (0.8 - local[0].abs()).min(0.6 - local[1].abs()) / SPACING;
        let class = if to_rim > 1.8 {
            0
        } else if to_rim > 0.0 {
            1
        } else {
            2
        };
        worst[class] = worst[class].max(off);
        if class == 0 && exact > 0.04 * SPACING {
            let n = placed.normal(x, 0.01 * SPACING);
            let side = rotate(&turn, [0.0, 0.0, local[2].signum()]);
            worst[3] = worst[3].max(1.0 - dot(n, side));
        }
    }
    println!("off by {worst:?} spacings: over the sheet, at the rim, beyond; normals by the last");
    assert!(worst[0] < 2e-5 && worst[3] < 1e-6, "{worst:?}");
    assert!(worst[1] < 0.3 && worst[2] < 1.8, "{worst:?}");
    // It goes on behind its rim for about a spacing at most.
    for k in 0..100_000 {
        let u = even(k);
        let x = rotate(&turn, [1.2 * u[0], 1.0 * u[1], 0.0]);
        assert!(field.distance(x) > 0.02 * SPACING || bvh.nearest(x, 0, &mut 0).0 < 1.1 * SPACING, "{x:?}");
    }
}

#[test]
fn a_folded_sheet_is_rounded_by_a_share_of_the_spacing() {
    for (degrees, right) in [(170.0, 0.1), (90.0, 0.4), (45.0, 0.9)] {
        let mesh = sheet(&[wing(0.0), wing(degrees)]);
        let (field, bvh) = (field(&mesh), Bvh::new(&mesh));
        let (mut worst, mut far) = (0.0f64, 0.0f64);
        for k in 0..200_000 {
            let u = even(k);
            // A place on one wing, away from other rims.
            let along = 0.7 * 0.5 * (u[0] + 1.0);
            let (s, c) = if k % 2 == 0 { (0.0, 1.0) } else { degrees.to_radians().sin_cos() };
            let x = rotate(&turn(), [along * c, along * s, 0.4 * u[1]]);
            let off = field.distance(x).abs() / SPACING;
            assert!(bvh.nearest(x, 0, &mut 0).0 < 1e-9);
            worst = worst.max(off);
            if along > 4.5 * SPACING {
                far = far.max(off);
            }
        }
        println!("{degrees}°: off by {worst:.3} spacings at the fold, {far:.5} away from it");
        assert!(worst < right && far < 2e-5, "{degrees}°: {worst}, {far}");
    }
}

/// Sheets of all kinds.
fn sheets() -> Vec<(&'static str, TriangleMesh)> {
    let flat = |z: f64| rectangle([0.0, 0.0, z], [0.8, 0.0, 0.0], [0.0, 0.6, 0.0]);
    let ribbon = |width: f64| rectangle([0.0; 3], [0.8, 0.0, 0.0], [0.0, 0.5 * width * SPACING, 0.0]);
    let wings = |all: &[f64]| sheet(&all.iter().map(|degrees| wing(*degrees)).collect::<Vec<_>>());
    let mut bowl = crate::mesh::tests::ball(24);
    bowl.triangles.retain(|t| t.iter().all(|v| bowl.vertices[*v as usize][2] < 0.5));
    vec![
        ("flat", sheet(&[flat(0.0)])),
        ("folded by 90°", wings(&[0.0, 90.0])),
        ("folded by 20°", wings(&[0.0, 20.0])),
        ("three at an edge", wings(&[0.0, 90.0, 180.0])),
        ("four at an edge", wings(&[10.0, 100.0, 190.0, 280.0])),
        ("two layers", sheet(&[flat(0.0), flat(0.3 * SPACING)])),
        ("two layers, apart", sheet(&[flat(0.0), flat(0.9 * SPACING)])),
        ("crossing", sheet(&[flat(0.0), rectangle([0.1, 0.0, 0.05], [0.1, 0.0, 0.7], [0.0, 0.7, 0.1])])),
        ("ribbon", sheet(&[ribbon(0.4)])),
        ("wide ribbon", sheet(&[ribbon(1.3)])),
        ("Möbius strip", moebius()),
        ("bowl", bowl),
    ]
}

fn moebius() -> TriangleMesh {
    let n = 60;
    let at = |k: usize, side: f64| {
        let a = 2.0 * std::f64::consts::PI * k as f64 / n as f64;
        let r = 0.8 + side * (0.5 * a).cos();
        [r * a.cos(), r * a.sin(), side * (0.5 * a).sin()]
    };
    let quads: Vec<_> = (0..n).map(|k| [at(k, -0.25), at(k + 1, -0.25), at(k + 1, 0.25), at(k, 0.25)]).collect();
    sheet(&quads)
}

/// Share of a spacing by which a rim may be cut off.
const AT_RIM: f64 = 0.7;

/// The open edges.
fn rim(mesh: &TriangleMesh) -> Vec<[[f64; 3]; 2]> {
    let rims = super::rims(mesh);
    let ends = |n: usize, k: usize| [k, (k + 1) % 3].map(|k| mesh.corners(n)[k]);
    (0..rims.len())
        .flat_map(|n| (0..3).map(move |k| (n, k)))
        .filter(|&(n, k)| rims[n][k])
        .map(|(n, k)| ends(n, k))
        .collect()
}

/// How many triangles a way goes through.
fn crossings(mesh: &TriangleMesh, from: [f64; 3], to: [f64; 3]) -> usize {
    let way = sub(to, from);
    let goes_through = |n: &usize| {
        let [a, b, c] = mesh.corners(*n);
        let (ab, ac, ax) = (sub(b, a), sub(c, a), sub(from, a));
        let (p, q) = (cross(way, ac), cross(ax, ab));
        let det = dot(ab, p);
        let (u, v, t) = (dot(ax, p) / det, dot(way, q) / det, dot(ac, q) / det);
        u >= 0.0 && v >= 0.0 && u + v <= 1.0 && (0.0..=1.0).contains(&t)
    };
    (0..mesh.triangles.len()).filter(goes_through).count()
}

fn to_line(x: [f64; 3], [a, b]: &[[f64; 3]; 2]) -> f64 {
    let (ab, ax) = (sub(*b, *a), sub(x, *a));
    let share = (dot(ab, ax) / dot(ab, ab)).clamp(0.0, 1.0);
    let r: [f64; 3] = std::array::from_fn(|k| ax[k] - share * ab[k]);
    dot(r, r).sqrt()
}

#[test]
fn nothing_gets_through_a_sheet() {
    for (name, mesh) in sheets() {
        let (field, bvh) = (field(&mesh), Bvh::new(&mesh));
        let filled = field.samples.iter().filter(|s| gridfall_core::sim::collider::sides(**s) == super::SOLID).count();
        let cut = field.samples.iter().filter(|s| gridfall_core::sim::collider::sides(**s) != 0).count();
        let collider = collider(&field);
        let placed = collider.at(0.0);
        let least = 0.01 * SPACING;
        let rim = rim(&mesh);
        let (mut through, mut all) = (0, 0);
        for k in 0..60_000 {
            // From a place off a point of the mesh, through that point.
            let t = mesh.corners(k % mesh.triangles.len());
            let u = even(k);
            let (p, q) = (0.5 * (u[0] + 1.0), 0.5 * (u[1] + 1.0));
            let (p, q) = if p + q > 1.0 { (1.0 - p, 1.0 - q) } else { (p, q) };
            let on: [f64; 3] = std::array::from_fn(|a| t[0][a] + p * (t[1][a] - t[0][a]) + q * (t[2][a] - t[0][a]));
            let way = even(k / 7 + 3);
            let size = [1.5, 3.0, 8.0][k % 3] * SPACING / dot(way, way).sqrt();
            let way = way.map(|a| a * size);
            let n = cross(sub(t[1], t[0]), sub(t[2], t[0]));
            let steep = dot(n, way).abs() / (dot(n, n) * dot(way, way)).sqrt();
            let from = sub(on, way);
            let to = std::array::from_fn(|a| on[a] + way[a]);
            if steep < 0.3
                || !name.ends_with("ribbon") && rim.iter().any(|line| to_line(on, line) < AT_RIM * SPACING)
                || [from, to].iter().any(|x| bvh.nearest(*x, 0, &mut 0).0 < 0.9 * SPACING)
                || field.distance(from) < 0.0
            {
                continue;
            }
            // What cuts the tip of a fold off stays on its side.
            if !name.starts_with("two") && crossings(&mesh, from, to) != 1 {
                continue;
            }
            all += 1;
            through += usize::from(placed.meets(&placed, from, to, least).is_none());
        }
        println!("{name}: {through} of {all} get through; of {cut} cells, {filled} are filled");
        assert!(all > 1000, "{name}: {all}");
        // A ribbon of about a spacing has little but a rim.
        assert!(
            through == 0 || name.ends_with("ribbon") && 25 * through < all,
            "{name}: {through} of {all} get through"
        );
    }
}
