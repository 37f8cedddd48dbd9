//! The rules of docs/ARCHITECTURE.md and CONTRIBUTING.md as tests. Each rule is shown to catch a
//! planted fault.

mod graph;
mod house;
mod layers;
mod text;

use std::fs;
use std::path::{Path, PathBuf};

/// A file of the project: its path from the root, with `/`, and its text.
#[derive(Clone, Debug)]
pub struct Source {
    pub path: String,
    pub text: String,
}

impl Source {
    pub fn new(path: &str, text: &str) -> Self {
        Self { path: path.into(), text: text.into() }
    }
}

/// All files with an extension below a folder of the project, by path.
pub fn sources(folder: &str, extension: &str) -> Vec<Source> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut found: Vec<PathBuf> = Vec::new();
    let mut open = vec![root.join(folder)];
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display())) {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|e| e == extension) {
                found.push(path);
            }
        }
    }
    found.sort();
    let source = |path: PathBuf| {
        let text = fs::read_to_string(&path).unwrap();
        let path = path.strip_prefix(root).unwrap().components();
        let path: Vec<_> = path.map(|part| part.as_os_str().to_string_lossy().into_owned()).collect();
        Source { path: path.join("/"), text }
    };
    found.into_iter().map(source).collect()
}

/// Fails with all faults of a rule, if there are any.
pub fn none(faults: &[String]) {
    assert!(faults.is_empty(), "\n{}", faults.join("\n"));
}

/// Fails unless a rule finds exactly one fault and its text has all of `words`.
pub fn caught(faults: &[String], words: &[&str]) {
    assert_eq!(faults.len(), 1, "{faults:?}");
    assert!(words.iter().all(|word| faults[0].contains(word)), "{faults:?}");
}
