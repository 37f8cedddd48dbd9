//! Properties of shapes: signed distances against a simple inside test, rigid invariance, slopes,
//! bounds, and sampled volume.
//!
//! proptest draws the cases from a fixed seed (`TestRunner::deterministic`) and prints the smallest
//! failing case.

use gridfall_core::sim::collider::{Sdf, axis_angle, rotate, rotate_back};
use gridfall_scene::schema::{Collider, ContactKind, Scene, Shape};
use gridfall_scene::{self as scene, Limits};
use proptest::prelude::*;
use proptest::test_runner::TestRunner;
use serde_json::json;

type Point = [f64; 3];

/// A scene with one body and the shape as a collider.
pub fn scene_with(shape: &Shape) -> Scene {
    let mut scene: Scene = serde_json::from_value(json!({
        "gridfall": 1, "name": "shapes", "domain": { "min": [-2, -2, -2], "max": [2, 2, 2], "dx": 0.125 },
        "materials": { "m": { "model": "neo-hookean", "density": 2, "youngs_modulus": 1, "poissons_ratio": 0.3 } },
        "bodies": [ { "name": "b", "material": "m", "shape": { "sphere": { "center": [0, 0, 0], "radius": 0.2 } } } ],
        "time": { "end": 1 },
    }))
    .unwrap();
    let collider = Collider {
        name: "shape".into(),
        shape: shape.clone(),
        contact: ContactKind::Slip,
        friction: 0.0,
        motion: None,
        from: None,
        until: None,
    };
    scene.colliders.push(collider);
    scene
}

fn sdf(shape: &Shape) -> Sdf {
    let problem = scene::problem(&scene_with(shape), &Limits::default());
    problem.unwrap_or_else(|faults| panic!("{shape:?}: {faults:?}")).setup.colliders.remove(0).sdf
}

/// Whether a point lies in a shape, straight from the definition of the scene format.
fn inside(shape: &Shape, x: Point) -> bool {
    let minus = |p: &[f64]| [x[0] - p[0], x[1] - p[1], x[2] - p[2]];
    // Along and across an axis.
    let split = |p: &[f64], axis: &[f64]| {
        let length = axis.iter().map(|a| a * a).sum::<f64>().sqrt();
        let r = minus(p);
        let along = (0..3).map(|a| r[a] * axis[a] / length).sum::<f64>();
        (along, (r.iter().map(|a| a * a).sum::<f64>() - along * along).max(0.0).sqrt())
    };
    match shape {
        Shape::Box { min, max } => (0..3).all(|a| min[a] < x[a] && x[a] < max[a]),
        Shape::Sphere { center, radius } => minus(center).iter().map(|a| a * a).sum::<f64>() < radius * radius,
        Shape::Cylinder { center, axis, radius, height } => {
            let (along, across) = split(center, axis);
            along.abs() < 0.5 * height && across < *radius
        }
        Shape::Capsule { center, axis, radius, height } => {
            let (along, across) = split(center, axis);
            (along.abs() - 0.5 * height).max(0.0).hypot(across) < *radius
        }
        Shape::Cone { base, axis, radius, top_radius, height } => {
            let (along, across) = split(base, axis);
            0.0 < along && along < *height && across < radius + (top_radius - radius) * along / height
        }
        Shape::Torus { center, axis, major_radius, minor_radius } => {
            let (along, across) = split(center, axis);
            (across - major_radius).hypot(along) < *minor_radius
        }
        Shape::HalfSpace { point, normal } => split(point, normal).0 < 0.0,
        Shape::Union(shapes) => shapes.iter().any(|s| inside(s, x)),
        Shape::Intersection(shapes) => shapes.iter().all(|s| inside(s, x)),
        Shape::Difference(shapes) => inside(&shapes[0], x) && !shapes[1..].iter().any(|s| inside(s, x)),
        Shape::Translate { offset, shape } => inside(shape, minus(offset)),
        Shape::Rotate { axis, angle_degrees, center, shape } => {
            let center = center.clone().unwrap_or(vec![0.0; 3]);
            let back = rotate_back(&turn(axis, *angle_degrees), minus(&center));
            inside(shape, [0, 1, 2].map(|a| back[a] + center[a]))
        }
        Shape::Scale { factor, center, shape } => {
            let center = center.clone().unwrap_or(vec![0.0; 3]);
            let back = minus(&center);
            inside(shape, [0, 1, 2].map(|a| center[a] + back[a] / factor))
        }
        Shape::Heightfield { .. } | Shape::Mesh { .. } => unreachable!("sampled shapes have tests of their own"),
        Shape::Shell { .. } => unreachable!("a shell is defined by the distance"),
    }
}

