//! A bad scene is refused with all its faults at once: pointer, code, reason and remedy of each.

use gridfall_scene::{self as scene, Fault, Limits};
use serde_json::{Value, json};

fn good() -> Value {
    json!({
        "gridfall": 1, "name": "good",
        "domain": { "min": [0, 0, 0], "max": [1, 1, 1], "dx": 0.0625,
                    "boundary": { "x": "periodic", "z-": { "contact": "separate", "friction": 0.3 } } },
        "gravity": [0, 0, -9.81],
        "materials": {
            "water": { "model": "weakly-compressible-fluid", "density": 1000, "bulk_modulus": 5e4 },
            "jelly": { "model": "neo-hookean", "density": 1000, "youngs_modulus": 1e5, "poissons_ratio": 0.3 },
        },
        "bodies": [
            { "name": "a", "material": "water", "shape": { "box": { "min": [0, 0, 0], "max": [0.5, 0.5, 0.5] } } },
            { "name": "b", "material": "jelly", "shape": { "sphere": { "center": [0.7, 0.7, 0.7], "radius": 0.2 } },
              "velocity": [0, 0, -1], "angular_velocity": [0, 0, 1] },
        ],
        "colliders": [ { "name": "post", "shape": { "cylinder": { "center": [0.8, 0.2, 0.5], "radius": 0.1, "height": 1 } },
                         "contact": "slip", "motion": { "angular_velocity": [0, 0, 1] } } ],
        "time": { "end": 1, "frame_rate": 24 },
        "solver": { "kernel": "compact" },
        "output": { "fields": ["velocity", "J"] },
    })
}

fn flat() -> Value {
    json!({
        "gridfall": 1, "name": "flat", "dimension": 2, "domain": { "min": [0, 0], "max": [1, 1], "dx": 0.0625 },
        "materials": { "jelly": { "model": "neo-hookean", "density": 1000, "youngs_modulus": 1e5, "poissons_ratio": 0.3 } },
        "bodies": [ { "name": "a", "material": "jelly", "angular_velocity": [1],
                      "shape": { "rotate": { "angle_degrees": 30, "center": [0.5, 0.5],
                                 "shape": { "box": { "min": [0.2, 0.2], "max": [0.5, 0.5] } } } } } ],
        "time": { "end": 1 },
    })
}

/// All faults of a document, whichever stage finds them.
fn faults(document: &Value, limits: &Limits) -> Vec<Fault> {
    match scene::from_value(document) {
        Err(faults) => faults,
        Ok(scene) => scene::problem(&scene, limits).err().unwrap_or_default(),
    }
}

/// `changes` are pairs of JSON pointer and value; a missing member is made, `null` removes one.
fn changed(mut document: Value, changes: &[(&str, Value)]) -> Value {
    for (pointer, value) in changes {
        let (parent, last) = pointer.rsplit_once('/').unwrap();
        match document.pointer_mut(parent).unwrap() {
            Value::Object(fields) if value.is_null() => drop(fields.remove(last)),
            Value::Object(fields) => drop(fields.insert(last.replace("~1", "/"), value.clone())),
            Value::Array(items) => items[last.parse::<usize>().unwrap()] = value.clone(),
            _ => panic!("no member {pointer}"),
        }
    }
    document
}

fn expect(document: &Value, limits: &Limits, expected: &[(&str, &str)]) {
    let found = faults(document, limits);
    let mut got: Vec<(&str, &str)> = found.iter().map(|f| (f.pointer.as_str(), f.code)).collect();
    let mut expected = expected.to_vec();
    got.sort_unstable();
    expected.sort_unstable();
    assert_eq!(got, expected, "faults found: {found:#?}");
    for fault in &found {
        assert!(!fault.reason.is_empty() && !fault.remedy.is_empty(), "{fault:?}");
    }
}

/// Changes to a good scene, and the faults they must bring: neither more nor fewer.
type Case = (&'static [(&'static str, fn() -> Value)], &'static [(&'static str, &'static str)]);

macro_rules! case {
    ([$($at:literal = $value:tt),* $(,)?], [$($pointer:literal $code:literal),* $(,)?]) => {
        (&[$(($at, (|| json!($value)) as fn() -> Value)),*], &[$(($pointer, $code)),*])
    };
}

