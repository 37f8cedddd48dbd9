//! Recordings of domains far from the origin, as in UTM coordinates, lose nothing.

use std::collections::BTreeSet;

use gridfall_core::sim::collider::SdfOp;
use gridfall_core::sim::setup::Problem;

use super::fixture::{messages, numbers, problem, python, record};

/// Where a float's neighbours are half a metre away (m).
const FAR: [f64; 3] = [5e6, 5e6, 5e3];

/// The same problem elsewhere.
fn moved(mut problem: Problem, by: [f64; 3]) -> Problem {
    let shift = |x: &mut [f64; 3]| (0..3).for_each(|a| x[a] += by[a]);
    problem.particles.x.iter_mut().for_each(shift);
    shift(&mut problem.setup.origin);
    for collider in &mut problem.setup.colliders {
        shift(&mut collider.motion.center);
        for op in &mut collider.sdf.ops {
            if let SdfOp::Primitive { translation, .. } = op {
                shift(translation);
            }
        }
    }
    problem
}

#[test]
fn twenty_layers_stay_twenty_layers() {
    let directory = tempfile::tempdir().unwrap();
    let mut problem = problem(0.1);
    let layer = |k: usize| 0.2 + 0.025 * (k % 20) as f64;
    problem.particles.x.iter_mut().enumerate().for_each(|(k, x)| *x = [layer(k); 3]);
    let problem = moved(problem, FAR);
    let recording = &python(&[], &[record(&problem, directory.path()).recording])[0];
    let cloud = &messages(recording, "/particles")[0]["content"];
    for (a, axis) in ["x", "y", "z"].into_iter().enumerate() {
        assert_eq!(cloud["pose"]["position"][axis], FAR[a]);
        let positions = numbers(&cloud["points"][axis]);
        assert_eq!(positions.iter().map(|x| x.to_bits()).collect::<BTreeSet<_>>().len(), 20);
        for (k, x) in positions.iter().enumerate() {
            assert!((x - layer(k)).abs() < 1e-7, "{axis} of {k}: {x}");
        }
    }
    assert_eq!(cloud["pose"]["orientation"]["w"], 1.0);
    // Viewers that draw in f32 look from the corner.
    let world = &messages(recording, "/tf")[0]["content"]["transforms"][0];
    assert_eq!(world["child_frame_id"], "world");
    assert_eq!(["x", "y", "z"].map(|axis| world["translation"][axis].as_f64().unwrap()), FAR.map(|x| -x));
}

#[test]
fn colliders_keep_their_shapes() {
    let directory = tempfile::tempdir().unwrap();
    let scene = |problem: &Problem| {
        let recording = python(&[], &[record(problem, directory.path()).recording]).remove(0);
        messages(&recording, "/colliders")[1]["content"]["entities"].as_array().unwrap().clone()
    };
    let (here, there) = (scene(&problem(0.1)), scene(&moved(problem(0.1), FAR)));
    assert_eq!(here.len(), there.len());
    let positions = |entity: &serde_json::Value| -> Vec<[f64; 3]> {
        let kinds = ["lines", "triangles", "cubes", "spheres", "cylinders"];
        let shapes = kinds.iter().flat_map(|kind| entity[kind].as_array().unwrap());
        shapes.map(|shape| ["x", "y", "z"].map(|a| shape["pose"]["position"][a].as_f64().unwrap())).collect()
    };
    for (here, there) in here.iter().zip(&there) {
        for (here, there) in positions(here).iter().zip(positions(there)) {
            (0..3).for_each(|a| assert!((there[a] - here[a] - FAR[a]).abs() < 1e-8, "{here:?} and {there:?}"));
        }
        for kind in ["lines", "triangles"] {
            let points = |entity: &serde_json::Value| entity[kind][0]["points"].as_array().cloned().unwrap_or_default();
            for (here, there) in points(here).iter().zip(points(there)) {
                for a in ["x", "y", "z"] {
                    let (here, there) = (here[a].as_f64().unwrap(), there[a].as_f64().unwrap());
                    assert!((here - there).abs() < 1e-6, "{kind}: {here} and {there}");
                }
            }
        }
    }
}

#[test]
fn pictures_show_the_same() {
    let directory = tempfile::tempdir().unwrap();
    let picture = |problem: &Problem| {
        let path = record(problem, directory.path()).thumbnail.unwrap();
        let decoder = png::Decoder::new(std::io::BufReader::new(std::fs::File::open(path).unwrap()));
        let mut reader = decoder.read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        pixels
    };
    let (here, there) = (picture(&problem(0.05)), picture(&moved(problem(0.05), FAR)));
    // The last digits decide some samples on outlines.
    let differing = here.iter().zip(&there).filter(|(a, b)| a.abs_diff(**b) > 8).count();
    assert!(1000 * differing < here.len(), "{differing} of {} values differ", here.len());
}
