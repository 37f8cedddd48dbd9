//! Every scene in `scenes/` is valid and says what to look for.

use std::path::PathBuf;

use gridfall::scene::{self, Limits, Scene};

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

#[test]
fn are_valid_and_small_enough_for_any_machine() {
    for (path, scene) in shipped() {
        let problem = scene::problem(&scene, &Limits::default()).unwrap_or_else(|f| panic!("{path:?}: {f:#?}"));
        let particles = problem.particles.len();
        println!("{}: {particles} particles, {:?} cells, {} frames", scene.name, problem.cells, problem.frames);
        assert_eq!(path.file_stem().unwrap().to_str(), Some(scene.name.as_str()));
        assert!(scene.description.is_some_and(|line| line.len() > 20), "{path:?} does not say what to look for");
        assert!((1000..250_000).contains(&particles), "{path:?} has {particles} particles");
    }
}

#[test]
fn the_json_schema_in_the_repository_is_the_one_of_the_code() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("api/scene.schema.json");
    let stored = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        stored == scene::schema::json_schema(),
        "run `gridfall schema scene > api/scene.schema.json` and commit the result"
    );
}