fn turn(axis: &[f64], degrees: f64) -> [f64; 9] {
    let length = axis.iter().map(|a| a * a).sum::<f64>().sqrt();
    axis_angle([axis[0] / length, axis[1] / length, axis[2] / length], degrees.to_radians())
}

fn point() -> impl Strategy<Value = Point> {
    prop::array::uniform3(-1.5..1.5f64)
}

fn vector() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(-0.6..0.6f64, 3)
}

fn axis() -> impl Strategy<Value = Vec<f64>> {
    let random = prop::collection::vec(-3.0..3.0f64, 3).prop_filter("a direction", |v| v.iter().any(|a| a.abs() > 0.1));
    prop_oneof![
        random,
        (0..3usize, any::<bool>()).prop_map(|(a, up)| {
            let mut v = vec![0.0; 3];
            v[a] = if up { 1.0 } else { -1.0 };
            v
        })
    ]
}

fn primitive() -> impl Strategy<Value = Shape> {
    let size = || 0.1..0.8;
    prop_oneof![
        (vector(), prop::collection::vec(0.1..1.0, 3)).prop_map(|(min, size)| {
            let max = (0..3).map(|a| min[a] + size[a]).collect();
            Shape::Box { min, max }
        }),
        (vector(), size()).prop_map(|(center, radius)| Shape::Sphere { center, radius }),
        (vector(), axis(), size(), size()).prop_map(|(center, axis, radius, height)| Shape::Cylinder {
            center,
            axis,
            radius,
            height
        }),
        (vector(), axis(), size(), size()).prop_map(|(center, axis, radius, height)| Shape::Capsule {
            center,
            axis,
            radius,
            height
        }),
        (vector(), axis(), size(), prop_oneof![Just(0.0), 0.1..0.8], size()).prop_map(
            |(base, axis, radius, top_radius, height)| Shape::Cone { base, axis, radius, top_radius, height }
        ),
        (vector(), axis(), 0.3..0.8, 0.05..0.29).prop_map(|(center, axis, major_radius, minor_radius)| {
            Shape::Torus { center, axis, major_radius, minor_radius }
        }),
        (vector(), axis()).prop_map(|(point, normal)| Shape::HalfSpace { point, normal }),
    ]
}

fn shape() -> impl Strategy<Value = Shape> {
    primitive().prop_recursive(3, 12, 3, |part| {
        let parts = |least| prop::collection::vec(part.clone(), least..4);
        prop_oneof![
            parts(1).prop_map(Shape::Union),
            parts(1).prop_map(Shape::Intersection),
            parts(2).prop_map(Shape::Difference),
            (vector(), part.clone()).prop_map(|(offset, s)| Shape::Translate { offset, shape: Box::new(s) }),
            (0.3..3.0, prop::option::of(vector()), part.clone()).prop_map(|(factor, center, s)| Shape::Scale {
                factor,
                center,
                shape: Box::new(s)
            }),
            (axis(), -180.0..180.0, prop::option::of(vector()), part.clone()).prop_map(
                |(axis, angle_degrees, center, s)| {
                    Shape::Rotate { axis, angle_degrees, center, shape: Box::new(s) }
                }
            ),
        ]
    })
}

fn check<S: Strategy>(strategy: S, test: impl Fn(S::Value) -> Result<(), TestCaseError>) {
    let mut runner = TestRunner::deterministic();
    runner.run(&strategy, test).unwrap_or_else(|e| panic!("{e}"));
}

/// Closer to the surface than this, rounding may decide on which side a point lies.
const TIE: f64 = 1e-9;

#[test]
fn the_sign_of_the_distance_is_the_inside_test() {
    check((shape(), prop::collection::vec(point(), 40)), |(shape, points)| {
        let sdf = sdf(&shape);
        for x in points {
            let d = sdf.distance(x);
            prop_assert!(d.abs() < TIE || (d < 0.0) == inside(&shape, x), "{d} at {x:?}");
        }
        Ok(())
    });
}

