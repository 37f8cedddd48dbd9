//! Meshes without inside in scenes: where they may be, and what refuses them elsewhere.

use std::path::Path;

use gridfall_core::sim::setup::{Integrator, Problem};
use gridfall_scene::assets::LocalFiles;
use gridfall_scene::{self as scene, Fault, Limits};
use serde_json::{Value, json};

fn judge(document: &Value, folder: &Path) -> Result<Problem, Vec<Fault>> {
    let files = LocalFiles { folder: folder.to_owned() };
    scene::problem_with(&scene::from_value(document)?, &Limits::default(), &files)
}

/// A folder with an open square, a Möbius strip, and a square far away in f32.
fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, text: String| std::fs::write(dir.path().join(name), text).unwrap();
    write("square.obj", "v -0.5 -0.5 0\nv 0.5 -0.5 0\nv 0.5 0.5 0\nv -0.5 0.5 0\nf 1 2 3 4\n".into());
    // Twice the same face, as modellers that know one side only have it.
    write("twice.obj", "v -0.5 -0.5 0\nv 0.5 -0.5 0\nv 0.5 0.5 0\nf 1 2 3\nf 1 3 2\n".into());
    let (mut strip, n) = (String::new(), 40);
    for k in 0..n {
        let a = 2.0 * std::f64::consts::PI * f64::from(k) / f64::from(n);
        for side in [-0.15, 0.15] {
            let r = 0.5 + side * (0.5 * a).cos();
            strip += &format!("v {} {} {}\n", r * a.cos(), r * a.sin(), side * (0.5 * a).sin());
        }
    }
    for k in 0..n {
        let [a, b] = [2 * k + 1, 2 * k + 2];
        let [c, d] = if k + 1 < n { [a + 2, b + 2] } else { [2, 1] };
        strip += &format!("f {a} {c} {d} {b}\n");
    }
    write("strip.obj", strip);
    let far = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]].map(|[x, y]| format!("vertex {} {y} 0\n", 1e6 + x)).concat();
    write("far.stl", format!("solid a\nfacet normal 0 0 1\nouter loop\n{far}endloop\nendfacet\nendsolid a\n"));
    dir
}

fn scene(shape: &Value) -> Value {
    json!({
        "gridfall": 1, "name": "sheets", "domain": { "min": [-1, -1, -1], "max": [1, 1, 1], "dx": 0.125 },
        "materials": { "m": { "model": "neo-hookean", "density": 2, "youngs_modulus": 1, "poissons_ratio": 0.3 } },
        "bodies": [ { "name": "b", "material": "m",
            "shape": { "box": { "min": [-0.5, -0.5, 0.25], "max": [0.5, 0.5, 0.75] } } } ],
        "colliders": [ { "name": "c", "contact": "separate", "shape": shape } ],
        "time": { "end": 1 },
    })
}

fn sheet(file: &str) -> Value {
    json!({ "mesh": { "file": file, "fill": "sheet" } })
}

fn block() -> Value {
    json!({ "box": { "min": [-0.2, -0.2, -0.2], "max": [0.2, 0.2, 0.2] } })
}

#[test]
fn a_collider_may_be_a_sheet() {
    let dir = folder();
    let square = sheet("square.obj");
    let at = |shape: &Value, x: [f64; 3]| {
        let problem = judge(&scene(shape), dir.path()).unwrap_or_else(|faults| panic!("{faults:#?}"));
        assert!(problem.setup.notices.iter().all(|n| n.code != "volume_differs"), "{:?}", problem.setup.notices);
        problem.setup.colliders[0].at(0.0).distance(x)
    };
    let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-5, "{a} against {b}");
    close(at(&square, [0.1, 0.2, 0.03]), 0.03);
    close(at(&square, [0.1, 0.2, -0.03]), 0.03);
    close(at(&sheet("twice.obj"), [0.2, -0.2, -0.03]), 0.03);
    assert!(at(&sheet("strip.obj"), [-0.5, 0.0, 0.1]).abs() < 0.01);
    let placed = json!({ "translate": { "offset": [0, 0, 0.1], "shape": { "scale": { "factor": 0.5, "shape": {
        "rotate": { "axis": [0, 1, 0], "angle_degrees": 90, "shape": square } } } } } });
    close(at(&placed, [0.07, 0.05, 0.1]), 0.07);
    // A union has both; a difference cuts a hole; an intersection leaves what is in the other shape.
    close(at(&json!({ "union": [block(), square] }), [0.1, 0.1, 0.0]), -0.1);
    close(at(&json!({ "union": [block(), square] }), [0.35, 0.0, 0.04]), 0.04);
    close(at(&json!({ "difference": [square, block()] }), [0.0, 0.0, 0.0]), 0.2);
    close(at(&json!({ "difference": [square, block()] }), [0.35, 0.0, 0.0]), 0.0);
    close(at(&json!({ "intersection": [square, block()] }), [0.1, 0.0, 0.0]), 0.0);
    assert!(at(&json!({ "intersection": [square, block()] }), [0.35, 0.0, 0.0]) > 0.1);
}

