//! Good scenes, and changes to them with exactly the faults that they must cause.

use serde_json::{Value, json};

/// A 3D scene without faults.
pub fn good() -> Value {
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
        "colliders": [
            { "name": "post", "shape": { "cylinder": { "center": [0.8, 0.2, 0.5], "radius": 0.1, "height": 1 } },
              "contact": "slip", "motion": { "angular_velocity": [0, 0, 1] } } ],
        "time": { "end": 1, "frame_rate": 24 },
        "solver": { "kernel": "compact" },
        "output": { "fields": ["velocity", "J"] },
    })
}

/// A 2D scene without faults.
pub fn flat() -> Value {
    json!({
        "gridfall": 1, "name": "flat", "dimension": 2, "domain": { "min": [0, 0], "max": [1, 1], "dx": 0.0625 },
        "materials": {
            "jelly": { "model": "neo-hookean", "density": 1000, "youngs_modulus": 1e5, "poissons_ratio": 0.3 } },
        "bodies": [ { "name": "a", "material": "jelly", "angular_velocity": [1],
                      "shape": { "rotate": { "angle_degrees": 30, "center": [0.5, 0.5],
                                 "shape": { "box": { "min": [0.2, 0.2], "max": [0.5, 0.5] } } } } } ],
        "time": { "end": 1 },
    })
}

/// [`good`] with a source.
pub fn pouring() -> Value {
    let source = json!({ "name": "tap", "material": "water", "velocity": [0, 0, -1], "until": 0.5,
                         "shape": { "box": { "min": [0.5, 0.5, 0.75], "max": [0.625, 0.625, 0.8125] } } });
    changed(good(), &[("/sources", json!([source]))])
}

/// `changes` are pairs of JSON pointer and value; a missing member is made, `null` removes one.
pub fn changed(mut document: Value, changes: &[(&str, Value)]) -> Value {
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

/// Changes to a good scene, and exactly the faults that they must cause.
pub type Case = (&'static [(&'static str, fn() -> Value)], &'static [(&'static str, &'static str)]);

macro_rules! case {
    ([$($at:literal = $value:tt),* $(,)?], [$($pointer:literal $code:literal),* $(,)?]) => {
        (&[$(($at, (|| json!($value)) as fn() -> Value)),*], &[$(($pointer, $code)),*])
    };
}
pub(crate) use case;

/// Faults of structure: types, missing and unknown fields, unknown choices.
#[rustfmt::skip]
pub const STRUCTURE: &[Case] = &[
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
    case!(["/bodies/0/shape" = { "union": [{ "cube": 1 }, { "sphere": { "center": [0.5, 0.5, 0.5],
           "radius": true } }] }],
          ["/bodies/0/shape/union/0/cube" "unknown_value", "/bodies/0/shape/union/1/sphere/radius" "wrong_type"]),
    case!(["/bodies/0/particles_per_cell" = (-8)], ["/bodies/0/particles_per_cell" "out_of_range"]),
    case!(["/bodies/0/particles_per_cell" = 8.5], ["/bodies/0/particles_per_cell" "wrong_type"]),
    case!(["/bodies/0/sampling" = "poisson"], ["/bodies/0/sampling" "unknown_value"]),
    case!(["/bodies/1" = "b"], ["/bodies/1" "wrong_type"]),
    case!(["/solver/kernel" = "quadratc"], ["/solver/kernel" "unknown_value"]),
    case!(["/solver/integrator" = "implict"], ["/solver/integrator" "unknown_value"]),
    case!(["/solver/implicit" = { "method": "steepest" }], ["/solver/implicit/method" "unknown_value"]),
    case!(["/solver/implicit" = { "smoother": "sor", "levels": 2.5 }],
          ["/solver/implicit/smoother" "unknown_value", "/solver/implicit/levels" "wrong_type"]),
    case!(["/solver/implicit" = { "tolerence": 1e-7 }], ["/solver/implicit/tolerence" "unknown_field"]),
    case!(["/solver/implicit" = "hot"], ["/solver/implicit" "wrong_type"]),
    case!(["/output/fields/1" = "temperature"], ["/output/fields/1" "unknown_value"]),
    case!(["/a~1b" = 1], ["/a~1b" "unknown_field"]),
    case!(["/seed" = (-1)], ["/seed" "out_of_range"]),
];

