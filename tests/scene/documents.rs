//! Every scene in `scenes/` is valid, says what to look for, and has a size that any machine can
//! run. The JSON Schema is current.

use std::path::PathBuf;

use gridfall_scene::{self as scene, Limits, Scene};

/// Most particles of a scene that runs on two cores within minutes.
const MODEST: u64 = 100_000;

fn shipped() -> Vec<(PathBuf, Scene)> {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let mut paths: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    let parse = |path: PathBuf| {
        let scene =
            scene::parse(&std::fs::read_to_string(&path).unwrap()).unwrap_or_else(|f| panic!("{path:?}: {f:#?}"));
        (path, scene)
    };
    paths.into_iter().map(parse).collect()
}

/// Whether there is a reduced variant: `NAME-small` for NAME and NAME-SIZE.
fn is_large(scene: &Scene, all: &[(PathBuf, Scene)]) -> bool {
    let bases = all.iter().filter_map(|(_, other)| other.name.strip_suffix("-small"));
    !scene.name.ends_with("-small") && bases.into_iter().any(|base| scene.name.starts_with(base))
}

#[test]
fn are_valid_and_say_what_to_look_for() {
    let all = shipped();
    for (path, scene) in &all {
        assert_eq!(path.file_stem().unwrap().to_str(), Some(scene.name.as_str()));
        assert!(scene.description.as_ref().is_some_and(|line| line.len() > 20), "{path:?} has no description");
        let mut judged = scene.clone();
        if is_large(scene, &all) {
            // Wider cells: everything is judged as it is, except for the number of particles, up to
            // 84 million.
            judged.domain.dx *= 8.0;
        }
        scene::check(&judged, &Limits::default()).unwrap_or_else(|f| panic!("{path:?}: {f:#?}"));
    }
}

#[test]
fn are_small_enough_for_any_machine_or_have_a_variant_that_is() {
    let all = shipped();
    for (path, scene) in all.iter().filter(|(_, scene)| !is_large(scene, &all)) {
        let problem = scene::problem(scene, &Limits::default()).unwrap_or_else(|f| panic!("{path:?}: {f:#?}"));
        let particles = problem.particles.len() as u64;
        println!(
            "{}: {particles} particles, {:?} cells, {} frames",
            scene.name, problem.setup.cells, problem.setup.frames
        );
        assert!((100..=MODEST).contains(&particles), "{path:?} has {particles} particles");
    }
}

#[test]
fn the_json_schema_in_the_repository_is_the_one_of_the_code() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("api/scene.schema.json");
    let stored = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        stored == scene::contract::json_schema(),
        "run `gridfall schema scene > api/scene.schema.json` and commit the result"
    );
}
