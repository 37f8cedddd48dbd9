//! The house rules of docs/ARCHITECTURE.md and CONTRIBUTING.md, as a test.

use std::fs;
use std::path::{Path, PathBuf};

/// What each module may use of the crate, beside itself. Arrows point one way only.
const MAY_USE: &[(&str, &[&str])] = &[
    ("provenance", &[]),
    ("material", &["scene::schema", "sim"]),
    ("sim", &["scene::schema", "material", "engine"]),
    ("scene", &["sim", "material"]),
    ("engine", &["sim"]),
    ("implicit", &["engine", "sim", "material", "scene::schema"]),
    ("cpu", &["engine", "sim", "material"]),
    ("gpu", &["engine", "sim", "material", "implicit", "scene::schema"]),
    ("backend", &["engine", "sim", "implicit", "cpu", "gpu"]),
    ("recording", &["engine", "sim", "material", "scene", "provenance"]),
    ("run", &["engine", "sim", "scene", "recording", "provenance"]),
    ("bench", &["backend", "engine", "implicit", "cpu", "gpu", "run", "scene", "sim", "provenance"]),
    ("verify", &["backend", "engine", "implicit", "cpu", "gpu", "scene", "sim"]),
    ("store", &["engine", "scene", "sim", "run"]),
    ("jobs", &["store", "run", "backend", "engine", "scene", "sim", "recording", "provenance"]),
    ("http", &["jobs", "store", "scene", "sim", "recording", "provenance", "engine", "run", "backend", "gpu"]),
    (
        "cli",
        &[
            "http",
            "jobs",
            "store",
            "run",
            "bench",
            "verify",
            "backend",
            "engine",
            "gpu",
            "scene",
            "sim",
            "recording",
            "provenance",
        ],
    ),
];

/// Crates that only one module may name.
const OWNED: &[(&str, &str)] = &[("wgpu", "gpu"), ("axum", "http"), ("mcap", "recording"), ("sqlx", "store")];

/// Lines a source file may have; past that, look for the seam.
const MAX_LINES: usize = 500;

fn files(dir: &str, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut open = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join(dir)];
    while let Some(dir) = open.pop() {
        for entry in fs::read_dir(&dir).unwrap_or_else(|e| panic!("{}: {e}", dir.display())) {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|e| e == extension) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// Code without comments and without the unit tests at its end.
fn code(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap();
    let text = text.split("#[cfg(test)]").next().unwrap_or_default();
    text.lines().filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n")
}

/// Top-level module of a source file.
fn module(path: &Path) -> String {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let relative = path.strip_prefix(src).unwrap();
    relative.components().next().unwrap().as_os_str().to_string_lossy().trim_end_matches(".rs").to_string()
}

/// What follows every occurrence of `mark` in `text`.
fn after<'a>(text: &'a str, mark: &'a str) -> impl Iterator<Item = &'a str> {
    text.match_indices(mark).map(move |(at, _)| &text[at + mark.len()..])
}

fn word(text: &str) -> &str {
    text.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or_default()
}

#[test]
fn modules_use_only_what_lies_below() {
    let mut faults = Vec::new();
    let is_test = |path: &PathBuf| path.file_stem().is_some_and(|stem| stem.to_string_lossy().ends_with("tests"));
    for path in files("src", "rs").into_iter().filter(|path| !is_test(path)) {
        let own = module(&path);
        if ["lib", "main"].contains(&own.as_str()) {
            continue;
        }
        let (_, allowed) = MAY_USE.iter().find(|(m, _)| *m == own).unwrap_or_else(|| panic!("{own} has no entry here"));
        let text = code(&path);
        for used in after(&text, "crate::") {
            // `use crate::{a, b::c}` names several.
            let names: Vec<&str> = if let Some(list) = used.strip_prefix('{') {
                list.split('}').next().unwrap().split(',').map(str::trim).collect()
            } else {
                vec![used]
            };
            for name in names {
                let top = word(name);
                let fits = top == own
                    || allowed.iter().any(|a| match a.split_once("::") {
                        Some((m, inner)) => top == m && name.starts_with(&format!("{m}::{inner}")),
                        None => top == *a,
                    });
                if !fits && !top.is_empty() {
                    faults.push(format!("{} uses {top}", path.display()));
                }
            }
        }
        for (name, owner) in OWNED {
            let named = after(&text, name).any(|rest| rest.starts_with("::")) && own != *owner;
            if named && text.lines().any(|l| l.contains(&format!("{name}::")) && !l.contains(&format!("_{name}::"))) {
                faults.push(format!("{} names {name}, which is {owner}'s", path.display()));
            }
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}

#[test]
fn nothing_is_unfinished_or_silenced() {
    // Written apart, so that this file does not find itself.
    let marks = ["todo", "unimplemented"].map(|m| format!("{m}!(")).into_iter();
    let marks: Vec<String> = marks.chain(["#[ignore", "allow(dead_code", "FIXME"].map(String::from)).collect();
    for dir in ["src", "tests", "wgsl"] {
        for path in files(dir, "rs").into_iter().chain(files(dir, "wgsl")) {
            if path.ends_with("tidy.rs") {
                continue;
            }
            let text = fs::read_to_string(&path).unwrap();
            for mark in &marks {
                assert!(!text.contains(mark.as_str()), "{} has {mark}", path.display());
            }
        }
    }
}

#[test]
fn files_fit_a_head() {
    for (dir, extension) in [("src", "rs"), ("tests", "rs"), ("wgsl", "wgsl")] {
        for path in files(dir, extension) {
            let lines = fs::read_to_string(&path).unwrap().lines().count();
            assert!(lines <= MAX_LINES, "{} has {lines} lines; look for the seam", path.display());
        }
    }
}

#[test]
fn every_file_says_what_it_is() {
    for path in files("src", "rs").into_iter().chain(files("tests", "rs")) {
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.starts_with("//!"), "{} has no module documentation", path.display());
    }
    for path in files("wgsl", "wgsl") {
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.starts_with("//"), "{} has no opening comment", path.display());
    }
}

#[test]
fn every_scene_says_what_to_look_for() {
    let scenes = files("scenes", "json");
    assert!(scenes.len() >= 7, "only {} scenes", scenes.len());
    for path in scenes {
        let scene: serde_json::Value = serde_json::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
        let description = scene["description"].as_str().unwrap_or_default();
        assert!(description.len() > 20, "{} has no description", path.display());
        assert_eq!(scene["name"].as_str(), path.file_stem().and_then(|s| s.to_str()), "{}", path.display());
    }
}