/// Faults of meaning.
#[rustfmt::skip]
pub const MEANING: &[Case] = &[
    case!(["/gridfall" = 2], ["/gridfall" "unsupported_version"]),
    case!(["/dimension" = 4], ["/dimension" "out_of_range"]),
    case!(["/dimension" = 40], ["/dimension" "out_of_range"]),
    case!(["/name" = " "], ["/name" "empty"]),
    case!(["/gravity" = [0, -9.81]], ["/gravity" "wrong_length"]),
    case!(["/domain/dx" = 0], ["/domain/dx" "not_positive"]),
    case!(["/domain/dx" = (-0.1)], ["/domain/dx" "not_positive"]),
    case!(["/domain/dx" = 0.06], ["/domain/max/0" "not_whole_cells"]),
    case!(["/domain/dx" = 0.06, "/domain/fit" = "exact"],
          ["/domain/max/0" "not_whole_cells", "/domain/max/1" "not_whole_cells", "/domain/max/2" "not_whole_cells"]),
    case!(["/domain/dx" = 1e-6],
          ["/domain/max/0" "too_many_cells", "/domain/max/1" "too_many_cells", "/domain/max/2" "too_many_cells"]),
    case!(["/domain/max/2" = 0], ["/domain/max/2" "empty"]),
    case!(["/domain/max" = [1, 1]], ["/domain/max" "wrong_length"]),
    case!(["/domain/boundary/x-" = { "contact": "slip" }], ["/domain/boundary/x" "conflicting_walls"]),
    case!(["/domain/boundary/y+" = "periodic"], ["/domain/boundary/y+" "periodic_wall"]),
    case!(["/domain/boundary/w" = "periodic"], ["/domain/boundary/w" "unknown_wall"]),
    case!(["/domain/boundary/y" = { "contact": "slip", "friction": 0.2 }],
          ["/domain/boundary/y/friction" "friction_unused"]),
    case!(["/domain/boundary/y" = { "contact": "separate", "friction": (-0.2) }],
          ["/domain/boundary/y/friction" "negative"]),
    case!(["/domain/max/0" = 1.0625], ["/domain/boundary/x" "periodic_cells"]),
    case!(["/materials/water/density" = (-1000)], ["/materials/water/density" "not_positive"]),
    case!(["/materials/water/bulk_modulus" = 0], ["/materials/water/bulk_modulus" "not_positive"]),
    case!(["/materials/water/viscosity" = (-1)], ["/materials/water/viscosity" "negative"]),
    case!(["/materials/jelly/damping" = (-0.1)], ["/materials/jelly/damping" "negative"]),
    case!(["/materials/jelly/damping" = 0.002], []),
    case!(["/materials/water/damping" = 0.002], ["/materials/water/damping" "unknown_field"]),
    case!(["/materials/water/gamma" = 1], ["/materials/water/gamma" "out_of_range"]),
    case!(["/materials/jelly/poissons_ratio" = 0.5], ["/materials/jelly/poissons_ratio" "out_of_range"]),
    case!(["/materials/jelly/poissons_ratio" = (-1)], ["/materials/jelly/poissons_ratio" "out_of_range"]),
    case!(["/materials/jelly/youngs_modulus" = 0], ["/materials/jelly/youngs_modulus" "not_positive"]),
    case!(["/bodies" = []], ["/bodies" "empty"]),
    case!(["/bodies/1/name" = "a"], ["/bodies/1/name" "duplicate_name"]),
    case!(["/bodies/1/material" = "jely"], ["/bodies/1/material" "unknown_material"]),
    case!(["/bodies/1/particles_per_cell" = 9], ["/bodies/1/particles_per_cell" "not_a_power"]),
    case!(["/bodies/1/particles_per_cell" = 0], ["/bodies/1/particles_per_cell" "not_a_power"]),
    case!(["/bodies/1/particles_per_cell" = 9, "/bodies/1/sampling" = "conforming"], []),
    case!(["/bodies/1/shape/sphere/radius" = 0.011, "/bodies/1/sampling" = "conforming"],
          ["/bodies/1/shape" "too_thin"]),
    case!(["/bodies/1/velocity" = [1]], ["/bodies/1/velocity" "wrong_length"]),
    case!(["/bodies/1/angular_velocity" = [1]], ["/bodies/1/angular_velocity" "wrong_length"]),
    case!(["/bodies/1/velocity_gradient" = [[1, 0], [0, 1]]], ["/bodies/1/velocity_gradient" "wrong_length"]),
    case!(["/bodies/1/velocity_gradient" = [[1, 0, 0], [0, 1], [0, 0, 1]]],
          ["/bodies/1/velocity_gradient/1" "wrong_length"]),
    case!(["/bodies/1/deformation_gradient" = [[1, 0, 0], [0, 1, 0], [0, 0, (-1)]]],
          ["/bodies/1/deformation_gradient" "not_positive"]),
    case!(["/bodies/1/deformation_gradient" = [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "/bodies/1/J" = 1],
          ["/bodies/1/J" "conflicting_fields"]),
    case!(["/bodies/1/J" = 0], ["/bodies/1/J" "not_positive"]),
    case!(["/bodies/1/shape/sphere/radius" = (-1)], ["/bodies/1/shape/sphere/radius" "not_positive"]),
    case!(["/bodies/1/shape/sphere/radius" = 0.5], ["/bodies/1/shape" "outside_domain"]),
    case!(["/bodies/1/shape/sphere/center" = [7, 7, 7]], ["/bodies/1/shape" "outside_domain"]),
    case!(["/bodies/1/shape/sphere/radius" = 1e9], ["/bodies/1/shape" "outside_domain"]),
    case!(["/bodies/1/shape/sphere/radius" = 1e14], ["/bodies/1/shape" "outside_domain"]),
    case!(["/bodies/1/shape/sphere/radius" = 1e-4], ["/bodies/1/shape" "no_particles"]),
    case!(["/bodies/0/shape/box/max/1" = 0], ["/bodies/0/shape/box/max/1" "empty"]),
    case!(["/bodies/0/shape" = { "difference": [{ "sphere": { "center": [0.5, 0.5, 0.5], "radius": 0.2 } },
           { "sphere": { "center": [0.5, 0.5, 0.5], "radius": 0.3 } }] }],
          ["/bodies/0/shape" "no_particles"]),
    case!(["/bodies/0/shape" = { "intersection": [{ "sphere": { "center": [0.2, 0.5, 0.5], "radius": 0.1 } },
           { "sphere": { "center": [0.8, 0.5, 0.5], "radius": 0.1 } }] }],
          ["/bodies/0/shape" "no_particles"]),
    case!(["/bodies/0/shape" = { "difference": [{ "sphere": { "center": [0.5, 0.5, 0.5], "radius": 0.2 } }] }],
          ["/bodies/0/shape/difference" "too_few_shapes"]),
    case!(["/bodies/0/shape" = { "union": [] }], ["/bodies/0/shape/union" "too_few_shapes"]),
    case!(["/bodies/0/shape" = { "half-space": { "point": [0, 0, 0], "normal": [0, 0, 0] } }],
          ["/bodies/0/shape/half-space/normal" "zero_vector"]),
    case!(["/bodies/0/shape" = { "cylinder": { "center": [0.5, 0.5, 0.5], "axis": [0, 0], "radius": 0.1,
           "height": 0 } }],
          ["/bodies/0/shape/cylinder/axis" "wrong_length", "/bodies/0/shape/cylinder/height" "not_positive"]),
    case!(["/bodies/0/shape" = { "capsule": { "center": [0.5, 0.5, 0.5], "axis": [0, 0, 0], "radius": 0,
           "height": 0.1 } }],
          ["/bodies/0/shape/capsule/axis" "zero_vector", "/bodies/0/shape/capsule/radius" "not_positive"]),
    case!(["/bodies/0/shape" = { "cone": { "base": [0.5, 0.5], "radius": 0.1, "top_radius": (-0.1), "height": 0 } }],
          ["/bodies/0/shape/cone/base" "wrong_length", "/bodies/0/shape/cone/top_radius" "negative",
           "/bodies/0/shape/cone/height" "not_positive"]),
    case!(["/bodies/0/shape" = { "scale": { "factor": 0, "center": [0.5], "shape": { "sphere": { "center": [0, 0, 0],
           "radius": 0 } } } }],
          ["/bodies/0/shape/scale/factor" "not_positive", "/bodies/0/shape/scale/center" "wrong_length",
           "/bodies/0/shape/scale/shape/sphere/radius" "not_positive"]),
    case!(["/bodies/0/shape" = { "heightfield": { "min": [0, 0], "max": [0.5, 0], "base": 0, "heights": [[0.1, 0.2],
           [0.3, (-0.1)]] } }],
          ["/bodies/0/shape/heightfield/max/1" "empty", "/bodies/0/shape/heightfield/heights/1/1" "below_base"]),
    case!(["/bodies/0/shape" = { "heightfield": { "min": [0], "max": [0.5, 0.5], "base": 0, "heights": [[0.1, 0.2],
           [0.3]] } }],
          ["/bodies/0/shape/heightfield/min" "wrong_length", "/bodies/0/shape/heightfield/heights/1" "wrong_length"]),
    case!(["/bodies/0/shape" = { "heightfield": { "min": [0, 0], "max": [0.5, 0.5], "base": 0, "heights": [[0.1,
           0.2]] } }],
          ["/bodies/0/shape/heightfield/heights" "wrong_length"]),
    case!(["/bodies/0/shape" = { "mesh": { "file": "a.obj" } }], ["/bodies/0/shape/mesh/file" "file_refused"]),
    case!(["/bodies/0/shape" = { "torus": { "center": [0.5, 0.5, 0.5], "major_radius": 0.2, "minor_radius": 0 } }],
          ["/bodies/0/shape/torus/minor_radius" "not_positive"]),
    case!(["/bodies/0/shape" = { "shell": { "thickness": 0, "shape": { "sphere": { "center": [0.5, 0.5, 0.5],
           "radius": 0 } } } }],
          ["/bodies/0/shape/shell/thickness" "not_positive",
           "/bodies/0/shape/shell/shape/sphere/radius" "not_positive"]),
    case!(["/colliders/0/friction" = 0.5], ["/colliders/0/friction" "friction_unused"]),
    case!(["/colliders/0/shape" = { "half-space": { "point": [0, 0, 0], "normal": [0, 0, 1] } }],
          ["/colliders/0/motion/center" "missing_field"]),
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
    case!(["/solver/implicit" = { "tolerance": 0.2, "levels": 0, "max_iterations": 0 }],
          ["/solver/implicit/tolerance" "out_of_range", "/solver/implicit/levels" "out_of_range",
           "/solver/implicit/max_iterations" "out_of_range"]),
    case!(["/solver/implicit" = { "tolerance": (-1e-7), "levels": 11 }],
          ["/solver/implicit/tolerance" "out_of_range", "/solver/implicit/levels" "out_of_range"]),
    case!(["/solver/implicit" = { "tolerance": 1e-2, "levels": 1, "max_iterations": 1 }], []),
    case!(["/solver/implicit" = { "method": "hot", "tolerance": 0.1 }], ["/solver/implicit/tolerance" "out_of_range"]),
    case!(["/solver/implicit" = { "method": "newton", "norm": "characteristic", "plasticity": "lagged" }], []),
    case!(["/solver/implicit" = { "method": "hot", "norm": "error", "plasticity": "flowing" }],
          ["/solver/implicit/norm" "unsupported", "/solver/implicit/plasticity" "unsupported"]),
    case!(["/solver/integrator" = "implicit"], ["/solver/integrator" "unsupported"]),
    case!(["/solver/integrator" = "implicit", "/bodies/0/material" = "jelly"], []),
    case!(["/solver/integrator" = "implicit", "/bodies/0/material" = "jelly", "/materials/jelly/damping" = 0.002],
          ["/solver/integrator" "unsupported"]),
    case!(["/solver/integrator" = "auto", "/bodies/0/material" = "jelly", "/materials/jelly/damping" = 0.002], []),
    case!(["/solver/integrator" = "implicit", "/bodies/0/material" = "jelly", "/solver/implicit" = { "method": "admm" },
           "/solver/transfer" = "pic", "/solver/contact" = "nodes"],
          []),
    case!(["/solver/integrator" = "implicit", "/bodies/0/material" = "jelly",
           "/solver/implicit" = { "method": "admm" }],
          ["/solver/contact" "unsupported"]),
    case!(["/solver/integrator" = "implicit", "/bodies/0/material" = "jelly", "/solver/implicit" = { "method": "admm" },
           "/solver/contact" = "nodes", "/materials/jelly" = { "model": "von-mises", "density": 1000,
           "youngs_modulus": 1e5, "poissons_ratio": 0.3, "yield_stress": 1e3 }],
          ["/solver/implicit/method" "unsupported"]),
    case!(["/solver/integrator" = "auto", "/solver/implicit" = { "method": "admm" }], []),
    case!(["/output/preview_points" = 0], ["/output/preview_points" "out_of_range"]),
    case!(["/output/fields/1" = "velocity"], ["/output/fields/1" "duplicate"]),
];

/// Faults of structure and of meaning in several places at once.
#[rustfmt::skip]
pub const TOGETHER: &[Case] = &[
    case!(["/solver/kernel" = 3, "/time/end" = (-1), "/bodies/0/velocity" = "up", "/bodies/0/material" = "watr",
           "/materials/jelly/density" = (-1)],
          ["/solver/kernel" "wrong_type", "/time/end" "not_positive", "/bodies/0/velocity" "wrong_type",
           "/bodies/0/material" "unknown_material", "/materials/jelly/density" "not_positive"]),
    // Without a domain, nothing can be outside it, but radii can still be wrong.
    case!(["/domain" = null, "/bodies/1/shape/sphere/radius" = (-1), "/bodies/0/shape/box/max" = [9, 9, 9]],
          ["/domain" "missing_field", "/bodies/1/shape/sphere/radius" "not_positive"]),
    // The name and the material of a body are judged even if its shape cannot be read.
    case!(["/bodies/0/shape" = "box", "/bodies/0/name" = "b", "/bodies/0/material" = "ice"],
          ["/bodies/0/shape" "wrong_type", "/bodies/1/name" "duplicate_name", "/bodies/0/material" "unknown_material"]),
    // A material with a fault still exists.
    case!(["/materials/water/density" = "heavy"], ["/materials/water/density" "wrong_type"]),
    // Without a dimension, lengths of vectors cannot be judged.
    case!(["/dimension" = "3D", "/gravity" = [0, -9.81], "/materials/water/gamma" = (-7)],
          ["/dimension" "wrong_type", "/materials/water/gamma" "out_of_range"]),
    // The rest is judged despite an unknown field.
    case!(["/domain/walls" = {}, "/bodies/1/shape/sphere/radius" = 0.5],
          ["/domain/walls" "unknown_field", "/bodies/1/shape" "outside_domain"]),
];

/// Faults of 2D scenes.
#[rustfmt::skip]
pub const FLAT: &[Case] = &[
    case!(["/bodies/0/angular_velocity" = [0, 0, 1]], ["/bodies/0/angular_velocity" "wrong_length"]),
    case!(["/bodies/0/particles_per_cell" = 8], ["/bodies/0/particles_per_cell" "not_a_power"]),
    case!(["/bodies/0/shape/rotate/axis" = [1, 0, 0]], ["/bodies/0/shape/rotate/axis" "needs_3d"]),
    case!(["/bodies/0/shape" = { "torus": { "center": [0.5, 0.5, 0.5], "major_radius": 0.2, "minor_radius": 0 } }],
          ["/bodies/0/shape/torus" "needs_3d"]),
    case!(["/bodies/0/shape" = { "cylinder": { "center": [0.5, 0.5], "radius": 0.2, "height": 1 } }],
          ["/bodies/0/shape/cylinder" "needs_3d"]),
    case!(["/bodies/0/shape" = { "capsule": { "center": [0.5, 0.5], "radius": 0.2, "height": 1 } }],
          ["/bodies/0/shape/capsule" "needs_3d"]),
    case!(["/bodies/0/shape" = { "cone": { "base": [0.5, 0.5], "radius": 0.2, "height": 1 } }],
          ["/bodies/0/shape/cone" "needs_3d"]),
    case!(["/bodies/0/shape" = { "heightfield": { "min": [0.1], "max": [0.5], "base": 0, "heights": [[0.1, 0.2], [0.3,
           0.1]] } }],
          ["/bodies/0/shape/heightfield/heights" "wrong_length"]),
    case!(["/bodies/0/shape" = { "mesh": { "file": "a.obj" } }], ["/bodies/0/shape/mesh" "needs_3d"]),
    case!(["/domain/boundary" = { "z-": { "contact": "slip" } }], ["/domain/boundary/z-" "unknown_wall"]),
    case!(["/domain/min" = [0, 0, 0]], ["/domain/min" "wrong_length"]),
    case!(["/bodies/0/grips" = [{ "name": "g", "shape": { "sphere": { "center": [0.5, 0.5], "radius": 0.1 } },
           "motion": { "axis": [0, 1], "keyframes": [{ "time": 0 }, { "time": 1, "angle_degrees": 9 }] } }]],
          ["/bodies/0/grips/0/motion/axis" "needs_3d"]),
];

/// Prescribed motion.
#[rustfmt::skip]
pub const MOTION: &[Case] = &[
    case!(["/colliders/0/motion" = { "keyframes": [{ "time": 0 }, { "time": 1, "offset": [0, 0, 0.1],
           "angle_degrees": 30 }] }],
          []),
    case!(["/colliders/0/motion/keyframes" = [{ "time": 0 }, { "time": 1 }]],
          ["/colliders/0/motion/keyframes" "conflicting_fields"]),
    case!(["/colliders/0/motion" = { "keyframes": [{ "time": 0.5 }] }],
          ["/colliders/0/motion/keyframes" "too_few_keyframes"]),
    case!(["/colliders/0/motion" = { "keyframes": [{ "time": 0 }, { "time": 0.5 }, { "time": 0.5 }] }],
          ["/colliders/0/motion/keyframes/2/time" "not_rising"]),
    case!(["/colliders/0/motion" = { "keyframes": [{ "time": (-1) }, { "time": 0.5, "offset": [1] }] }],
          ["/colliders/0/motion/keyframes/0/time" "negative", "/colliders/0/motion/keyframes/1/offset" "wrong_length"]),
    case!(["/colliders/0/motion" = { "keyframes": [{ "offset": [0, 0, 0] }, { "time": 0.5 }] }],
          ["/colliders/0/motion/keyframes/0/time" "missing_field"]),
    case!(["/colliders/0/motion/axis" = [1, 0, 0]], ["/colliders/0/motion/axis" "axis_unused"]),
    case!(["/colliders/0/motion" = { "axis": [0, 0, 0], "keyframes": [{ "time": 0 }, { "time": 1 }] }],
          ["/colliders/0/motion/axis" "zero_vector"]),
    case!(["/colliders/0/shape" = { "half-space": { "point": [0, 0, 0], "normal": [0, 0, 1] } },
           "/colliders/0/motion" = { "keyframes": [{ "time": 0 }, { "time": 1, "angle_degrees": 9 }] }],
          ["/colliders/0/motion/center" "missing_field"]),
    case!(["/colliders/0/name" = "wall_x-"], ["/colliders/0/name" "reserved_name"]),
    case!(["/colliders/0/from" = (-1)], ["/colliders/0/from" "negative"]),
    case!(["/colliders/0/from" = 0.5, "/colliders/0/until" = 0.5], ["/colliders/0/until" "empty"]),
    case!(["/colliders/0/until" = 0], ["/colliders/0/until" "empty"]),
    case!(["/bodies/1/grips" = [{ "name": "top", "shape": { "sphere": { "center": [0.7, 0.7, 0.9],
           "radius": 0.1 } } }]],
          []),
    case!(["/bodies/1/grips" = [{ "name": "top", "shape": { "sphere": { "center": [0.7, 0.7, 0.9], "radius": 0 } },
           "until": 0 }]],
          ["/bodies/1/grips/0/shape/sphere/radius" "not_positive", "/bodies/1/grips/0/until" "empty"]),
    case!(["/bodies/1/grips" = [{ "name": "top", "shape": { "sphere": { "center": [0.7, 0.7, 0.9], "radius": 0.1 } },
           "contact": "slip" }]],
          ["/bodies/1/grips/0/contact" "unknown_field"]),
    case!(["/bodies/1/grips" = [{ "name": "top", "shape": { "sphere": { "center": [0.7, 0.7, 0.9], "radius": 0.1 } } },
           { "name": "top", "shape": { "sphere": { "center": [0.7, 0.7, 0.5], "radius": 0.1 } },
           "motion": { "angular_velocity": [1], "linear_velocity": [0, 0] } }]],
          ["/bodies/1/grips/1/name" "duplicate_name", "/bodies/1/grips/1/motion/angular_velocity" "wrong_length",
           "/bodies/1/grips/1/motion/linear_velocity" "wrong_length"]),
    case!(["/colliders/0/name" = "b/top", "/bodies/1/grips" = [{ "name": "top", "shape": { "sphere": { "center": [0.7,
           0.7, 0.9], "radius": 0.1 } } }]],
          ["/bodies/1/grips/0/name" "duplicate_name"]),
];

/// Sources: a stream through a box that falls along z.
#[rustfmt::skip]
pub const SOURCES: &[Case] = &[
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
    case!(["/sources/0/shape" = { "half-space": { "point": [0, 0, 0.5], "normal": [0, 0, 1] } }],
          ["/sources/0/shape" "unbounded_shape"]),
    case!(["/sources/0/shape/box/max/0" = 0], ["/sources/0/shape/box/max/0" "empty"]),
    case!(["/sources/0/shape/box" = { "min": [0.5, 0.5, 0.7], "max": [0.501, 0.501, 0.8] }],
          ["/sources/0/shape" "no_particles"]),
    case!(["/bodies" = [], "/sources" = []], ["/bodies" "empty"]),
    case!(["/bodies" = []], []),
];