#[rustfmt::skip]
const STRUCTURE: &[Case] = &[
    case!(["/name" = 3], ["/name" "wrong_type"]),
    case!(["/name" = null], ["/name" "missing_field"]),
    case!(["/domain" = null], ["/domain" "missing_field"]),
    case!(["/bodies" = null, "/time" = null], ["/bodies" "missing_field", "/time" "missing_field"]),
    case!(["/gravty" = [0, 0, -9]], ["/gravty" "unknown_field"]),
    case!(["/domain/dx" = "0.1"], ["/domain/dx" "wrong_type"]),
    case!(["/domain/min/1" = "0"], ["/domain/min/1" "wrong_type"]),
    case!(["/domain/boundary/z-" = "slippy"], ["/domain/boundary/z-" "unknown_value"]),
    case!(["/domain/boundary/z-" = 4], ["/domain/boundary/z-" "wrong_type"]),
    case!(["/domain/boundary/z-" = { "contact": "seperate" }], ["/domain/boundary/z-/contact" "unknown_value"]),
    case!(["/domain/boundary/z-" = { "friction": 0.1 }], ["/domain/boundary/z-/contact" "missing_field"]),
    case!(["/materials/water/model" = "fluid"], ["/materials/water/model" "unknown_value"]),
    case!(["/materials/water/model" = null], ["/materials/water/model" "missing_field"]),
    case!(["/materials/water/youngs_modulus" = 1], ["/materials/water/youngs_modulus" "unknown_field"]),
    case!(["/materials/jelly/poissons_ratio" = null], ["/materials/jelly/poissons_ratio" "missing_field"]),
    case!(["/materials/jelly" = []], ["/materials/jelly" "wrong_type"]),
    case!(["/bodies/0/shape" = { "ball": { "radius": 1 } }], ["/bodies/0/shape/ball" "unknown_value"]),
    case!(["/bodies/0/shape" = {}], ["/bodies/0/shape" "not_one_variant"]),
    case!(["/bodies/0/shape" = { "box": {}, "sphere": {} }], ["/bodies/0/shape" "not_one_variant"]),
    case!(["/bodies/0/shape" = { "sphere": { "radius": "big" } }],
          ["/bodies/0/shape/sphere/radius" "wrong_type", "/bodies/0/shape/sphere/center" "missing_field"]),
    case!(["/bodies/0/shape" = { "union": [{ "cube": 1 }, { "sphere": { "center": [0.5, 0.5, 0.5], "radius": true } }] }],
          ["/bodies/0/shape/union/0/cube" "unknown_value", "/bodies/0/shape/union/1/sphere/radius" "wrong_type"]),
    case!(["/bodies/0/particles_per_cell" = (-8)], ["/bodies/0/particles_per_cell" "out_of_range"]),
    case!(["/bodies/0/particles_per_cell" = 8.5], ["/bodies/0/particles_per_cell" "wrong_type"]),
    case!(["/bodies/0/sampling" = "poisson"], ["/bodies/0/sampling" "unknown_value"]),
    case!(["/bodies/1" = "b"], ["/bodies/1" "wrong_type"]),
    case!(["/solver/kernel" = "quadratc"], ["/solver/kernel" "unknown_value"]),
    case!(["/solver/integrator" = "implict"], ["/solver/integrator" "unknown_value"]),
    case!(["/solver/implicit" = { "method": "newton" }], ["/solver/implicit/method" "unknown_value"]),
    case!(["/solver/implicit" = { "smoother": "sor", "levels": 2.5 }],
          ["/solver/implicit/smoother" "unknown_value", "/solver/implicit/levels" "wrong_type"]),
    case!(["/solver/implicit" = { "tolerence": 1e-7 }], ["/solver/implicit/tolerence" "unknown_field"]),
    case!(["/solver/implicit" = "hot"], ["/solver/implicit" "wrong_type"]),
    case!(["/output/fields/1" = "temperature"], ["/output/fields/1" "unknown_value"]),
    case!(["/a~1b" = 1], ["/a~1b" "unknown_field"]),
    case!(["/seed" = (-1)], ["/seed" "out_of_range"]),
];

