//! The quality of conforming points: depths of the layers, distances, holes, numbers and volumes.

use std::f64::consts::PI;

use gridfall_core::sim::collider::axis_angle;

use super::neighbours::Cells;
use super::*;

const SEED: u64 = 5;

/// The largest distance that is looked for (spacings).
const FAR: f64 = 1.25;

fn placed(primitive: Primitive, rotation: [f64; 9], translation: [f64; 3]) -> SdfOp {
    SdfOp::Primitive { primitive, rotation, translation }
}

fn turned(primitive: Primitive) -> Sdf {
    Sdf { ops: vec![placed(primitive, axis_angle([0.48, 0.6, 0.64], 0.7), [0.503, 0.498, 0.511])] }
}

fn flat(primitive: Primitive) -> Sdf {
    Sdf { ops: vec![placed(primitive, axis_angle([0.0, 0.0, 1.0], 0.3), [0.503, 0.498, 0.0])] }
}

fn lattice(sdf: &Sdf, h: f64, dimension: usize) -> Lattice {
    Lattice::over([0.0; 3], h, dimension, sdf.bounds())
}

/// What is measured of points, lengths in spacings.
#[derive(Debug)]
struct Quality {
    count: usize,
    /// Volume of the solid over that of the cube (square) of a spacing.
    volume: f64,
    /// The largest deviation of the first layer's points from half a spacing below the surface.
    outer: f64,
    /// Points in the first layer.
    first: usize,
    /// The least and the mean distance to the nearest point, and the same within the first layer.
    nearest: [f64; 2],
    in_layer: [f64; 2],
    /// The radius of the largest hole at least half a spacing below the surface.
    hole: f64,
    /// Least and largest number, and standard deviation, in cells of 2^d spacings inside.
    cells: [f64; 3],
}

fn quality(sdf: &Sdf, h: f64, dimension: usize) -> Quality {
    let lattice = lattice(sdf, h, dimension);
    let solid = Solid::new(&lattice, sdf);
    let (x, volume) = fill(&lattice, sdf, SEED, 0);
    let first: Vec<[f64; 3]> = x.iter().copied().filter(|x| solid.depth(*x) < h).collect();
    let mut leaves = Vec::new();
    lattice.leaves(sdf, lattice.range.clone(), &mut leaves);
    let cells = leaves.iter().flat_map(super::super::indices);
    let probes: Vec<[f64; 3]> =
        cells.flat_map(|cell| solid.fine(cell)).filter(|x| solid.depth(*x) >= 0.5 * h).collect();
    let counts = counts(&solid, &x, h);
    let deviation = mean(&counts.iter().map(|n| (n - mean(&counts)).powi(2)).collect::<Vec<f64>>()).sqrt();
    let distances = |x: &[[f64; 3]]| {
        let nearest = nearest(x, x, h);
        [least(&nearest) / h, mean(&nearest) / h]
    };
    Quality {
        count: x.len(),
        volume: volume / h.powi(dimension as i32),
        outer: largest(&first.iter().map(|x| (solid.depth(*x) / h - 0.5).abs()).collect::<Vec<_>>()),
        first: first.len(),
        nearest: distances(&x),
        in_layer: distances(&first),
        hole: largest(&nearest(&probes, &x, h)) / h,
        cells: [least(&counts), largest(&counts), deviation],
    }
}

fn least(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::INFINITY, f64::min)
}

