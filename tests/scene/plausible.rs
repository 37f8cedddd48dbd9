//! Numbers that no scene in SI units has, and names that disturb what they are shown in.

use gridfall_scene::{self as scene, Limits};
use serde_json::{Value, json};

use crate::cases::{Case, case, changed, good, pouring};
use crate::faults::{expect, faults, run};

#[rustfmt::skip]
const CASES: &[Case] = &[
    case!(["/bodies/0/velocity" = [1e30, 0, 0]], ["/bodies/0/velocity/0" "implausible"]),
    case!(["/bodies/0/velocity" = [0, 4e6, 0]], ["/bodies/0/velocity" "implausible"]),
    case!(["/bodies/1/angular_velocity" = [0, 0, 1e7]], ["/bodies/1/angular_velocity" "implausible"]),
    case!(["/bodies/1/velocity_gradient" = [[1e7, 0, 0], [0, 0, 0], [0, 0, 0]]],
          ["/bodies/1/velocity_gradient" "implausible"]),
    case!(["/bodies/1/J" = 1e-4], ["/bodies/1/J" "implausible"]),
    case!(["/bodies/1/deformation_gradient" = [[20, 0, 0], [0, 20, 0], [0, 0, 20]]],
          ["/bodies/1/deformation_gradient" "implausible"]),
    case!(["/materials/jelly/youngs_modulus" = 1e30, "/materials/jelly/density" = 1e-30],
          ["/materials/jelly/youngs_modulus" "implausible", "/materials/jelly/density" "implausible"]),
    // Each by itself is one of a material that there is; the speed of sound is not.
    case!(["/materials/jelly/youngs_modulus" = 1e12, "/materials/jelly/density" = 0.01],
          ["/materials/jelly/youngs_modulus" "implausible"]),
    case!(["/materials/jelly/poissons_ratio" = 0.49999999999999],
          ["/materials/jelly/youngs_modulus" "implausible"]),
    case!(["/materials/water/bulk_modulus" = 1e14, "/materials/water/density" = 1],
          ["/materials/water/bulk_modulus" "implausible"]),
    case!(["/materials/water/density" = 1e10], ["/materials/water/density" "implausible"]),
    case!(["/materials/water/gamma" = 1000], ["/materials/water/gamma" "implausible"]),
    case!(["/materials/jelly/damping" = 1e4], ["/materials/jelly/damping" "implausible"]),
    case!(["/gravity" = [0, 0, -1e12]], ["/gravity" "implausible"]),
    case!(["/domain/min" = [0, 0, 2e9], "/domain/max" = [1, 1, 2000000001]],
          ["/domain/min" "implausible", "/domain/max" "implausible"]),
    case!(["/domain/dx" = 1e-10], ["/domain/dx" "implausible"]),
    case!(["/time/end" = 1e10, "/time/frame_rate" = 1e-9], ["/time/end" "implausible"]),
    case!(["/colliders/0/motion" = { "linear_velocity": [4e6, 0, 0] }],
          ["/colliders/0/motion/linear_velocity" "implausible"]),
    case!(["/colliders/0/motion" = { "angular_velocity": [0, 0, 1e7] }],
          ["/colliders/0/motion/angular_velocity" "implausible"]),
    case!(["/colliders/0/motion" = { "angular_velocity": [0, 0, 100], "center": [1e6, 0, 0] }],
          ["/colliders/0/motion/angular_velocity" "implausible"]),
    case!(["/colliders/0/motion" = { "keyframes": [{ "time": 0 }, { "time": 1e-7, "offset": [1, 0, 0] }] }],
          ["/colliders/0/motion/keyframes/1/time" "implausible"]),
    case!(["/bodies/1/shape" = { "sphere": { "center": [0.7, 0.7, 1e20], "radius": 0.2 } }],
          ["/bodies/1/shape/sphere/center/2" "implausible"]),
    case!(["/bodies/1/velocity" = [1e5, 0, 0], "/solver/integrator" = "implicit", "/bodies/0" =
           { "name": "a", "material": "jelly", "shape": { "box": { "min": [0, 0, 0], "max": [0.5, 0.5, 0.5] } } }],
          ["/solver/integrator" "too_fast"]),
    case!(["/name" = "a\u{202e}b"], ["/name" "hidden_character"]),
    case!(["/description" = "one\n\ttwo \u{1b}[2J"], ["/description" "hidden_character"]),
    case!(["/description" = "one\r\n\ttwo"], []),
    case!(["/bodies/0/name" = "a\n"], ["/bodies/0/name" "hidden_character"]),
    case!(["/bodies/1/grips" = [{ "name": "\u{2067}", "shape": { "box": { "min": [0, 0, 0], "max": [1, 1, 1] } } }]],
          ["/bodies/1/grips/0/name" "hidden_character"]),
    case!(["/colliders/0/name" = "\u{0}post"], ["/colliders/0/name" "hidden_character"]),
    case!(["/materials/jelly\u{7f}" = { "model": "weakly-compressible-fluid", "density": 1, "bulk_modulus": 1 }],
          ["/materials/jelly\u{7f}" "hidden_character"]),
    case!(["/bodies/0/name" = "вода 水 ماء"], []),
];

#[test]
fn numbers_are_plausible_and_names_legible() {
    run(good, CASES);
    expect(
        &changed(pouring(), &[("/sources/0/velocity", json!([0, 0, -4e6]))]),
        &Limits::default(),
        &[("/sources/0/velocity", "implausible")],
    );
}

#[test]
fn what_is_shown_on_a_terminal_does_not_control_it() {
    let document = changed(good(), &[("/solver/kernel", json!("\u{1b}[31mred")), ("/name", json!("\u{202e}"))]);
    let found = faults(&document, &Limits::default());
    assert_eq!(found.len(), 2, "{found:?}");
    for fault in found {
        assert!(scene::hidden(&fault.to_string()).is_none(), "{fault}");
    }
}