#[rustfmt::skip]
const MEANING: &[Case] = &[
    case!(["/gridfall" = 2], ["/gridfall" "unsupported_version"]),
    case!(["/dimension" = 4], ["/dimension" "out_of_range"]),
    case!(["/name" = " "], ["/name" "empty"]),
    case!(["/gravity" = [0, -9.81]], ["/gravity" "wrong_length"]),
    case!(["/domain/dx" = 0], ["/domain/dx" "not_positive"]),
    case!(["/domain/dx" = (-0.1)], ["/domain/dx" "not_positive"]),
    case!(["/domain/dx" = 0.06], ["/domain/max/0" "not_whole_cells", "/domain/max/1" "not_whole_cells", "/domain/max/2" "not_whole_cells"]),
    case!(["/domain/dx" = 1e-6], ["/domain/max/0" "too_many_cells", "/domain/max/1" "too_many_cells", "/domain/max/2" "too_many_cells"]),
    case!(["/domain/max/2" = 0], ["/domain/max/2" "empty"]),
    case!(["/domain/max" = [1, 1]], ["/domain/max" "wrong_length"]),
    case!(["/domain/boundary/x-" = { "contact": "slip" }], ["/domain/boundary/x" "conflicting_walls"]),
    case!(["/domain/boundary/y+" = "periodic"], ["/domain/boundary/y+" "periodic_wall"]),
    case!(["/domain/boundary/w" = "periodic"], ["/domain/boundary/w" "unknown_wall"]),
    case!(["/domain/boundary/y" = { "contact": "slip", "friction": 0.2 }], ["/domain/boundary/y/friction" "friction_unused"]),
    case!(["/domain/boundary/y" = { "contact": "separate", "friction": (-0.2) }], ["/domain/boundary/y/friction" "negative"]),
    case!(["/domain/max/0" = 1.0625], ["/domain/boundary/x" "periodic_cells"]),
    case!(["/materials/water/density" = (-1000)], ["/materials/water/density" "not_positive"]),
    case!(["/materials/water/bulk_modulus" = 0], ["/materials/water/bulk_modulus" "not_positive"]),
    case!(["/materials/water/viscosity" = (-1)], ["/materials/water/viscosity" "negative"]),
    case!(["/materials/water/gamma" = 1], ["/materials/water/gamma" "out_of_range"]),
    case!(["/materials/jelly/poissons_ratio" = 0.5], ["/materials/jelly/poissons_ratio" "out_of_range"]),
    case!(["/materials/jelly/poissons_ratio" = (-1)], ["/materials/jelly/poissons_ratio" "out_of_range"]),
    case!(["/materials/jelly/youngs_modulus" = 0], ["/materials/jelly/youngs_modulus" "not_positive"]),
    case!(["/bodies" = []], ["/bodies" "empty"]),
    case!(["/bodies/1/name" = "a"], ["/bodies/1/name" "duplicate_name"]),
    case!(["/bodies/1/material" = "jely"], ["/bodies/1/material" "unknown_material"]),
    case!(["/bodies/1/particles_per_cell" = 9], ["/bodies/1/particles_per_cell" "not_a_power"]),
    case!(["/bodies/1/particles_per_cell" = 0], ["/bodies/1/particles_per_cell" "not_a_power"]),
    case!(["/bodies/1/velocity" = [1]], ["/bodies/1/velocity" "wrong_length"]),
    case!(["/bodies/1/angular_velocity" = [1]], ["/bodies/1/angular_velocity" "wrong_length"]),
    case!(["/bodies/1/velocity_gradient" = [[1, 0], [0, 1]]], ["/bodies/1/velocity_gradient" "wrong_length"]),
    case!(["/bodies/1/velocity_gradient" = [[1, 0, 0], [0, 1], [0, 0, 1]]], ["/bodies/1/velocity_gradient/1" "wrong_length"]),
    case!(["/bodies/1/deformation_gradient" = [[1, 0, 0], [0, 1, 0], [0, 0, (-1)]]], ["/bodies/1/deformation_gradient" "not_positive"]),
    case!(["/bodies/1/deformation_gradient" = [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "/bodies/1/J" = 1], ["/bodies/1/J" "conflicting_fields"]),
    case!(["/bodies/1/J" = 0], ["/bodies/1/J" "not_positive"]),
    case!(["/bodies/1/shape/sphere/radius" = (-1)], ["/bodies/1/shape/sphere/radius" "not_positive"]),
    case!(["/bodies/1/shape/sphere/radius" = 0.5], ["/bodies/1/shape" "outside_domain"]),
    case!(["/bodies/1/shape/sphere/center" = [7, 7, 7]], ["/bodies/1/shape" "outside_domain"]),
    case!(["/bodies/1/shape/sphere/radius" = 1e9], ["/bodies/1/shape" "outside_domain"]),
    case!(["/bodies/1/shape/sphere/radius" = 1e300], ["/bodies/1/shape" "outside_domain"]),
    case!(["/bodies/1/shape/sphere/radius" = 1e-4], ["/bodies/1/shape" "no_particles"]),
    case!(["/bodies/0/shape/box/max/1" = 0], ["/bodies/0/shape/box/max/1" "empty"]),
    case!(["/bodies/0/shape" = { "difference": [{ "sphere": { "center": [0.5, 0.5, 0.5], "radius": 0.2 } },
                                              { "sphere": { "center": [0.5, 0.5, 0.5], "radius": 0.3 } }] }], ["/bodies/0/shape" "no_particles"]),
    case!(["/bodies/0/shape" = { "intersection": [{ "sphere": { "center": [0.2, 0.5, 0.5], "radius": 0.1 } },
                                                { "sphere": { "center": [0.8, 0.5, 0.5], "radius": 0.1 } }] }], ["/bodies/0/shape" "no_particles"]),
    case!(["/bodies/0/shape" = { "difference": [{ "sphere": { "center": [0.5, 0.5, 0.5], "radius": 0.2 } }] }], ["/bodies/0/shape/difference" "too_few_shapes"]),
    case!(["/bodies/0/shape" = { "union": [] }], ["/bodies/0/shape/union" "too_few_shapes"]),
    case!(["/bodies/0/shape" = { "half-space": { "point": [0, 0, 0], "normal": [0, 0, 0] } }], ["/bodies/0/shape/half-space/normal" "zero_vector"]),
    case!(["/bodies/0/shape" = { "cylinder": { "center": [0.5, 0.5, 0.5], "axis": [0, 0], "radius": 0.1, "height": 0 } }],
          ["/bodies/0/shape/cylinder/axis" "wrong_length", "/bodies/0/shape/cylinder/height" "not_positive"]),
    case!(["/bodies/0/shape" = { "capsule": { "center": [0.5, 0.5, 0.5], "axis": [0, 0, 0], "radius": 0, "height": 0.1 } }],
          ["/bodies/0/shape/capsule/axis" "zero_vector", "/bodies/0/shape/capsule/radius" "not_positive"]),
    case!(["/bodies/0/shape" = { "cone": { "base": [0.5, 0.5], "radius": 0.1, "top_radius": (-0.1), "height": 0 } }],
          ["/bodies/0/shape/cone/base" "wrong_length", "/bodies/0/shape/cone/top_radius" "negative", "/bodies/0/shape/cone/height" "not_positive"]),
    case!(["/bodies/0/shape" = { "scale": { "factor": 0, "center": [0.5], "shape": { "sphere": { "center": [0, 0, 0], "radius": 0 } } } }],
          ["/bodies/0/shape/scale/factor" "not_positive", "/bodies/0/shape/scale/center" "wrong_length", "/bodies/0/shape/scale/shape/sphere/radius" "not_positive"]),
    case!(["/bodies/0/shape" = { "heightfield": { "min": [0, 0], "max": [0.5, 0], "base": 0, "heights": [[0.1, 0.2], [0.3, (-0.1)]] } }],
          ["/bodies/0/shape/heightfield/max/1" "empty", "/bodies/0/shape/heightfield/heights/1/1" "below_base"]),
    case!(["/bodies/0/shape" = { "heightfield": { "min": [0], "max": [0.5, 0.5], "base": 0, "heights": [[0.1, 0.2], [0.3]] } }],
          ["/bodies/0/shape/heightfield/min" "wrong_length", "/bodies/0/shape/heightfield/heights/1" "wrong_length"]),
    case!(["/bodies/0/shape" = { "heightfield": { "min": [0, 0], "max": [0.5, 0.5], "base": 0, "heights": [[0.1, 0.2]] } }],
          ["/bodies/0/shape/heightfield/heights" "wrong_length"]),
    case!(["/bodies/0/shape" = { "mesh": { "file": "a.obj" } }], ["/bodies/0/shape/mesh/file" "file_refused"]),
    case!(["/bodies/0/shape" = { "torus": { "center": [0.5, 0.5, 0.5], "major_radius": 0.2, "minor_radius": 0 } }], ["/bodies/0/shape/torus/minor_radius" "not_positive"]),
    case!(["/bodies/0/shape" = { "shell": { "thickness": 0, "shape": { "sphere": { "center": [0.5, 0.5, 0.5], "radius": 0 } } } }],
          ["/bodies/0/shape/shell/thickness" "not_positive", "/bodies/0/shape/shell/shape/sphere/radius" "not_positive"]),
    case!(["/colliders/0/friction" = 0.5], ["/colliders/0/friction" "friction_unused"]),
    case!(["/colliders/0/shape" = { "half-space": { "point": [0, 0, 0], "normal": [0, 0, 1] } }], ["/colliders/0/motion/center" "missing_field"]),
    case!(["/colliders/0/motion/linear_velocity" = [1]], ["/colliders/0/motion/linear_velocity" "wrong_length"]),
    case!(["/time/end" = 0], ["/time/end" "not_positive"]),
    case!(["/time/end" = 1.01], ["/time/end" "not_whole_frames"]),
    case!(["/time/end" = 1e6], ["/time/end" "too_many_frames"]),
    case!(["/time/frame_rate" = (-24)], ["/time/frame_rate" "not_positive"]),
    case!(["/solver/cfl" = 0], ["/solver/cfl" "out_of_range"]),
    case!(["/solver/cfl" = 1.5], ["/solver/cfl" "out_of_range"]),
    case!(["/solver/max_dt" = 0], ["/solver/max_dt" "not_positive"]),
    case!(["/solver/max_dt" = 1e-12], ["/time/end" "too_many_steps"]),
    case!(["/solver/implicit" = { "tolerance": 0 }], ["/solver/implicit/tolerance" "out_of_range"]),
    case!(["/solver/implicit" = { "tolerance": 0.02, "levels": 0, "max_iterations": 0 }],
          ["/solver/implicit/tolerance" "out_of_range", "/solver/implicit/levels" "out_of_range", "/solver/implicit/max_iterations" "out_of_range"]),
    case!(["/solver/implicit" = { "tolerance": (-1e-7), "levels": 11 }], ["/solver/implicit/tolerance" "out_of_range", "/solver/implicit/levels" "out_of_range"]),
    case!(["/solver/implicit" = { "tolerance": 1e-2, "levels": 1, "max_iterations": 1 }], []),
    case!(["/solver/integrator" = "implicit"], ["/solver/integrator" "unsupported"]),
    case!(["/solver/integrator" = "implicit", "/bodies/0/material" = "jelly"], []),
    case!(["/solver/integrator" = "implicit", "/bodies/0/material" = "jelly", "/solver/implicit" = { "method": "admm" }, "/solver/transfer" = "pic"], []),
    case!(["/solver/integrator" = "implicit", "/bodies/0/material" = "jelly", "/solver/implicit" = { "method": "admm" },
           "/materials/jelly" = { "model": "von-mises", "density": 1000, "youngs_modulus": 1e5, "poissons_ratio": 0.3, "yield_stress": 1e3 }],
          ["/solver/implicit/method" "unsupported"]),
    case!(["/solver/integrator" = "auto", "/solver/implicit" = { "method": "admm" }], []),
    case!(["/output/preview_points" = 0], ["/output/preview_points" "out_of_range"]),
    case!(["/output/fields/1" = "velocity"], ["/output/fields/1" "duplicate"]),
];

/// Faults of structure and of meaning in several places at once.
#[rustfmt::skip]
const TOGETHER: &[Case] = &[
    case!(["/solver/kernel" = 3, "/time/end" = (-1), "/bodies/0/velocity" = "up", "/bodies/0/material" = "watr", "/materials/jelly/density" = (-1)],
          ["/solver/kernel" "wrong_type", "/time/end" "not_positive", "/bodies/0/velocity" "wrong_type",
           "/bodies/0/material" "unknown_material", "/materials/jelly/density" "not_positive"]),
    // Without a domain nothing can be outside it, but radii can still be wrong.
    case!(["/domain" = null, "/bodies/1/shape/sphere/radius" = (-1), "/bodies/0/shape/box/max" = [9, 9, 9]],
          ["/domain" "missing_field", "/bodies/1/shape/sphere/radius" "not_positive"]),
    // A body that cannot be read keeps its name and its material under judgement.
    case!(["/bodies/0/shape" = "box", "/bodies/0/name" = "b", "/bodies/0/material" = "ice"],
          ["/bodies/0/shape" "wrong_type", "/bodies/1/name" "duplicate_name", "/bodies/0/material" "unknown_material"]),
    // A material with a fault still exists.
    case!(["/materials/water/density" = "heavy"], ["/materials/water/density" "wrong_type"]),
    // Without a dimension, lengths of vectors cannot be judged.
    case!(["/dimension" = "3D", "/gravity" = [0, -9.81], "/materials/water/gamma" = (-7)],
          ["/dimension" "wrong_type", "/materials/water/gamma" "out_of_range"]),
    // An unknown field does not keep the rest from being judged.
    case!(["/domain/walls" = {}, "/bodies/1/shape/sphere/radius" = 0.5], ["/domain/walls" "unknown_field", "/bodies/1/shape" "outside_domain"]),
];

#[rustfmt::skip]
const FLAT: &[Case] = &[
    case!(["/bodies/0/angular_velocity" = [0, 0, 1]], ["/bodies/0/angular_velocity" "wrong_length"]),
    case!(["/bodies/0/particles_per_cell" = 8], ["/bodies/0/particles_per_cell" "not_a_power"]),
    case!(["/bodies/0/shape/rotate/axis" = [1, 0, 0]], ["/bodies/0/shape/rotate/axis" "needs_3d"]),
    case!(["/bodies/0/shape" = { "torus": { "center": [0.5, 0.5, 0.5], "major_radius": 0.2, "minor_radius": 0 } }], ["/bodies/0/shape/torus" "needs_3d"]),
    case!(["/bodies/0/shape" = { "cylinder": { "center": [0.5, 0.5], "radius": 0.2, "height": 1 } }], ["/bodies/0/shape/cylinder" "needs_3d"]),
    case!(["/bodies/0/shape" = { "capsule": { "center": [0.5, 0.5], "radius": 0.2, "height": 1 } }], ["/bodies/0/shape/capsule" "needs_3d"]),
    case!(["/bodies/0/shape" = { "cone": { "base": [0.5, 0.5], "radius": 0.2, "height": 1 } }], ["/bodies/0/shape/cone" "needs_3d"]),
    case!(["/bodies/0/shape" = { "heightfield": { "min": [0.1], "max": [0.5], "base": 0, "heights": [[0.1, 0.2], [0.3, 0.1]] } }],
          ["/bodies/0/shape/heightfield/heights" "wrong_length"]),
    case!(["/bodies/0/shape" = { "mesh": { "file": "a.obj" } }], ["/bodies/0/shape/mesh" "needs_3d"]),
    case!(["/domain/boundary" = { "z-": { "contact": "slip" } }], ["/domain/boundary/z-" "unknown_wall"]),
    case!(["/domain/min" = [0, 0, 0]], ["/domain/min" "wrong_length"]),
    case!(["/bodies/0/grips" = [{ "name": "g", "shape": { "sphere": { "center": [0.5, 0.5], "radius": 0.1 } },
                                  "motion": { "axis": [0, 1], "keyframes": [{ "time": 0 }, { "time": 1, "angle_degrees": 9 }] } }]],
          ["/bodies/0/grips/0/motion/axis" "needs_3d"]),
];

/// What moves by prescription.
#[rustfmt::skip]
const MOTION: &[Case] = &[
    case!(["/colliders/0/motion" = { "keyframes": [{ "time": 0 }, { "time": 1, "offset": [0, 0, 0.1], "angle_degrees": 30 }] }], []),
    case!(["/colliders/0/motion/keyframes" = [{ "time": 0 }, { "time": 1 }]], ["/colliders/0/motion/keyframes" "conflicting_fields"]),
    case!(["/colliders/0/motion" = { "keyframes": [{ "time": 0.5 }] }], ["/colliders/0/motion/keyframes" "too_few_keyframes"]),
    case!(["/colliders/0/motion" = { "keyframes": [{ "time": 0 }, { "time": 0.5 }, { "time": 0.5 }] }], ["/colliders/0/motion/keyframes/2/time" "not_rising"]),
    case!(["/colliders/0/motion" = { "keyframes": [{ "time": (-1) }, { "time": 0.5, "offset": [1] }] }],
          ["/colliders/0/motion/keyframes/0/time" "negative", "/colliders/0/motion/keyframes/1/offset" "wrong_length"]),
    case!(["/colliders/0/motion" = { "keyframes": [{ "offset": [0, 0, 0] }, { "time": 0.5 }] }], ["/colliders/0/motion/keyframes/0/time" "missing_field"]),
    case!(["/colliders/0/motion/axis" = [1, 0, 0]], ["/colliders/0/motion/axis" "axis_unused"]),
    case!(["/colliders/0/motion" = { "axis": [0, 0, 0], "keyframes": [{ "time": 0 }, { "time": 1 }] }], ["/colliders/0/motion/axis" "zero_vector"]),
    case!(["/colliders/0/shape" = { "half-space": { "point": [0, 0, 0], "normal": [0, 0, 1] } },
           "/colliders/0/motion" = { "keyframes": [{ "time": 0 }, { "time": 1, "angle_degrees": 9 }] }], ["/colliders/0/motion/center" "missing_field"]),
    case!(["/colliders/0/name" = "wall_x-"], ["/colliders/0/name" "reserved_name"]),
    case!(["/colliders/0/from" = (-1)], ["/colliders/0/from" "negative"]),
    case!(["/colliders/0/from" = 0.5, "/colliders/0/until" = 0.5], ["/colliders/0/until" "empty"]),
    case!(["/colliders/0/until" = 0], ["/colliders/0/until" "empty"]),
    case!(["/bodies/1/grips" = [{ "name": "top", "shape": { "sphere": { "center": [0.7, 0.7, 0.9], "radius": 0.1 } } }]], []),
    case!(["/bodies/1/grips" = [{ "name": "top", "shape": { "sphere": { "center": [0.7, 0.7, 0.9], "radius": 0 } }, "until": 0 }]],
          ["/bodies/1/grips/0/shape/sphere/radius" "not_positive", "/bodies/1/grips/0/until" "empty"]),
    case!(["/bodies/1/grips" = [{ "name": "top", "shape": { "sphere": { "center": [0.7, 0.7, 0.9], "radius": 0.1 } }, "contact": "slip" }]],
          ["/bodies/1/grips/0/contact" "unknown_field"]),
    case!(["/bodies/1/grips" = [{ "name": "top", "shape": { "sphere": { "center": [0.7, 0.7, 0.9], "radius": 0.1 } } },
                                { "name": "top", "shape": { "sphere": { "center": [0.7, 0.7, 0.5], "radius": 0.1 } },
                                  "motion": { "angular_velocity": [1], "linear_velocity": [0, 0] } }]],
          ["/bodies/1/grips/1/name" "duplicate_name", "/bodies/1/grips/1/motion/angular_velocity" "wrong_length",
           "/bodies/1/grips/1/motion/linear_velocity" "wrong_length"]),
    case!(["/colliders/0/name" = "b/top", "/bodies/1/grips" = [{ "name": "top", "shape": { "sphere": { "center": [0.7, 0.7, 0.9], "radius": 0.1 } } }]],
          ["/bodies/1/grips/0/name" "duplicate_name"]),
];

/// Sources: a stream through a box that falls along z.
#[rustfmt::skip]
const SOURCES: &[Case] = &[
    case!(["/sources/0/velocity" = [0, 0, 0]], ["/sources/0/velocity" "zero_vector"]),
    case!(["/sources/0/velocity" = [0, 1]], ["/sources/0/velocity" "wrong_length"]),
    case!(["/sources/0/velocity" = null], ["/sources/0/velocity" "missing_field"]),
    case!(["/sources/0/material" = "watr"], ["/sources/0/material" "unknown_material"]),
    case!(["/sources/0/name" = "b"], ["/sources/0/name" "duplicate_name"]),
    case!(["/sources/0/particles_per_cell" = 9], ["/sources/0/particles_per_cell" "not_a_power"]),
    case!(["/sources/0/sampling" = "jittered"], ["/sources/0/sampling" "unsupported"]),
    case!(["/sources/0/until" = 0], ["/sources/0/until" "empty"]),
    case!(["/sources/0/from" = 5], ["/sources/0/until" "empty"]),
    case!(["/sources/0/from" = 5, "/sources/0/until" = null], ["/sources/0/shape" "no_particles"]),
    case!(["/sources/0/velocity" = [0, 0, (-9)]], ["/sources/0/shape" "outside_domain"]),
    case!(["/sources/0/shape" = { "half-space": { "point": [0, 0, 0.5], "normal": [0, 0, 1] } }], ["/sources/0/shape" "unbounded_shape"]),
    case!(["/sources/0/shape/box/max/0" = 0], ["/sources/0/shape/box/max/0" "empty"]),
    case!(["/sources/0/shape/box" = { "min": [0.5, 0.5, 0.7], "max": [0.501, 0.501, 0.8] }], ["/sources/0/shape" "no_particles"]),
    case!(["/bodies" = [], "/sources" = []], ["/bodies" "empty"]),
    case!(["/bodies" = []], []),
];

fn pouring() -> Value {
    let source = json!({ "name": "tap", "material": "water", "velocity": [0, 0, -1], "until": 0.5,
                         "shape": { "box": { "min": [0.5, 0.5, 0.75], "max": [0.625, 0.625, 0.8125] } } });
    changed(good(), &[("/sources", json!([source]))])
}

fn run(base: fn() -> Value, cases: &[Case]) {
    for (changes, expected) in cases {
        let changes: Vec<(&str, Value)> = changes.iter().map(|(at, value)| (*at, value())).collect();
        println!("{changes:?}");
        expect(&changed(base(), &changes), &Limits::default(), expected);
    }
}

#[test]
fn the_scenes_that_the_cases_change_are_good() {
    expect(&good(), &Limits::default(), &[]);
    expect(&flat(), &Limits::default(), &[]);
    expect(&pouring(), &Limits::default(), &[]);
}

#[test]
fn structure_is_judged_everywhere() {
    run(good, STRUCTURE);
}

#[test]
fn meaning_is_judged_everywhere() {
    run(good, MEANING);
}

#[test]
fn motions_are_judged() {
    run(good, MOTION);
    run(pouring, SOURCES);
}

#[test]
fn faults_do_not_hide_each_other() {
    run(good, TOGETHER);
}

#[test]
fn flat_scenes_have_rules_of_their_own() {
    run(flat, FLAT);
}

#[test]
fn limits_are_judged_before_anything_is_made() {
    let limits = Limits::default();
    expect(
        &good(),
        &Limits { max_particles: 1000, ..limits },
        &[("/bodies/0/shape", "too_many_particles"), ("/bodies/1/shape", "too_many_particles")],
    );
    expect(&good(), &Limits { max_particles: 5000, ..limits }, &[("/bodies", "too_many_particles")]);
    expect(&good(), &Limits { max_memory_bytes: 5 << 20, ..limits }, &[("/bodies", "too_much_memory")]);
    expect(&good(), &Limits { max_steps: 10, ..limits }, &[("/time/end", "too_many_steps")]);
    // 10^12 particles are counted, not made.
    let huge = changed(good(), &[("/domain/dx", json!(1.0 / 16384.0)), ("/bodies/1/particles_per_cell", json!(27))]);
    expect(&huge, &limits, &[("/bodies/0/shape", "too_many_particles"), ("/bodies/1/shape", "too_many_particles")]);
}

#[test]
fn a_thin_shape_that_is_costly_to_sample_is_refused() {
    let shell =
        json!({ "shell": { "thickness": 0.005, "shape": { "sphere": { "center": [0.5, 0.5, 0.5], "radius": 0.2 } } } });
    let small = json!({ "box": { "min": [0, 0, 0], "max": [0.1, 0.1, 0.1] } });
    let thin = |sampling| {
        changed(
            good(),
            &[("/bodies/0/shape", small.clone()), ("/bodies/1/shape", shell.clone()), ("/bodies/1/sampling", sampling)],
        )
    };
    let limits = Limits { max_memory_bytes: 300 << 10, ..Limits::default() };
    expect(&thin(json!("jittered")), &limits, &[]);
    expect(&thin(json!("poisson-disk")), &limits, &[("/bodies/1/shape", "too_much_memory")]);
}

#[test]
fn syntax_errors_name_line_and_column() {
    for (text, code, place) in [
        ("{ \"gridfall\": 1,\n \"name\": }", "syntax", "line 2, column 10"),
        ("", "syntax", "line 1, column 0"),
        ("{ \"a\": NaN }", "syntax", "line 1, column 8"),
        ("{} x", "syntax", "line 1, column 4"),
        ("{ \"domain\": { \"dx\": 1e999 } }", "not_finite", "line 1, column"),
    ] {
        let found = scene::parse(text).unwrap_err();
        assert_eq!((found.len(), found[0].code, found[0].pointer.as_str()), (1, code, ""), "{text}: {found:?}");
        assert!(found[0].reason.contains(place), "{text}: {}", found[0].reason);
    }
    let deep = format!("{}{}", "[".repeat(5000), "]".repeat(5000));
    assert_eq!(scene::parse(&deep).unwrap_err()[0].code, "too_deep");
}

#[test]
fn a_key_that_occurs_twice_is_a_fault() {
    let text = r#"{ "materials": { "a": 1, "a": 2 }, "bodies": [ { "name": "x", "name": "y" } ] }"#;
    let found = scene::parse(text).unwrap_err();
    let pointers: Vec<&str> = found.iter().map(|f| f.pointer.as_str()).collect();
    assert_eq!(pointers, ["/materials/a", "/bodies/0/name"]);
    assert!(found.iter().all(|f| f.code == "duplicate_key"));
}

#[test]
fn nested_shapes_beyond_the_evaluators_stack_are_refused() {
    let ball = || json!({ "sphere": { "center": [0.5, 0.5, 0.5], "radius": 0.3 } });
    let nest = |levels: usize, key: &str| (0..levels).fold(ball(), |inner, _| json!({ key: [ball(), inner] }));
    // A chain of unions is evaluated deepest first and needs no stack; differences cannot be turned round.
    for (key, levels, expected) in
        [("union", 30, None), ("difference", 7, Some("no_particles")), ("difference", 8, Some("too_deep"))]
    {
        let document = changed(good(), &[("/bodies/1/shape", nest(levels, key))]);
        let found = faults(&document, &Limits::default());
        let codes: Vec<&str> =
            found.iter().map(|f| f.code).filter(|code| *code != "no_particles" || levels == 7).collect();
        match expected {
            Some(code) if code == "no_particles" => assert!(found.iter().all(|f| f.code == code), "{found:?}"),
            Some(code) => assert_eq!(codes, [code]),
            None => assert!(found.is_empty(), "{found:?}"),
        }
    }
}

#[test]
fn messages_are_for_people() {
    let document = changed(
        good(),
        &[
            ("/bodies/0/angular-velocty", json!([0, 0, -9])),
            ("/solver/kernel", json!("quadratc")),
            ("/domain/dx", json!(0.06)),
            ("/bodies/1/material", json!("jely")),
        ],
    );
    let text: Vec<String> = faults(&document, &Limits::default()).iter().map(Fault::to_string).collect();
    let text = text.join("\n");
    for part in ["did you mean `angular_velocity`?", "did you mean `quadratic`?", "did you mean `jelly`?"] {
        assert!(text.contains(part), "{text}");
    }
    println!("{text}");
}

#[test]
fn material_parameters_out_of_range() {
    let with = |material: &str| {
        format!(
            r#"{{ "gridfall": 1, "name": "m", "domain": {{ "min": [0,0,0], "max": [1,1,1], "dx": 0.125 }}, "materials": {{ "m": {material} }},
            "bodies": [ {{ "name": "b", "material": "m", "shape": {{ "box": {{ "min": [0.2,0.2,0.2], "max": [0.8,0.8,0.8] }} }} }} ], "time": {{ "end": 1 }} }}"#
        )
    };
    let solid = r#""density": 1000, "youngs_modulus": 1e5, "poissons_ratio": 0.3"#;
    for (parameters, pointer) in [
        (r#""model": "drucker-prager", "friction_angle_degrees": 90"#, "friction_angle_degrees"),
        (r#""model": "von-mises", "yield_stress": 0"#, "yield_stress"),
        (r#""model": "nacc", "M": 0, "beta": 0.5, "xi": 3, "alpha0": -0.01"#, "M"),
        (r#""model": "nacc", "M": 2, "beta": -1, "xi": 3, "alpha0": -0.01"#, "beta"),
        (r#""model": "snow", "critical_compression": 1"#, "critical_compression"),
        (r#""model": "snow", "hardening": -1"#, "hardening"),
        (r#""model": "von-mises", "yield_stress": 1e3, "elasticity": "hooke""#, "elasticity"),
    ] {
        let text = with(&format!("{{ {parameters}, {solid} }}"));
        let scene = gridfall_scene::parse(&text);
        let faults =
            scene.and_then(|scene| gridfall_scene::problem(&scene, &Default::default()).map(drop)).unwrap_err();
        assert_eq!(faults.len(), 1, "{faults:?}");
        assert_eq!(faults[0].pointer, format!("/materials/m/{pointer}"));
        assert!(!faults[0].remedy.is_empty());
    }
}

#[test]
fn what_sources_bring_counts() {
    // 4 × 4 points every 1/32 m for half a metre: 16 layers of 16.
    let limits = |max_particles| Limits { max_particles, ..Limits::default() };
    let alone = changed(pouring(), &[("/bodies", json!([]))]);
    expect(&alone, &limits(256), &[]);
    expect(&alone, &limits(255), &[("/sources/0/shape", "too_many_particles")]);
}
