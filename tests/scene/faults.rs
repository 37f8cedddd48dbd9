//! A bad scene is refused with all its faults at once: pointer, code, reason and remedy of each.

use gridfall_scene::{self as scene, Fault, Limits};
use serde_json::{Value, json};

use crate::cases::{Case, FLAT, MEANING, MOTION, SOURCES, STRUCTURE, TOGETHER, changed, flat, good, pouring};

/// All faults of a document, whichever stage finds them.
pub fn faults(document: &Value, limits: &Limits) -> Vec<Fault> {
    match scene::from_value(document) {
        Err(faults) => faults,
        Ok(scene) => scene::problem(&scene, limits).err().unwrap_or_default(),
    }
}

pub fn expect(document: &Value, limits: &Limits, expected: &[(&str, &str)]) {
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

pub fn run(base: fn() -> Value, cases: &[Case]) {
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
fn documents_that_ask_for_too_much_are_refused_before_they_are_expanded() {
    let body = good()["bodies"][0].clone();
    let many = |n: usize, part: &Value| Value::Array(vec![part.clone(); n]);
    let limits = Limits::default();
    expect(&changed(good(), &[("/bodies", many(10_001, &body))]), &limits, &[("/bodies", "too_many")]);
    let union = json!({ "union": many(4097, &body["shape"]) });
    expect(&changed(good(), &[("/bodies/0/shape", union)]), &limits, &[("/bodies/0/shape/union", "too_complex")]);
    // Faults have an end, and each is found in the time of one.
    let faulty = changed(good(), &[("/bodies", many(10_000, &json!({ "name": "", "shape": { "ball": {} } })))]);
    assert_eq!(scene::from_value(&faulty).unwrap_err().len(), 200);
}

#[test]
fn a_scene_that_is_costly_to_judge_is_refused_and_the_costly_part_named() {
    let balls: Vec<Value> = (0..400)
        .map(|n| json!({ "sphere": { "center": [0.5 + 1e-4 * f64::from(n), 0.5, 0.5], "radius": 0.1 } }))
        .collect();
    let costly = changed(good(), &[("/bodies/1/shape", json!({ "union": balls }))]);
    expect(&costly, &Limits { max_work: 20_000, ..Limits::default() }, &[("/bodies/1/shape", "too_costly")]);
    expect(&costly, &Limits { max_work: 200_000_000, ..Limits::default() }, &[]);
}

#[test]
fn meshes_that_are_costly_to_sample_are_refused() {
    let waves = |n: u32| -> Vec<Vec<f64>> {
        let height = |i: u32, j: u32| 0.3 + 0.05 * f64::from(i).sin() * f64::from(j).cos();
        (0..n).map(|j| (0..n).map(|i| height(i, j)).collect()).collect()
    };
    let shape = json!({ "heightfield": { "min": [0.1, 0.1], "max": [0.9, 0.9], "base": 0.1, "heights": waves(40) } });
    let costly = changed(good(), &[("/bodies/1/shape", shape)]);
    let limits = |max_work| Limits { max_work, ..Limits::default() };
    expect(&costly, &limits(20_000), &[("/bodies/1/shape/heightfield", "too_costly")]);
    expect(&costly, &limits(20_000_000), &[]);
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
    // A chain of unions is evaluated deepest first and needs no stack; differences cannot be
    // reordered.
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
        let domain = r#"{ "min": [0, 0, 0], "max": [1, 1, 1], "dx": 0.125 }"#;
        let shape = r#"{ "box": { "min": [0.2, 0.2, 0.2], "max": [0.8, 0.8, 0.8] } }"#;
        format!(
            r#"{{ "gridfall": 1, "name": "m", "domain": {domain}, "materials": {{ "m": {material} }},
                 "bodies": [ {{ "name": "b", "material": "m", "shape": {shape} }} ], "time": {{ "end": 1 }} }}"#
        )
    };
    let solid = r#""density": 1000, "youngs_modulus": 1e5, "poissons_ratio": 0.3"#;
    for (parameters, pointer) in [
        (r#""model": "drucker-prager", "friction_angle_degrees": 90"#, "friction_angle_degrees"),
        (r#""model": "drucker-prager", "friction_angle_degrees": 30, "cohesion": -1"#, "cohesion"),
        (
            r#""model": "drucker-prager", "friction_angle_degrees": 30, "dilatancy_angle_degrees": 31"#,
            "dilatancy_angle_degrees",
        ),
        (r#""model": "drucker-prager", "friction_angle_degrees": 30, "cone": "inscribed""#, "cone"),
        (r#""model": "mohr-coulomb", "friction_angle_degrees": -1"#, "friction_angle_degrees"),
        (r#""model": "mohr-coulomb", "friction_angle_degrees": 0, "cohesion": -1"#, "cohesion"),
        (
            r#""model": "mohr-coulomb", "friction_angle_degrees": 30, "dilatancy_angle_degrees": -1"#,
            "dilatancy_angle_degrees",
        ),
        (r#""model": "von-mises", "yield_stress": 0"#, "yield_stress"),
        (r#""model": "nacc", "M": 0, "beta": 0.5, "xi": 3, "alpha0": -0.01"#, "M"),
        (r#""model": "nacc", "M": 2, "beta": -1, "xi": 3, "alpha0": -0.01"#, "beta"),
        (r#""model": "snow", "critical_compression": 1"#, "critical_compression"),
        (r#""model": "snow", "hardening": -1"#, "hardening"),
        (r#""model": "von-mises", "yield_stress": 1e3, "elasticity": "hooke""#, "elasticity"),
    ] {
        let text = with(&format!("{{ {parameters}, {solid} }}"));
        let scene = scene::parse(&text);
        let faults = scene.and_then(|scene| scene::problem(&scene, &Limits::default()).map(drop)).unwrap_err();
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