#[test]
fn bounds_contain_the_shape() {
    check((shape(), prop::collection::vec(point(), 40)), |(shape, points)| {
        let sdf = sdf(&shape);
        let [lower, upper] = sdf.bounds();
        for x in points {
            let within = (0..3).all(|a| lower[a] - TIE <= x[a] && x[a] <= upper[a] + TIE);
            prop_assert!(within || !inside(&shape, x), "{x:?} is outside {lower:?} {upper:?}");
        }
        Ok(())
    });
}

#[test]
fn bounds_of_primitives_are_tight() {
    check(primitive(), |shape| {
        let sdf = sdf(&shape);
        let [lower, upper] = sdf.bounds();
        // The surface touches each side of the box.
        for a in 0..3 {
            for (side, bound) in [(-1.0, lower[a]), (1.0, upper[a])] {
                if !bound.is_finite() {
                    continue;
                }
                let mut low = lower.map(|l| l.max(-2.5));
                let mut high = upper.map(|u| u.min(2.5));
                if side < 0.0 {
                    high[a] = bound;
                } else {
                    low[a] = bound;
                }
                // The least distance over that side is zero; a coarse grid finds it up to a cell.
                let mut best = (f64::INFINITY, [0.0; 3]);
                for i in 0..=24 {
                    for j in 0..=24 {
                        let mut x = low;
                        let (b, c) = ((a + 1) % 3, (a + 2) % 3);
                        x[b] += (high[b] - low[b]) * f64::from(i) / 24.0;
                        x[c] += (high[c] - low[c]) * f64::from(j) / 24.0;
                        let d = sdf.distance(x);
                        best = if d < best.0 { (d, x) } else { best };
                    }
                }
                let cell = (0..3).filter(|&b| b != a).map(|b| (high[b] - low[b]) / 24.0).fold(0.0, f64::max);
                prop_assert!(best.0 < cell, "the surface stays {} from side {side} of axis {a}", best.0);
                prop_assert!(best.0 > -TIE, "the shape reaches beyond side {side} of axis {a}");
            }
        }
        Ok(())
    });
}

#[test]
fn distances_move_and_turn_with_the_shape() {
    let motion = (vector(), axis(), -180.0..180.0, vector());
    check((shape(), motion, point()), |(shape, (offset, axis, angle_degrees, center), x)| {
        let still = sdf(&shape).distance(x);
        let inner =
            Shape::Rotate { axis: axis.clone(), angle_degrees, center: Some(center.clone()), shape: Box::new(shape) };
        let moved = sdf(&Shape::Translate { offset: offset.clone(), shape: Box::new(inner) });
        let turned = rotate(&turn(&axis, angle_degrees), [0, 1, 2].map(|a| x[a] - center[a]));
        let there = moved.distance([0, 1, 2].map(|a| turned[a] + center[a] + offset[a]));
        prop_assert!((there - still).abs() < 1e-12, "{there} against {still}");
        Ok(())
    });
}

#[test]
fn distances_grow_with_the_shape() {
    check((shape(), 0.2..5.0, vector(), point()), |(shape, factor, center, x)| {
        let (small, thickness) = (sdf(&shape), 0.05);
        let scale = |shape| Shape::Scale { factor, center: Some(center.clone()), shape: Box::new(shape) };
        let there = [0, 1, 2].map(|a| center[a] + factor * (x[a] - center[a]));
        let (large, still) = (sdf(&scale(shape.clone())).distance(there), small.distance(x));
        prop_assert!((large - factor * still).abs() < 1e-11, "{large} against {factor} times {still}");
        let shell = Shape::Shell { thickness, shape: Box::new(shape) };
        let (large, still) = (sdf(&scale(shell.clone())).distance(there), sdf(&shell).distance(x));
        prop_assert!((large - factor * still).abs() < 1e-11, "shell: {large} against {factor} times {still}");
        Ok(())
    });
}

#[test]
fn distances_never_rise_faster_than_the_way() {
    check((shape(), point(), point()), |(shape, x, y)| {
        let sdf = sdf(&shape);
        let way = (0..3).map(|a| (x[a] - y[a]).powi(2)).sum::<f64>().sqrt();
        prop_assert!((sdf.distance(x) - sdf.distance(y)).abs() <= way + 1e-12);
        Ok(())
    });
}

