//! Rules about modules and crates: dependencies point one way, nobody has a permission that it does
//! not use, and some crates may be named in a few folders only.

use super::graph::{Crate, check, manifest, names};
use super::layers::{CORE, CRATES, ENGINE, Layer, OWNED, RECORDING, ROOT, SCENE, SERVICE};
use super::{Source, caught, none, sources};

/// Files of the root package: those that belong to no other crate.
fn root() -> Vec<Source> {
    let elsewhere = |file: &Source| CRATES.iter().any(|(name, _)| file.path.starts_with(&format!("src/{name}/")));
    sources("src", "rs").into_iter().filter(|file| !elsewhere(file)).collect()
}

fn check_crate(folder: &str, layers: &[Layer]) {
    let files = if folder == "src" { root() } else { sources(folder, "rs") };
    none(&check(&Crate { folder, layers }, &files));
}

/// Dependencies among the workspace's crates that are not permitted, permissions without a
/// dependency, and dependencies that are never used.
fn check_manifest(name: &str, allowed: &[&str], text: &str, files: &[Source]) -> Vec<String> {
    let mut faults = Vec::new();
    let tables = manifest(text);
    let dependencies = tables.get("dependencies").cloned().unwrap_or_default();
    let others: Vec<&str> = dependencies.iter().filter_map(|d| d.strip_prefix("gridfall-")).collect();
    for other in &others {
        if !allowed.contains(other) {
            faults.push(format!("{name} depends on {other}, which it may not"));
        }
    }
    for other in allowed.iter().filter(|other| !others.contains(other)) {
        faults.push(format!("{name} may depend on {other}, and does not"));
    }
    let code: Vec<String> = dependencies.iter().map(|d| d.replace('-', "_")).collect();
    let code: Vec<&str> = code.iter().map(String::as_str).collect();
    let used: Vec<&str> = files.iter().flat_map(|file| names(&file.text, &code)).collect();
    for dependency in code.iter().filter(|dependency| !used.contains(dependency)) {
        faults.push(format!("{name} depends on {dependency}, and never names it"));
    }
    faults
}

/// Files that name a crate that only other folders may name.
fn check_owners(files: &[Source]) -> Vec<String> {
    let owned: Vec<&str> = OWNED.iter().map(|(name, _)| *name).collect();
    let mut faults = Vec::new();
    for file in files {
        for name in names(&file.text, &owned) {
            let (_, owners) = OWNED.iter().find(|(known, _)| *known == name).unwrap();
            if !owners.iter().any(|owner| file.path.starts_with(owner)) {
                faults.push(format!("{} names {name}, which belongs to {}", file.path, owners.join(", ")));
            }
        }
    }
    faults
}

#[test]
fn core_is_layered() {
    check_crate("src/core", CORE);
}

#[test]
fn scenes_are_layered() {
    check_crate("src/scene", SCENE);
}

#[test]
fn recordings_are_layered() {
    check_crate("src/recording", RECORDING);
}

#[test]
fn the_engines_are_layered() {
    check_crate("src/engine", ENGINE);
}

#[test]
fn the_service_is_layered() {
    check_crate("src/service", SERVICE);
}

#[test]
fn the_program_is_layered() {
    check_crate("src", ROOT);
}

#[test]
fn crates_depend_on_what_lies_below_and_on_nothing_that_they_do_not_use() {
    for (name, allowed) in CRATES {
        let path = format!("{}/src/{name}/Cargo.toml", env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(path).unwrap();
        none(&check_manifest(name, allowed, &text, &sources(&format!("src/{name}"), "rs")));
    }
    let file = Source::new("src/scene/lib.rs", "use gridfall_engine::Engine;");
    let text = "[dependencies]\ngridfall-engine.workspace = true\n";
    let fault = check_manifest("scene", &[], text, std::slice::from_ref(&file));
    caught(&fault, &["scene depends on engine"]);
    caught(&check_manifest("scene", &["engine"], "", &[]), &["may depend on engine, and does not"]);
    let silent = Source::new("src/scene/lib.rs", "// gridfall_engine::Engine is not for us.\n");
    caught(&check_manifest("scene", &["engine"], text, &[silent]), &["never names it"]);
}

#[test]
fn some_crates_have_one_owner() {
    none(&check_owners(&sources("src", "rs")));
    let fault = Source::new("src/engine/choice.rs", "fn open() { wgpu::Instance::default(); }");
    caught(&check_owners(&[fault]), &["src/engine/choice.rs", "wgpu"]);
}

/// Two layers for planted faults.
const ROOMS: &[Layer] = &[("ground", &[]), ("roof", &["ground"])];

fn rooms(layers: &[Layer], ground: &str, roof: &str) -> Vec<String> {
    let files = [Source::new("house/ground.rs", ground), Source::new("house/roof/mod.rs", roof)];
    check(&Crate { folder: "house", layers }, &files)
}

#[test]
fn a_sound_house_has_no_faults() {
    none(&rooms(ROOMS, "fn a() {}", "use crate::ground::a;"));
    none(&rooms(ROOMS, "fn a() {}", "fn b() { super::ground::a() }"));
    none(&rooms(
        ROOMS,
        "fn a() {} #[cfg(test)] mod tests { use crate::roof; } // crate::roof",
        "use crate::{ground::a};",
    ));
}

#[test]
fn a_circle_is_caught() {
    let circle: &[Layer] = &[("ground", &["roof"]), ("roof", &["ground"])];
    caught(&rooms(circle, "use crate::roof;", "use crate::ground;"), &["ground may use roof", "does not lie below"]);
}

#[test]
fn an_unused_permission_is_caught() {
    caught(&rooms(ROOMS, "fn a() {}", "fn b() {}"), &["roof may use ground, and does not"]);
}

#[test]
fn a_module_outside_its_layer_is_caught() {
    let uses = "use crate::ground::a;";
    caught(&rooms(ROOMS, "use crate::roof::b;", uses), &["ground.rs uses roof"]);
    caught(&rooms(ROOMS, "use crate::{ground::x, roof::{b}};", uses), &["ground.rs uses roof"]);
    // After the first unit test, and inside a macro.
    let behind = "#[cfg(test)] mod tests {} fn a() { crate::roof::b() }";
    caught(&rooms(ROOMS, behind, uses), &["ground.rs uses roof"]);
    caught(&rooms(ROOMS, "wide! { fn a() { super::roof::b() } }", uses), &["ground.rs uses roof"]);
    let homeless = Source::new("house/shed.rs", "fn a() {}");
    let files = [Source::new("house/ground.rs", ""), Source::new("house/roof.rs", uses), homeless];
    caught(&check(&Crate { folder: "house", layers: ROOMS }, &files), &["shed has no layer"]);
}
