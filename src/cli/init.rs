//! `gridfall init`: a scene to begin with.

use std::fs::OpenOptions;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use clap::Args;

use super::CliError;
use super::talk::remark;
use gridfall_scene::contract;

const SPATIAL: &str = include_str!("init/scene.json");
const PLANE: &str = include_str!("init/scene-2d.json");
const SCHEMA: &str = "scene.schema.json";

/// Write a commented scene to begin with, and the JSON Schema by which editors complete and explain it.
#[derive(Debug, Args)]
pub struct Arguments {
    /// The scene.
    #[arg(default_value = "scene.json")]
    scene: PathBuf,
    /// In two dimensions (plane strain).
    #[arg(long = "2d")]
    plane: bool,
    /// Replace files that are there.
    #[arg(long)]
    force: bool,
}

pub fn execute(arguments: Arguments) -> Result<(), CliError> {
    let Arguments { scene, plane, force } = arguments;
    let schema = scene.with_file_name(SCHEMA);
    write(&scene, if plane { PLANE } else { SPATIAL }, force)?;
    // The schema is not the user's work: an older one is replaced.
    write(&schema, &contract::json_schema(), true)?;
    println!("wrote {} and {}", scene.display(), schema.display());
    remark(format_args!("next: gridfall check {0}; gridfall run {0}", scene.display()));
    Ok(())
}

fn write(path: &Path, text: &str, replace: bool) -> Result<(), CliError> {
    let failed = |error: std::io::Error| match error.kind() {
        ErrorKind::AlreadyExists => {
            CliError::BadInput(format!("{} is there already; give another name, or --force", path.display()))
        }
        _ => CliError::BadInput(format!("cannot write {}: {error}", path.display())),
    };
    let mut options = OpenOptions::new();
    options.write(true).truncate(true).create(replace).create_new(!replace);
    options.open(path).and_then(|mut file| file.write_all(text.as_bytes())).map_err(failed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scenes_are_valid_and_nothing_is_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        for (name, plane) in [("a.json", false), ("b.json", true)] {
            let path = folder.path().join(name);
            let arguments = |force| Arguments { scene: path.clone(), plane, force };
            execute(arguments(false)).unwrap();
            let (scene, problem) = crate::cli::run::load(&path, &[]).unwrap();
            assert!(scene.dimension == if plane { 2 } else { 3 } && problem.setup.notices.is_empty());
            std::fs::write(&path, "mine").unwrap();
            assert!(matches!(execute(arguments(false)), Err(CliError::BadInput(text)) if text.contains("--force")));
            assert_eq!(std::fs::read_to_string(&path).unwrap(), "mine");
            execute(arguments(true)).unwrap();
            assert_ne!(std::fs::read_to_string(&path).unwrap(), "mine");
        }
        assert_eq!(std::fs::read_to_string(folder.path().join(SCHEMA)).unwrap(), contract::json_schema());
    }
}