#[test]
fn the_slope_of_a_primitive_is_one() {
    check((primitive(), point()), |(shape, x)| {
        let sdf = sdf(&shape);
        let h = 1e-5;
        let slope = |a: usize| {
            let (mut ahead, mut behind) = (x, x);
            ahead[a] += h;
            behind[a] -= h;
            let (f, b, m) = (sdf.distance(ahead), sdf.distance(behind), sdf.distance(x));
            // Where the two one-sided slopes differ, there is a kink between the points.
            ((f - b) / (2.0 * h), ((f - m) - (m - b)).abs() / h < 1e-3)
        };
        let slopes = [slope(0), slope(1), slope(2)];
        prop_assume!(slopes.iter().all(|s| s.1));
        let length = slopes.iter().map(|s| s.0 * s.0).sum::<f64>().sqrt();
        prop_assert!((length - 1.0).abs() < 1e-6, "slope {length} at {x:?}");
        Ok(())
    });
}

#[test]
fn a_shell_is_the_layer_below_the_surface() {
    check((primitive(), 0.01..0.2f64, point()), |(shape, thickness, x)| {
        let d = sdf(&shape).distance(x);
        let shell = sdf(&Shape::Shell { thickness, shape: Box::new(shape) }).distance(x);
        prop_assume!(d.abs() > TIE && (d + thickness).abs() > TIE);
        prop_assert_eq!(shell < 0.0, -thickness < d && d < 0.0);
        Ok(())
    });
}

#[test]
fn sampled_mass_is_volume_times_density() {
    use std::f64::consts::PI;
    let cases = [
        (
            json!({ "box": { "min": [-0.5, -0.40625, -0.3125], "max": [0.6875, 0.3125, 0.40625] } }),
            1.1875 * 0.71875 * 0.71875,
        ),
        (json!({ "sphere": { "center": [0.1, 0.2, 0.0], "radius": 0.7 } }), 4.0 / 3.0 * PI * 0.343),
        (
            json!({ "cylinder": { "center": [0, 0, 0], "axis": [1, 2, 3], "radius": 0.5, "height": 1.1 } }),
            PI * 0.25 * 1.1,
        ),
        (
            json!({ "capsule": { "center": [0, 0, 0], "axis": [1, -2, 1], "radius": 0.4, "height": 0.8 } }),
            PI * 0.16 * 0.8 + 4.0 / 3.0 * PI * 0.064,
        ),
        (
            json!({ "scale": { "factor": 1.5, "shape": { "cone": {
                "base": [-0.2, 0.1, -0.3], "axis": [1, 1, 2], "radius": 0.5, "top_radius": 0.2, "height": 0.7 } } } }),
            1.5f64.powi(3) * PI / 3.0 * 0.7 * (0.25 + 0.1 + 0.04),
        ),
        (
            json!({ "torus": { "center": [0, 0, 0], "axis": [1, 0, 1], "major_radius": 0.7, "minor_radius": 0.25 } }),
            2.0 * PI * PI * 0.7 * 0.0625,
        ),
        (
            json!({ "shell": { "thickness": 0.2, "shape": { "sphere": { "center": [0, 0, 0], "radius": 0.9 } } } }),
            4.0 / 3.0 * PI * (0.729 - 0.343),
        ),
        (
            json!({ "difference": [ { "box": { "min": [-0.5, -0.5, -0.5], "max": [0.5, 0.5, 0.5] } },
                                 { "cylinder": { "center": [0, 0, 0], "radius": 0.3, "height": 2 } } ] }),
            1.0 - PI * 0.09,
        ),
    ];
    for sampling in ["regular", "jittered", "poisson-disk", "conforming"] {
        for (shape, volume) in &cases {
            let mut document =
                serde_json::to_value(scene_with(&serde_json::from_value(shape.clone()).unwrap())).unwrap();
            document["domain"]["dx"] = json!(0.0625);
            document["bodies"][0]["shape"] = shape.clone();
            document["bodies"][0]["sampling"] = json!(sampling);
            let problem = scene::problem(&scene::from_value(&document).unwrap(), &Limits::default()).unwrap();
            let mass = problem.particles.len() as f64 * problem.setup.bodies[0].mass;
            assert!(
                (mass / (2.0 * volume) - 1.0).abs() < 0.01,
                "{sampling} {shape}: {mass} kg, {} expected",
                2.0 * volume
            );
        }
    }
}
