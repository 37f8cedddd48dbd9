//! The guide in `docs/guide` does what it says: its commands run, page by page, and its JSON is valid.

#[path = "../common/guide.rs"]
mod pages;

use std::path::Path;

use gridfall_scene::{self as scene, Limits};
use serde_json::Value;

pub use pages::pages;
use pages::{ROOT, install_package, run};

#[test]
fn the_commands_of_every_page_run() {
    let package = tempfile::tempdir().unwrap();
    install_package(package.path());
    let mut run_pages = 0;
    for (name, blocks) in pages() {
        // They need a cluster: tests/cluster.
        if !["cluster", "kubernetes"].contains(&name.as_str()) {
            run_pages += u32::from(run(&name, &blocks, package.path(), &[]));
        }
    }
    assert!(run_pages >= 6, "only {run_pages} pages have commands");
}

#[test]
fn the_fragments_of_scenes_are_valid() {
    let text = std::fs::read_to_string(Path::new(ROOT).join("scenes/quickstart.json")).unwrap();
    let mut patched = 0;
    for (name, blocks) in pages() {
        for (_, code) in blocks.iter().filter(|(mark, _)| mark == "json patch") {
            let mut document: Value = serde_json::from_str(&text).unwrap();
            let patch = serde_json::from_str(code).unwrap_or_else(|error| panic!("docs/guide/{name}.md: {error}"));
            merge(&mut document, patch);
            let judged = scene::from_value(&document).and_then(|scene| scene::problem(&scene, &Limits::default()));
            assert!(judged.is_ok(), "docs/guide/{name}.md: {:?}\n{code}", judged.err());
            patched += 1;
        }
    }
    assert!(patched >= 2, "only {patched} fragments");
}

/// RFC 7396.
pub fn merge(target: &mut Value, patch: Value) {
    match (target, patch) {
        (Value::Object(target), Value::Object(patch)) => {
            patch.into_iter().for_each(|(key, value)| merge(target.entry(key).or_insert(Value::Null), value));
        }
        (target, patch) => *target = patch,
    }
}

#[test]
fn the_reference_of_scenes_is_current() {
    let kept = std::fs::read_to_string(Path::new(ROOT).join("docs/guide/scene.md")).unwrap();
    assert!(
        kept == scene::contract::reference_page(),
        "docs/guide/scene.md is out of date: run `gridfall schema reference > docs/guide/scene.md`"
    );
}
