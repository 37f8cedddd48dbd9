//! `gridfall material` as its users call it, and its page.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::{Value, json};

fn material(folder: &Path, arguments: &[&str]) -> Output {
    let program = env!("CARGO_BIN_EXE_gridfall");
    Command::new(program).arg("material").args(arguments).current_dir(folder).output().unwrap()
}

fn said(output: &Output) -> (String, String) {
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    (text(&output.stdout), text(&output.stderr))
}

#[test]
fn the_page_of_presets_is_current() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/PRESETS.md");
    let kept = std::fs::read_to_string(path).unwrap();
    let current = gridfall_scene::presets::page::markdown();
    assert!(kept == current, "docs/PRESETS.md is out of date: run `gridfall schema materials > docs/PRESETS.md`");
}

#[test]
fn presets_are_shown_and_tested() {
    let folder = tempfile::tempdir().unwrap();
    let (list, _) = said(&material(folder.path(), &[]));
    assert!(list.contains("dry-sand") && list.contains("Metals"), "{list}");
    let (steel, _) = said(&material(folder.path(), &["steel"]));
    assert!(steel.contains("EN 1993-1-1:2005") && steel.contains("Left out: No hardening"), "{steel}");
    let tested = material(folder.path(), &["steel", "--test", "uniaxial", "--csv", "s.csv", "--plot", "s.svg"]);
    assert!(tested.status.success(), "{:?}", said(&tested));
    let rows = std::fs::read_to_string(folder.path().join("s.csv")).unwrap();
    let last: Vec<f64> = rows.lines().last().unwrap().split(',').map(|number| number.parse().unwrap()).collect();
    assert!((last[2] / 235e6 - 1.0).abs() < 1e-2, "{last:?}");
    assert!(std::fs::read_to_string(folder.path().join("s.svg")).unwrap().contains("steel: uniaxial"));
    let changed = material(folder.path(), &["steel", "--set", "yield_stress=1e8", "--json"]);
    let changed: Value = serde_json::from_str(&said(&changed).0).unwrap();
    assert_eq!((&changed["yield_stress"], &changed["origin"]), (&json!(1e8), &json!("steel")));
}

#[test]
fn materials_come_from_files_and_scenes_and_are_fitted() {
    let folder = tempfile::tempdir().unwrap();
    let scene = json!({
        "gridfall": 1, "name": "s", "domain": { "min": [0, 0, 0], "max": [1, 1, 1], "dx": 0.25 },
        "materials": { "sand": { "preset": "dry-sand", "friction_angle_degrees": 38 } },
        "bodies": [{ "name": "b", "material": "sand", "shape": { "box": { "min": [0, 0, 0], "max": [1, 1, 0.5] } } }],
        "time": { "end": 1 },
    });
    std::fs::write(folder.path().join("s.json"), scene.to_string()).unwrap();
    let truth = ["s.json#bodies.0", "--test", "triaxial", "--strain", "0.08", "--csv", "-", "--steps", "50"];
    let (csv, errors) = said(&material(folder.path(), &truth));
    let line =
        |line: &str| line.split(',').take(1).chain(line.split(',').skip(6).take(1)).collect::<Vec<_>>().join(",");
    let measured: Vec<String> = csv.lines().map(line).collect();
    assert_eq!(measured[0], "strain,q", "{errors}");
    std::fs::write(folder.path().join("m.csv"), measured.join("\n")).unwrap();
    let fit =
        ["dry-sand", "--test", "triaxial", "--fit", "m.csv", "--parameters", "friction_angle_degrees", "-o", "f.json"];
    let fitted = material(folder.path(), &[&fit[..], &["--plot", "f.svg"]].concat());
    assert!(fitted.status.success(), "{:?}", said(&fitted));
    let result: Value = serde_json::from_slice(&std::fs::read(folder.path().join("f.json")).unwrap()).unwrap();
    assert!((result["friction_angle_degrees"].as_f64().unwrap() - 38.0).abs() < 1e-3, "{result}");
    assert!(std::fs::read_to_string(folder.path().join("f.svg")).unwrap().contains("measured"));
    // What it wrote is a material again.
    assert!(material(folder.path(), &["f.json", "--test", "oedometer"]).status.success());
}

#[test]
fn wrong_use_is_said() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("m.csv"), "strain,q\n0,0\n0.1,much\n").unwrap();
    std::fs::write(folder.path().join("q.csv"), "strain,q\n0,0\n0.01,1e5\n0.02,2e5\n").unwrap();
    let fit = |file| ["dry-sand", "--test", "triaxial", "--fit", file, "--parameters"];
    let cases: [(Vec<&str>, i32, &str); 9] = [
        (vec!["dry_snad"], 2, "did you mean `dry-sand`?"),
        (vec!["steel", "--set", "yield_stres=1"], 2, "did you mean `yield_stress`?"),
        (vec!["steel", "--set", "yield_stress=-1"], 2, "/yield_stress: the yield stress is -1"),
        (vec!["steel", "--test", "uniaxial", "--strain", "-1"], 2, "--strain is -1"),
        (vec!["steel", "--test", "uniaxial", "--confining-pressure", "1e5"], 2, "holds no pressure"),
        (vec!["steel", "--test", "uniaxial", "--plot", "s.png"], 2, "pictures are SVG"),
        ([&fit("m.csv")[..], &["cohesion"]].concat(), 2, "m.csv: line 3: 'much' under q is not a number"),
        ([&fit("q.csv")[..], &["yield_stress"]].concat(), 2, "has no parameter 'yield_stress'"),
        ([&fit("q.csv")[..], &["density"]].concat(), 2, "'density' changes nothing in q"),
    ];
    for (arguments, code, words) in cases {
        let output = material(folder.path(), &arguments);
        let (_, errors) = said(&output);
        assert!(output.status.code() == Some(code) && errors.contains(words), "{arguments:?}: {errors}");
    }
}
