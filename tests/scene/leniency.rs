//! What is taken in another form than the schema's first: domains that are not whole cells, names of physics-USD,
//! comments, and spins that are one number.

use gridfall_scene::{self as scene, Limits};
use serde_json::json;

use crate::cases::{changed, flat, good};

#[test]
fn a_domain_grows_to_whole_cells_and_says_so() {
    let document = changed(flat(), &[("/domain/max", json!([1.03, 1]))]);
    let problem = scene::problem(&scene::from_value(&document).unwrap(), &Limits::default()).unwrap();
    assert_eq!(problem.setup.cells[..2], [17, 16]);
    let [notice] = &problem.setup.notices[..] else { panic!("{:?}", problem.setup.notices) };
    assert_eq!((notice.code.as_str(), notice.pointer.as_str()), ("domain_grown", "/domain/max/0"));
    for part in ["16.4800 cells", "17 cells, up to 1.0625", "write 1 or 1.0625"] {
        assert!(notice.to_string().contains(part), "{notice} lacks {part:?}");
    }
    // The same as if it had been written so, but for the notice.
    let written = changed(flat(), &[("/domain/max", json!([1.0625, 1]))]);
    let mut other = scene::problem(&scene::from_value(&written).unwrap(), &Limits::default()).unwrap();
    other.setup.notices = problem.setup.notices.clone();
    assert_eq!(format!("{:?}", other.setup), format!("{:?}", problem.setup));
    assert_eq!(other.particles.x, problem.particles.x);
}

#[test]
fn a_domain_of_less_than_a_cell_does_not_grow() {
    let document = changed(flat(), &[("/domain/max", json!([0.03, 1])), ("/bodies", json!([]))]);
    let faults = scene::check(&scene::from_value(&document).unwrap(), &Limits::default()).unwrap_err();
    assert!(faults.iter().any(|fault| fault.code == "not_whole_cells"), "{faults:?}");
}

#[test]
fn names_of_physics_usd_and_comments_make_the_same_scene() {
    let mut usd = good();
    usd["$comment"] = json!("A jelly above water.");
    let jelly = json!({ "$comment": "soft", "model": "neo-hookean", "physics:density": 1000, "youngsModulus": 1e5,
                        "poissonsRatio": 0.3 });
    usd["materials"]["jelly"] = jelly;
    usd["domain"]["boundary"]["z-"] = json!({ "contact": "separate", "physics:dynamicFriction": 0.3 });
    assert_eq!(scene::from_value(&usd).unwrap(), scene::from_value(&good()).unwrap());

    usd["materials"]["jelly"] = json!({ "preset": "jelly", "youngsModulus": 2e4 });
    let of_a_preset = scene::from_value(&usd).unwrap().materials.remove("jelly").unwrap();
    usd["materials"]["jelly"] = json!({ "preset": "jelly", "youngs_modulus": 2e4 });
    assert_eq!(of_a_preset, scene::from_value(&usd).unwrap().materials["jelly"]);

    let faults = |change: (&str, serde_json::Value)| {
        let faults = scene::from_value(&changed(good(), &[change])).unwrap_err();
        faults.iter().map(|fault| format!("{} {}", fault.pointer, fault.code)).collect::<Vec<_>>()
    };
    assert_eq!(faults(("/materials/jelly/youngsModulus", json!(1))), ["/materials/jelly/youngsModulus duplicate_key"]);
    assert_eq!(faults(("/bodies/1/angularVelocity", json!([0, 0, 1]))), ["/bodies/1/angularVelocity other_unit"]);
    assert_eq!(faults(("/bodies/1/$comment", json!(1))), ["/bodies/1/$comment unknown_field"]);
    assert_eq!(faults(("/bodies/1/staticFriction", json!(1))), ["/bodies/1/staticFriction unknown_field"]);
}

#[test]
fn a_spin_in_two_dimensions_is_a_number() {
    let number = changed(flat(), &[("/bodies/0/angular_velocity", json!(1))]);
    assert_eq!(scene::from_value(&number).unwrap(), scene::from_value(&flat()).unwrap());
    let faults = |document| scene::check(&scene::from_value(&document).unwrap(), &Limits::default()).unwrap_err();
    let spatial = faults(changed(good(), &[("/bodies/1/angular_velocity", json!(1))]));
    assert_eq!((spatial[0].code, spatial[0].pointer.as_str()), ("wrong_length", "/bodies/1/angular_velocity"));
    let text = changed(flat(), &[("/bodies/0/angular_velocity", json!("fast"))]);
    let fault = &scene::from_value(&text).unwrap_err()[0];
    assert!(fault.to_string().contains("a number or a list of numbers"), "{fault}");
}
