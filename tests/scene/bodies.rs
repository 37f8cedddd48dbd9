//! What bodies are made into: how many particles, where, and in which state.

use gridfall_core::sim::collider::rotate;
use gridfall_scene::schema::Shape;
use gridfall_scene::{self as scene, Limits};
use serde_json::json;

use crate::shapes::scene_with;

#[test]
fn poisson_disk_points_may_be_any_number_a_cell_up_to_the_walls() {
    let box_ = Shape::Box { min: vec![-2.0; 3], max: vec![2.0; 3] };
    for per_cell in [1, 5, 16, 27] {
        let mut document = serde_json::to_value(scene_with(&box_)).unwrap();
        document["domain"] = json!({ "min": [-2, -2, -2], "max": [2, 2, 2], "dx": 0.5 });
        document["bodies"][0]["shape"] = serde_json::to_value(&box_).unwrap();
        document["bodies"][0]["particles_per_cell"] = json!(per_cell);
        document["bodies"][0]["sampling"] = json!("poisson-disk");
        let problem = scene::problem(&scene::from_value(&document).unwrap(), &Limits::default()).unwrap();
        let x = &problem.particles.x;
        assert!(x.iter().flatten().all(|x| x.abs() <= 2.0), "{per_cell} a cell: points outside the domain");
        // Points are a little denser at the walls, because there are none beyond.
        let expected = 512.0 * f64::from(per_cell);
        assert!((x.len() as f64 / expected - 1.0).abs() < 0.15, "{per_cell} a cell: {} of {expected}", x.len());
        assert!((x.len() as f64 * problem.setup.bodies[0].volume0 / 64.0 - 1.0).abs() < 0.01, "{per_cell} a cell");
    }
}

#[test]
fn the_papers_sphere_has_the_papers_number_of_particles() {
    // CK-MPM §6.1: radius 10 dx, 8 particles per cell, 33,552 particles.
    let text = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/colliding-spheres.json")).unwrap();
    let problem = scene::problem(&scene::parse(&text).unwrap(), &Limits::default()).unwrap();
    assert_eq!(problem.setup.bodies[0].particles.len(), 33_552);
    assert_eq!(problem.setup.bodies[1].particles.len(), 33_552);
}

#[test]
fn the_initial_state_is_the_rigid_motion_and_gradient_that_was_asked_for() {
    for (kernel, transfer) in [("compact", "mls"), ("quadratic", "apic"), ("linear", "mls"), ("compact", "pic")] {
        let mut document =
            serde_json::to_value(scene_with(&Shape::Sphere { center: vec![0.0; 3], radius: 0.1 })).unwrap();
        document["bodies"][0]["velocity"] = json!([1, -2, 3]);
        document["bodies"][0]["angular_velocity"] = json!([0.5, -1.0, 2.0]);
        document["bodies"][0]["velocity_gradient"] = json!([[0.1, 0, 0], [0, -0.3, 0.7], [0, 0, 0.2]]);
        document["bodies"][0]["shape"] = json!({ "box": { "min": [0.3, -0.2, 0.1], "max": [0.9, 0.3, 1.1] } });
        document["solver"] = json!({ "kernel": kernel, "transfer": transfer });
        let problem = scene::problem(&scene::from_value(&document).unwrap(), &Limits::default()).unwrap();
        let p = &problem.particles;
        let n = p.len() as f64;
        let centroid = [0, 1, 2].map(|a| p.x.iter().map(|x| x[a]).sum::<f64>() / n);
        let mean = [0, 1, 2].map(|a| p.v.iter().map(|v| v[a]).sum::<f64>() / n);
        assert!((0..3).all(|a| (mean[a] - [1.0, -2.0, 3.0][a]).abs() < 1e-12), "{mean:?}");
        let c = [0.1, -2.0, -1.0, 2.0, -0.3, 0.2, 1.0, 0.5, 0.2];
        for (x, v) in p.x.iter().zip(&p.v) {
            let turned = rotate(&c, [0, 1, 2].map(|a| x[a] - centroid[a]));
            assert!((0..3).all(|a| (v[a] - mean[a] - turned[a]).abs() < 1e-12));
        }
        let still = p.b.iter().all(|b| *b == [0.0; 9]);
        assert_eq!(still, transfer == "pic", "{kernel} {transfer}");
        let rate = gridfall_core::sim::timestep::initial_extremes(&problem.setup, &problem.particles).affine_rate_1_s;
        let expected = if still { 0.0 } else { c.iter().map(|c| c * c).sum::<f64>().sqrt() };
        assert!((rate - expected).abs() < 1e-9, "{kernel} {transfer}: ‖C‖ = {rate}, {expected} expected");
    }
}

#[test]
fn a_body_may_lie_across_the_seam_of_a_periodic_axis() {
    let scene = |x: [f64; 2]| {
        let text = json!({
            "gridfall": 1, "name": "seam", "dimension": 2,
            "domain": { "min": [0, 0], "max": [1, 1], "dx": 0.0625, "boundary": { "x": "periodic" } },
            "materials": { "m": { "model": "fixed-corotated", "density": 1000, "youngs_modulus": 1e5,
                                  "poissons_ratio": 0.3 } },
            "bodies": [ { "name": "b", "material": "m", "angular_velocity": [1.0],
                          "shape": { "box": { "min": [x[0], 0.25], "max": [x[1], 0.5] } } } ],
            "time": { "end": 1 }
        });
        scene::from_value(&text).and_then(|scene| scene::problem(&scene, &Limits::default()))
    };
    let whole = scene([0.25, 0.75]).unwrap();
    for shift in [0.5, -0.5, 2.0] {
        let across = scene([0.25 + shift, 0.75 + shift]).unwrap();
        assert_eq!(across.particles.len(), whole.particles.len());
        for i in 0..whole.particles.len() {
            let (there, here) = (&across.particles, &whole.particles);
            assert!((0.0..1.0).contains(&there.x[i][0]));
            let expected = (here.x[i][0] + shift).rem_euclid(1.0);
            assert!((there.x[i][0] - expected).abs() < 1e-12, "{} is not {expected}", there.x[i][0]);
            // It turns about its own middle.
            assert!((0..2).all(|a| (there.v[i][a] - here.v[i][a]).abs() < 1e-12));
        }
    }
    let faults = scene([0.25, 1.5]).unwrap_err();
    assert!(faults.iter().any(|f| f.code == "outside_domain" && f.reason.contains("repeats every 1 m")), "{faults:#?}");
}