fn largest(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Distances from each of some points to the nearest of others, up to FAR.
fn nearest(from: &[[f64; 3]], to: &[[f64; 3]], h: f64) -> Vec<f64> {
    let all: Vec<[f64; 3]> = from.iter().chain(to).copied().collect();
    let all = &all;
    Cells::new(all, FAR * h).map(|points, around| {
        let distance =
            |n: u32, m: u32| (0..3).map(|a| (all[n as usize][a] - all[m as usize][a]).powi(2)).sum::<f64>().sqrt();
        let others =
            |n: u32| around.iter().filter(move |&&m| m as usize >= from.len() && all[m as usize] != all[n as usize]);
        let nearest = |n: u32| others(n).map(|&m| distance(n, m)).fold(FAR * h, f64::min);
        points.iter().filter(|&&n| (n as usize) < from.len()).map(|&n| nearest(n)).collect::<Vec<_>>()
    })
}

/// Numbers of points in the cells two spacings wide that lie inside.
fn counts(solid: &Solid, x: &[[f64; 3]], h: f64) -> Vec<f64> {
    let d = solid.lattice.dimension;
    let mut cells: Vec<[i64; 3]> = x.iter().map(|x| x.map(|x| (x / (2.0 * h)).floor() as i64)).collect();
    cells.sort_unstable();
    let inside = |cell: &[i64; 3]| {
        let center = std::array::from_fn(|a| if a < d { (cell[a] as f64 + 0.5) * 2.0 * h } else { 0.0 });
        solid.depth(center) > h * (d as f64).sqrt()
    };
    cells.chunk_by(|a, b| a == b).filter(|c| inside(&c[0])).map(|c| c.len() as f64).collect()
}

/// Volume of a solid, from its formula, over what was measured; and the claims that hold for all.
fn judge(name: &str, sdf: &Sdf, h: f64, dimension: usize, volume: f64) -> Quality {
    let q = quality(sdf, h, dimension);
    println!("{name}, seed {SEED}: {q:.3?}");
    let expected = volume / h.powi(dimension as i32);
    assert!((q.volume / expected - 1.0).abs() < 1e-3, "{name}: a volume of {}, {expected} expected", q.volume);
    assert!((q.count as f64 - expected).abs() < 0.5 + 1e-3 * expected, "{name}: {} points, not {expected}", q.count);
    // The widest holes of a lattice have a radius of 0.71 in 2D and 0.87 in 3D.
    assert!(q.hole < 0.9, "{name}: a hole with a radius of {}", q.hole);
    q
}

#[test]
fn layers_of_smooth_solids_are_parallel_to_the_surface_and_even() {
    let ([disc, ball], long) = ([PI, 4.0 / 3.0 * PI], 2.0 * PI * PI);
    let lens = 2.0 * (0.01 * 0.75f64.acos() - 0.075 * (0.01f64 - 0.075 * 0.075).sqrt());
    let at = |x: f64| placed(Primitive::Sphere(0.1), IDENTITY, [x, 0.5, 0.0]);
    let pair = Sdf { ops: vec![at(0.5), at(0.65), SdfOp::Union] };
    for (name, sdf, h, dimension, volume) in [
        ("disc", flat(Primitive::Sphere(0.2)), 0.01 / 3.0, 2, disc * 0.04),
        ("small disc", flat(Primitive::Sphere(0.05)), 0.005, 2, disc * 0.0025),
        ("sphere", turned(Primitive::Sphere(0.15)), 0.01, 3, ball * 0.15f64.powi(3)),
        ("capsule", turned(Primitive::Capsule(0.08, 0.1)), 0.01, 3, disc * 0.0064 * 0.2 + ball * 0.000512),
        ("torus", turned(Primitive::Torus(0.2, 0.052)), 0.01, 3, long * 0.2 * 0.052 * 0.052),
        ("pair", pair, 0.005, 2, 2.0 * disc * 0.01 - lens),
    ] {
        let q = judge(name, &sdf, h, dimension, volume);
        assert!(q.outer < 0.01, "{name}: the first layer is {} of a spacing off", q.outer);
        assert!(q.nearest[0] > 0.8 && q.in_layer[0] > 0.85, "{name}: {:?} {:?}", q.nearest, q.in_layer);
        assert!((q.in_layer[1] - 1.0).abs() < 0.03, "{name}: the first layer's points are {} apart", q.in_layer[1]);
        // Eight of random points would deviate by 2.8, four by 2.
        assert!(q.cells[2] < if dimension == 2 { 0.6 } else { 1.2 }, "{name}: cells with {:?}", q.cells);
    }
}

#[test]
fn the_first_layer_has_as_many_points_as_its_volume_is_worth() {
    let h = 0.01;
    let disc = quality(&flat(Primitive::Sphere(0.2)), h, 2);
    let shell = |inner: f64, d: i32| 0.2f64.powi(d) - inner.powi(d);
    assert!((disc.first as f64 - PI * shell(0.19, 2) / h.powi(2)).abs() < 1.5, "{disc:?}");
    let sphere = quality(&turned(Primitive::Sphere(0.2)), 0.02, 3);
    let expected = 4.0 / 3.0 * PI * shell(0.18, 3) / 0.02f64.powi(3);
    assert!((sphere.first as f64 / expected - 1.0).abs() < 0.01, "{sphere:?}, {expected} expected");
}

#[test]
fn edges_and_tips_are_filled_as_far_as_half_a_spacing_allows() {
    for (name, sdf, dimension, volume) in [
        ("box", flat(Primitive::Box([0.3, 0.15, FLAT_HALF_EXTENT])), 2, 0.18),
        ("plate", flat(Primitive::Box([0.3, 0.0171, FLAT_HALF_EXTENT])), 2, 0.6 * 0.0342),
        ("cylinder", turned(Primitive::Cylinder(0.12, 0.15)), 3, PI * 0.0144 * 0.3),
        ("cone", turned(Primitive::Cone(0.15, 0.0, 0.15)), 3, PI / 3.0 * 0.0225 * 0.3),
    ] {
        let q = judge(name, &sdf, 0.01, dimension, volume);
        // The plate has room for 3.4 layers: some of the points between them are nearer to the surface than a
        // spacing. The tip of the cone is thinner than a spacing, and its points lie in its middle.
        let (outer, nearest) = match name {
            "plate" => (0.5, 0.7),
            "cone" => (0.5, 0.5),
            _ => (0.01, 0.8),
        };
        assert!(q.outer < outer, "{name}: the first layer is {} of a spacing off", q.outer);
        assert!(q.nearest[0] > nearest, "{name}: points {} apart", q.nearest[0]);
    }
}

#[test]
fn a_sheet_thinner_than_a_spacing_keeps_its_points_in_its_middle() {
    let h = 0.01;
    let sdf = flat(Primitive::Box([0.3, 0.4 * h, FLAT_HALF_EXTENT]));
    let solid = Solid::new(&lattice(&sdf, h, 2), &sdf);
    let (x, volume) = fill(&solid.lattice, &sdf, SEED, 0);
    assert_eq!(x.len(), (volume / h.powi(2)).round() as usize);
    let off = largest(&x.iter().map(|x| 0.4 - solid.depth(*x) / h).collect::<Vec<_>>());
    assert!(off < 0.05, "points {off} of a spacing off the middle");
    let thick = |half: f64| {
        let sdf = flat(Primitive::Box([0.3, half * h, FLAT_HALF_EXTENT]));
        is_thick(&lattice(&sdf, h, 2), &sdf)
    };
    assert_eq!([0.2, 0.3, 0.5, 3.0, 20.0].map(thick), [false, false, true, true, true]);
}

#[test]
fn points_depend_on_seed_and_body_and_on_nothing_else() {
    let sdf = turned(Primitive::Torus(0.2, 0.08));
    let lattice = lattice(&sdf, 0.02, 3);
    let draw = |seed, body| fill(&lattice, &sdf, seed, body).0;
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(draw(7, 0), one_thread.install(|| draw(7, 0)));
    assert_ne!(draw(7, 0), draw(8, 0));
    assert_ne!(draw(7, 0), draw(7, 1));
}
