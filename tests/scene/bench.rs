//! `gridfall bench` as its users call it: every case on both engines, small, and comparisons of what it says.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn bench(folder: &Path, arguments: &[&str]) -> Output {
    let program = env!("CARGO_BIN_EXE_gridfall");
    Command::new(program).args(["bench", "--quiet"]).args(arguments).current_dir(folder).output().unwrap()
}

fn said(output: &Output) -> (String, String) {
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    (text(&output.stdout), text(&output.stderr))
}

/// Rows of all cases with about 2,000 particles, plausible, and kept in a file.
fn rows(folder: &Path, device: &[&str]) -> Vec<Value> {
    let output = bench(folder, &[device, &["--particles", "2k", "--json"]].concat());
    let (document, errors) = said(&output);
    assert!(output.status.success(), "{errors}");
    std::fs::write(folder.join("old.json"), &document).unwrap();
    let rows: Vec<Value> = serde_json::from_str(&document).unwrap();
    let mut cases: Vec<&str> = rows.iter().map(|row| row["case"].as_str().unwrap()).collect();
    cases.sort_unstable();
    assert_eq!(cases, ["bullet", "fluid", "nacc", "pair", "sand"]);
    for row in &rows {
        let number = |name: &str| row[name].as_f64().unwrap_or_else(|| panic!("{name} in {row}"));
        let rate = |name: &str| row["particle_steps_per_s"][name].as_f64().unwrap();
        assert!((1_700.0..2_300.0).contains(&number("particles")), "{row}");
        assert!(0.0 < rate("min") && rate("min") <= rate("median") && rate("median") <= rate("max"), "{row}");
        let a_simulated_second = number("particles") / rate("median") / number("dt_s");
        assert!((number("wall_s_per_simulated_s") / a_simulated_second - 1.0).abs() < 1e-9, "{row}");
        assert!(number("rounds") >= 5.0 && number("steps") >= 4.0, "{row}");
        assert!((56.0..=136.0).contains(&number("floor_bytes")) && number("copy_bandwidth_b_s") > 1e8, "{row}");
    }
    rows
}

#[test]
fn cases_are_measured_on_the_cpu_and_compared() {
    let folder = tempfile::tempdir().unwrap();
    for row in rows(folder.path(), &["--backend", "cpu"]) {
        assert!(row["stages"].as_array().unwrap().is_empty() && row["device_bytes"].is_null(), "{row}");
    }
    let output = bench(folder.path(), &["--from", "old.json", "--compare", "old.json"]);
    let (text, errors) = said(&output);
    assert!(output.status.success() && errors.is_empty(), "{errors}");
    let same = |line: &&str| line.contains("1.000 times commit") && line.ends_with("within the spread");
    assert_eq!(text.lines().filter(same).count(), 5, "{text}");
    let output = bench(folder.path(), &["--from", "old.json", "--compare", "old.json", "--json"]);
    let rows: Vec<Value> = serde_json::from_str(&said(&output).0).unwrap();
    assert!(rows.iter().all(|row| row["compared"]["ratio"] == 1.0 && row["compared"]["verdict"] == "within-spread"));
    // One of them again, in another size: nothing of the old file is its partner.
    let again = ["--backend", "cpu", "--cases", "pair", "--particles", "3k", "--compare", "old.json"];
    let (_, errors) = said(&bench(folder.path(), &again));
    assert!(errors.contains("warning: nothing earlier to compare with: pair, "), "{errors}");
    assert_eq!(errors.matches("warning: not measured again: ").count(), 5, "{errors}");
}

#[test]
fn cases_are_measured_on_software_vulkan_with_their_stages() {
    let folder = tempfile::tempdir().unwrap();
    for row in rows(folder.path(), &["--adapter", "llvmpipe"]) {
        assert_eq!(row["backend"]["software"], true);
        let stages = row["stages"].as_array().unwrap();
        for name in ["grid_update", "g2p2g", "bin"] {
            let stage = stages.iter().find(|stage| stage["stage"] == name).unwrap_or_else(|| panic!("{name}: {row}"));
            let time = |name: &str| stage["time_us"][name].as_f64().unwrap();
            assert!(0.0 < time("min") && time("min") <= time("median") && time("median") <= time("max"), "{row}");
            let bytes = |name: &str| stage[name].as_f64().unwrap();
            assert!(bytes("read_bytes") > 0.0 && bytes("written_bytes") > 0.0, "{row}");
        }
        let sum: f64 =
            stages.iter().filter_map(|s| Some(s["read_bytes"].as_f64()? + s["written_bytes"].as_f64()?)).sum();
        assert!(sum > row["floor_bytes"].as_f64().unwrap(), "{sum} B are less than the floor: {row}");
        let (blocks, device) = (row["blocks"].as_u64().unwrap(), row["device_bytes"].as_u64().unwrap());
        assert!((27..1000).contains(&blocks) && device > 200 * row["particles"].as_u64().unwrap(), "{row}");
        let dispatches = row["dispatches"].as_u64().unwrap();
        assert!(stages.iter().filter(|stage| !stage["read_bytes"].is_null()).count() as u64 == dispatches, "{row}");
    }
}

#[test]
fn wrong_use_of_bench_is_said() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("rows.csv"), "case,rate\n").unwrap();
    std::fs::write(folder.path().join("other.json"), r#"[{ "scene": "twist" }]"#).unwrap();
    let cases: [(&[&str], &str); 6] = [
        (&["--compare", "gone.json"], "cannot read gone.json"),
        (&["--compare", "rows.csv"], "rows.csv is not JSON"),
        (&["--from", "other.json"], "other.json is JSON of another form"),
        (&["--particles", "small"], "as in 17k"),
        (&["--cases", "water"], "fluid"),
        (&["--from", "other.json", "--particles", "2k"], "cannot be used with"),
    ];
    for (arguments, message) in cases {
        let output = bench(folder.path(), arguments);
        let (_, errors) = said(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {errors}");
        assert!(errors.contains(message), "{arguments:?}: {errors}");
    }
}