#[test]
fn what_needs_an_inside_refuses_a_sheet() {
    let dir = folder();
    let square = sheet("square.obj");
    let fault = |document: &Value| -> (String, &'static str, String) {
        let faults = judge(document, dir.path()).unwrap_err();
        assert_eq!(faults.len(), 1, "{faults:#?}");
        (faults[0].pointer.clone(), faults[0].code, faults[0].to_string())
    };
    let refused = |document: &Value, pointer: &str, code: &str, part: &str| {
        let fault = fault(document);
        assert_eq!((fault.0.as_str(), fault.1), (pointer, code), "{}", fault.2);
        assert!(fault.2.contains(part), "{}", fault.2);
    };
    let with = |key: &str, value: Value| {
        let mut document = scene(&block());
        document[key] = value;
        document
    };
    let body = |shape: &Value| with("bodies", json!([{ "name": "b", "material": "m", "shape": shape }]));
    refused(&body(&square), "/bodies/0/shape/mesh/fill", "needs_inside", "winding-number");
    let turned = json!({ "union": [block(), { "rotate": { "angle_degrees": 10, "shape": square } }] });
    refused(&body(&turned), "/bodies/0/shape/union/1/rotate/shape/mesh/fill", "needs_inside", "colliders");
    let gripped = json!([{ "name": "b", "material": "m", "shape": block(),
        "grips": [{ "name": "g", "shape": square }] }]);
    refused(&with("bodies", gripped), "/bodies/0/grips/0/shape/mesh/fill", "needs_inside", "held");
    let source = json!([{ "name": "s", "material": "m", "shape": square, "velocity": [0, 0, -1], "until": 0.5 }]);
    refused(&with("sources", source), "/sources/0/shape/mesh/fill", "needs_inside", "filled");
    let of = |shape: Value| scene(&shape);
    let at = |part: &str| format!("/colliders/0/shape/{part}/mesh/fill");
    refused(&of(json!({ "difference": [block(), square] })), &at("difference/1"), "needs_inside", "taken away");
    refused(&of(json!({ "intersection": [square, square] })), &at("intersection/1"), "needs_inside", "a line");
    refused(
        &of(json!({ "shell": { "thickness": 0.1, "shape": square } })),
        &at("shell/shape"),
        "needs_inside",
        "shell",
    );
    refused(&of(sheet("far.stl")), "/colliders/0/shape/mesh/file", "imprecise_mesh", "origin");
    // The remedies of a mesh that is no solid name the sheet to colliders alone.
    let solid = json!({ "mesh": { "file": "square.obj" } });
    refused(&of(solid.clone()), "/colliders/0/shape/mesh/file", "bad_mesh", "\"fill\": \"sheet\"");
    let strip = json!({ "mesh": { "file": "strip.obj" } });
    refused(&of(strip), "/colliders/0/shape/mesh/file", "not_orientable", "\"fill\": \"sheet\"");
    assert!(!fault(&body(&solid)).2.contains("sheet\""));
}

#[test]
fn only_contact_at_the_particles_meets_a_sheet() {
    let dir = folder();
    let mut document = scene(&sheet("square.obj"));
    for integrator in ["auto", "implicit"] {
        document["solver"] = json!({ "integrator": integrator });
        // Slow and stiff enough for implicit steps.
        document["materials"]["m"]["youngs_modulus"] = json!(1e9);
        assert_eq!(judge(&document, dir.path()).unwrap().setup.integrator, Integrator::Implicit);
    }
    document["solver"] = json!({ "integrator": "explicit", "contact": "nodes" });
    let faults = judge(&document, dir.path()).unwrap_err();
    assert_eq!((faults[0].pointer.as_str(), faults[0].code, faults.len()), ("/solver/contact", "unsupported", 1));
}
